"""Doors that a stranger found open: entries of the cache exchanged, results and cards edited by
hand."""

import json
import os
import re
import subprocess
import sys
from dataclasses import fields
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from estimators.contract import Estimator
from model.drive_files import load_drive
from model.effects import adopt, library
from model.errors import LONGEST_SENTENCE, BadInput, raised
from model.given import LONGEST, read_toml
from model.kernels import kept
from sandbox import audit, maps, verify
from sandbox.cli import main
from sandbox.drive import design
from sandbox.drive.feasible import first_state
from sandbox.engine.journal import Journal
from sandbox.evaluation.sweep import store
from sandbox.evaluation.sweep.plan import _found
from sandbox.output.files import check_output
from sandbox.public import verifying
from sandbox.public.result import keep_other
from sandbox.withheld.scoring.documents import check_report
from sandbox.withheld.scoring.rows import read_rows
from tests.sandbox.public.naming import python


def test_an_entry_in_another_s_place_is_made_anew(tmp_path, capsys):
    kept.note.cache_clear()
    one, other = tmp_path / "one.kept", tmp_path / "other.kept"
    kept.write(one, b"1")
    kept.write(other, b"2")
    assert (kept.read(one), kept.read(other)) == (b"1", b"2")
    held = one.read_bytes()
    one.write_bytes(other.read_bytes())
    other.write_bytes(held)
    assert (kept.read(one), kept.read(other)) == (None, None)
    assert capsys.readouterr().err.count("was damaged and is made anew") == 2


@pytest.fixture(scope="module")
def made(tmp_path_factory):
    folder = tmp_path_factory.mktemp("audit")
    audit("ipm").save(folder)
    return json.loads((folder / "audit.json").read_text())


@pytest.mark.parametrize(
    ("change", "said"),
    [
        ({"keep": "elsewhere"}, "no result keeps the argument 'keep'"),
        ({"cluster": "tcp://127.0.0.1:9"}, "no result keeps the argument 'cluster'"),
        ({"effects_from": 3}, "no list of files"),
        ({"effects_from": ["\0.py"]}, "no list of files"),
        ({"radius": [1]}, r"radius = \[1\] is no number"),
    ],
)
def test_a_result_s_call_reaches_nothing_else(tmp_path, made, change, said):
    made = json.loads(json.dumps(made))
    made["made_by"]["call"]["arguments"] |= change
    (tmp_path / "audit.json").write_text(json.dumps(made))
    with pytest.raises(BadInput, match=said) as told:
        verify(tmp_path)
    assert "\n" not in str(told.value)
    assert len(str(told.value)) <= LONGEST_SENTENCE
    assert [p.name for p in tmp_path.iterdir()] == ["audit.json"]


def test_a_key_of_a_result_is_shown_without_its_control_characters(tmp_path):
    first = verifying.Difference("\x1b[31mkey\n", 1, 2)
    said = verifying.Verification(tmp_path, "audit", 3, 0.5, (first,), ()).summary()
    assert said.isprintable()


def test_what_is_too_long_is_not_read_whole(tmp_path, monkeypatch):
    long = tmp_path / "long.toml"
    with long.open("wb") as file:
        file.truncate(LONGEST + 1)
    with pytest.raises(BadInput, match="more than 20 MB"):
        read_toml(long)
    monkeypatch.setattr(verifying, "MOST_JSON", 10)
    (tmp_path / "audit.json").write_text("[" * 11)
    with pytest.raises(BadInput, match="more than 1e-05 MB"):
        verify(tmp_path)


def test_a_deep_json_in_an_output_folder_is_no_earlier_result(tmp_path):
    (tmp_path / "audit.json").write_text("[" * 200_000)
    assert keep_other(tmp_path, "audit", "ipm") == ""


