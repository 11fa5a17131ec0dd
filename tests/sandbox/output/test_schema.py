"""Every JSON file that a command writes is what its schema says, key by key, and every key of a
schema is explained."""

from __future__ import annotations

import copy
import json
from pathlib import Path

import pytest
from jsonschema import Draft202012Validator

import sandbox
from model.errors import BadInput
from sandbox.output.schema import json_schema, schema_names
from sandbox.replay.identification.locked_test import paper_campaign
from tests.schemas import misfits

ROOT = Path(__file__).resolve().parents[3]
LOADED = sandbox.Scenario("loaded", (sandbox.Segment(0.2, load=1.0, settle=0.15),), start_up=False)
ELSEWHERE = {  # files whose command takes long: checked where a test has run it anyway
    "bench": "experiments/results/bench.json",  # as the command wrote it
    # likewise, with a date; a new one: tests/sandbox/gap/report/test_answers.py
    "diagnosis": "docs/stored/diagnosis.json",
    # where `check`, `plan` and `verify` are tested: tests/sandbox/recordings, tests/sandbox/public
    "check": "",
    "plan": "",
    "verify": "",
    "withheld": "",  # tests/sandbox/withheld/making/test_make_commands.py
}
SWEEP = {
    "run": {"estimator": "qnull", "seed": 1},
    "scenario": {"start_up": False},
    "segment": [{"duration": 0.2, "load": 1.0, "settle": 0.15}],
    "grid": {"belief": ["linear", "saturated"]},
    "random": {"points": 2, "draw": {"true_factor": {"magnet_flux": {"normal": [1.0, 0.02]}}}},
}


def identified(folder):
    drive = sandbox.load_motor("ipm_exchanged")
    return sandbox.identify(paper_campaign(drive, levels=(-2.0, -1.0, 0.0, 1.0, 2.0)))


def replayed(folder):
    sandbox.simulate("ipm_exchanged", LOADED, record=folder / "bench")
    return sandbox.replay(folder / "bench", {"current_offset.offset_a": 0.01})


def set_beside(folder):
    """Return settings beside a hand-made result: what is not told is null."""
    folder.mkdir(exist_ok=True)
    (folder / "identify.json").write_text('{"campaign": "c"}')
    (folder / "motor.toml").write_text(
        "[motor]\npole_pairs = 7\nresistance = 0.05\n[ci95]\nresistance = [0.04, 0.06]\n"
    )
    (folder / "vesc.xml").write_text(
        "<a><foc_motor_r>0.1</foc_motor_r><foc_current_ki>50</foc_current_ki></a>"
    )
    return sandbox.check_settings(folder, folder / "vesc.xml")


MADE = {
    "settings": set_beside,
    "simulate": lambda folder: sandbox.simulate(
        "ipm_exchanged", LOADED, effects="dead_time.time=1e-6"
    ),
    "compare": lambda folder: sandbox.compare("ipm_exchanged", LOADED, ["qnull"]),
    "audit": lambda folder: sandbox.audit("spm"),  # not valid: violations and nulls
    "maps": lambda folder: sandbox.maps("spm", points=5),
    "identify": identified,
    "replay": replayed,
    "protocol": lambda folder: sandbox.protocol(["qnull"], ["ipm_exchanged"], ["load_step"]),
    "sweep": lambda folder: sandbox.sweep(SWEEP, folder / "runs", jobs=1),
    "tolerances": lambda folder: sandbox.tolerances(
        "ipm_exchanged", LOADED, "qnull", percent=[10], draws=2, jobs=1
    ),
    "export-drive": lambda folder: sandbox.export_drive("ipm", {"dead_time.time": 1e-6}, fmu=False),
    "export-estimator": lambda folder: sandbox.export_estimator("qnull"),
    "motor": lambda folder: sandbox.convert_motor(
        ["poles=14", "kv=300", "r_ll=0.1ohm", "inductance=30uH", "current=20A", "voltage=24V"]
    ),
}


def test_every_schema_is_checked():
    assert {*MADE, *ELSEWHERE} == set(schema_names())


@pytest.mark.parametrize("name", MADE)
def test_what_is_written_fits_its_schema(name, tmp_path):
    folder = MADE[name](tmp_path).save(tmp_path / "out")
    assert misfits(name, folder / f"{name}.json") == []


@pytest.mark.parametrize("name", [name for name, file in ELSEWHERE.items() if file])
def test_what_is_kept_fits_its_schema(name):
    content = json.loads((ROOT / ELSEWHERE[name]).read_text())
    content.pop("date", None)
    assert misfits(name, content) == []


@pytest.mark.parametrize("name", schema_names())
def test_schemas_are_sound_and_explain_every_key(name):
    whole = json_schema(name)
    Draft202012Validator.check_schema(whole)
    assert whole["description"]
    for key, value in whole["properties"].items():
        referred = whole["$defs"][value["$ref"].rpartition("/")[2]] if "$ref" in value else {}
        assert (referred | value)["description"].endswith((".", ":")), key


def test_another_key_a_missing_one_and_a_wrong_kind_are_seen():
    good = json.loads((ROOT / ELSEWHERE["bench"]).read_text())
    assert misfits("bench", good) == []
    for change in ({"more": 1}, {"schema": 2}, {"ratios": {"a": "fast"}}):
        assert len(misfits("bench", good | change)) == 1
    lacking = copy.deepcopy(good)
    del lacking["measured"]
    assert misfits("bench", lacking) == [": 'measured' is a required property"]
    with pytest.raises(BadInput, match="did you mean 'compare'"):
        json_schema("compar")
