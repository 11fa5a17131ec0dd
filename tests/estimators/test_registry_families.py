"""The families of estimators: equations against closed forms and twins, position error by the
protocol's tests."""

from __future__ import annotations

import dataclasses
import math
from importlib import import_module

import numpy as np
import pytest
from scipy.linalg import expm

from estimators import active_flux, fluxdemod, rotating, table, tracking
from estimators.believed import UNCERTAIN, believed_flux, trust
from estimators.contract import Oversampled, Sample
from estimators.demodulation import ACCELERATION, AXIS, LOAD_TORQUE, OMEGA, blank
from estimators.registry import estimator_names, load_estimator
from model import energy
from model.drive_files import load_drive
from model.errors import BadInput
from model.saliency import self_consistent_angle
from sandbox.drive.design import belief_of, design
from sandbox.drive.scenario import Scenario, Segment
from sandbox.drive.simulate import simulate
from sandbox.evaluation import protocol_tests as t
from sandbox.evaluation.protocol_motion import (
    bandwidth,
    chirp_scenario,
    hand_over,
    reversal,
    reversal_case,
)

p = import_module("sandbox.evaluation.protocol")  # the name in `sandbox` is the function
DRIVE = load_drive("ipm_exchanged")
MOTOR = DRIVE.motor
GAMMA = [float(g) for g in energy.hessian(MOTOR.energy, 0.02, 0.12)]


@pytest.mark.parametrize("name", estimator_names())
def test_every_estimator_has_a_card(name):
    e = load_estimator(name)
    assert all((e.summary, e.delay, e.speeds, e.source))
    assert e.name == name


@pytest.mark.parametrize("name", p.ESTIMATORS)
def test_saturated_belief_meets_the_goals(name):
    """The goals of the protocol, at standstill over the current plane and creeping under 180 %
    load."""
    if name == "active_flux":  # it has no injection to live on at standstill
        passing = hand_over(DRIVE, name, "saturated", 0)
        assert passing.passed, passing.metrics
        return
    creep = t.creep(DRIVE, name, "saturated", 0)
    assert creep.passed, creep.metrics
    plane = t.static_map(DRIVE, name, "saturated", 0)
    assert plane.passed, plane.metrics
    assert plane.metrics["mean_deg"] < 0.3


@pytest.mark.parametrize("n", [4, 8, 12])
def test_negative_sequence_is_that_of_the_sampled_winding(n):
    """Closed form against the winding itself: matrix exponential, stepped to its periodic state,
    Fourier sum."""
    dd, dq, qq = GAMMA
    gamma, h, r = np.array([[dd, dq], [dq, qq]]), 1e-4, 12.15
    decay = expm(-r * gamma * h)
    gain = np.linalg.solve(r * gamma, np.eye(2) - decay)
    u = np.exp(2j * np.pi * np.arange(n) / n)
    psi, seen = np.zeros(2), []
    for k in range(200 * n):
        seen.append(gamma @ psi)
        psi = decay @ psi + gain @ [u[k % n].real, u[k % n].imag]
    current = np.array(seen[-n:]) @ [1.0, 1j]
    ideal = h / (np.exp(2j * np.pi / n) - 1.0) * u
    measured = np.sum(current * ideal) / np.sum(np.abs(ideal) ** 2)
    # the transient has decayed by exp(-R mu h 200 n): below 1e-6
    assert abs(rotating.believed_sequence(dd, dq, qq, r, h, n) - measured) < 1e-5 * abs(measured)
    lossless = rotating.believed_sequence(dd, dq, qq, 1e-6, h, n)
    assert abs(lossless - (0.5 * (dd - qq) + 1j * dq)) < 1e-4 * abs(lossless)


def test_rotating_injection_needs_four_samples_of_square_wave():
    for change in ({"frequency": 2000.0}, {"waveform": "sine"}):
        drive = dataclasses.replace(DRIVE, injection=dataclasses.replace(DRIVE.injection, **change))
        with pytest.raises(BadInput, match="at least 4 samples"):
            simulate(drive, Scenario("s", (Segment(0.05),)), load_estimator("rotating"))