@pytest.mark.parametrize(
    "change",
    [
        {"cpu_seconds": "x"},
        {"cpu_seconds": 10**400},
        {"unknown": 3},
        {"gap": {"before": 2.0, "raw": "x"}},
    ],
)
def test_a_report_s_costs_and_sizes_are_numbers(change):
    report = {
        "campaign": "w000",
        "verdict": "no_gap",
        "gap": {"before": 1.0},
        "ambiguity_set": [[]],
        "hypotheses": [{"effects": [], "probability": 1.0, "parameters": {}}],
    }
    assert check_report(report, "w000") == report
    with pytest.raises(BadInput):
        check_report(report | change, "w000")


def test_a_sweep_names_no_file_with_a_nul():
    with pytest.raises(BadInput, match="NUL"):
        _found("motor", "\0.toml", Path())


@pytest.mark.parametrize(
    ("change", "said"),
    [
        ({"confused_with": ("\x1b[31m",)}, "is no line"),
        ({"confused_with": 3}, "is no tuple of str"),
        ({"parameters": (3,)}, "is no tuple of Parameter"),
        ({"at": (3,)}, "is no tuple of At"),
        ({"name": "class"}, "is no name"),
    ],
)
def test_a_card_s_lists_are_checked_at_the_door(tmp_path, change, said):
    card = library.load_effect("coulomb_friction")
    other = SimpleNamespace(
        **{f.name: getattr(card, f.name) for f in fields(card)} | {"name": "mine"} | change
    )
    own = object.__new__(type(card))
    for name, value in vars(other).items():
        object.__setattr__(own, name, value)
    with pytest.raises(BadInput, match=said):
        adopt.check_card(own, Path("mine.py"))


def test_maps_reach_as_far_as_an_audit():
    """Twenty times rated current: beyond, the model is not made for it."""
    with pytest.raises(BadInput, match="20 x rated"):
        maps("ipm_exchanged", 1e150)


def test_a_path_that_is_no_utf8_is_told_before_a_run(tmp_path):
    with pytest.raises(BadInput, match="no UTF-8"):
        check_output(tmp_path / "o\udcff")


@pytest.mark.parametrize(
    "block",
    [
        3,
        {"start": "x"},
        {
            "start": 0,
            "rows": 1,
            "file": "../elsewhere.parquet",
            "cpu_seconds": 1.0,
            "kernel_seconds": 1.0,
        },
        {
            "start": 0,
            "rows": 1,
            "file": store.block_file(0),
            "cpu_seconds": "x",
            "kernel_seconds": 1.0,
        },
    ],
)
def test_a_journal_that_is_none_of_ours_is_none(tmp_path, block):
    """Nothing but a sweep's own blocks is believed: a path elsewhere would be read."""
    sound = {
        "start": 0,
        "rows": 1,
        "file": store.block_file(0),
        "cpu_seconds": 1.0,
        "kernel_seconds": 1.0,
    }
    journal = Journal(tmp_path / store.JOURNAL)
    journal.add(store.SWEEP, {"runs": 2})
    journal.add("0", sound)
    assert store.counts(tmp_path) == (1, 2)
    journal.add("0", block)
    assert store.counts(tmp_path) == (0, 0)
    with pytest.raises(BadInput, match="holds no sweep"):
        store.read_table(tmp_path)


def test_a_command_whose_output_is_closed_goes_well(tmp_path):
    code = (
        "import sys; sys.stdout = None; from sandbox.cli import main; sys.exit(main(['list', "
        "'motors']))"
    )
    done = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, check=False, cwd=tmp_path
    )
    assert (done.returncode, done.stderr) == (0, "")


def test_a_check_loads_no_more_than_it_needs(tmp_path):
    """Statistics, filters, data frames and the closed loop take as long to load as a check of
    twelve recordings takes to run."""
    heavy = "pandas", "scipy.stats", "scipy.signal", "matplotlib", "sandbox.drive.loop"
    code = (
        "import sys, sandbox; from sandbox.recordings.campaign import EXAMPLE\n"
        f"sandbox.check(EXAMPLE); print([m for m in {heavy} if m in sys.modules])"
    )
    done = python(code, tmp_path)
    assert (done.returncode, done.stdout) == (0, "[]\n"), done.stderr


