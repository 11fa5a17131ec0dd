"""The command line: contract of the JSON files, exit codes, one sentence for every wrong call, nothing half-written."""

from __future__ import annotations

import errno
import json
import os
import signal
import subprocess
import sys
from functools import partial
from pathlib import Path

import numpy as np
import pytest
from cyclopts import CycloptsError
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from model.drive_files import MOTORS
from model.errors import BadInput
from sandbox.cli import main, parse
from sandbox.output.files import results

SHORT = """
[scenario]
settle = 0.1
[[segment]]
duration = 0.2
[[segment]]
duration = 0.3
load = 1.0
ramp = 0.05
settle = 0.2
"""


@pytest.fixture
def short(tmp_path):
    path = tmp_path / "short.toml"
    path.write_text(SHORT)
    return path


def content(folder, command):
    document = json.loads((folder / f"{command}.json").read_text())
    assert (document["schema"], document["command"]) == (1, command)
    assert document["version"]
    return document


def test_compare(short, tmp_path, capsys):
    out = tmp_path / "out"
    assert main(["compare", "--scenario", str(short), "--estimators", "qnull,inversion", "--out", str(out)]) == 0
    found = content(out, "compare")
    assert (found["motor"], found["scenario"], found["trace"]) == ("ipm_exchanged", "short", "compare.rrd")
    assert sorted(p.name for p in out.iterdir()) == [
        f"compare.{kind}" for kind in ("html", "json", "parquet", "png", "rrd")
    ]
    assert len(found["rows"]) == 2 * 2 * 2 * 2
    for row in found["rows"]:
        assert {"estimator", "belief", "closed_loop", "load", "speed_rpm", "error_deg", "predicted_mean_deg"} <= set(
            row
        )
        assert set(row["error_deg"]) == {"mean", "rms", "p95", "max"}
        assert row["lost_lock"] is False
    said = capsys.readouterr().out
    assert "theory" in said
    assert "-5.89" in said  # the self-consistent angle at rated load


def test_quiet_says_nothing_and_seed_repeats(short, tmp_path, capsys):
    for k in (1, 2):
        call = [
            "compare",
            "--scenario",
            str(short),
            "--estimators",
            "ekf",
            "--seed",
            "9",
            "--jobs",
            str(k),
            "--no-trace",
        ]
        assert main([*call, "--quiet", "--out", str(tmp_path / str(k))]) == 0
    assert capsys.readouterr().out == ""
    one, two = (content(tmp_path / k, "compare") for k in "12")
    assert one["rows"] == two["rows"]
    assert one["trace"] is None


def test_simulate(short, tmp_path, capsys):
    call = [
        "simulate",
        "--scenario",
        str(short),
        "--estimator",
        "inversion",
        "--belief",
        "linear",
        "--out",
        str(tmp_path),
    ]
    assert main(call) == 0
    found = content(tmp_path, "simulate")
    assert found["rows"][1]["error_deg"]["mean"] == pytest.approx(-5.89, abs=0.2)
    assert found["loops"]["current"]["phase_margin_deg"] > 59
    assert (tmp_path / found["trace"]).is_file()
    assert "phase margin" in capsys.readouterr().out


def test_audit(tmp_path, capsys):
    assert main(["audit", "spm", "--out", str(tmp_path)]) == 0
    found = content(tmp_path, "audit")
    assert found["passed"] is False
    assert found["valid_radius"] == pytest.approx(0.786, abs=1e-3)
    assert found["violations"][0]["i_d"] == pytest.approx(-0.786, abs=1e-3)
    assert found["error_per_10mA_deg"][18] == pytest.approx(2.7, abs=0.05)  # the notes' value for the SPM at 40 V
    said = capsys.readouterr().out
    assert "NOT valid" in said
    assert "q-null injection is feasible: up to 0.786 A, as far as the model is valid" in " ".join(said.split())
    assert "whole disc" not in said
    assert main(["audit", "ipm_exchanged", "--out", str(tmp_path)]) == 0
    assert content(tmp_path, "audit")["valid_radius"] == pytest.approx(1.8 * 1.2)
    # 10 mA of ripple error, IPM at 30 V: the notes' 3.5 degrees
    assert content(tmp_path, "audit")["error_per_10mA_deg"][18] == pytest.approx(3.5, abs=0.05)


