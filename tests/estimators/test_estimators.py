"""Every registered estimator through the contract; starting up; a Python port that must give the same numbers."""

from __future__ import annotations

import dataclasses
import math
from collections import deque

import numpy as np
import pytest

from estimators.contract import Estimate, Estimator
from estimators.registry import estimator_names, load_estimator
from model.energy import Energy
from model.errors import BadInput
from model.frames import wrapped
from model.parameters import load_drive
from sandbox.scenario import Scenario, Segment
from sandbox.simulate import simulate

STILL = Scenario("still", (Segment(0.05),))
LOADED = Scenario("loaded", (Segment(0.05), Segment(0.35, 1.5, ramp=0.05)))


@pytest.mark.parametrize("name", estimator_names())
@pytest.mark.parametrize("belief", ["saturated", "linear"])
def test_every_estimator_runs_with_both_beliefs(name, belief):
    estimator = load_estimator(name)
    run = simulate(load_drive("ipm_exchanged"), STILL, estimator, belief, seed=1)
    assert estimator.summary
    assert np.degrees(np.abs(run.recording.error[run.recording.tracking > 0])).max() < 3.0


def test_unknown_estimator_names_the_nearest():
    with pytest.raises(BadInput, match="did you mean 'qnull'"):
        load_estimator("qnul")


@pytest.mark.parametrize("motor", ["ipm", "ipm_exchanged", "spm_exchanged"])
def test_starting_up_finds_position_and_polarity_everywhere(motor):
    """36 angles: the closed form has no blind spot, and the magnet's end is told from the other by saturation."""
    qnull, drive = load_estimator("qnull"), load_drive(motor)
    errors = []
    for k, angle in enumerate(np.arange(36) * np.pi / 18 - np.pi):
        scenario = dataclasses.replace(STILL, start_angle=float(angle))
        run = simulate(drive, scenario, qnull, "linear" if k % 2 else "saturated", seed=k)
        first = int(np.argmax(run.recording.tracking > 0))
        errors.append(math.degrees(run.recording.error[first]))
    # 10 mA of ripple are 3.5 degrees (notes); here noise 2 mA averaged over 16 ms, and the bias current's tail
    assert np.max(np.abs(errors)) < 1.5


def test_polarity_from_the_belief_where_the_magnet_desaturates():
    """A motor with alpha_30 < 0 has its larger ripple at the other end; the saturated belief knows."""
    drive = load_drive("ipm_exchanged")
    motor = dataclasses.replace(drive.motor, alpha_30=-7.7, alpha_12=-5.35)
    run = simulate(dataclasses.replace(drive, motor=motor), STILL, load_estimator("qnull"), "saturated")
    assert np.degrees(np.abs(run.recording.error[-1])) < 3.0