def test_a_whole_entry_with_something_else_in_it_is_made_anew(tmp_path, monkeypatch, capsys):
    """Designed once; after that, what stands for designing counts how often it is asked."""
    monkeypatch.setenv("SENSORLESS_CACHE", str(tmp_path))
    kept.note.cache_clear()
    plant, asked = design.SampledMotor(5, 1e-4, 2.0, 5e-3, 9e-3, 1e4, 2.0), []
    loops = design.remembered_loops(plant)
    monkeypatch.setattr(design, "design_loops", lambda plant: asked.append(plant) or loops)
    (entry,) = (tmp_path / "designs").iterdir()
    good = json.loads(kept.read(entry))
    for content in (
        {},
        [],
        {"current": 3},
        good | {"more": good["speed"]},
        good | {"speed": good["speed"] | {"kp": "1"}},
    ):
        kept.note.cache_clear()
        kept.write(entry, json.dumps(content).encode())
        assert design.remembered_loops(plant) == loops
        assert asked.pop() == plant
        assert "was damaged and is made anew" in capsys.readouterr().err
        assert json.loads(kept.read(entry)) == good
        assert design.remembered_loops(plant) == loops
        assert asked == []


def test_results_of_names_that_look_alike_stand_side_by_side(tmp_path):
    """'a b' and 'a_b' gave one name, and the second removed the first without a word."""
    for motor in ("a b", "a_b", "a/b", "c"):
        keep_other(tmp_path, "audit", motor)
        (tmp_path / "audit.json").write_text(json.dumps({"motor": motor}))
    found = {json.loads(p.read_text())["motor"]: p.name for p in tmp_path.glob("audit*.json")}
    assert set(found) == {"a b", "a_b", "a/b", "c"}
    assert found["a_b"] == "audit-a_b.json"


def test_a_folder_in_a_file_s_place_is_told_before_the_run(tmp_path, capsys):
    (tmp_path / "audit.png").mkdir()
    assert main(["audit", "ipm", "--out", str(tmp_path)]) == 2
    assert (
        "audit.png' is a folder, where a file is to be written; move it" in capsys.readouterr().err
    )
    with pytest.raises(BadInput, match="is a folder, where a file"):
        audit("ipm").save(tmp_path)
    assert [p.name for p in tmp_path.iterdir()] == ["audit.png"]


def test_files_of_other_names_have_their_places_checked_too(tmp_path):
    (tmp_path / "effects.toml").mkdir()
    for command in ("diagnosis", "identify"):
        with pytest.raises(
            BadInput, match=r"effects.toml' is a folder, where a file is to be written"
        ):
            check_output(tmp_path, command)
    check_output(tmp_path, "audit")


@pytest.mark.parametrize("name", ["runs", "traces.zarr"])
def test_a_sweep_follows_no_link_and_removes_nothing_behind_one(tmp_path, name):
    behind, out = tmp_path / "behind", tmp_path / "out"
    behind.mkdir()
    (behind / "mine.txt").write_text("kept")
    out.mkdir()
    (out / name).symlink_to(behind)
    with pytest.raises(BadInput, match="is a link or a file, where a sweep keeps a folder"):
        store.open_folder(None, out, afresh=True)
    assert (behind / "mine.txt").read_text() == "kept"