def test_list_and_version(capsys):
    for kind, name in (("motors", "spm_exchanged"), ("estimators", "ekf_filterpy"), ("scenarios", "creep_reversal")):
        assert main(["list", kind]) == 0
        assert name in capsys.readouterr().out


def motor_file(tmp_path, old, new):
    path = tmp_path / "m.toml"
    path.write_text((MOTORS / "ipm_exchanged.toml").read_text().replace(old, new))
    return str(path)


WRONG = {
    "unknown motor": (["compare", "--motor", "ipm_exchange"], 2, ["unknown motor", "did you mean 'ipm_exchanged'"]),
    "unknown scenario": (["compare", "--scenario", "stairs"], 2, ["unknown scenario 'stairs'", "staircase"]),
    "unknown estimator": (["compare", "--estimators", "qnul"], 2, ["unknown estimator 'qnul'", "mean 'qnull'"]),
    "no estimator": (["compare", "--estimators", ","], 2, ["no estimator"]),
    "missing file": (["compare", "--motor", "nowhere.toml"], 2, ["nowhere.toml", "does not exist"]),
    "outside the domain": (["compare", "--motor", "spm"], 3, ["convex", "-0.786 A", "spm_exchanged"]),
    "duration too long": (["simulate", "--duration", "1e9"], 2, ["1000000000.0 s", "staircase"]),
    "duration nan": (["simulate", "--duration", "nan"], 2, ["duration nan"]),
    "radius": (["audit", "ipm", "--radius", "-1"], 2, ["radius -1.0 A", "24] A"]),
    "duration tiny": (["simulate", "--duration", "1e-12"], 2, ["[0.001, "]),
    "jobs of an audit": (["audit", "nothing", "--jobs", "2", "--seed", "1"], 2, ["unknown motor 'nothing'"]),
    "unknown command": (["comapre"], 2, ["unknown command 'comapre'; did you mean compare?\n"]),
    "no command": ([], 2, ["a command is missing; see `sensorless --help`"]),
    "no step": (["withheld"], 2, ["a command is missing; see `sensorless withheld --help`"]),
    "unknown option": (["compare", "--motr", "ipm"], 2, ["unknown option '--motr'; did you mean --motor?\n"]),
    "shortened option": (["simulate", "--dur", "1"], 2, ["unknown option '--dur'; did you mean --duration?\n"]),
    "an option of nothing near": (["bench", "--foo"], 2, ["unknown option '--foo'; see `sensorless bench --help`"]),
    "an argument too many": (["compare", "ipm"], 2, ["unrecognized argument 'ipm'"]),
    "an option without its value": (["compare", "--motor"], 2, ["--motor needs a value"]),
    "no motor": (["audit"], 2, ["MOTOR is missing"]),
    "no campaign": (["diagnose"], 2, ["give CAMPAIGN, or --example"]),
    "two campaigns": (["diagnose", "folder", "--example"], 2, ["give one of them"]),
    "two estimators": (["simulate", "--estimator", "ekf", "--estimator-library", "x.so"], 2, ["give one of them"]),
    "no count": (["withheld", "make", "check"], 2, ["sensorless withheld make: --count is missing"]),
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


@pytest.mark.parametrize(
    ("old", "new", "code", "words"),
    [
        ("resistance = 12.15", "resistance = -12.15", 2, ["resistance = -12.15", "ohm"]),
        ("resistance = 12.15", "resistance = nan", 2, ["resistance = nan", "ohm"]),
        ("frequency = 500.0", "frequency = 3000.0", 2, ["3000 Hz", "4000 Hz", "inject at 2000 Hz"]),
        ("dc_bus_voltage = 400.0", "dc_bus_voltage = 80.0", 3, ["80 V", "raise dc_bus_voltage"]),
        ("dc_bus_voltage = 400.0", "dc_bus_voltage = 20.0", 3, ["injection of 30 V exceeds", "11.55 V"]),
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
    assert all(line.startswith("caution: ") for line in said.err.splitlines()[1:])  # of ratings that do not go together
    assert not out.exists()


def test_a_refused_run_says_what_about_the_ratings_cannot_be_meant(tmp_path, capsys):
    """Inductances in mH: a run ends before it tells anything, and the cause stands beside the refusal."""
    motor = (MOTORS / "ipm_exchanged.toml").read_text().replace("inductance_d = ", "inductance_d = 1e2 #")
    motor = motor.replace("inductance_q = ", "inductance_q = 2e2 #")
    (tmp_path / "mine.toml").write_text(motor.replace("1e2", "9.0").replace("2e2", "9.9"))
    assert main(["simulate", "--motor", str(tmp_path / "mine.toml"), "--out", str(tmp_path / "o"), "--quiet"]) in (2, 3)
    first, second = capsys.readouterr().err.strip().splitlines()
    assert first.startswith("sensorless simulate: ")
    assert "inductance_d and inductance_q in mH?" in second


def test_out_that_cannot_be_written(short, tmp_path, capsys):
    (tmp_path / "file").write_text("")
    call = ["compare", "--scenario", str(short), "--estimators", "qnull", "--out", str(tmp_path / "file" / "below")]
    assert main(call) == 2
    assert "cannot write" in capsys.readouterr().err


def test_a_full_disk_is_told_with_its_folder(short, tmp_path, capsys, monkeypatch):
    """Writing into a file fails without a name; `experiments.full_disk` tries disks that end after some bytes."""

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
    assert said == f"sensorless simulate: '{out}': No space left on device; make room there, or give another place\n"
    assert not out.exists()


@settings(max_examples=80, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(
    st.lists(
        st.one_of(
            st.sampled_from(["compare", "simulate", "audit", "--motor", "--jobs", "--seed"]), st.text(max_size=6)
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


def test_as_a_program(tmp_path):
    root = Path(__file__).resolve().parents[3]
    call = [sys.executable, "-m", "sandbox.cli", "audit", "nothing"]
    done = subprocess.run(call, cwd=root, capture_output=True, text=True, check=False)
    assert done.returncode == 2
    assert "Traceback" not in done.stderr


@pytest.mark.parametrize(
    ("module", "own", "said"),
    [("sandbox.cli", {}, "1 1 1"), ("sandbox.cli", {"OPENBLAS_NUM_THREADS": "2"}, "2 None None"),
     ("sandbox.cli", {"OMP_NUM_THREADS": "2"}, "None 2 None"), ("sandbox", {}, "None None None")],
)  # fmt: skip
def test_a_command_has_one_thread_of_blas(module, own, said):
    """Set before numpy is loaded, which reads it then; what the user has set stays, and so does a user's own Python."""
    names = ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "MKL_NUM_THREADS")
    code = (
        "import os, sys\n"
        "class Seen:\n"
        "    def find_spec(self, name, *_):\n"
        f"        if name == 'numpy': print(*(os.environ.get(x) for x in {names}))\n"
        "sys.meta_path.insert(0, Seen())\n"
        f"import {module}, numpy\n"
    )
    around = {k: v for k, v in os.environ.items() if k not in names} | own
    root = Path(__file__).resolve().parents[3]
    call = [sys.executable, "-c", code]
    done = subprocess.run(call, cwd=root, env=around, capture_output=True, text=True, check=True)
    assert done.stdout.strip() == said


@pytest.mark.parametrize(("sent", "code"), [(signal.SIGINT, 130), (signal.SIGTERM, 143)])
def test_interrupt_leaves_nothing_half_written(sent, code, tmp_path):
    """Ctrl-C or SIGTERM as soon as the first file of the results is written aside: the process sends it itself.

    While this is cleared away both come once more.
    """
    root, out = Path(__file__).resolve().parents[3], tmp_path / "new" / "out"
    script = (
        "import os, runpy, sys, time\n"
        "from pathlib import Path\n"
        "write = Path.write_bytes\n"
        "def stopped(path, content):\n"
        "    write(path, content)\n"
        f"    if {str(tmp_path)!r} in str(path):\n"
        f"        print(path, flush=True); os.kill(os.getpid(), {int(sent)}); time.sleep(600)\n"
        "Path.write_bytes = stopped\n"
        "import sandbox.cli\n"
        "clear = sandbox.cli.discard\n"
        "def impatient(folder):\n"
        f"    os.kill(os.getpid(), {int(signal.SIGINT)}); os.kill(os.getpid(), {int(signal.SIGTERM)})\n"
        "    clear(folder)\n"
        "sandbox.cli.discard = impatient\n"
        f"sys.argv = ['sensorless', 'audit', 'ipm', '--out', {str(out)!r}]\n"
        "runpy.run_module('sandbox.cli', run_name='__main__')\n"
    )
    heard = partial(signal.signal, signal.SIGINT, signal.SIG_DFL)  # a background shell would ignore it
    process = subprocess.Popen(
        [sys.executable, "-c", script], cwd=root, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True,
        preexec_fn=heard,
    )  # fmt: skip
    written, said = process.communicate(timeout=600)
    assert str(tmp_path) in written  # there was something to take away
    assert process.returncode == code
    assert "interrupted" in said
    assert list(tmp_path.iterdir()) == []


def test_files_come_together_or_not_at_all(tmp_path):
    """Stopped when all is written but the last step, no folder is left on the way; done, only the files are."""
    out = tmp_path / "not" / "there" / "yet"

    def stopped():
        with results(out, "audit") as folder:
            (folder / "audit.json").write_text("{}")
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        stopped()
    assert list(tmp_path.iterdir()) == []
    for text in ("{}", "[]"):  # into a new folder, then into the same again
        with results(out, "audit") as folder:
            (folder / "audit.json").write_text(text)
            assert not (out / "audit.json").exists() or text == "[]"
        assert [p.relative_to(out).as_posix() for p in out.rglob("*")] == ["audit.json"]
        assert (out / "audit.json").read_text() == text
        assert list(tmp_path.iterdir()) == [tmp_path / "not"]


def test_a_folder_made_by_another_in_the_meantime_takes_the_files(tmp_path):
    out = tmp_path / "shared" / "audit"
    with results(out, "audit") as folder:
        (folder / "audit.json").write_text("{}")
        (tmp_path / "shared" / "maps").mkdir(parents=True)
    assert sorted(p.relative_to(tmp_path).as_posix() for p in tmp_path.rglob("*")) == [
        "shared", "shared/audit", "shared/audit/audit.json", "shared/maps"
    ]  # fmt: skip


def test_stale_files_go_and_strangers_stay(short, tmp_path):
    out = tmp_path / "out"
    out.mkdir()
    (out / "compare.rrd").write_text("old")
    (out / "compare.notes").write_text("mine")
    call = ["compare", "--scenario", str(short), "--estimators", "qnull", "--no-trace", "--quiet", "--out", str(out)]
    assert main(call) == 0
    assert sorted(p.name for p in out.iterdir()) == [
        f"compare.{kind}" for kind in ("html", "json", "notes", "parquet", "png")
    ]


def test_what_an_earlier_call_wrote_under_names_of_its_own_goes(tmp_path):
    """An earlier diagnosis left a motor; the new one writes none.  Without an earlier one it is somebody else's."""
    for earlier, left in ((True, {"diagnosis.json"}), (False, {"diagnosis.json", "motor.toml"})):
        out = tmp_path / str(earlier)
        out.mkdir()
        (out / "motor.toml").write_text("old")
        if earlier:
            (out / "diagnosis.json").write_text("{}")
        with results(out, "diagnosis") as folder:
            (folder / "diagnosis.json").write_text("{}")
        assert {p.name for p in out.iterdir()} == left


def test_what_a_user_corrects_and_what_another_command_wrote_stays(tmp_path):
    """A second check drafts no columns: the corrected draft stays.  Nor does a diagnosis without a motor take the motor
    that an identification left in the same folder."""
    for name in ("check.json", "columns.toml", "identify.json", "motor.toml", "diagnosis.json"):
        (tmp_path / name).write_text("{}")
    for command in ("check", "diagnosis"):
        with results(tmp_path, command) as folder:
            (folder / f"{command}.json").write_text("{}")
    left = {"check.json", "columns.toml", "identify.json", "motor.toml", "diagnosis.json"}
    assert {p.name for p in tmp_path.iterdir()} == left


def test_a_corrected_draft_is_kept_beside_a_new_one(tmp_path):
    """The second call drafts anew: what the user had corrected has another name; a third, alike, moves nothing."""
    (tmp_path / "columns.toml").write_text("corrected")
    for _ in range(2):
        with results(tmp_path, "check") as folder:
            (folder / "columns.toml").write_text("draft")
        assert (tmp_path / "columns.earlier.toml").read_text() == "corrected"
        assert (tmp_path / "columns.toml").read_text() == "draft"


def test_names_with_markup_are_names(short, tmp_path, capsys):
    motor = motor_file(tmp_path, 'name = "ipm_exchanged"', 'name = "[bold] $_{$ <b>"')
    call = [
        "compare",
        "--motor",
        motor,
        "--scenario",
        str(short),
        "--estimators",
        "qnull",
        "--out",
        str(tmp_path / "o"),
    ]
    assert main(call) == 0
    assert "[bold] $_{$ <b>" in capsys.readouterr().out


@pytest.mark.parametrize("plant", ["exact", "switched"])
def test_simulate_with_effects_on_both_plants_records_a_campaign(short, tmp_path, plant):
    from sandbox.recordings.campaign import read_campaign

    out, folder = tmp_path / "out", tmp_path / "recorded"
    call = ["simulate", "--scenario", str(short), "--no-trace", "--plant", plant, "--out", str(out)]
    effects = "encoder_offset.offset=0.05,current_offset.offset_a=0.2"
    assert main([*call, "--effects", effects, "--record", str(folder)]) == 0
    found = content(out, "simulate")
    assert found["plant"] == plant
    assert found["effects"] == {"encoder_offset.offset": 0.05, "current_offset.offset_a": 0.2}
    campaign = read_campaign(folder)
    recording = campaign.recordings[0]
    assert recording.rotor == "locked"
    half = 0.5 * 2 * np.pi * campaign.drive.motor.pole_pairs / 4096
    assert campaign.drive.converter.encoder_counts == 4096
    assert recording.theta[0] == pytest.approx(1.05, abs=half)  # the encoder's reading, not the true 1.0 rad
    assert recording.i_a[:2] == pytest.approx([0.2] * 2, abs=0.02)  # nothing acts in the first period
    assert recording.u_dc.mean() == pytest.approx(400.0, abs=0.1)
    assert recording.u_dc.std() == pytest.approx(0.3, rel=0.2)
    assert (campaign.uncertainty["resistance"], campaign.background["current_gain"]) == (0.01, 0.0015)
    assert recording.injection_axis == "d"
    assert main([*call, "--record", str(folder)]) == 2


def test_list_effects_prints_all_and_one_card(capsys):
    assert main(["list", "effects"]) == 0
    assert len(capsys.readouterr().out.splitlines()) >= 26
    assert main(["list", "effects", "dead_time"]) == 0
    said = capsys.readouterr().out
    assert all(word in said for word in ("equation", "source", "confused with", "separated by", "dead_time.time"))
    assert main(["list", "effects", "dead_tme"]) == 2
    assert "did you mean 'dead_time'" in capsys.readouterr().err
    assert main(["list", "motors", "ipm"]) == 0
    assert "magnet_flux           0.0981 Wb" in capsys.readouterr().out


def test_simulate_refuses_wrong_effects(capsys, tmp_path):
    assert main(["simulate", "--effects", "dead_time.time=1", "--out", str(tmp_path)]) == 2
    assert "give a number in [-5e-06, 5e-05] s" in capsys.readouterr().err