def test_rotating_injection_turns():
    """The voltage commanded beside the controller's is a vector of constant size that turns once in
    N samples."""
    run = simulate(
        DRIVE, Scenario("s", (Segment(0.2),), start_up=False), load_estimator("rotating")
    )
    r = run.recording.between(0.1, 0.2)
    u = np.array(r.u_alpha + 1j * r.u_beta)
    turn = np.fft.fft(u) / u.size
    line = np.argmax(np.abs(turn))
    assert line / u.size == pytest.approx(1 / 8)
    assert abs(turn[line]) == pytest.approx(30.0, rel=0.02)


@pytest.mark.parametrize("current", [(0.0, 1.2), (0.5, -1.5), (-0.8, 2.0)])
def test_table_is_the_self_consistent_offset(current):
    """The fixed point by iteration against the zero of the ripple followed from zero current
    (model.saliency)."""
    found = table.entry(MOTOR.energy, *current, 0.0)[0]
    assert found == pytest.approx(self_consistent_angle(MOTOR.energy, *current), abs=1e-9)
    belief, tuning = belief_of(DRIVE, "saturated"), design(DRIVE).tuning
    state = load_estimator("table").init(belief, tuning)
    where = [(i / 1.2 / table.REACH + 1.0) * 0.5 * (table.SIDE - 1) for i in current]
    # bilinear, step 0.24 A: an eighth of the square of the step times the curvature, here below 0.1
    # degrees
    assert table.look_up(state, table.ANGLES, *where) == pytest.approx(found, abs=math.radians(0.1))


def test_flux_ripple_slope():
    """The slope of the demodulated flux by difference: L R(e) Gamma R(-e) (1, 0) at small e."""
    dd, dq, qq = GAMMA
    gamma = np.array([[dd, dq], [dq, qq]])

    def flux(e):
        turn = np.array([[math.cos(e), -math.sin(e)], [math.sin(e), math.cos(e)]])
        return (np.linalg.solve(gamma, turn @ gamma @ turn.T) @ [1.0, 0.0])[1]

    assert flux(0.0) == pytest.approx(0.0, abs=1e-14)
    assert fluxdemod.flux_slope(dd, dq, qq) == pytest.approx(
        (flux(1e-5) - flux(-1e-5)) / 2e-5, rel=1e-8
    )


def test_auxiliary_flux_is_the_derivative_by_the_angle():
    belief = belief_of(DRIVE, "saturated")
    state = load_estimator("active_flux").init(belief, design(DRIVE).tuning, 0.0)
    i, at, h = (0.4, 1.3), 0.7, 1e-6
    _, _, a_a, a_b = active_flux.current_flux(state, *i, at, belief)
    low, high = (np.array(active_flux.current_flux(state, *i, at + s, belief)[:2]) for s in (-h, h))
    np.testing.assert_allclose([a_a, a_b], (high - low) / (2 * h), rtol=1e-7)
    linear = belief_of(DRIVE, "linear")  # closed form of the active flux: psi_m + (L_d - L_q) i_d
    state = load_estimator("active_flux").init(linear, design(DRIVE).tuning, 0.0)
    _, _, a_a, a_b = active_flux.current_flux(state, -0.8, 0.5, 0.0, linear)
    assert a_b == pytest.approx(
        MOTOR.magnet_flux + (MOTOR.inductance_d - MOTOR.inductance_q) * -0.8
    )
    assert a_a == pytest.approx((MOTOR.inductance_d - MOTOR.inductance_q) * 0.5)


def test_unscented_filter_is_filterpys():
    """Without quantisation, as the extended one: the same sums in another order, no branch that
    could flip."""
    drive = dataclasses.replace(
        DRIVE, converter=dataclasses.replace(DRIVE.converter, current_resolution=0.0)
    )
    scene = Scenario("loaded", (Segment(0.03), Segment(0.12, 1.5, ramp=0.03)), start_up=False)
    fast = simulate(drive, scene, load_estimator("ukf"), seed=4).recording
    slow = simulate(drive, scene, load_estimator("ukf_filterpy"), seed=4).recording
    assert np.abs(fast.theta_hat - slow.theta_hat).max() < 1e-7


