"""The PWM's own ripple: the fit against currents written down here, the angle's sign, recovery,
theory, noise."""

from __future__ import annotations

import cmath
import math

import numpy as np
import pytest

from estimators import matrix_fit, pwm_ripple
from estimators.believed import LEAST
from estimators.demodulation import blank
from estimators.registry import load_estimator
from model import energy
from model.drive_files import load_drive
from sandbox.drive.design import TRACKING_MARGIN, belief_of, design, frequency_grid, margins
from sandbox.drive.inside import USUAL_READINGS, USUAL_SHIFT, commanded, shift_pulses
from sandbox.drive.scenario import Scenario, Segment
from sandbox.drive.simulate import simulate
from sandbox.evaluation import protocol_tests as t
from sandbox.plant.edges import duties

DRIVE = load_drive("ipm_exchanged")
TUNING = design(DRIVE).tuning
DD, DQ, QQ = (float(g) for g in energy.hessian(DRIVE.motor.energy, 0.02, 0.12))
S, D = 0.5 * (DD + QQ), complex(0.5 * (DD - QQ), DQ)
H, U_DC, N = TUNING.sampling_period, DRIVE.converter.dc_bus_voltage, USUAL_READINGS


def periods(u, axis, emf=0j):
    """Yield the readings (N, 4) of period after period of a lossless linear winding whose d axis
    stands at `axis`."""
    shifts = np.zeros(3)
    for k in range(60):
        shift_pulses(shifts, k, USUAL_SHIFT * H)
        legs, rows = duties(u.real, u.imag, U_DC), []
        for at in (np.arange(N) + 0.5) * H / N:
            psi = complex(*commanded(at, H, legs, shifts, U_DC))
            seen = (psi - emf * at) * cmath.exp(-1j * axis)
            i = 0.7 - 0.2j + (S * seen + D * seen.conjugate()) * cmath.exp(1j * axis)
            rows.append([i.real, i.imag, psi.real, psi.imag])
        yield np.array(rows)


@pytest.mark.parametrize("u", [0j, 30.0 - 55j])
@pytest.mark.parametrize("angle", [0.0, 0.3, -1.2])
def test_error_of_the_frame_is_half_the_turn_of_the_matrix(u, angle):
    """Back-EMF, mean current and mean voltage leave no trace; positive where the rotor is ahead of
    the estimate."""
    state, axis = blank(pwm_ripple.OWN), 0.8
    for readings in periods(u, axis, emf=7.0 + 3j):
        pwm_ripple.collect(state, readings, cmath.exp(-1j * (axis - angle)), S, D, 0.0, TUNING)
    d_s, d_d = matrix_fit.solve(state, 1e-14)
    assert 0.5 * cmath.phase((D + d_d) / D) == pytest.approx(angle, abs=1e-6)
    assert abs(d_s) < 1e-5 * S
    # at zero current D' = 2 j D, and the step is that of a null, sin(2 e)/2, drawn out a little by
    # the damping
    expected = 0.5 * math.sin(2.0 * angle) * abs(D) ** 2
    m, least = DRIVE.motor.energy, LEAST**2
    whole = (1.0 + least) / (4.0 * abs(D) ** 2 + least * (m.gamma_d - m.gamma_q) ** 2)
    assert matrix_fit.angle_error(D, 2j * D, d_d, m) == pytest.approx(
        4.0 * expected * whole, abs=1e-6
    )


def test_what_two_periods_have_alike_is_taken_off():
    """A current of any shape that repeats every period, such as dead time makes, turns nothing."""
    state, shape = blank(pwm_ripple.OWN), np.random.default_rng(1).standard_normal((N, 2))
    for readings in periods(0j, 0.8):
        readings[:, :2] += 0.05 * shape
        pwm_ripple.collect(state, readings, cmath.exp(-0.8j), S, D, 0.0, TUNING)
    assert abs(matrix_fit.solve(state, 1e-14)[1]) < 1e-6 * abs(D)


def test_without_ripple_the_belief_stays():
    """Centred pulses of equal duty: noise alone in the current, and the saliency stays that of the
    belief."""
    state, rng = blank(pwm_ripple.OWN), np.random.default_rng(2)
    sigma = math.sqrt(TUNING.current_variance)
    for _ in range(200):
        readings = np.zeros((N, 4))
        readings[:, :2] = sigma * rng.standard_normal((N, 2))
        pwm_ripple.collect(state, readings, 1.0 + 0j, S, D, DRIVE.motor.resistance, TUNING)
    weight = pwm_ripple.believed_weight(DRIVE.motor.energy, TUNING)
    # left of f is R times the integral of noise, of v twice the noise: a random sum over the N
    # readings of 4.5 periods
    bound = (
        4.0
        * math.sqrt(4.5 * N)
        * (DRIVE.motor.resistance * sigma * H / math.sqrt(N))
        * 2.0
        * sigma
        / weight
    )
    assert abs(matrix_fit.solve(state, weight)[1]) < bound
    assert bound < 0.15 * abs(D)


