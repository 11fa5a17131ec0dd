"""A short run of damaged inputs at every door, and every escape that was ever found: none may
escape (again)."""

from __future__ import annotations

import json
import os
import shutil
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from model.errors import LONGEST_SENTENCE, BadInput
from model.fluxmap import read_map
from sandbox.cli.arguments import number, positive_int, seed_number
from tests.fuzz.commands import call, call_number, left_behind, make_home
from tests.fuzz.doors import damaged, judged, listing, tried, wrong_sentence
from tests.fuzz.mutations import CALLS
from tests.fuzz.whole import COSTLY, DOORS

INPUTS, WORDS = 15, 80  # a door, and of the command line; about ten seconds in all
FINDINGS = sorted((Path(__file__).parent / "findings").glob("*"))
BY_NAME = {d.name: d for d in DOORS}


@pytest.fixture(scope="module")
def whole_home(tmp_path_factory):
    """A folder with what the calls name."""
    folder = tmp_path_factory.mktemp("whole")
    make_home(folder)
    return folder


@pytest.fixture
def home(whole_home, tmp_path, monkeypatch):
    """A copy of it, the place to be."""
    shutil.copytree(whole_home, tmp_path, dirs_exist_ok=True)
    monkeypatch.chdir(tmp_path)
    return tmp_path


@pytest.mark.parametrize("name", BY_NAME)
def test_no_damaged_file_escapes(name, tmp_path):
    door = BY_NAME[name]
    door.make(tmp_path)
    door.read(tmp_path)  # let in while it is whole
    whole = {f: (tmp_path / f).read_bytes() for f in door.files}
    kinds = []
    for k in range(max(1, round(INPUTS * COSTLY.get(name, 1.0)))):
        file, content = damaged(door, whole, k)
        outcome = tried(door, whole, tmp_path, file, content)
        assert outcome.kind != "escaped", f"input {k}: {outcome.why}"
        kinds.append(outcome.kind)
    assert "refused" in kinds or len(kinds) < 5  # the damage is felt


def test_no_damaged_call_escapes(home):
    before, kinds = listing(home), []
    for k in range(WORDS):
        words = call_number(k)
        outcome = call(words)
        assert outcome.kind != "escaped", f"{words}: {outcome.why}"
        assert not left_behind(home, before, words), words
        kinds.append(outcome.kind)
    assert set(kinds) == {"accepted", "refused"}


@pytest.mark.parametrize("words", CALLS, ids=lambda words: " ".join(words[:2]))
def test_whole_calls_end_well(words, home):
    assert call([*words, "--offline"]).kind in ("accepted", "refused")


@pytest.mark.parametrize("path", FINDINGS, ids=lambda p: p.name)
def test_what_once_escaped_does_not_again(path, tmp_path, monkeypatch):
    name = path.name.partition("-")[0]
    if name == "cli":
        make_home(tmp_path)
        monkeypatch.chdir(tmp_path)
        words, before = json.loads(path.read_text()), listing(tmp_path)
        assert call(words).kind != "escaped"
        assert not left_behind(tmp_path, before, words)
        return
    door = BY_NAME[name]
    door.make(tmp_path)
    whole = {f: (tmp_path / f).read_bytes() for f in door.files}
    file = next(f for f in door.files if f.endswith(path.suffix))
    outcome = tried(door, whole, tmp_path, file, path.read_bytes())
    if outcome.why.startswith("took "):  # what is compiled at first use is compiled once
        outcome = tried(door, whole, tmp_path, file, path.read_bytes())
    assert outcome.kind != "escaped", outcome.why


def test_an_escape_is_seen():
    """The judge itself: a traceback, a bad sentence and an honest refusal are told apart."""

    def refuse(text):
        """Refuse with a sentence."""
        error = BadInput("x")
        error.args = (text,)  # as if nobody had made one line of it
        raise error

    assert judged(lambda: 1 / 0).why.startswith("ZeroDivisionError in test_fuzz.py")
    assert [
        judged(lambda t=t: refuse(t)).kind
        for t in ("a\nb", "", "x" * (LONGEST_SENTENCE + 1), "give a number")
    ] == ["escaped", "escaped", "escaped", "refused"]
    assert judged(lambda: 1).kind == "accepted"
    assert wrong_sentence("5\xa0%") == ""


@settings(max_examples=100, deadline=None)
@given(st.text(max_size=40))
def test_words_are_numbers_or_refused(text):
    for kind in (number, positive_int, seed_number):
        try:
            assert isinstance(kind(text), (int, float))
        except ValueError as error:
            assert len(str(error)) < 200


HUGE = (
    b"\x93NUMPY\x01\x00v\x00{'descr': '<f8', 'fortran_order': False, 'shape': (4000000000, 100), }"
)


def test_a_declared_size_is_not_believed(tmp_path):
    """A header of 3 TB in a file of 200 bytes is refused before anything is set aside for it."""
    import zipfile

    path = tmp_path / "m.npz"
    with zipfile.ZipFile(path, "w") as archive:
        archive.writestr("i_d.npy", HUGE.ljust(127) + b"\n")
    with pytest.raises(
        BadInput, match=r"'i_d' has shape \(4000000000, 100\); at most 800000 values are read"
    ):
        read_map(path)


class Opened:
    """Makes a file when it is unpickled."""

    def __init__(self, path):
        self.path = path

    def __reduce__(self):
        return os.mkdir, (self.path,)


def test_nothing_is_unpickled(tmp_path):
    made = tmp_path / "made"
    np.savez(tmp_path / "m.npz", i_d=np.array([Opened(str(made))], dtype=object), psi_d=np.zeros(9))
    with pytest.raises(BadInput, match="no 'i_d' of numbers"):
        read_map(tmp_path / "m.npz")
    assert not made.exists()