@pytest.mark.parametrize("kind", ["type 2", "type 3", "mechanical"])
def test_loops_on_a_ramp_of_speed(kind):
    """Type 2 lags by acceleration/ki; type 3 and the mechanical observer by nothing, once
    settled."""
    tuning, belief = design(DRIVE).tuning, belief_of(DRIVE, "saturated")
    state, h, acceleration = blank(), tuning.sampling_period, 400.0
    for k in range(8000):
        tracking.predict(state, tuning)
        error = 0.5 * acceleration * (k * h) ** 2 - state[AXIS]
        if kind == "type 2":
            tracking.correct(state, error, tuning)
        elif kind == "type 3":
            tracking.correct_type_3(state, error, tuning)
        else:
            tracking.correct_mechanical(state, error, 0.5, belief, tuning)
    # the triple pole at kp/3 > 50 1/s has settled to exp(-100); one sample of the integrals is 2 %
    # of kp h
    expected = acceleration / tuning.ki if kind == "type 2" else 0.0
    assert error == pytest.approx(expected, rel=0.1, abs=1e-6)
    if kind == "type 3":
        assert state[ACCELERATION] == pytest.approx(acceleration, rel=1e-6)
    if kind == "mechanical":  # Newton: J/p d omega/dt = T - T_load
        assert state[LOAD_TORQUE] == pytest.approx(0.5 - acceleration * MOTOR.inertia / 6, rel=1e-6)


def test_monitor_leaves_the_wrong_pole_under_load_and_only_there():
    """180 degrees wrong at 180 % load: inversion stays, the watch returns; no false alarm in the
    peer's reversal."""
    scene = Scenario("wrong", (Segment(0.6, 1.8, settle=0.5),), start_up=False, start_error=math.pi)
    ends = {}
    for name in ("inversion", "monitor"):
        run = simulate(DRIVE, scene, load_estimator(name), closed_loop=False)
        ends[name] = abs(math.degrees(run.recording.error[-1]))
    assert ends["inversion"] > 140.0
    assert ends["monitor"] < 3.0
    assert reversal(reversal_case()[0], "monitor", "linear", 0).passed


@pytest.mark.parametrize("name", ["qnull", "inversion", "table", "fluxdemod"])
@pytest.mark.parametrize("motor", ["ipm", "ipm_exchanged"])
def test_resistance_at_speed_is_taken_along(name, motor):
    """lag R omega trace(Gamma) Gamma_qq / saliency: 0.1 and 0.25 degrees at 5 % left out; 0.08 for
    the next orders."""
    drive = load_drive(motor)
    quiet = dataclasses.replace(drive.converter, current_noise=0.0, current_resolution=0.0)
    drive = dataclasses.replace(drive, converter=quiet)
    ends = []
    for speed in (0.05, -0.05):
        scene = Scenario(
            "v", (Segment(0.8, 1.0, speed, ramp=0.2, settle=0.5),), "driven", start_up=False
        )
        run = simulate(drive, scene, load_estimator(name), closed_loop=False)
        ends.append(np.degrees(run.recording.between(0.5, 0.8).error.mean()))
    assert abs(ends[0] - ends[1]) / 2 < 0.08


def test_belief_without_an_answer_says_so():
    """Far outside the convex domain of `spm`: the last flux is kept and Estimate.tracking tells."""
    state, m = blank(), load_drive("spm").motor.energy
    kept = believed_flux(state, m, 0.5, 0.5)
    assert trust(state) == 1.0
    assert believed_flux(state, m, -3.0, 0.5) == kept
    assert trust(state) == UNCERTAIN
    assert believed_flux(state, m, 0.5, 0.5) == pytest.approx(kept)
    assert trust(state) == 1.0


def test_hybrid_shares_by_speed():
    from estimators.hybrid import share

    belief, tuning = belief_of(DRIVE, "saturated"), design(DRIVE).tuning
    first = 0.5 * MOTOR.resistance * MOTOR.rated_current / MOTOR.magnet_flux
    assert [share(x * first, belief, tuning) for x in (0.0, -1.0, 1.5, -3.0)] == [
        0.0,
        0.0,
        0.5,
        1.0,
    ]


