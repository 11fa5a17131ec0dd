"""The compiled filter against filterpy step by step, its Jacobian against differences."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

from estimators import kalman
from estimators.contract import Sample
from estimators.demodulation import PHASE
from estimators.kalman_filterpy import EnergyFilter, begin
from estimators.registry import load_estimator
from estimators.startup import TRACKING
from model.drive_files import load_drive
from sandbox.drive.design import belief_of, design
from sandbox.drive.scenario import Scenario, Segment
from sandbox.drive.simulate import simulate

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


def test_innovations_are_as_large_as_the_filter_says(monkeypatch):
    """Normalised innovations squared of two currents average 2 when the tuning states the noise
    that is there.

    The plant has no inverter error, so its share is taken out; a variance off by 30 % would leave
    the band, which is 2 +- 4 sigma of a mean of 1000 (sigma = 2/sqrt(1000)) and 10 % for the Heun
    step.
    """
    monkeypatch.setattr("sandbox.drive.design.VOLTAGE_UNCERTAINTY", 1e-4)
    drive = DRIVE
    ekf, seen = load_estimator("ekf"), []
    twin = design(drive).tuning

    def spy(state, sample, belief, tuning):
        if state[PHASE] == TRACKING:
            ahead = state.copy()
            kalman.predict(ahead, sample.u_alpha, sample.u_beta, belief, tuning)
            x, p = ahead[kalman.X : kalman.X + 4], ahead[kalman.P : kalman.P + 16].reshape(4, 4)
            g_aa, g_ab, g_bb, j_a, j_b = kalman.current_jacobian(x[0], x[1], x[3], belief)
            h = np.array([[g_aa, g_ab, 0.0, j_a], [g_ab, g_bb, 0.0, j_b]])
            r = np.array([sample.i_alpha, sample.i_beta]) - kalman.stator_current(
                x[0], x[1], x[3], belief
            )
            seen.append(r @ np.linalg.solve(h @ p @ h.T + twin.current_variance * np.eye(2), r))
        return ekf.step(state, sample, belief, tuning)

    scenario = Scenario("s", (Segment(0.1), Segment(0.3, 1.0, ramp=0.05)))
    simulate(drive, scenario, dataclasses.replace(ekf, step=spy, compiled=False), seed=2)
    assert np.mean(seen[300:]) == pytest.approx(2.0, abs=0.45)
