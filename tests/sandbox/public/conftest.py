"""Fixtures of the page's tests: one short run, and a file with an estimator of one's own."""

from __future__ import annotations

import pytest

import sandbox
from tests.sandbox.public.naming import OWN, SHORT


@pytest.fixture(scope="module")
def run():
    return sandbox.simulate("ipm_exchanged", SHORT, "inversion", belief="linear", seed=2)


@pytest.fixture
def own_file(tmp_path):
    path = tmp_path / "mine.py"
    path.write_text(OWN.format(name="mine"))
    return path
