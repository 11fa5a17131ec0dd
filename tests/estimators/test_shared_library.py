"""Estimators in shared libraries: what they are handed, what they tell, what is refused at the
door."""

from __future__ import annotations

import ctypes
import json
import re
import time
from pathlib import Path

import numpy as np
import pytest

import sandbox
from estimators.c.build import build, compiler
from estimators.c.generate import HEADER
from estimators.contract import Belief, Estimate, Sample, Tuning
from estimators.shared_library import FUNCTIONS, load_library, setup_of
from model.drive_files import load_drive
from model.energy import Energy
from model.errors import BadInput
from sandbox.cli import main
from sandbox.drive.design import belief_of, design

needs_compiler = pytest.mark.skipif(compiler() is None, reason="no C compiler")
SETUP = (
    *(f"belief.energy.{f}" for f in Energy._fields),
    *(f"belief.{f}" for f in Belief._fields[1:]),
    *(f"tuning.{f}" for f in Tuning._fields),
    "angle_known",
    "angle",
)
# Echoes: a step tells its sample, and one number of the setup after the other.
SPY = (
    '#include "HEADER"\n'
    "typedef struct { sensorless_setup setup; int32_t n; } spy;\n"
    "int32_t sensorless_init(void *state, const sensorless_setup *setup) {\n"
    "    spy *s = state; s->setup = *setup; return setup->belief.inertia > 1 ? 7 : 0; }\n"
    "void sensorless_step(void *state, const sensorless_sample *x, sensorless_estimate *e) {\n"
    "    spy *s = state; sensorless_real told[] = {TOLD};\n"
    "    e->theta = (sensorless_real)((s->n % 20) * 0.31415926535897932); e->omega = "
    "x->i_alpha; e->axis = x->i_beta;\n"
    "    e->bias = x->u_alpha; e->tracking = 1; e->ripple_d = x->carrier;\n"
    "    e->ripple_q = told[s->n % COUNT]; s->n++; }\n"
    'SENSORLESS_ESTIMATOR("spy", spy, SENSORLESS_NONE);\n'
)


def built(folder: Path, text: str = SPY, name: str = "spy", **more: bool) -> Path:
    """Return a library of a text."""
    found = ", ".join(f"(sensorless_real)s->setup.{f}" for f in SETUP)
    text = (
        text.replace("HEADER", str(HEADER)).replace("TOLD", found).replace("COUNT", str(len(SETUP)))
    )
    file = folder / f"{name}.c"
    file.write_text(text)
    return build(file, folder, **more)


def case():
    """Return belief and tuning of a motor."""
    drive = load_drive("ipm_exchanged")
    return belief_of(drive, "saturated"), design(drive).tuning


@needs_compiler
@pytest.mark.parametrize("double", [False, True])
def test_the_whole_setup_and_sample_arrive(double, tmp_path):
    """Every number under its own name, to the width's rounding; nothing else is handed over."""
    belief, tuning = case()
    spy = load_library(built(tmp_path, double=double))
    assert (spy.name, spy.injection, spy.compiled) == ("spy", "none", True)
    state = spy.init(belief, tuning, 0.7)
    sample = Sample(1.1, -2.2, 33.3, -4.4, 5e-4)
    found = [spy.step(state, sample, belief, tuning) for _ in SETUP]
    exact = {"rtol": 0.0 if double else 2.0**-24}
    wanted = [*belief.energy, *belief[1:], *tuning, 1, 0.7]
    np.testing.assert_allclose([e.ripple_q for e in found], wanted, **exact)
    first = found[0]
    shown = [first.omega, first.axis, first.bias, first.ripple_d]
    np.testing.assert_allclose(
        shown, [sample.i_alpha, sample.i_beta, sample.u_alpha, sample.carrier], **exact
    )
    assert first.injection == 1.0  # what it does not tell is the neutral value
    structure = setup_of(ctypes.c_double, belief, tuning, None)
    assert (structure.angle_known, structure.angle) == (0, 0.0)


@needs_compiler
def test_in_the_loop_it_sees_measurements_and_its_angle_is_followed(tmp_path):
    """Recorded beside what it tells: the measured current, not the true one; R as believed, not as
    in the plant."""
    scene = sandbox.Scenario("short", (sandbox.Segment(0.05),), start_up=False, start_angle=0.0)
    motor = sandbox.load_motor("ipm_exchanged")
    spy = sandbox.load_estimator_library(built(tmp_path, double=True))
    plant = {"stator_resistance.resistance": 2.0 * motor.motor.resistance}
    run = sandbox.simulate(motor, scene, spy, closed_loop=False, effects=plant).recording
    measured = (2.0 * run.i_a - run.i_b - run.i_c) / 3.0
    np.testing.assert_allclose(run.omega_hat, measured, rtol=1e-12, atol=1e-15)
    # noise
    assert (
        np.max(np.abs(measured - (run.i_d * np.cos(run.theta) - run.i_q * np.sin(run.theta))))
        > 1e-4
    )
    found = run.ripple_q[SETUP.index("belief.resistance") :: len(SETUP)]
    np.testing.assert_array_equal(found, motor.motor.resistance)
    # told modulo a turn, 0 to 2 pi: recorded as it goes on, a tenth of half a turn a sample
    np.testing.assert_allclose(np.diff(run.theta_hat), np.pi / 10.0, rtol=1e-9)


