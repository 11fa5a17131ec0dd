"""Our estimators in C: current, strict C99, and as their Python twins."""

from __future__ import annotations

import dataclasses
import json
import re
import subprocess
from pathlib import Path

import numpy as np
import pytest

from estimators.c import generate
from estimators.c.build import STRICT, build, compiler
from estimators.c.counting import operations
from estimators.c.golden import read_golden
from estimators.c.target import TOLERANCE_DEG
from estimators.registry import load_estimator
from experiments import releases
from model.frames import rotate, wrapped
from sandbox import export_estimator, load_motor, protocol, simulate
from sandbox.cli import main
from sandbox.drive.scenario import Scenario, Segment
from sandbox.public.exports.estimator import in_windows

NAMES = generate.NAMES
DIGITS = 5e-9  # golden.json holds nine of them
needs_compiler = pytest.mark.skipif(compiler() is None, reason="no C compiler")
LOADED = Scenario("loaded", (Segment(0.2), Segment(0.4, 1.0, 0.02, ramp=0.1, settle=0.2)), "driven")


@pytest.fixture(scope="module")
def libraries(tmp_path_factory):
    """Every estimator in float and double, and the worked example."""
    folder = tmp_path_factory.mktemp("c")
    files = [generate.HERE / f"{name}.c" for name in NAMES]
    found = {
        (f.stem, d): load_estimator(build(f, folder, double=d))
        for f in files
        for d in (False, True)
    }
    examples = (generate.HERE / "examples").glob("*.c")
    return found | {(f.stem, False): load_estimator(build(f, folder)) for f in examples}


def unquantised(motor):
    """Return a motor whose current readings have noise, but no counts: one turns a last digit into
    other noise."""
    drive = load_motor(motor)
    return dataclasses.replace(
        drive, converter=dataclasses.replace(drive.converter, current_resolution=0.0)
    )


@pytest.mark.parametrize("name", NAMES)
def test_the_files_are_what_the_python_sources_say(name):
    """Otherwise: python -m estimators.c.generate."""
    assert (generate.HERE / f"{name}.c").read_text() == generate.source(name)
    assert (generate.HERE / "startup.h").read_text() == generate.start_up()


@pytest.mark.parametrize("name", NAMES)
def test_golden_vectors_are_the_twins(name):
    """Otherwise: python -m experiments.c_estimators --golden."""
    golden = read_golden()
    found = in_windows(load_estimator(name), golden)
    # the samples kept are rounded in their ninth digit, and each angle is some digits of them
    np.testing.assert_allclose(found, golden.estimates[name], rtol=10 * DIGITS, atol=100 * DIGITS)


@needs_compiler
@pytest.mark.parametrize("name", NAMES)
def test_in_c_on_golden_vectors(name, libraries):
    """In double the order of operations is the same (1e-9 rad is a million roundings); in float the
    goal holds."""
    golden = read_golden()
    twin = in_windows(load_estimator(name), golden)
    np.testing.assert_allclose(
        in_windows(libraries[name, True], golden), twin, rtol=1e-9, atol=1e-9
    )
    narrow = wrapped(
        in_windows(libraries[name, False], golden)[:, 0] - golden.estimates[name][:, 0]
    )
    assert np.degrees(np.abs(narrow)).max() <= TOLERANCE_DEG


@needs_compiler
@pytest.mark.parametrize("motor", ["ipm_exchanged", "spm_exchanged"])
@pytest.mark.parametrize("name", NAMES)
def test_closed_loop_with_start_up_in_float(name, motor, libraries):
    drive = unquantised(motor)
    rows = [simulate(drive, LOADED, e).rows for e in (load_estimator(name), libraries[name, False])]
    for ours, theirs in zip(*rows, strict=True):
        assert not ours.lost_lock
        assert not theirs.lost_lock
        assert ours.error_deg.mean == pytest.approx(theirs.error_deg.mean, abs=TOLERANCE_DEG)
        assert ours.error_deg.p95 == pytest.approx(theirs.error_deg.p95, abs=TOLERANCE_DEG)


@needs_compiler
def test_part_of_the_protocol_in_float(libraries):
    """The rest: experiments/c_estimators.py, results/c_estimators.md."""
    pairs = [x for name in NAMES for x in (name, libraries[name, False])]
    rows = protocol(pairs, [unquantised("ipm_exchanged")], ["creep"]).protocol.rows
    by = {(r.unit.estimator, r.unit.belief): r.outcome for r in rows}
    for name in NAMES:
        for belief in ("saturated", "linear"):
            ours, theirs = by[name, belief], by[f"{name}_c", belief]
            assert belief == "linear" or ours.passed == theirs.passed  # theory goes by the name
            assert len(ours.points) == len(theirs.points) > 0
            for a, b in zip(ours.points, theirs.points, strict=True):
                assert a.mean_deg == pytest.approx(b.mean_deg, abs=TOLERANCE_DEG)


