"""Wrong calls, motors, places and arguments end in one sentence and an exit code."""

from __future__ import annotations

import errno
import io
import os
from contextlib import redirect_stderr
from pathlib import Path

import pytest
from cyclopts import CycloptsError
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from model.drive_files import MOTORS
from model.errors import BadInput
from sandbox.cli import main, parse
from tests.sandbox.public.short_run import motor_file

WRONG = {
    "unknown motor": (
        ["compare", "--motor", "ipm_exchange"],
        2,
        ["unknown motor", "did you mean 'ipm_exchanged'"],
    ),
    "unknown scenario": (
        ["compare", "--scenario", "stairs"],
        2,
        ["unknown scenario 'stairs'", "staircase"],
    ),
    "unknown estimator": (
        ["compare", "--estimators", "qnul"],
        2,
        ["unknown estimator 'qnul'", "mean 'qnull'"],
    ),
    "no estimator": (["compare", "--estimators", ","], 2, ["no estimator"]),
    "missing file": (["compare", "--motor", "nowhere.toml"], 2, ["nowhere.toml", "does not exist"]),
    "outside the domain": (
        ["compare", "--motor", "spm"],
        3,
        ["convex", "-0.786 A", "spm_exchanged"],
    ),
    "duration too long": (["simulate", "--duration", "1e9"], 2, ["1000000000.0 s", "staircase"]),
    "a unit": (
        ["plan", "--voltage", "24V"],
        2,
        ["'24V' is no number; write 24, without a unit (--help says which it is in)"],
    ),
    "a unit behind a power of ten": (
        ["maps", "ipm", "--radius", "1.5e3 mA"],
        2,
        ["'1.5e3 mA' is no number; write 1.5e3, without a unit"],
    ),
    "a folder for a motor": (["audit", "."], 2, ["'.' is a folder; give a motor's TOML file"]),
    "duration nan": (["simulate", "--duration", "nan"], 2, ["duration nan"]),
    "radius": (["audit", "ipm", "--radius", "-1"], 2, ["radius -1.0 A", "24] A"]),
    "duration tiny": (["simulate", "--duration", "1e-12"], 2, ["[0.001, "]),
    "jobs of an audit": (
        ["audit", "nothing", "--jobs", "2", "--seed", "1"],
        2,
        ["unknown motor 'nothing'"],
    ),
    "unknown command": (["comapre"], 2, ["unknown command 'comapre'; did you mean compare?\n"]),
    "no command": ([], 2, ["a command is missing; see `sensorless --help`"]),
    "no step": (["withheld"], 2, ["a command is missing; see `sensorless withheld --help`"]),
    "unknown option": (
        ["compare", "--motr", "ipm"],
        2,
        ["unknown option '--motr'; did you mean --motor?\n"],
    ),
    "shortened option": (
        ["simulate", "--dur", "1"],
        2,
        ["unknown option '--dur'; did you mean --duration?\n"],
    ),
    "an option of nothing near": (
        ["bench", "--foo"],
        2,
        ["unknown option '--foo'; see `sensorless bench --help`"],
    ),
    "an argument too many": (["compare", "ipm"], 2, ["unrecognized argument 'ipm'", "--motor ipm"]),
    "an option without its value": (["compare", "--motor"], 2, ["--motor needs a value"]),
    "no motor": (["audit"], 2, ["MOTOR is missing"]),
    "no campaign": (["diagnose"], 2, ["give CAMPAIGN, or --example"]),
    "two campaigns": (["diagnose", "folder", "--example"], 2, ["give one of them"]),
    "two estimators": (
        ["simulate", "--estimator", "ekf", "--estimator-library", "x.so"],
        2,
        ["give one of them"],
    ),
    "no count": (
        ["withheld", "make", "check"],
        2,
        ["sensorless withheld make: --count is missing"],
    ),
    "wrong kind": (["list", "motor"], 2, ["motor", "motors"]),
    "wrong belief": (["simulate", "--belief", "quartic"], 2, ["quartic", "saturated"]),
    "jobs": (["compare", "--jobs", "0"], 2, ["'0'", "at least 1"]),
    "seed": (["compare", "--seed", "-1"], 2, ["'-1'"]),
    "no trace to view": (["view", "nowhere.rrd"], 2, ["nowhere.rrd"]),
}


@pytest.mark.parametrize("case", WRONG)
def test_wrong_calls(case, tmp_path, capsys, monkeypatch):
    call, code, words = WRONG[case]
    monkeypatch.chdir(tmp_path)
    found = main(call)
    said = capsys.readouterr()
    assert found == code
    assert said.out == ""
    assert said.err.count("\n") == 1
    for word in words:
        assert word in said.err
    assert list(tmp_path.iterdir()) == []


def test_a_quiet_check_says_what_stops_a_campaign(tmp_path, capsys):
    assert main(["check", str(tmp_path), "--quiet", "--out", str(tmp_path / "out")]) == 2
    said = capsys.readouterr()
    assert said.out == ""
    assert "1 finding stops this campaign: '" in said.err
    assert "holds no campaign.toml" in said.err