@pytest.mark.parametrize("motor", ["ipm", "ipm_exchanged", "spm_exchanged"])
def test_gains_of_the_design_keep_their_margin(motor):
    """The loop as the kernel runs it: gains, forgetting, pairs of periods, 0.5 and 1.5 periods
    old."""
    tuning = design(load_drive(motor)).tuning
    h, kp, keep = tuning.sampling_period, tuning.kp, matrix_fit.forgetting(pwm_ripple.AGE)
    w = frequency_grid(h)
    z = np.exp(1j * w * h)
    # a pair every second period
    fit = (1 - keep * keep) / (1 - (keep / z) ** 2) * (1.0 + 1.0 / z) / 2.0
    fit *= (1.0 + 1.0 / z) / 2.0 * z**-0.5  # and the period in which none comes
    s = (z - 1.0) / h
    assert (
        margins((kp + kp**2 / (3.0 * s) + kp**3 / (27.0 * s * s)) / s * fit, w)[1] > TRACKING_MARGIN
    )


def spread(motor, d, pairs):
    """Standard deviation (degrees) of the angle from so many pairs of periods at zero voltage:
    least squares.

    A pair's current noise is 2 sigma^2 an axis; the part of dD across D has variance 2 sigma^2 /
    sum |f|^2.
    """
    drive, square = load_drive(motor), 0.0
    h, u_dc, shifts = drive.converter.sampling_period, drive.converter.dc_bus_voltage, np.zeros(3)
    shift_pulses(shifts, 0, USUAL_SHIFT * h)
    at = (np.arange(N) + 0.5) * h / N
    rho = np.array([complex(*commanded(s, h, (0.5, 0.5, 0.5), shifts, u_dc)) for s in at])
    rho -= np.polyval(np.polyfit(at, rho, 1), at)
    square = pairs * np.sum(np.abs(2.0 * rho) ** 2)
    return math.degrees(
        math.sqrt(2.0 * design(drive).tuning.current_variance / square) / (2.0 * abs(d))
    )


@pytest.mark.parametrize("load", [0.0, 1.0, 1.8])
@pytest.mark.parametrize("motor", ["ipm", "ipm_exchanged", "spm_exchanged"])
def test_recovers_the_angle_at_standstill(motor, load):
    """Told 10 degrees wrong; mean within four of its standard deviations, spread that of pairs
    through the loop.

    Beside noise: curvature of saturation over the ripple, 0.05 degrees allowed.
    """
    drive = load_drive(motor)
    scene = Scenario(
        "s",
        (Segment(0.9, load, ramp=0.1, settle=0.4),),
        start_up=False,
        start_error=math.radians(10.0),
    )
    run = simulate(drive, scene, load_estimator("pwm_ripple"), seed=2)
    e = np.degrees(run.recording.between(run.start_time + 0.4, math.inf).error)
    dd, dq, qq = energy.hessian(
        drive.motor.energy,
        *energy.flux_from_current(drive.motor.energy, 0.0, load * drive.motor.rated_current),
    )
    d = complex(0.5 * (dd - qq), dq)
    assert abs(e.mean()) < 4.0 * spread(motor, d, e.size / 2) + 0.05
    assert e.std() == pytest.approx(
        spread(motor, d, 1) * math.sqrt(passed(design(drive).tuning)), rel=0.4
    )


def passed(tuning):
    """Share of the variance of pairs, 2 h apart, that the tracking loop passes: its noise bandwidth
    times 2 h."""
    w = np.linspace(0.0, 40.0 * tuning.kp, 40001)
    s, pole = 1j * w, tuning.kp / 3.0
    closed = (3.0 * pole * s * s + 3.0 * pole**2 * s + pole**3) / (s + pole) ** 3
    return 2.0 * tuning.sampling_period * float(np.trapezoid(np.abs(closed) ** 2, w)) / math.pi


@pytest.mark.parametrize("motor", ["ipm", "ipm_exchanged"])
def test_linear_belief_errs_by_the_cross_saturation_angle(motor):
    """Both axes carry ripple; the null is that of an injection along either, theory by the exact
    Hessian."""
    plane = t.static_map(load_drive(motor), "pwm_ripple", "linear", 0)
    assert plane.passed, plane.metrics


def test_weight_is_a_saliency_as_uncertain_as_it_is_large():
    m, belief = DRIVE.motor, belief_of(DRIVE, "saturated")
    d_0 = 0.5 * (1.0 / m.inductance_d - 1.0 / m.inductance_q)
    expected = 2.0 * (TUNING.current_variance / d_0**2 + TUNING.flux_variance)
    assert pwm_ripple.believed_weight(belief.energy, TUNING) == pytest.approx(expected)


@pytest.mark.parametrize("current", [0j, 1.3j, -1.0 + 1.5j])
def test_slope_is_the_turn_of_matrix_and_current(current):
    """D(R(-e) i) exp(2 j e) by the exact flux and Hessian, differenced here."""
    m, e, values = DRIVE.motor.energy, 1e-4, []
    for angle in (-e, e):
        i = current * cmath.exp(-1j * angle)
        dd, dq, qq = energy.hessian(
            m, *(float(x) for x in energy.flux_from_current(m, i.real, i.imag))
        )
        values.append(complex(0.5 * (dd - qq), dq) * cmath.exp(2j * angle))
    slope = matrix_fit.believed(blank(pwm_ripple.OWN), m, current)[2]
    # half width 0.02 rad in place of 1e-4: (2 x 0.02)^2/6 of the slope, third derivatives of the
    # map less
    assert slope == pytest.approx((values[1] - values[0]) / (2.0 * e), rel=2e-3)
