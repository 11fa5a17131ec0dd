"""Long runs: a dying process is one miss, an interrupted run goes on, an ambiguity is followed up
and scored."""

import ast
import json
import shutil
import subprocess
import sys
import time
from pathlib import Path
from types import SimpleNamespace

import pytest

from model.errors import BadInput
from model.kernels.sources import ROOT, code_files
from sandbox.withheld.making import make as maker
from sandbox.withheld.making.make import CheckPlan, campaign_of, make
from sandbox.withheld.scoring import running
from sandbox.withheld.scoring.blind import score
from sandbox.withheld.scoring.running import Check, code_digest
from tests.sandbox.withheld.known import diagnosis_of

PAIR = diagnosis_of(
    (["dead_time"], 0.6), (["device_drop"], 0.4), members=[["dead_time"], ["device_drop"]]
)
AMBIGUOUS = {
    **PAIR,
    "verdict": "ambiguous",
    "next_recording": {"entry": "locked_low_current", "seconds": 0.5, "power": 0.9},
}


def blind(folder, exclude):
    """Be ambiguous about twelve recordings and sure about thirteen."""
    more = (folder / "recommended.parquet").is_file()
    assert len(list(folder.glob("*.parquet"))) == (13 if more else 12)
    return SimpleNamespace(json=diagnosis_of((["dead_time"], 1.0)) if more else AMBIGUOUS)


@pytest.fixture
def check(tmp_path, monkeypatch, in_this_process):
    """Two short campaigns."""
    monkeypatch.setattr(maker, "campaign_of", lambda drawn, share: campaign_of(drawn, 0.02))
    make(tmp_path, CheckPlan(2, 5))
    return tmp_path


def test_an_ambiguity_is_followed_up_and_scored(check, monkeypatch):
    right = json.loads((check / "truth.sealed").read_text())["campaigns"]["w000"]["effects"]

    def told(folder, exclude):
        first = blind(folder, exclude)
        return (
            first
            if first.json is AMBIGUOUS
            else SimpleNamespace(json=diagnosis_of((right, 1.0), members=[right]))
        )

    result = score(Check(check, told))
    assert (result.figures["resolved"].n, result.figures["resolved"].value) == (2, 0.5)
    assert [j.set_size for j in result.followed] == [1, 1]
    assert [row[0] for row in result.as_json()["unresolved"]] == ["w001"]
    assert result.code == (code_digest(),)
    monkeypatch.setattr(running, "grow", None)  # another call makes no recording again
    assert score(Check(check, blind)).followed == result.followed


def test_what_is_finished_can_be_judged_alone(check):
    with pytest.raises(BadInput, match="has a report of 'diagnosis' yet"):
        score(Check(check, blind), finished=True)
    score(Check(check, blind), limit=1)
    part = score(Check(check, None), finished=True)
    assert [j.name for j in part.judged] == [j.name for j in part.followed] == ["w000"]
    report = check / "diagnoses" / "w000.json"
    report.write_text(report.read_text().replace(code_digest(), "of before"))
    assert score(Check(check, blind), allow_mixed=True).code == (code_digest(), "of before")


def test_states_of_the_code_are_not_mixed(check):
    """Refused before anything is diagnosed, and where what is finished is judged; allowed, each has
    its own figures."""
    score(Check(check, blind), limit=1)
    report, seen = check / "diagnoses" / "w000.json", []
    report.write_text(report.read_text().replace(code_digest(), "of before"))
    for more in ({}, {"finished": True}):
        with pytest.raises(BadInput, match=r"mixes 2 states of the code .*--again.*--allow-mixed"):
            score(Check(check, lambda folder, exclude: seen.append(folder)), **more)
    assert not seen
    mixed = score(Check(check, blind), allow_mixed=True).as_json()
    assert {c: f["ambiguity_hit"]["n"] for c, f in mixed["by_code"].items()} == {
        code_digest(): 1,
        "of before": 1,
    }
    assert score(Check(check, blind), again=True).code == (code_digest(),)


def test_another_recommendation_is_recorded_anew(check):
    """What was recorded stands in the report; the same recommendation is not recorded twice."""
    score(Check(check, blind), limit=1)
    report, asked = (
        check / "diagnoses" / "resolved" / "w000.json",
        check / "diagnoses" / "w000.json",
    )
    assert json.loads(report.read_text())["recorded"] == ["locked_low_current", 0.5]
    seen = []
    score(Check(check, lambda folder, exclude: seen.append(folder)), limit=1)
    asked.write_text(asked.read_text().replace('"seconds": 0.5', '"seconds": 0.25'))
    score(
        Check(check, lambda folder, exclude: seen.append(folder.name) or blind(folder, exclude)),
        limit=1,
    )
    assert seen == ["w000"]
    assert json.loads(report.read_text())["recorded"] == ["locked_low_current", 0.25]
    for damage in ("{", "[]"):
        report.write_text(damage)
        with pytest.raises(
            BadInput, match=r"resolved/w000\.json' holds no report of w000; delete it"
        ):
            score(Check(check, blind), limit=1)
        assert report.read_text() == damage


