"""A Python for the peer: made once, nothing left of one that could not be made, said in one
sentence."""

from __future__ import annotations

import subprocess
from pathlib import Path

import pytest

from model.errors import BadInput
from sandbox.evaluation import peer_python as made
from sandbox.evaluation.peer_python import PEER, peer_python


@pytest.fixture
def calls(monkeypatch, tmp_path):
    """Commands that would have run; those that hold a word of `failing` fail."""
    found = {"ran": [], "failing": ()}

    def run(call, **_):
        if any(word in call for word in found["failing"]):
            return subprocess.CompletedProcess(call, 1, "", "no such thing\n")
        found["ran"].append(call)
        if "venv" in call:
            Path(call[-1]).mkdir(parents=True)
        return subprocess.CompletedProcess(call, 0, "", "")

    monkeypatch.setattr(made.subprocess, "run", run)
    monkeypatch.setattr(made, "find_spec", lambda name: None)
    monkeypatch.setenv("SENSORLESS_CACHE", str(tmp_path))
    monkeypatch.delenv("SENSORLESS_OFFLINE", raising=False)
    return found


def test_it_is_made_once(calls):
    assert peer_python("mine") == "mine"
    assert not calls["ran"]
    first = peer_python(None)
    assert [call[1:3] for call in calls["ran"]] == [
        ["-c", "import venv"],
        ["-m", "venv"],
        ["-m", "pip"],
    ]
    assert calls["ran"][-1][0] == first
    assert calls["ran"][-1][-1] == PEER
    assert peer_python(None) == first
    assert len(calls["ran"]) == 3


@pytest.mark.parametrize(
    ("failing", "said"),
    [(("pip",), r"cannot be made \(no such thing\)"), (("import venv",), "is not found here")],
)
def test_what_cannot_be_made_leaves_nothing(failing, said, calls, tmp_path):
    calls["failing"] = failing
    with pytest.raises(BadInput, match=f"{said}.*give --peer-python"):
        peer_python(None)
    assert not list((tmp_path / "peers").glob("*"))


def test_offline_nothing_is_made(calls, monkeypatch):
    monkeypatch.setenv("SENSORLESS_OFFLINE", "1")
    with pytest.raises(BadInput, match="nothing is downloaded"):
        peer_python(None)
    assert not calls["ran"]
