"""The compiled filter against filterpy step by step, its Jacobian against differences."""

from __future__ import annotations

import numpy as np
import pytest

from estimators import kalman
from estimators.contract import Sample
from estimators.kalman_filterpy import EnergyFilter, begin
from model.parameters import load_drive
from sandbox.design import belief_of, design

DRIVE = load_drive("ipm_exchanged")
BELIEF = belief_of(DRIVE, "saturated")
TUNING = design(DRIVE).tuning


def test_jacobian_is_the_derivative_of_the_current():
    f = EnergyFilter(BELIEF, TUNING)
    x = np.array([0.12, -0.07, 30.0, 0.8])
    steps = 1e-6 * np.array([0.1, 0.1, 1.0, 1.0])
    for k, h in enumerate(steps):
        e = np.eye(4)[k] * h
        slope = (f.current(x + e) - f.current(x - e)) / (2 * h)
        # central difference: h^2 times the third derivative, and rounding 1e-16/1e-7
        np.testing.assert_allclose(f.current_jacobian(x)[:, k], slope, rtol=1e-6, atol=1e-6)


def test_compiled_filter_is_filterpys_step_by_step():
    rng = np.random.default_rng(5)
    theta, i = 0.4, np.array([0.1, -0.2])
    oracle = begin(theta, i, BELIEF, TUNING)
    state = kalman.init(BELIEF, TUNING, theta)
    kalman.begin(state, Sample(i[0], i[1], 0.0, 0.0, 0.0), BELIEF)
    for k in range(400):
        u = np.array([30.0 * (1 if k % 8 < 4 else -1), 12.0]) + rng.standard_normal(2)
        z = oracle.current(oracle.x) + 0.02 * rng.standard_normal(2)
        oracle.predict(u=u)
        kalman.predict(state, u[0], u[1], BELIEF, TUNING)
        np.testing.assert_allclose(state[kalman.X : kalman.X + 4], oracle.x, rtol=1e-10, atol=1e-12)
        oracle.update(z, oracle.current_jacobian, oracle.current)
        kalman.update(state, z[0], z[1], BELIEF, TUNING)
        np.testing.assert_allclose(state[kalman.X : kalman.X + 4], oracle.x, rtol=1e-10, atol=1e-12)
        found = state[kalman.P : kalman.P + 16].reshape(4, 4)
        np.testing.assert_allclose(found, oracle.P, rtol=1e-8, atol=1e-16)


def test_covariance_stays_symmetric_and_positive():
    state = kalman.init(BELIEF, TUNING, 0.0)
    kalman.begin(state, Sample(0.0, 0.0, 0.0, 0.0, 0.0), BELIEF)
    for k in range(2000):
        kalman.predict(state, 30.0 if k % 8 < 4 else -30.0, 0.0, BELIEF, TUNING)
        i = kalman.stator_current(*state[[kalman.X, kalman.X + 1, kalman.X + 3]], BELIEF)
        kalman.update(state, i[0] + 1e-3 * (-1) ** k, i[1], BELIEF, TUNING)
    p = state[kalman.P : kalman.P + 16].reshape(4, 4)
    assert p == pytest.approx(p.T, rel=1e-9, abs=1e-15)
    assert np.linalg.eigvalsh(p).min() > 0