@pytest.mark.parametrize("name", ["journal.jsonl", "schema.json"])
def test_a_folder_in_the_journal_s_place_is_told(tmp_path, name):
    (tmp_path / name).mkdir()
    with pytest.raises(BadInput, match="is a folder, where a file is to be written"):
        store.open_folder(None, tmp_path, afresh=True)


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (["compare", "--draws", "8"], "--draws 8 belongs to --tolerances"),
        (["simulate", "--effects", ",,,"], "effects ',,,' name none"),
        (["sweep", "{folder}/empty.toml"], "empty.toml says nothing; name what is run"),
        (["diagnose", "/dev/null"], "is a pipe or a device"),
        (["audit", "{folder}/pipe.toml"], "is a pipe or a device"),
        (["simulate", "--effects-from", "{folder}/pipe.toml"], "is a pipe or a device"),
        (["diagnose", "--example", "--continue", "{folder}/pipe.toml"], "is a pipe or a device"),
        (["verify", "{folder}/pipe.toml"], "is a pipe or a device|no result at"),
    ],
)
def test_what_says_nothing_or_is_no_file_is_refused(tmp_path, capsys, arguments, said):
    (tmp_path / "empty.toml").write_text("")
    os.mkfifo(tmp_path / "pipe.toml")
    code = main([a.format(folder=tmp_path) for a in arguments] + (["--out", str(tmp_path / "out")]))
    assert code == 2
    assert re.search(said, capsys.readouterr().err)
    assert not (tmp_path / "out").exists()


def test_rows_of_a_check_name_their_campaigns_in_texts(tmp_path):
    path = tmp_path / "withheld.rows.jsonl"
    row = {
        "method": "diagnosis",
        "part": "blind",
        "campaign": ["w000"],
        "truth": {},
        "answer": {"failed": "x"},
    }
    path.write_text(json.dumps(row | {"code": ""}) + "\n")
    with pytest.raises(BadInput, match="line 1 is no row of a check"):
        read_rows(path)


class Speechless(Exception):
    """What cannot say what it is."""

    def __str__(self):
        raise RuntimeError


@pytest.mark.parametrize(
    ("error", "said"),
    [
        (ValueError("one\n  two"), "ValueError: one two"),
        (KeyError(), "KeyError"),
        (Speechless(), "Speechless"),
        (ValueError("x" * 10_000), "ValueError: " + "x" * 200),
    ],
)
def test_what_a_user_s_code_raises_is_one_short_line(error, said):
    assert raised(error) == said


FAN = Path(__file__).parents[3] / "docs" / "stored" / "my_effects.py"


BODIES = {
    "return coefficient.size * omega": "cannot be compiled: TypingError: .*'size' of type float64 .own_0.py, line 10",  # noqa: E501
    'return "x"': "returns .*str.*; at 'load' it returns 1 number: N m that the load takes",
    "return omega, omega": "returns UniTuple",
    "return coefficient * omega * 1j": "returns complex128; at 'load' it returns 1 number",
    "return missing(omega)": "NameError: name 'missing' is not defined",
}
ADOPT = """
import sys
from model.effects.adopt import adopt
from model.errors import BadInput
for path in sys.argv[1:]:
    try:
        adopt(path)
    except BadInput as error:
        print(error)
"""


def test_equations_that_cannot_be_compiled_are_told_at_the_door(tmp_path):
    """Each in a line, in one process that has compiled no plant: what is refused is not there for
    the next."""
    paths = [tmp_path / f"own_{k}.py" for k in range(len(BODIES))]
    for path, body in zip(paths, BODIES, strict=True):
        path.write_text(FAN.read_text().replace("return coefficient * omega * abs(omega)", body))
    call = [sys.executable, "-c", ADOPT, *map(str, paths)]
    done = subprocess.run(call, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    for line, said in zip(done.stdout.splitlines(), BODIES.values(), strict=True):
        assert re.search(said, line)
        assert len(line) < 500


def test_a_compiled_estimator_begins_with_numbers():
    drive = load_drive("ipm")
    for state in ([1.0], np.zeros(3, np.float32), np.zeros((2, 2)), None):
        own = Estimator("own", "begins with something else", lambda *_, s=state: s, None)
        with pytest.raises(BadInput, match=r"a compiled one returns an array .n,. of float64"):
            first_state(own, drive.motor, None, None)