def test_a_recording_that_cannot_be_made_settles_nothing(check):
    asked = {**AMBIGUOUS, "next_recording": {"entry": "of another version", "seconds": 0.5}}
    result = score(Check(check, lambda folder, exclude: SimpleNamespace(json=asked)), limit=1)
    assert result.followed[0].failed
    assert result.figures["resolved"].value == 0.0
    assert "of another version" in (check / "diagnoses" / "resolved" / "w000.json").read_text()


def loaded(code):
    """Return the project's modules that some code loads, as files."""
    code += (
        "\nimport sys\nprint([m.__file__ for m in sys.modules.values() if getattr(m, "
        "'__file__', None)])"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    files = {Path(f).resolve() for f in ast.literal_eval(done.stdout)}
    inside = {f: f.relative_to(ROOT).parts for f in files if ROOT in f.parents}
    # an environment inside the checkout, as the README makes it, is not the code
    foreign = {"tests", "site-packages"}
    return {f for f, parts in inside.items() if not foreign & set(parts)}


def test_the_codes_hash_covers_whatever_diagnosing_loads():
    used = loaded("import sandbox.withheld.scoring.blind, sandbox.gap.report.answers")
    known = ("recordings/campaign.py", "switched/phase_machine.py")
    assert used >= {ROOT / "sandbox" / name for name in known}
    assert {f for f in used if f.name != "__init__.py"} <= code_files(*running.CODE)


WATCHED = """
import json, os, sys
seen = []
def note(event, args):
    if event in ("open", "os.listdir", "os.scandir") and args and isinstance(args[0], (str, bytes, os.PathLike)):
        seen.append(os.path.realpath(os.fsdecode(args[0])))
sys.addaudithook(note)
from pathlib import Path
from pyarrow import parquet
File = parquet.ParquetFile
parquet.ParquetFile = lambda path, **more: (seen.append(os.path.realpath(path)), File(path, **more))[1]
from sandbox.withheld.scoring.blind import standard
found = standard(Path(sys.argv[1])).json
Path(sys.argv[2]).write_text(json.dumps({"verdict": found["verdict"], "seen": seen}))
"""  # noqa: E501


def test_diagnosing_opens_nothing_but_its_campaign(quiet_folder, tmp_path):
    """Of the check's folder: not the seal, no other campaign, no list of either.

    By the interpreter's audit events, which parquet's own reader does not raise: it is watched
    beside them.
    """
    folder = tmp_path / "check"
    for name in ("w000", "w001"):
        shutil.copytree(quiet_folder, folder / "campaigns" / name)
    for name in ("truth.sealed", "SHA256"):
        (folder / name).write_text("{}")
    own, found = folder / "campaigns" / "w000", tmp_path / "seen.json"
    subprocess.run([sys.executable, "-c", WATCHED, str(own), str(found)], check=True)
    report = json.loads(found.read_text())
    assert report["verdict"] in ("no_gap", "ambiguous", "explained", "unknown")
    paths = {Path(p) for p in report["seen"]}
    assert own.resolve() / "campaign.toml" in paths  # the hook sees what is opened
    assert any(p.suffix == ".parquet" and own.resolve() in p.parents for p in paths)
    inside = {p for p in paths if p == folder.resolve() or folder.resolve() in p.parents}
    assert {p for p in inside if p != own.resolve() and own.resolve() not in p.parents} == set()
    assert not any(p.name == "truth.sealed" for p in paths)


def test_processes_end_with_the_one_that_started_them(tmp_path):
    """As an interrupted command does, the parent leaves at once, without a word to its
    processes."""
    script = tmp_path / "leaves.py"
    script.write_text(
        "import os, pathlib, sys, threading, time\nfrom sandbox.engine.processes import "
        "Workers, spread\ndef wait(x):\n    "
        "pathlib.Path(sys.argv[1], str(os.getpid())).touch()\n    "
        "time.sleep(900)\ndef leave():\n    while len(list(pathlib.Path(sys.argv[1]).iterdir())) "
        "< 2: time.sleep(0.05)\n    os._exit(130)\nif __name__ == '__main__':\n    "
        "threading.Thread(target=leave).start()\n    list(spread(wait, [1, 2], Workers(2)))\n"
    )
    (tmp_path / "pids").mkdir()
    done = subprocess.run(
        [sys.executable, str(script), str(tmp_path / "pids")], timeout=600, check=False
    )
    assert done.returncode == 130
    left = [int(p.name) for p in (tmp_path / "pids").iterdir()]
    assert len(left) == 2
    end = time.monotonic() + 120.0
    while time.monotonic() < end and any(map(alive, left)):
        time.sleep(0.05)
    assert not any(map(alive, left))


def alive(pid):
    """Tell whether a process is there (a zombie is not)."""
    try:
        return Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[0] != "Z"
    except OSError:
        return False
