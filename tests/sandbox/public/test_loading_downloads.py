"""Nothing touches the network before a call is known to be valid; off-line it is said which file to
put where."""

from __future__ import annotations

import re
import sys
import types

import pytest

from model import datasets
from model.drive_files import MAPPED, load_drive
from model.errors import BadInput
from sandbox.cli import main


@pytest.fixture
def asked(tmp_path, monkeypatch):
    """No data on this machine, and a pooch that notes what it is asked for and has no network."""
    found = []

    def retrieve(url, *_, **__):
        found.append(url)
        raise OSError("no network")

    for name in ("SENSORLESS_DATA", "SENSORLESS_OFFLINE"):
        monkeypatch.delenv(name, raising=False)
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    monkeypatch.setitem(sys.modules, "pooch", types.SimpleNamespace(retrieve=retrieve))
    monkeypatch.chdir(tmp_path)
    return found


MOTOR = ("--motor", "baldor_pmsyrm")
WRONG = {
    "scenario": ["compare", *MOTOR, "--scenario", "stairs"],
    "estimator": ["compare", *MOTOR, "--estimators", "qnul"],
    "effects": ["compare", *MOTOR, "--effects", "dead_time.time=9"],
    "duration": ["simulate", *MOTOR, "--duration", "1e9"],
    "estimator of one run": ["simulate", *MOTOR, "--estimator", "qnul"],
    "place to record": ["simulate", *MOTOR, "--record", "."],
    "place to write": ["simulate", *MOTOR, "--out", "/dev/null/x"],
    "another motor": ["protocol", "--motors", "baldor_pmsyrm,ipn"],
    "test": ["protocol", "--motors", "baldor_pmsyrm", "--tests", "strt"],
    "estimator of the protocol": ["protocol", "--motors", "baldor_pmsyrm", "--estimators", "qnul"],
    "unknown data set's own file": ["audit", "wrong.toml"],
}


@pytest.mark.parametrize("case", WRONG)
def test_a_wrong_call_downloads_nothing_and_leaves_nothing(case, asked, tmp_path, capsys):
    text = (MAPPED / "baldor_pmsyrm.toml").read_text()
    (tmp_path / "wrong.toml").write_text(
        re.sub(r"(?m)^resistance = .*$", "resistance = -1.0", text)
    )
    before = sorted(tmp_path.rglob("*"))
    assert main(WRONG[case]) == 2
    assert capsys.readouterr().err.count("\n") == 1
    assert asked == []
    assert sorted(tmp_path.rglob("*")) == before


def test_a_right_call_asks_once(asked, capsys):
    assert main(["audit", "baldor_pmsyrm"]) == 2
    assert "failed (no network)" in capsys.readouterr().err
    assert len(asked) == 1


@pytest.mark.parametrize("how", ["flag", "variable"])
def test_off_line_it_is_said_which_file_to_put_where(how, asked, capsys, monkeypatch):
    if how == "variable":
        monkeypatch.setenv("SENSORLESS_OFFLINE", "1")
    assert main(["audit", "baldor_pmsyrm", *(["--offline"] if how == "flag" else [])]) == 2
    said = capsys.readouterr().err
    assert "'baldor_meas.npz' (https://" in said
    assert str(datasets.cache() / "baldor_pmsyrm") in said
    assert f"{'--offline' if how == 'flag' else 'SENSORLESS_OFFLINE'} forbids a download" in said
    assert said.count("\n") == 1
    assert asked == []


def test_the_flag_ends_with_its_call(asked):
    main(["audit", "baldor_pmsyrm", "--offline"])
    with pytest.raises(BadInput, match="no network"):
        load_drive("baldor_pmsyrm")


def test_zero_is_on_line(asked, monkeypatch):
    monkeypatch.setenv("SENSORLESS_OFFLINE", "0")
    with pytest.raises(BadInput, match="no network"):
        load_drive("baldor_pmsyrm")


def test_the_usual_motors_are_found_without_asking(asked, capsys):
    from sandbox.evaluation.protocol_names import MOTORS, usual_motors

    assert usual_motors() == MOTORS
    assert main(["protocol", "--tests", "strt"]) == 2
    assert asked == []