def ported_qnull() -> Estimator:
    """q-null with a linear belief, written in plain Python from its equations, tracking only."""

    def init(belief, tuning, angle=None):
        return {"axis": angle, "omega": 0.0, "ring": deque(maxlen=3 * tuning.period // 2)}

    def step(state, sample, belief, tuning):
        h, half = tuning.sampling_period, tuning.period // 2
        if "begun" not in state:
            state["begun"] = True
            return Estimate(state["axis"], 0.0, state["axis"], 0.0, 0.0, 0.0, 0.0)
        state["axis"] += h * state["omega"]
        state["ring"].append((complex(sample.i_alpha, sample.i_beta), sample.carrier))
        seen = []
        for age, (i, f) in enumerate(reversed(state["ring"])):
            weight = 1.0 if half <= age < 2 * half else 0.5
            seen.append((weight, f, i * np.exp(-1j * (state["axis"] - age * h * state["omega"]))))
        mean = sum(weight * i for weight, _, i in seen) / (2 * half)
        y = sum(weight * f * (i - mean) for weight, f, i in seen)
        y /= tuning.amplitude * tuning.power
        e = belief.energy
        error = min(max(y.imag / (e.gamma_d - e.gamma_q), -0.5), 0.5)
        state["axis"] += h * tuning.kp * error
        state["omega"] += h * tuning.ki * error
        size = tuning.amplitude * tuning.peak
        axis = state["axis"]
        return Estimate(axis, state["omega"], axis, 0.0, 1.0, y.real * size, y.imag * size)

    return Estimator("ported", "q-null in Python", init, step, compiled=False)


@pytest.mark.parametrize("closed", [True, False])
def test_python_port_gives_the_compiled_result(closed):
    """Same arithmetic in another order: differences grow from rounding (1e-16) through a stable loop."""
    scenario = dataclasses.replace(LOADED, start_up=False, start_angle=0.5)
    drive = load_drive("ipm_exchanged")
    ours = simulate(drive, scenario, load_estimator("qnull"), "linear", closed_loop=closed, seed=2).recording
    port = simulate(drive, scenario, ported_qnull(), "linear", closed_loop=closed, seed=2).recording
    # a rounding may flip one count of the quantiser, 2.4 mA: then 0.8 degrees times the loop's gain of one sample
    assert np.abs(wrapped(ours.theta_hat - port.theta_hat)).max() < 1e-9
    np.testing.assert_allclose(ours.table, port.table, rtol=1e-7, atol=1e-7)


def test_slow_path_is_the_kernel_bit_for_bit():
    """The loop's own source interpreted around the compiled estimator step."""
    ekf = load_estimator("ekf")
    drive = load_drive("ipm_exchanged")
    fast = simulate(drive, LOADED, ekf, seed=4).recording
    slow = simulate(drive, LOADED, dataclasses.replace(ekf, compiled=False), seed=4).recording
    assert np.array_equal(fast.table, slow.table)


def test_filterpy_in_the_loop_gives_the_compiled_filter():
    """Without quantisation, which turns a rounding into a count of 2.4 mA sooner or later."""
    drive = load_drive("ipm_exchanged")
    drive = dataclasses.replace(drive, converter=dataclasses.replace(drive.converter, current_resolution=0.0))
    fast = simulate(drive, LOADED, load_estimator("ekf"), seed=4).recording
    slow = simulate(drive, LOADED, load_estimator("ekf_filterpy"), seed=4).recording
    assert np.abs(fast.theta_hat - slow.theta_hat).max() < 1e-7


@pytest.mark.parametrize("name", ["qnull", "inversion", "ekf"])
def test_estimator_sees_measurements_only(name):
    """Watching (open loop), another truth with the same measurements gives the same estimate."""
    estimator, drive = load_estimator(name), load_drive("ipm_exchanged")
    samples, seen = [], []

    def spy(state, sample, belief, tuning):
        samples.append(tuple(sample))
        estimate = estimator.step(state, sample, belief, tuning)
        seen.append(tuple(estimate))
        return estimate

    simulate(drive, LOADED, dataclasses.replace(estimator, step=spy, compiled=False), closed_loop=False)
    from estimators.contract import Sample
    from sandbox.design import belief_of, design

    tuning, belief = design(drive).tuning, belief_of(drive, "saturated")
    state = estimator.init(belief, tuning)
    again = [tuple(estimator.step(state, Sample(*s), belief, tuning)) for s in samples]
    assert again == seen  # nothing but samples, belief and tuning went in


def test_belief_of_another_motor_changes_the_estimate_not_the_plant():
    drive = load_drive("ipm_exchanged")
    linear = Energy(drive.motor.energy.gamma_d, drive.motor.energy.gamma_q, 0.0, 0.0, 0.0, 0.0, 0.0)
    run = simulate(drive, LOADED, load_estimator("qnull"), "linear", truth=linear)
    late = run.recording.between(run.start_time + 0.25, 9.0)
    assert abs(np.degrees(late.error.mean())) < 0.1  # a linear motor has no cross-saturation to miss