@pytest.mark.parametrize(
    ("name", "still", "fast"),
    [("inversion", 30.0, 30.0), ("hybrid", 30.0, 0.0), ("active_flux", 0.0, 0.0)],
)
def test_injection_fades_out_where_nothing_reads_it(name, still, fast):
    """Line of the square wave in the commanded voltage, seen from the estimated rotor.

    The first line of a square wave of 8 samples is 4/8/sin(pi/8) times its amplitude (geometric
    sum).
    """
    first = 0.5 * MOTOR.resistance * MOTOR.rated_current / MOTOR.magnet_flux / MOTOR.rated_omega
    segments = (Segment(0.4, 0.5), Segment(0.8, 0.5, 4.0 * first, ramp=0.3, settle=0.5))
    run = simulate(
        DRIVE,
        Scenario("v", segments, "driven", start_up=False),
        load_estimator(name),
        closed_loop=False,
    )
    assert abs(math.degrees(run.recording.error[-1])) < 3.0
    for begin, amplitude in ((0.2, still), (1.0, fast)):
        r = run.recording.between(begin, begin + 0.2)
        u = (r.u_alpha + 1j * r.u_beta) * np.exp(-1j * r.theta_hat)
        line = np.exp(-2j * np.pi * np.arange(u.size) / 8) @ (u - u.mean()) / u.size
        # what noise of the current makes of the controller's voltage: below 1 V
        assert 2.0 * abs(line) / (0.5 / math.sin(math.pi / 8)) == pytest.approx(amplitude, abs=1.0)


def test_wanted_injection_is_whole_until_the_hand_over_ends():
    from estimators.hybrid import share, wanted

    belief, tuning = belief_of(DRIVE, "saturated"), design(DRIVE).tuning
    first = 0.5 * MOTOR.resistance * MOTOR.rated_current / MOTOR.magnet_flux
    assert [wanted(x * first, belief, tuning) for x in (0.0, -2.0, 2.5, -3.0, 9.0)] == [
        1.0,
        1.0,
        0.5,
        0.0,
        0.0,
    ]
    assert share(2.0 * first, belief, tuning) == 1.0  # so no ripple is read that is not whole


def test_bandwidth_is_that_of_the_designed_loop():
    """The flux observer has no window: its loop is (kp s + ki)/(s^2 + kp s + ki), -3 dB at 2.48 w0
    (damping 1)."""
    found = bandwidth(DRIVE, "active_flux", "saturated", 0).metrics
    w0 = design(DRIVE).tuning.kp / 2.0
    # lines 2 Hz apart, one sample
    assert found["bandwidth_hz"] == pytest.approx(2.48 * w0 / (2 * math.pi), rel=0.12)
    # |H| of damping 1 peaks at 2/sqrt(3)
    assert found["peak_gain"] == pytest.approx(1.15, abs=0.05)
    speed = np.array([s.speed for s in chirp_scenario(DRIVE, 0.0).segments[1:]]) * MOTOR.rated_omega
    assert np.abs(np.cumsum(speed) * 2e-3).max() == pytest.approx(math.radians(8.0), rel=0.15)


def test_samples_carry_what_step_needs():
    """A step of every compiled estimator on one sample is finite."""
    belief, tuning = belief_of(DRIVE, "saturated"), design(DRIVE).tuning
    for name in p.ESTIMATORS:
        estimator = load_estimator(name)
        state = estimator.init(belief, tuning, 0.3)
        for k in range(40):
            sample = Sample(0.1, 0.2, 5.0, -3.0, [-1, 1][k % 2] * tuning.peak)
            if estimator.inside:
                sample = Oversampled(*sample, 0.01 * np.sin(np.arange(32.0) + k).reshape(8, 4))
            out = estimator.step(state, sample, belief, tuning)
            assert np.isfinite(out).all(), name
        assert math.isfinite(state[OMEGA])


def size_along(i_q, phi):
    """Return |Gamma u| (1/H) of the true motor at i_d = 0, u along phi (rad) from d."""
    dd, dq, qq = (
        float(x)
        for x in energy.hessian(MOTOR.energy, *energy.flux_from_current(MOTOR.energy, 0.0, i_q))
    )
    c, s = math.cos(phi), math.sin(phi)
    return math.hypot(dd * c + dq * s, dq * c + qq * s)


