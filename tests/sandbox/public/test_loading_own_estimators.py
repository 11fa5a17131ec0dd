"""Estimators of the user's own on the page: by file, by object, in C; wrong ones named."""

from __future__ import annotations

import dataclasses
import json

import pytest

import sandbox
from sandbox.cli import commands, main, parse
from tests.sandbox.public.naming import OWN, SHORT, of


@of("compare")
def test_an_estimator_of_ones_own_by_file_and_object(own_file, tmp_path, capsys):
    """A copy of `qnull` under another name errs as `qnull` does, to the bit."""
    mine = sandbox.load_estimator(own_file)
    assert (mine.name, sandbox.load_estimator(str(own_file))) == ("mine", mine)
    result = sandbox.compare("ipm_exchanged", SHORT, ["qnull", mine])
    by_name = {
        name: [r.error_deg for r in result.rows if r.estimator == name]
        for name in ("qnull", "mine")
    }
    assert by_name["qnull"] == by_name["mine"]
    assert result.to_table().num_rows == len(result.rows) == 16
    assert "worst mean error" in repr(result)
    out = tmp_path / "out"
    call = [
        "compare",
        "--scenario",
        "speed_steps",
        "--estimators",
        "qnull",
        "--estimator",
        str(own_file),
    ]
    given = parse(call).given
    both = commands.asked_for(given("estimators"), given("estimator"), commands.USUAL_ESTIMATORS)
    assert both == ["qnull", str(own_file)]
    given = parse(["compare", "--estimator", "ekf"]).given  # it alone, as in `simulate`
    assert commands.asked_for(
        given("estimators"), given("estimator"), commands.USUAL_ESTIMATORS
    ) == ["ekf"]
    given = parse(["compare"]).given
    assert commands.asked_for(given("estimators"), given("estimator"), ("qnull",)) == ["qnull"]
    scene = tmp_path / "s.toml"
    scene.write_text("[[segment]]\nduration = 0.2\n")
    call = [
        "simulate",
        "--scenario",
        str(scene),
        "--estimator",
        str(own_file),
        "--json-only",
        "--out",
        str(out),
    ]
    assert main(call) == 0
    assert json.loads((out / "simulate.json").read_text())["estimator"] == "mine"
    assert [p.name for p in out.iterdir()] == ["simulate.json"]
    capsys.readouterr()


@pytest.mark.parametrize(
    ("text", "sentence"),
    [
        (OWN.format(name="ekf"), "'ekf' is the name of a built-in estimator"),
        ("x = 1", "defines no ESTIMATOR"),
        ("import nothing_of_this_name", "cannot be run: ModuleNotFoundError"),
    ],
)
def test_wrong_estimator_files(text, sentence, tmp_path):
    path = tmp_path / "wrong.py"
    path.write_text(text)
    with pytest.raises(sandbox.BadInput, match=sentence):
        sandbox.load_estimator(path)
    with pytest.raises(sandbox.BadInput, match="does not exist"):
        sandbox.load_estimator(tmp_path / "nowhere.py")


@of("load_estimator_library", "export_estimator")
def test_estimators_in_c_from_the_page(tmp_path):
    """What they do: tests/estimators/test_shared_library.py and test_c.py."""
    with pytest.raises(sandbox.BadInput, match="does not exist"):
        sandbox.load_estimator_library(tmp_path / "none.so")
    with pytest.raises(sandbox.BadInput, match="is neither a name nor a file nor a library"):
        sandbox.load_estimator_library(3)
    export = sandbox.export_estimator("qnull", "ipm_exchanged")
    assert (
        repr(export)
        == "<Export: qnull for ipm_exchanged, sensorless_estimator.h, qnull.c, motor.h, check.c>"
    )
    assert {p.name for p in export.save(tmp_path / "out").iterdir()} == {
        *export.files,
        "export-estimator.json",
    }
    with pytest.raises(sandbox.BadInput, match="unknown estimator in C"):
        sandbox.export_estimator("ukf")