def test_what_is_no_trace_is_not_viewed(tmp_path, capsys):
    (tmp_path / "compare.json").write_text("{}")
    assert main(["view", str(tmp_path / "compare.json")]) == 2
    assert "is no trace; give an .rrd" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("old", "new", "code", "words"),
    [
        ("resistance = 12.15", "resistance = -12.15", 2, ["resistance = -12.15", "ohm"]),
        ("resistance = 12.15", "resistance = nan", 2, ["resistance = nan", "ohm"]),
        ("frequency = 500.0", "frequency = 3000.0", 2, ["3000 Hz", "4000 Hz", "inject at 2000 Hz"]),
        ("dc_bus_voltage = 400.0", "dc_bus_voltage = 80.0", 3, ["80 V", "raise dc_bus_voltage"]),
        (
            "dc_bus_voltage = 400.0",
            "dc_bus_voltage = 20.0",
            3,
            ["injection of 30 V exceeds", "11.55 V"],
        ),
        ("magnet_flux = 0.0981", "magnet_flux = 0.0", 2, ["magnet_flux = 0", "> 0 Wb"]),
        ("resistance = 12.15", "resistance = 900.0", 3, ["starting up holds 1.2 A", "1080 V"]),
        ("inductance_q = 0.0919", "inductance_q = 0.0458", 2, ["no saliency"]),
        ("alpha_04 = 6.62", "alpha_04 = -66.2", 3, ["convex", "eigenvalue"]),
    ],
)
def test_wrong_motors(old, new, code, words, tmp_path, capsys):
    out = tmp_path / "out"
    assert main(["compare", "--motor", motor_file(tmp_path, old, new), "--out", str(out)]) == code
    said = capsys.readouterr()
    for word in words:
        assert word in said.err
    # of ratings that do not go together
    assert all(line.startswith("caution: ") for line in said.err.splitlines()[1:])
    assert not out.exists()


def test_a_refused_run_says_what_about_the_ratings_cannot_be_meant(tmp_path, capsys):
    """Inductances in mH: a run ends before it tells anything, and the cause stands beside the
    refusal."""
    motor = (
        (MOTORS / "ipm_exchanged.toml")
        .read_text()
        .replace("inductance_d = ", "inductance_d = 1e2 #")
    )
    motor = motor.replace("inductance_q = ", "inductance_q = 2e2 #")
    (tmp_path / "mine.toml").write_text(motor.replace("1e2", "9.0").replace("2e2", "9.9"))
    assert main(
        [
            "simulate",
            "--motor",
            str(tmp_path / "mine.toml"),
            "--out",
            str(tmp_path / "o"),
            "--quiet",
        ]
    ) in (2, 3)
    first, second = capsys.readouterr().err.strip().splitlines()
    assert first.startswith("sensorless simulate: ")
    assert "inductance_d and inductance_q in mH?" in second


def test_out_that_cannot_be_written(short, tmp_path, capsys):
    (tmp_path / "file").write_text("")
    call = [
        "compare",
        "--scenario",
        str(short),
        "--estimators",
        "qnull",
        "--out",
        str(tmp_path / "file" / "below"),
    ]
    assert main(call) == 2
    assert "cannot write" in capsys.readouterr().err


def test_a_full_disk_is_told_with_its_folder(short, tmp_path, capsys, monkeypatch):
    """Writing into a file fails without a name; `experiments.full_disk` tries disks that end after
    some bytes."""

    def full(path, content):
        """Write nothing."""
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    call = ["simulate", "--scenario", str(short), "--quiet", "--out"]
    assert main([*call, str(tmp_path / "before")]) == 0  # what it keeps in the cache is kept
    capsys.readouterr()
    monkeypatch.setattr(Path, "write_bytes", full)
    out = tmp_path / "out"
    assert main([*call, str(out)]) == 2
    said = capsys.readouterr().err
    assert said == (
        f"sensorless simulate: '{out}': No space left on device; make room there, or "
        "give another place\n"
    )
    assert not out.exists()


@settings(
    max_examples=80, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture]
)
@given(
    st.lists(
        st.one_of(
            st.sampled_from(["compare", "simulate", "audit", "--motor", "--jobs", "--seed"]),
            st.text(max_size=6),
        ),
        max_size=4,
    )
)
def test_any_arguments_parse_or_are_refused(arguments):
    """They call something, with all its arguments bound, or a text says what is wrong."""
    try:
        found = parse(arguments)
    except (CycloptsError, BadInput) as error:
        assert str(error).strip()
    else:
        assert callable(found.run)
        assert set(found.bound.arguments) == set(found.bound.signature.parameters)


def test_simulate_refuses_wrong_effects(capsys, tmp_path):
    assert main(["simulate", "--effects", "dead_time.time=1", "--out", str(tmp_path)]) == 2
    assert "give a number in [-5e-06, 5e-05] s" in capsys.readouterr().err


@pytest.mark.parametrize(
    "words",
    [
        ["plan", "--can", "flying"],
        ["plan", "--current", "nan"],
        ["protocol", "--dask", "nonsense"],
        ["withheld", "make", "check", "--count", "1", "--dask", "nonsense"],
        ["compare", "--dask", "nonsense", "--tolerances", "5"],
        ["protocol", "--peer", "--anchors", "nowhere"],
        ["bench", "--peer", "--anchors", "nowhere"],
        ["diagnose", "--example", "--exclude", "nonsense"],
        ["diagnose", "--example", "--memory", "nan"],
    ],
)
def test_what_is_wrong_in_a_call_is_refused_before_any_bar(words, tmp_path, monkeypatch):
    """Nothing is compiled, simulated or read for it: a bar's first report would be seen."""

    class Terminal(io.StringIO):
        def isatty(self):
            return True

    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("TERM", "xterm")
    with redirect_stderr(Terminal()) as seen:
        assert main(words) == 2
    assert seen.getvalue().startswith("sensorless ")
    assert "\x1b[" not in seen.getvalue()