@pytest.mark.parametrize("load", [0.6, 1.2])
def test_45_degrees_beside_d_a_linear_belief_rests_where_the_size_is_the_expected_one(load):
    """The saturated motor's ripple is as large there as the linear one's at 45 degrees; the encoder
    is in control.

    R Gamma T / 2 pi is 0.1 here, and its square is in the ripple of either model; 0.3 degrees of
    the difference.
    """
    from scipy.optimize import brentq

    wanted = math.hypot(1.0 / MOTOR.inductance_d, 1.0 / MOTOR.inductance_q) / math.sqrt(2.0)
    i_q = load * MOTOR.rated_current
    phi = brentq(lambda x: size_along(i_q, x) - wanted, 0.1, 1.4)
    scene = Scenario("s", (Segment(0.5, load, ramp=0.1, settle=0.3),), start_up=False)
    run = simulate(DRIVE, scene, load_estimator("hfi45"), "linear", closed_loop=False)
    error = np.degrees(run.recording.between(run.start_time + 0.3, 1.0).error.mean())
    assert error == pytest.approx(45.0 - math.degrees(phi), abs=0.3)


def stiffness_along(i_q, phi):
    """Return u Gamma u (1/H) of the true motor at i_d = 0, u along phi (rad) from d."""
    dd, dq, qq = (
        float(x)
        for x in energy.hessian(MOTOR.energy, *energy.flux_from_current(MOTOR.energy, 0.0, i_q))
    )
    c, s = math.cos(phi), math.sin(phi)
    return dd * c * c + 2.0 * dq * c * s + qq * s * s


@pytest.mark.parametrize("load", [0.6, 1.2])
def test_vesc_rests_where_the_ripple_along_the_injection_is_the_mean_of_both_axes(load):
    """The firmware's equation: rest is where (1/L_d + 1/L_q)/2 is seen along the axis; bound as
    above."""
    from scipy.optimize import brentq

    wanted = 0.5 * (1.0 / MOTOR.inductance_d + 1.0 / MOTOR.inductance_q)
    i_q = load * MOTOR.rated_current
    phi = brentq(lambda x: stiffness_along(i_q, x) - wanted, 0.1, 1.4)
    scene = Scenario("s", (Segment(0.5, load, ramp=0.1, settle=0.3),), start_up=False)
    run = simulate(DRIVE, scene, load_estimator("vesc_hfi"), "linear", closed_loop=False)
    error = np.degrees(run.recording.between(run.start_time + 0.3, 1.0).error.mean())
    assert error == pytest.approx(45.0 - math.degrees(phi), abs=0.3)
    saturated = simulate(DRIVE, scene, load_estimator("vesc_hfi"), closed_loop=False)
    assert (
        abs(np.degrees(saturated.recording.between(saturated.start_time + 0.3, 1.0).error.mean()))
        < 0.5
    )


def test_random_cycles_have_no_line():
    """The signs sent: flux stays within that of the long cycle; the strongest line is far below a
    square wave's."""
    run = simulate(
        DRIVE, Scenario("s", (Segment(1.2),), start_up=False), load_estimator("random_frequency")
    )
    r = run.recording.between(0.1, 1.124)  # 4096 samples
    along = (r.u_alpha * np.cos(r.theta_hat) + r.u_beta * np.sin(r.theta_hat)) / 30.0
    signs = np.sign(along)
    runs = np.diff(np.flatnonzero(np.diff(signs)))
    # quarters of 1 and 2 samples, halves of 2 and 4, joined quarters
    assert set(runs.tolist()) <= {1, 2, 3, 4}
    flux = np.cumsum(signs)
    assert np.ptp(flux) == 4.0  # +-2 samples of the long cycle: no cycle leaves a step of the mean
    power = np.abs(np.fft.rfft(along * np.hanning(along.size))) ** 2
    share = np.convolve(power, np.ones(3), "same").max() / power.sum()
    assert share < 0.05  # of a square wave's power 81 % lies in one line: 8/pi^2


def test_random_cycles_need_a_multiple_of_four_samples():
    for change in ({"frequency": 2000.0}, {"waveform": "sine"}):
        drive = dataclasses.replace(DRIVE, injection=dataclasses.replace(DRIVE.injection, **change))
        with pytest.raises(BadInput, match="a multiple of four"):
            simulate(drive, Scenario("s", (Segment(0.05),)), load_estimator("random_frequency"))
