"""Doors that a stranger found open: entries of the cache exchanged, results and cards edited by hand."""

import json
import subprocess
import sys
from dataclasses import fields
from pathlib import Path
from types import SimpleNamespace

import pytest

from model import kept
from model.compiling import Watch
from model.effects import adopt, library
from model.errors import BadInput
from model.parameters import LONGEST, read_toml
from sandbox import audit, maps, verify
from sandbox.output.files import check_output
from sandbox.public import verifying
from sandbox.public.result import keep_other
from sandbox.sweep import store
from sandbox.sweep.plan import _found
from sandbox.validation.scoring.documents import check_report


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


@pytest.mark.parametrize("text", ['{"x": 1' + "0" * 400 + "}", "[" * 100_000])
def test_seconds_of_compiling_that_cannot_be_read_are_forgotten(tmp_path, text):
    path = tmp_path / "compile-seconds.json"
    path.write_text(text)
    assert Watch(path).known() == {}


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
        ({"radius": [1]}, "states a call that cannot be made"),
    ],
)
def test_a_result_s_call_reaches_nothing_else(tmp_path, made, change, said):
    made = json.loads(json.dumps(made))
    made["made_by"]["call"]["arguments"] |= change
    (tmp_path / "audit.json").write_text(json.dumps(made))
    with pytest.raises(BadInput, match=said) as told:
        verify(tmp_path)
    assert "\n" not in str(told.value)
    assert len(str(told.value)) <= 400
    assert [p.name for p in tmp_path.iterdir()] == ["audit.json"]


def test_a_key_of_a_result_is_shown_without_its_control_characters(tmp_path):
    first = verifying.Difference("\x1b[31mkey\n", 1, 2)
    said = verifying.Verification(tmp_path, "audit", 3, 0.5, (first,), ()).sentence()
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
    [{"cpu_seconds": "x"}, {"cpu_seconds": 10**400}, {"unknown": 3}, {"gap": {"before": 2.0, "raw": "x"}}],
)
def test_a_report_s_costs_and_sizes_are_numbers(change):
    report = {
        "campaign": "w000", "verdict": "no_gap", "gap": {"before": 1.0}, "ambiguity_set": [[]],
        "hypotheses": [{"effects": [], "probability": 1.0, "parameters": {}}],
    }  # fmt: skip
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
    other = SimpleNamespace(**{f.name: getattr(card, f.name) for f in fields(card)} | {"name": "mine"} | change)
    own = object.__new__(type(card))
    for name, value in vars(other).items():
        object.__setattr__(own, name, value)
    with pytest.raises(BadInput, match=said):
        adopt._check(own, Path("mine.py"))


def test_maps_reach_as_far_as_an_audit():
    """Twenty times rated current: beyond, the model is not made for it."""
    with pytest.raises(BadInput, match="20 x rated"):
        maps("ipm_exchanged", 1e150)


def test_a_path_that_is_no_utf8_is_told_before_a_run(tmp_path):
    with pytest.raises(BadInput, match="no UTF-8"):
        check_output(tmp_path / "o\udcff")


@pytest.mark.parametrize(
    "blocks",
    [
        3, [3], [{"start": "x"}],
        [{"start": 0, "rows": 1, "file": "../elsewhere.parquet", "cpu_seconds": 1.0, "kernel_seconds": 1.0}],
        [{"start": 0, "rows": 1, "file": store._file(0), "cpu_seconds": "x", "kernel_seconds": 1.0}],
    ],
)  # fmt: skip
def test_a_manifest_that_is_none_of_ours_is_no_manifest(tmp_path, blocks):
    sound = {"start": 0, "rows": 1, "file": store._file(0), "cpu_seconds": 1.0, "kernel_seconds": 1.0}
    for own, there in (([sound], True), (blocks, False)):
        content = {"blocks": own}
        path = tmp_path / "manifest.json"
        path.write_text(json.dumps(content | {"sha256": store._digest(content)}))
        assert (store._read(path) is not None) == there


def test_a_command_whose_output_is_closed_goes_well(tmp_path):
    code = "import sys; sys.stdout = None; from sandbox.cli import main; sys.exit(main(['list', 'motors']))"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False, cwd=tmp_path)
    assert (done.returncode, done.stderr) == (0, "")
