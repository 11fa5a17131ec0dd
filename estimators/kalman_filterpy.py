"""The extended Kalman filter of `estimators.kalman` once more, on filterpy and NumPy.

Readable form and oracle of the compiled one (compared step by step in tests/estimators), and an
example of an estimator written in Python: any object may be its state.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
from filterpy.kalman import ExtendedKalmanFilter

from estimators.contract import Belief, Estimate, Estimator, Sample, Tuning
from estimators.demodulation import AXIS, PHASE, blank, demodulate
from estimators.kalman import START_ANGLE, START_FLUX, START_SPEED
from estimators.startup import TRACKING, start, tell
from model.energy import currents, hessian

OMEGA, THETA = 2, 3  # places in the filter's state, behind the two fluxes in the stationary frame
J = np.array([[0.0, -1.0], [1.0, 0.0]])


def rotation(theta: float) -> np.ndarray:
    """Return R(theta), 2 x 2."""
    return np.array([[np.cos(theta), -np.sin(theta)], [np.sin(theta), np.cos(theta)]])


class EnergyFilter(ExtendedKalmanFilter):
    """filterpy's filter with the nonlinear prediction that it leaves to the user."""

    def __init__(self, belief: Belief, tuning: Tuning) -> None:
        super().__init__(dim_x=4, dim_z=2)
        self.x: np.ndarray
        self.belief, self.tuning = belief, tuning
        self.Q = np.diag([tuning.flux_variance, tuning.flux_variance, tuning.speed_variance, 0.0])
        self.R = tuning.current_variance * np.eye(2)

    def current(self, x: np.ndarray) -> np.ndarray:
        """Return i_alpha, i_beta of the believed motor at state x (4,)."""
        turn = rotation(x[THETA])
        d, q = turn.T @ x[:2] - [self.belief.magnet_flux, 0.0]
        return turn @ np.array(currents.py_func(self.belief.energy, d, q))

    def current_jacobian(self, x: np.ndarray) -> np.ndarray:
        """Return d(i_alpha, i_beta)/dx, 2 x 4."""
        turn = rotation(x[THETA])
        d, q = turn.T @ x[:2] - [self.belief.magnet_flux, 0.0]
        dd, dq, qq = hessian.py_func(self.belief.energy, d, q)
        g = turn @ np.array([[dd, dq], [dq, qq]]) @ turn.T
        by_theta = J @ self.current(x) - g @ J @ x[:2]
        return np.column_stack([g, np.zeros(2), by_theta])

    def rate(self, x: np.ndarray, u: np.ndarray) -> np.ndarray:
        """Return dx/dt without noise."""
        return np.concatenate([u - self.belief.resistance * self.current(x), [0.0, x[OMEGA]]])

    def predict_x(self, u: Any = 0) -> None:
        """Propagate the mean by one Heun step and leave the Jacobian in F for filterpy's
        covariance."""
        t, x = self.tuning.sampling_period, self.x
        slope = self.rate(x, u)
        derivative = np.zeros((4, 4))
        derivative[:2] = -self.belief.resistance * self.current_jacobian(x)
        derivative[THETA, OMEGA] = 1.0
        self.F = np.eye(4) + t * derivative
        self.x = x + 0.5 * t * (slope + self.rate(x + t * slope, u))


class State:
    """Shared demodulation memory and, once started, the filter."""

    def __init__(self, angle: float | None) -> None:
        self.memory = tell(blank(), angle)
        self.filter: Any = None


def init(belief: Belief, tuning: Tuning, angle: float | None = None) -> State:
    """Return the state before starting up, or ready to track from a known angle (rad)."""
    return State(angle)


def begin(theta: float, i: np.ndarray, belief: Belief, tuning: Tuning) -> EnergyFilter:
    """Return a filter at the position found by starting up, i (2,) being the current there."""
    f = EnergyFilter(belief, tuning)
    magnet = rotation(theta) @ [belief.magnet_flux, 0.0]
    g = f.current_jacobian(np.array([*magnet, 0.0, theta]))[:, :2]
    f.x = np.array([*(magnet + np.linalg.solve(g, i)), 0.0, theta])
    flux = (START_FLUX * belief.magnet_flux) ** 2
    f.P = np.diag([flux, flux, START_SPEED**2, START_ANGLE**2])
    return f


def filtered(
    begin: Callable[..., Any],
    update: Callable[..., None],
    state: State,
    sample: Sample,
    belief: Belief,
    tuning: Tuning,
) -> Estimate:
    """Take one sample with the filter that `begin` returns; `update` gives it the current (2,)."""
    i = np.array([sample.i_alpha, sample.i_beta])
    if state.filter is None:
        estimate: Estimate = start(state.memory, sample, belief, tuning)
        if state.memory[PHASE] == TRACKING:
            state.filter = begin(float(state.memory[AXIS]), i, belief, tuning)
        return estimate
    f = state.filter
    f.predict(u=np.array([sample.u_alpha, sample.u_beta]))
    update(f, i)
    theta, omega = float(f.x[THETA]), float(f.x[OMEGA])
    _, _, y_d, y_q = demodulate(state.memory, sample, theta, omega, tuning)
    amplitude = tuning.amplitude * tuning.peak
    return Estimate(theta, omega, theta, 0.0, 1.0, y_d * amplitude, y_q * amplitude, 1.0)


def step(state: State, sample: Sample, belief: Belief, tuning: Tuning) -> Estimate:
    """Take one sample."""
    return filtered(
        begin,
        lambda f, i: f.update(i, f.current_jacobian, f.current),
        state,
        sample,
        belief,
        tuning,
    )


ESTIMATOR = Estimator(
    "ekf_filterpy",
    "the same filter on filterpy, in Python (slow path)",
    init,
    step,
    compiled=False,
    type_2=False,
    delay="as ekf",
    speeds="as ekf",
    source="as ekf; filterpy.kalman.ExtendedKalmanFilter",
)
