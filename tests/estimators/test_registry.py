"""Every registered estimator through the contract; starting up; a Python port that must give the
same numbers."""

from __future__ import annotations

import dataclasses
import math
from collections import deque

import numpy as np
import pytest
from scipy.optimize import minimize_scalar

from estimators import demodulation, inversion, tracking
from estimators.contract import Estimate, Estimator
from estimators.registry import estimator_names, load_estimator
from model import energy
from model.drive_files import load_drive
from model.energy import Energy
from model.errors import BadInput
from model.frames import stationary, wrapped
from sandbox.drive.design import belief_of, design
from sandbox.drive.scenario import Scenario, Segment
from sandbox.drive.simulate import simulate
from sandbox.recordings.injection import carrier

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
    """36 angles: the closed form has no blind spot, and the magnet's end is told from the other by
    saturation."""
    qnull, drive = load_estimator("qnull"), load_drive(motor)
    errors = []
    for k, angle in enumerate(np.arange(36) * np.pi / 18 - np.pi):
        scenario = dataclasses.replace(STILL, start_angle=float(angle))
        run = simulate(drive, scenario, qnull, "linear" if k % 2 else "saturated", seed=k)
        first = int(np.argmax(run.recording.tracking > 0))
        errors.append(math.degrees(run.recording.error[first]))
    # 10 mA of ripple are 3.5 degrees (notes); here noise 2 mA averaged over 16 ms, and the bias
    # current's tail
    assert np.max(np.abs(errors)) < 1.5


def test_polarity_from_the_belief_where_the_magnet_desaturates():
    """A motor with alpha_30 < 0 has its larger ripple at the other end; the saturated belief
    knows."""
    drive = load_drive("ipm_exchanged")
    motor = dataclasses.replace(drive.motor, alpha_30=-7.7, alpha_12=-5.35)
    run = simulate(
        dataclasses.replace(drive, motor=motor), STILL, load_estimator("qnull"), "saturated"
    )
    assert np.degrees(np.abs(run.recording.error[-1])) < 3.0