@needs_compiler
def test_the_worked_example_on_a_linear_motor(libraries):
    """The reversal of motulator's motor, which is as linear as the observer believes: its goal is
    lock."""
    (row,) = protocol([libraries["flux_observer", False]], ["ipm"], ["reversal"]).protocol.rows
    assert row.outcome.passed
    assert row.outcome.metrics["rms_deg"] < 1.0  # the protocol's goal for a mean


@pytest.mark.parametrize("name", generate.NAMES)
def test_the_readme_states_the_operations_of_the_files(name):
    head = (generate.HERE / f"{name}.c").read_text().partition("*/")[0]
    found = dict(
        re.findall(r"(mul|add|div|sqrt|trig|compare) (\d+)", re.sub(r"(\d+) (\w+)", r"\2 \1", head))
    )
    numbers = [found.get(k, "0") for k in ("mul", "add", "div", "sqrt", "trig", "compare")]
    state = re.search(r"(\d+) numbers of state", head)[1]
    readme = (generate.HERE / "README.md").read_text()
    assert f"| `{name}` | {' | '.join(numbers)} | {state} numbers |" in readme


@needs_compiler
def test_the_readmes_example(libraries):
    """The same text as examples/smallest.c; at 20 % speed without load it needs no map to know the
    angle."""
    readme = (generate.HERE / "README.md").read_text()
    example = (generate.HERE / "examples" / "smallest.c").read_text()
    assert f"```c\n{example}```" in readme
    scene = Scenario(
        "turning", (Segment(0.6, 0.0, 0.2, ramp=0.2, settle=0.4),), "driven", start_up=False
    )
    error = simulate("ipm_exchanged", scene, libraries["smallest", False]).error_deg
    assert abs(error.mean) < 1.0  # the protocol's goal


def step(state, sample, belief, tuning):
    """Whose operations are counted by hand: 4 + 1 mul, 2 + 1 add, 1 div, 2 trig."""
    x, y = rotate(sample.i_alpha, sample.i_beta, state[0])
    state[0] += tuning.kp * x / y
    return state[0]


def test_operations_are_counted():
    golden = read_golden()
    found = operations(step, (golden.belief, golden.tuning), np.ones(1), golden.samples[20:30])
    assert found.mean == {
        "mul": 5.0,
        "add": 3.0,
        "div": 1.0,
        "sqrt": 0.0,
        "trig": 2.0,
        "compare": 0.0,
    }
    assert found.most == found.mean
    assert found.steps == 5


def unknown(state, sample, belief, tuning):
    """Something that no kernel uses."""
    return [state[0]]


def test_what_is_not_translated_is_named():
    with pytest.raises(AssertionError, match=r"\[state\[0\]\]: List has no translation"):
        generate.translated(unknown, 1)


@needs_compiler
def test_an_export_is_whole(tmp_path, capsys):
    """Compiled as it lies there, alone, it finds its golden vectors again; double promotions would
    cost a target."""
    out = tmp_path / "firmware"
    assert (
        main(
            ["export-estimator", "qnull", "--motor", "ipm", "--belief", "linear", "--out", str(out)]
        )
        == 0
    )
    assert "mul" in capsys.readouterr().out
    found = json.loads((out / "export-estimator.json").read_text())
    assert {p.name for p in out.iterdir()} == {*found["files"], "export-estimator.json"}
    strict = (*STRICT, "-Wconversion", "-Wdouble-promotion")
    subprocess.run([compiler(), *strict, "-c", "qnull.c"], cwd=out, check=True)
    subprocess.run(
        [compiler(), *STRICT, "-O2", "-o", "check", "check.c", "qnull.c", "-lm"],
        cwd=out,
        check=True,
    )
    done = subprocess.run([out / "check"], capture_output=True, text=True, check=True)
    assert done.stdout.startswith("qnull on ipm, 240 samples: angle within ")
    assert (
        f".gamma_d = (sensorless_real){1.0 / load_motor('ipm').motor.inductance_d!r}"
        in (out / "motor.h").read_text()
    )


def test_exports_that_are_refused(tmp_path, capsys):
    assert main(["export-estimator", "ukf", "--out", str(tmp_path / "out")]) == 2
    assert "unknown estimator in C 'ukf'" in capsys.readouterr().err
    with pytest.raises(ValueError, match="neither 'saturated' nor 'linear'"):
        export_estimator("ekf", belief="quartic")
    assert not Path(tmp_path / "out").exists()


@needs_compiler
def test_compiled_python_costs_no_more_beside_c_than_at_the_last_release(libraries):
    """By five deviations of the median of seven runs in turns, or 0.2
    (experiments/results/releases.md)."""
    kept, own = releases.last(), releases.costs({name: libraries[name, False] for name in NAMES})
    assert set(own) == set(kept["cost"])
    assert releases.worse(kept, "cost", own) == []
    lost = {
        name: entry["value"] + 0.21 + 6.0 * entry["noise"] for name, entry in kept["cost"].items()
    }
    assert len(releases.worse(kept, "cost", lost)) == len(own)
