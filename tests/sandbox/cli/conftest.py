"""What the commands' tests share with those of the public page."""

from tests.sandbox.public.conftest import short  # noqa: F401 - a fixture
