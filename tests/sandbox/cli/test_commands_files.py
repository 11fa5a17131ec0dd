"""Files of results: whole or not at all, after interrupts, beside what others wrote; the program as
a process."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
from functools import partial
from pathlib import Path

import pytest

from sandbox.cli import main
from sandbox.output.files import results

SHEET = ["poles=14", "kv=300", "r_ll=0.1ohm", "inductance=30uH", "current=20A", "voltage=24V"]


def test_as_a_program(tmp_path):
    root = Path(__file__).resolve().parents[3]
    call = [sys.executable, "-m", "sandbox.cli", "audit", "nothing"]
    done = subprocess.run(call, cwd=root, capture_output=True, text=True, check=False)
    assert done.returncode == 2
    assert "Traceback" not in done.stderr


@pytest.mark.parametrize(
    ("module", "own", "said"),
    [
        ("sandbox.cli", {}, "1 1 1"),
        ("sandbox.cli", {"OPENBLAS_NUM_THREADS": "2"}, "2 None None"),
        ("sandbox.cli", {"OMP_NUM_THREADS": "2"}, "None 2 None"),
        ("sandbox", {}, "None None None"),
    ],
)
def test_a_command_has_one_thread_of_blas(module, own, said):
    """Set before numpy is loaded, which reads it then; what the user has set stays, and so does a
    user's own Python."""
    names = ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "MKL_NUM_THREADS")
    code = (
        "import os, sys\nclass Seen:\n    def find_spec(self, name, *_):\n        if name == "
        f"'numpy': print(*(os.environ.get(x) for x in {names}))\nsys.meta_path.insert(0, "
        f"Seen())\nimport {module}, numpy\n"
    )
    around = {k: v for k, v in os.environ.items() if k not in names} | own
    root = Path(__file__).resolve().parents[3]
    call = [sys.executable, "-c", code]
    done = subprocess.run(call, cwd=root, env=around, capture_output=True, text=True, check=True)
    assert done.stdout.strip() == said


@pytest.mark.parametrize(("sent", "code"), [(signal.SIGINT, 130), (signal.SIGTERM, 143)])
def test_interrupt_leaves_nothing_half_written(sent, code, tmp_path):
    """Ctrl-C or SIGTERM as soon as the first file of the results is written aside: the process
    sends it itself.

    While this is cleared away both come once more.
    """
    root, out = Path(__file__).resolve().parents[3], tmp_path / "new" / "out"
    script = (
        "import os, runpy, sys, time\nfrom pathlib import Path\nwrite = Path.write_bytes\ndef "
        f"stopped(path, content):\n    write(path, content)\n    if {str(tmp_path)!r} in "
        f"str(path):\n        print(path, flush=True); os.kill(os.getpid(), {int(sent)}); "
        "time.sleep(600)\nPath.write_bytes = stopped\nimport sandbox.cli\nclear = "
        "sandbox.cli.discard\ndef impatient(folder):\n    os.kill(os.getpid(), "
        f"{int(signal.SIGINT)}); os.kill(os.getpid(), {int(signal.SIGTERM)})\n    "
        "clear(folder)\nsandbox.cli.discard = impatient\nsys.argv = ['sensorless', 'motor', "
        f"*{SHEET}, '--out', {str(out)!r}]\nrunpy.run_module('sandbox.cli', run_name='__main__')\n"
    )
    # a background shell would ignore it
    heard = partial(signal.signal, signal.SIGINT, signal.SIG_DFL)
    process = subprocess.Popen(
        [sys.executable, "-c", script],
        cwd=root,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        preexec_fn=heard,
    )
    written, said = process.communicate(timeout=600)
    assert str(tmp_path) in written  # there was something to take away
    assert process.returncode == code
    assert "interrupted" in said
    assert list(tmp_path.iterdir()) == []


def test_files_come_together_or_not_at_all(tmp_path):
    """Stopped when all is written but the last step, no folder is left on the way; done, only the
    files are."""
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
        "shared",
        "shared/audit",
        "shared/audit/audit.json",
        "shared/maps",
    ]


def test_stale_files_go_and_strangers_stay(short, tmp_path):
    out = tmp_path / "out"
    out.mkdir()
    (out / "compare.rrd").write_text("old")
    (out / "compare.notes").write_text("mine")
    call = [
        "compare",
        "--scenario",
        str(short),
        "--estimators",
        "qnull",
        "--no-trace",
        "--quiet",
        "--out",
        str(out),
    ]
    assert main(call) == 0
    assert sorted(p.name for p in out.iterdir()) == [
        f"compare.{kind}" for kind in ("html", "json", "notes", "parquet", "png")
    ]


def test_what_an_earlier_call_wrote_under_names_of_its_own_goes(tmp_path):
    """An earlier diagnosis left a motor; the new one writes none.  Without an earlier one it is
    somebody else's."""
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
    """A second check drafts no columns: the corrected draft stays.  Nor does a diagnosis without a
    motor take the motor that an identification left in the same folder."""
    for name in ("check.json", "columns.toml", "identify.json", "motor.toml", "diagnosis.json"):
        (tmp_path / name).write_text("{}")
    for command in ("check", "diagnosis"):
        with results(tmp_path, command) as folder:
            (folder / f"{command}.json").write_text("{}")
    left = {"check.json", "columns.toml", "identify.json", "motor.toml", "diagnosis.json"}
    assert {p.name for p in tmp_path.iterdir()} == left


def test_a_corrected_draft_is_kept_beside_a_new_one(tmp_path):
    """The second call drafts anew: what the user had corrected has another name; a third, alike,
    moves nothing."""
    (tmp_path / "columns.toml").write_text("corrected")
    for _ in range(2):
        with results(tmp_path, "check") as folder:
            (folder / "columns.toml").write_text("draft")
        assert (tmp_path / "columns.earlier.toml").read_text() == "corrected"
        assert (tmp_path / "columns.toml").read_text() == "draft"
