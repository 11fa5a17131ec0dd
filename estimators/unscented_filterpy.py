"""The unscented filter of `estimators.unscented` once more, on filterpy and NumPy: its readable
form and oracle."""

from __future__ import annotations

from typing import Any

import numpy as np
from filterpy.kalman import MerweScaledSigmaPoints, UnscentedKalmanFilter

from estimators.contract import Belief, Estimate, Estimator, Sample, Tuning
from estimators.kalman_filterpy import EnergyFilter, State, filtered, init
from estimators.kalman_filterpy import begin as begin_extended
from estimators.unscented import ALPHA, BETA, KAPPA


def begin(theta: float, i: np.ndarray, belief: Belief, tuning: Tuning) -> Any:
    """Return a filter at the position found by starting up, i (2,) being the current there."""
    model: EnergyFilter = begin_extended(theta, i, belief, tuning)
    t = tuning.sampling_period

    def move(x: np.ndarray, dt: float, u: np.ndarray) -> np.ndarray:
        """Return the state (4,) a period later under the voltage u (2,), V, by Heun's rule."""
        slope = model.rate(x, u)
        return x + 0.5 * t * (slope + model.rate(x + t * slope, u))

    points = MerweScaledSigmaPoints(4, ALPHA, BETA, KAPPA)
    f = UnscentedKalmanFilter(4, 2, t, hx=model.current, fx=move, points=points)
    f.x, f.P, f.Q, f.R = model.x, model.P, model.Q, model.R
    return f


def step(state: State, sample: Sample, belief: Belief, tuning: Tuning) -> Estimate:
    """Take one sample."""
    return filtered(begin, lambda f, i: f.update(i), state, sample, belief, tuning)


ESTIMATOR = Estimator(
    "ukf_filterpy",
    "the unscented filter on filterpy, in Python (slow path)",
    init,
    step,
    compiled=False,
    type_2=False,
    delay="as ukf",
    speeds="as ukf",
    source="as ukf; filterpy.kalman.UnscentedKalmanFilter",
)