@of("export_drive")
def test_a_drive_from_the_page(tmp_path):
    """What it does: tests/sandbox/drive/export."""
    export = sandbox.export_drive("ipm_exchanged", "dead_time.time=2e-6", fmu=False)
    names = "sensorless_drive.h, sensorless_drive.c, closed_loop.c"
    assert repr(export) == f"<DriveExport: ipm_exchanged, {names}>"
    assert {p.name for p in export.save(tmp_path / "out").iterdir()} == {
        *export.files,
        "export-drive.json",
    }
    with pytest.raises(sandbox.BadInput, match=r"did you mean 'dead_time\.time'"):
        sandbox.export_drive("ipm_exchanged", {"dead_time.tim": 2e-6})
    with pytest.raises(sandbox.BadInput, match="top_speed_rpm = -1 is out of range"):
        sandbox.export_drive("ipm_exchanged", top_speed_rpm=-1.0)


def test_two_estimators_of_one_name_are_refused():
    one = dataclasses.replace(sandbox.load_estimator("qnull"), name="same")
    other = dataclasses.replace(one, summary="another")
    with pytest.raises(sandbox.BadInput, match="two estimators are called 'same'"):
        sandbox.compare("ipm_exchanged", SHORT, [one, other])


@of("Sample", "Estimate", "Belief", "Tuning", "Estimator")
def test_an_estimator_is_written_with_the_page_alone(tmp_path):
    """One that says what it was told: the angle of a locked rotor, so the error is nil but for the
    first sample."""

    def step(state, sample: sandbox.Sample, belief: sandbox.Belief, tuning: sandbox.Tuning):
        assert belief.magnet_flux > 0.0
        return sandbox.Estimate(state["told"], 0.0, state["told"], 0.0, 1.0, 0.0, 0.0)

    told = sandbox.Estimator(
        "told", "keeps what it was told", lambda b, t, angle=None: {"told": angle}, step, False
    )
    still = sandbox.Scenario("still", (sandbox.Segment(0.05),), start_up=False)
    assert sandbox.simulate("ipm", still, told, closed_loop=False).error_deg.max == pytest.approx(
        0.0, abs=1e-9
    )


RAISING = """import sandbox
def init(belief, tuning, angle=None):
    return [1 / {init}]
def far(x):
    return {{}}[x]
def step(state, sample, belief, tuning):
    return far("gone")
ESTIMATOR = sandbox.Estimator("mine", "raises", init, step, compiled=False)
"""


@pytest.mark.parametrize(
    ("init", "sentence"),
    [
        (
            0,
            (
                "init of estimator 'mine' raised ZeroDivisionError: division by zero "
                "(mine.py, line 3); mend it there"
            ),
        ),
        (1, "step of estimator 'mine' raised KeyError: 'gone' (mine.py, line 5); mend it there"),
    ],
)
def test_an_estimator_that_raises_is_told_with_its_line(init, sentence, tmp_path, capsys):
    """Lines as they stand in RAISING; a sweep's row says the same."""
    file, scene = tmp_path / "mine.py", tmp_path / "s.toml"
    file.write_text(RAISING.format(init=init))
    scene.write_text("[scenario]\nstart_up = false\n[[segment]]\nduration = 0.02\n")
    out = ["--scenario", str(scene), "--out", str(tmp_path / "out")]
    for call in (["simulate", "--estimator"], ["compare", "--estimators", "", "--estimator"]):
        assert main([*call, str(file), *out]) == 2
        assert capsys.readouterr().err == f"sensorless {call[0]}: {sentence}\n"
    plan = {
        "run": {"estimator": str(file)},
        "scenario": {"start_up": False},
        "segment": [{"duration": 0.02}],
        "grid": {"belief": ["linear"]},
    }
    row = sandbox.sweep(plan, tmp_path / "sweep", jobs=1).to_table().to_pylist()[0]
    assert (row["status"], row["sentence"]) == ("error", sentence)
