"""Fixtures of the page's tests: one short run, and a file with an estimator of one's own."""

from __future__ import annotations

import pytest

import sandbox
from tests.sandbox.public.naming import OWN, SHORT
from tests.sandbox.public.short_run import SHORT_TOML


@pytest.fixture(scope="module")
def run():
    return sandbox.simulate("ipm_exchanged", SHORT, "inversion", belief="linear", seed=2)


@pytest.fixture
def own_file(tmp_path):
    path = tmp_path / "mine.py"
    path.write_text(OWN.format(name="mine"))
    return path


@pytest.fixture
def short(tmp_path):
    """Return the file of a short scenario."""
    path = tmp_path / "short.toml"
    path.write_text(SHORT_TOML)
    return path
