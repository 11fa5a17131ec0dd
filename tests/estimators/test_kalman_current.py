"""The filter on currents: its prediction against the flux equations integrated by SciPy, its
correction by hand."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from estimators.contract import Sample
from estimators.kalman import P, X
from estimators.kalman_current import begin, init, predict, update
from model.drive_files import load_drive
from model.energy import currents, flux_from_current
from sandbox.drive.design import belief_of, design

DRIVE = load_drive("ipm_exchanged")
MOTOR = DRIVE.motor
TUNING = design(DRIVE, start_up=False).tuning
MEAN = np.array([0.7, -0.4, 150.0, 0.6])  # A, A, rad/s, rad


def later(x, u, h, energy):
    """Return the currents (A) h later: d psi/dt = u - R i, the angle turns at its speed."""
    omega, theta = x[2], x[3]

    def current(psi, angle):
        seen = psi * np.exp(-1j * angle)
        d, q = currents(energy, seen.real - MOTOR.magnet_flux, seen.imag)
        return complex(d, q) * np.exp(1j * angle)

    seen = complex(x[0], x[1]) * np.exp(-1j * theta)
    d, q = (float(v) for v in flux_from_current(energy, seen.real, seen.imag))
    start = complex(d + MOTOR.magnet_flux, q) * np.exp(1j * theta)

    def slope(t, y):
        v = u - MOTOR.resistance * current(complex(*y), theta + omega * t)
        return [v.real, v.imag]

    end = solve_ivp(slope, (0.0, h), [start.real, start.imag], rtol=1e-11, atol=1e-13).y[:, -1]
    i = current(complex(*end), theta + omega * h)
    return np.array([i.real, i.imag])


def predicted(x, u, h, belief, covariance=None):
    """Return the filter's state after one prediction of h (s)."""
    state = init(belief, TUNING, 0.0)
    state[X : X + 4] = x
    if covariance is not None:
        state[P : P + 16] = covariance.ravel()
    predict(state, u.real, u.imag, belief, TUNING._replace(sampling_period=h))
    return state


@pytest.mark.parametrize("name", ["saturated", "linear"])
def test_prediction_is_that_of_the_flux_equations(name):
    """Heun's step: of third order, so half the step leaves an eighth."""
    belief, u, missed = belief_of(DRIVE, name), 60.0 - 90.0j, []
    for h in (2.5e-4, 1.25e-4):
        state = predicted(MEAN, u, h, belief)
        missed.append(np.abs(state[X : X + 2] - later(MEAN, u, h, belief.energy)).max())
        assert state[X + 3] == pytest.approx(MEAN[3] + h * MEAN[2])
    assert missed[0] < 2e-3 * MOTOR.rated_current
    assert missed[1] < missed[0] / 6.0


def test_covariance_goes_through_the_slopes_of_that_step():
    """With a step so short that Heun is Euler: F P F^T + Q, F by differences of SciPy's
    solution."""
    belief, u, h = belief_of(DRIVE, "saturated"), 60.0 - 90.0j, 1e-5
    jacobian = np.eye(4)
    jacobian[3, 2] = h
    for k, e in enumerate((1e-4, 1e-4, 1.0, 1e-4)):
        way = np.zeros(4)
        way[k] = e
        jacobian[:2, k] = (
            later(MEAN + way, u, h, belief.energy) - later(MEAN - way, u, h, belief.energy)
        ) / (2.0 * e)
    a = np.random.default_rng(1).normal(size=(4, 4)) * np.array([0.1, 0.1, 3.0, 0.1])
    before = a.T @ a
    state = predicted(MEAN, u, h, belief, before)
    gain = 0.5 * (belief.energy.gamma_d**2 + belief.energy.gamma_q**2)
    noise = np.diag(
        [gain * TUNING.flux_variance, gain * TUNING.flux_variance, TUNING.speed_variance, 0.0]
    )
    np.testing.assert_allclose(
        state[P : P + 16].reshape(4, 4),
        jacobian @ before @ jacobian.T + noise,
        rtol=1e-3,
        atol=1e-5,
    )


def test_correction_is_kalmans():
    belief = belief_of(DRIVE, "saturated")
    state = init(belief, TUNING, 0.0)
    begin(state, Sample(0.5, -0.2, 0.0, 0.0, 0.0), TUNING)
    a = np.random.default_rng(2).normal(size=(4, 4))
    before, seen = a.T @ a, np.eye(4)[:2]
    state[P : P + 16] = before.ravel()
    update(state, 0.6, -0.1, TUNING)
    gain = (
        before
        @ seen.T
        @ np.linalg.inv(seen @ before @ seen.T + TUNING.current_variance * np.eye(2))
    )
    np.testing.assert_allclose(
        state[X : X + 4], np.array([0.5, -0.2, 0.0, 0.0]) + gain @ [0.1, 0.1], rtol=1e-9
    )
    after = (np.eye(4) - gain @ seen) @ before
    np.testing.assert_allclose(state[P : P + 16].reshape(4, 4), after, rtol=1e-6, atol=1e-9)
    assert math.isfinite(state[X])