def ported_qnull() -> Estimator:
    """q-null with a linear belief, written in plain Python from its equations, tracking only."""

    def init(belief, tuning, angle=None):
        return {
            "axis": angle,
            "omega": 0.0,
            "slow": 0.0,
            "ring": deque(maxlen=3 * tuning.period // 2),
        }

    def step(state, sample, belief, tuning):
        h, half = tuning.sampling_period, tuning.period // 2
        if "begun" not in state:
            state["begun"] = True
            return Estimate(state["axis"], 0.0, state["axis"], 0.0, 0.0, 0.0, 0.0)
        state["slow"] += 0.05 * h * tuning.kp * (state["omega"] - state["slow"])
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
        e = belief.energy
        turned = (
            tuning.lag * belief.resistance * state["slow"] * (e.gamma_d + e.gamma_q) * e.gamma_q
        )
        return Estimate(
            axis + turned / (e.gamma_d - e.gamma_q),
            state["omega"],
            axis,
            0.0,
            1.0,
            y.real * size,
            y.imag * size,
        )

    return Estimator("ported", "q-null in Python", init, step, compiled=False)


@pytest.mark.parametrize("closed", [True, False])
def test_python_port_gives_the_compiled_result(closed):
    """Same arithmetic in another order: differences grow from rounding (1e-16) through a stable
    loop."""
    scenario = dataclasses.replace(LOADED, start_up=False, start_angle=0.5)
    drive = load_drive("ipm_exchanged")
    ours = simulate(
        drive, scenario, load_estimator("qnull"), "linear", closed_loop=closed, seed=2
    ).recording
    port = simulate(drive, scenario, ported_qnull(), "linear", closed_loop=closed, seed=2).recording
    # a rounding may flip one count of the quantiser, 2.4 mA: then 0.8 degrees times the loop's gain
    # of one sample
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
    drive = dataclasses.replace(
        drive, converter=dataclasses.replace(drive.converter, current_resolution=0.0)
    )
    fast = simulate(drive, LOADED, load_estimator("ekf"), seed=4).recording
    slow = simulate(drive, LOADED, load_estimator("ekf_filterpy"), seed=4).recording
    assert np.abs(fast.theta_hat - slow.theta_hat).max() < 1e-7


@pytest.mark.parametrize("closed", [True, False])
def test_estimator_sees_the_readings_and_the_commands_only(closed):
    """Bit for bit: what it is given are the recorded sensor readings and the voltage commanded one
    interval ago."""
    estimator, drive = load_estimator("qnull"), load_drive("ipm_exchanged")
    samples = []

    def spy(state, sample, belief, tuning):
        samples.append(sample)
        return estimator.step(state, sample, belief, tuning)

    r = simulate(
        drive, LOADED, dataclasses.replace(estimator, step=spy, compiled=False), closed_loop=closed
    ).recording
    read = np.array([stationary(*row) for row in zip(r.i_a, r.i_b, r.i_c, strict=True)])
    assert np.array_equal(read, [(s.i_alpha, s.i_beta) for s in samples])
    assert np.array_equal(
        np.column_stack([r.u_alpha, r.u_beta])[:-1], [(s.u_alpha, s.u_beta) for s in samples[1:]]
    )
    primitive = carrier(drive.injection, drive.converter).primitive
    assert np.array_equal([s.carrier for s in samples], primitive[np.arange(len(samples)) % 8])


def test_starting_up_needs_no_encoder():
    """The start-up orients by itself in open loop, too: an encoder turned by 1 rad changes nothing
    until tracking."""
    drive, scenario = load_drive("ipm_exchanged"), STILL
    plain = simulate(drive, scenario, load_estimator("qnull"), closed_loop=False, seed=1).recording
    turned = simulate(
        drive,
        scenario,
        load_estimator("qnull"),
        closed_loop=False,
        seed=1,
        effects={"encoder_offset.offset": 0.5},
    ).recording
    starting = plain.tracking == 0
    assert np.array_equal(plain.theta_hat[starting], turned.theta_hat[starting])
    assert np.array_equal(plain.i_a[starting], turned.i_a[starting])


@pytest.mark.parametrize("load", [0.0, 1.0, 1.8])
def test_inversion_minimises_both_components(load):
    """Gauss-Newton of the estimator against a search over |y - S(e)| with S built here from the
    exact Hessian."""
    drive = load_drive("ipm_exchanged")
    m, tuning = drive.motor.energy, design(drive).tuning._replace(lag=0.0)
    belief = belief_of(drive, "saturated")
    i = np.array([0.2, load * 1.2])

    def believed(e):
        turn = np.array([[math.cos(e), -math.sin(e)], [math.sin(e), math.cos(e)]])
        dd, dq, qq = energy.hessian(
            m, *(float(v) for v in energy.flux_from_current(m, *(turn.T @ i)))
        )
        return turn @ np.array([[dd, dq], [dq, qq]]) @ turn.T @ [1.0, 0.0]

    for y in (believed(0.05), believed(-0.08), believed(0.0) + np.array([1.5, 0.4])):
        best = minimize_scalar(
            lambda e, y=y: np.sum((y - believed(e)) ** 2),
            bounds=(-0.4, 0.4),
            method="bounded",
            options={"xatol": 1e-10},
        ).x
        found = 0.0
        for _ in range(60):
            found += error_seen_from(found, y, i, believed, belief, tuning)
        assert found == pytest.approx(best, abs=2e-3)


def error_seen_from(e, y, i, believed, belief, tuning):
    """Return one Gauss-Newton step at e, from the estimator's own residual and slope."""
    state = inversion.init(belief, tuning, 0.0)
    low, high = (
        np.array(inversion.believed_ripple(state, *i, e + d, belief, tuning)) for d in (-0.01, 0.01)
    )
    middle = np.array(inversion.believed_ripple(state, *i, e, belief, tuning))
    np.testing.assert_allclose(middle, believed(e), rtol=1e-10)
    slope, rest = (high - low) / 0.02, y - middle
    if e == 0.0:  # where the estimator takes it
        ours = inversion.believed_error(state, *i, *y, belief, tuning)
        m = belief.energy  # damped by 0.3 of the slope at zero current, in full there
        least = 0.09 * (m.gamma_d - m.gamma_q) ** 2
        assert ours == pytest.approx(
            1.09 * float(slope @ rest / (slope @ slope + least)), rel=1e-3, abs=1e-9
        )
    return float(slope @ rest / (slope @ slope))


def test_belief_of_another_motor_changes_the_estimate_not_the_plant():
    drive = load_drive("ipm_exchanged")
    linear = Energy(drive.motor.energy.gamma_d, drive.motor.energy.gamma_q, 0.0, 0.0, 0.0, 0.0, 0.0)
    run = simulate(drive, LOADED, load_estimator("qnull"), "linear", truth=linear)
    late = run.recording.between(run.start_time + 0.25, 9.0)
    # a linear motor has no cross-saturation to miss
    assert abs(np.degrees(late.error.mean())) < 0.1


def test_tracking_takes_no_error_beyond_half_a_radian():
    """A slipped pole or a noise peak moves angle and speed by what 0.5 rad would, and no more."""
    tuning = design(load_drive("ipm_exchanged")).tuning
    for error, taken in ((0.3, 0.3), (7.0, 0.5), (-7.0, -0.5)):
        state = demodulation.blank()
        tracking.correct(state, error, tuning)
        assert state[demodulation.AXIS] == pytest.approx(
            tuning.sampling_period * tuning.kp * taken, rel=1e-12
        )
        assert state[demodulation.OMEGA] == pytest.approx(
            tuning.sampling_period * tuning.ki * taken, rel=1e-12
        )