@needs_compiler
@pytest.mark.parametrize(
    ("pattern", "by", "sentence"),
    [
        ("SENSORLESS_ESTIMATOR(.*);", "", "lacks sensorless_abi, sensorless_real_bytes"),
        (
            r'#include "HEADER"',
            '#include "HEADER"\n#undef SENSORLESS_ABI\n#define SENSORLESS_ABI 2',
            "has ABI 2",
        ),
        ("int32_t n; }", "int32_t n; char much[1 << 20]; }", "bytes; 1 to 1048576 are handed out"),
        ("SENSORLESS_NONE", "9", "names injection 9; the header has 0 to 2"),
        (r'"spy"', '"ekf"', "'ekf' is the name of a built-in estimator"),
    ],
)
def test_refused_at_the_door(pattern, by, sentence, tmp_path, capsys):
    library = built(tmp_path, re.sub(pattern, by.replace("\\", r"\\"), SPY), "wrong")
    with pytest.raises(BadInput, match=re.escape(sentence)):
        sandbox.load_estimator_library(library)
    assert (
        main(["simulate", "--estimator-library", str(library), "--out", str(tmp_path / "out")]) == 2
    )
    said = capsys.readouterr().err
    assert sentence in said
    assert said.count("\n") == 1


def test_no_file_and_no_library(tmp_path, capsys):
    text = tmp_path / "text.so"
    text.write_text("no library")
    for path, sentence in (
        (tmp_path / "none.so", "does not exist"),
        (text, "is no library that this machine can load"),
    ):
        with pytest.raises(BadInput, match=sentence):
            sandbox.load_estimator_library(path)
        with pytest.raises(BadInput, match=sentence):
            sandbox.load_estimator(path)  # the usual door knows the suffix
        for command in ("compare", "protocol"):
            assert (
                main([command, "--estimator-library", str(path), "--out", str(tmp_path / "out")])
                == 2
            )
            assert sentence in capsys.readouterr().err
    assert not (tmp_path / "out").exists()


@needs_compiler
def test_refused_when_it_begins(tmp_path):
    belief, tuning = case()
    spy = load_library(built(tmp_path))
    with pytest.raises(
        BadInput, match=r"refuses this motor: sensorless_init returned 7; its source says why$"
    ):
        spy.init(belief._replace(inertia=2.0), tuning, 0.3)
    with pytest.raises(
        BadInput, match=r"or to find its first angle itself: .* start_up = false tells the angle$"
    ):
        spy.init(belief._replace(inertia=2.0), tuning)
    with pytest.raises(BadInput, match="takes the quartic energy"):
        spy.init(belief._replace(energy=object()), tuning)
    beyond = SPY.replace(
        "s->setup = *setup;", "s->setup = *setup; ((unsigned char *)s)[sizeof(spy) + 4] = 1;"
    )
    with pytest.raises(BadInput, match="writes beyond the"):
        load_library(built(tmp_path, beyond, "beyond")).init(belief, tuning)


@needs_compiler
def test_what_is_not_finite_ends_the_run(tmp_path):
    """In the plant or in the estimate, as the sentence says; nothing of it is recorded."""
    wrong = SPY.replace(
        "e->omega = x->i_alpha", "e->omega = (sensorless_real)(0.0 / (double)(s->n < 0))"
    )
    scene = sandbox.Scenario("short", (sandbox.Segment(0.05),), start_up=False)
    with pytest.raises(sandbox.PhysicsError, match="in the plant or in the estimate"):
        sandbox.simulate(
            "ipm_exchanged", scene, sandbox.load_estimator_library(built(tmp_path, wrong))
        )


@needs_compiler
def test_a_library_built_anew_is_loaded_anew(tmp_path):
    library = built(tmp_path)
    first = load_library(library)
    assert load_library(library) is first
    time.sleep(0.02)  # a file system's clock
    built(tmp_path, SPY.replace('"spy"', '"other"'))
    assert load_library(library).name == "other"
    assert first.name == "spy"


@needs_compiler
def test_one_run_by_the_command_line(tmp_path, capsys):
    scene = tmp_path / "s.toml"
    scene.write_text("[[segment]]\nduration = 0.05\n")
    call = [
        "simulate",
        "--scenario",
        str(scene),
        "--open",
        "--json-only",
        "--out",
        str(tmp_path / "out"),
    ]
    assert main([*call, "--estimator-library", str(built(tmp_path))]) == 0
    assert json.loads((tmp_path / "out" / "simulate.json").read_text())["estimator"] == "spy"
    capsys.readouterr()


def test_the_header_says_what_the_contract_says():
    """Field by field, in order: what one side adds the other must know."""
    text = re.sub(r"/\*.*?\*/", "", HEADER.read_text(), flags=re.S)
    for name, template in {
        "energy": Energy,
        "belief": Belief,
        "tuning": Tuning,
        "sample": Sample,
        "estimate": Estimate,
    }.items():
        body = re.search(rf"typedef struct {{([^}}]*)}} sensorless_{name};", text)[1]
        fields = [
            f.strip()
            for line in body.split(";")
            for f in re.sub(r"^\s*\w+ ", "", line).split(",")
            if f.strip()
        ]
        assert fields == list(template._fields), name
    for function in FUNCTIONS:
        assert f"sensorless_{function}(" in text
