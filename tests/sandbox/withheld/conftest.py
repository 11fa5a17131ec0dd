"""Campaigns that the diagnosis' tests make."""

from tests.sandbox.gap.conftest import quiet_folder  # noqa: F401 - a fixture
