"""Campaigns that the diagnosis' tests make; a sealed check without recordings."""

import hashlib
import json

import pytest

from tests.sandbox.gap.conftest import quiet_folder  # noqa: F401 - a fixture
from tests.sandbox.withheld.known import truth_of


@pytest.fixture
def check(tmp_path):
    """A sealed check of five campaigns without recordings; a fake diagnosis needs their names
    only."""
    truths = {
        "w000": truth_of(),
        "w001": truth_of((), "none", (), {}),
        "w002": truth_of(("unknown",), "outside", (1.0,), {}),
        "w003": truth_of(("dead_time", "inertia"), "several", (1.0, 1.0), {}),
        "w004": truth_of(sizes=(0.25,)),
    }
    data = json.dumps({"campaigns": truths}).encode()
    (tmp_path / "truth.sealed").write_bytes(data)
    (tmp_path / "SHA256").write_text(f"{hashlib.sha256(data).hexdigest()}  truth.sealed\n")
    for name in truths:
        (tmp_path / "campaigns" / name).mkdir(parents=True)
    return tmp_path
