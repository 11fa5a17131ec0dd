"""Unscented Kalman filter with the energy model, compiled.

State and model as in `estimators.kalman`; instead of Jacobians, nine points at mean +- columns of
the square root of (n + lambda) P go through Heun's step and through the current of the model.
Merwe's weights: alpha = 1/2, beta = 2, kappa = 0.  Twin on filterpy:
`estimators.unscented_filterpy`.
"""

from __future__ import annotations

import math

from estimators.contract import STEP, Estimator
from estimators.demodulation import FREE, PHASE, blank
from estimators.kalman import P, X, blur, estimate_of, started, stator_current
from estimators.startup import TRACKING, tell
from model.compiled import kernel, kernel_as

N = 4
ALPHA, BETA, KAPPA = 0.5, 2.0, 0.0
LAMBDA = ALPHA**2 * (N + KAPPA) - N
MEAN_0 = LAMBDA / (N + LAMBDA)  # weight of the middle point in means
COVARIANCE_0 = MEAN_0 + 1.0 - ALPHA**2 + BETA
OTHERS = 0.5 / (N + LAMBDA)
POINTS = 2 * N + 1
S = P + 16  # sigma points, POINTS x 4
Z = S + POINTS * N  # their currents, POINTS x 2
C = Z + POINTS * 2  # Cholesky factor, 4 x 4, lower
SIZE = C + 16 - FREE


@kernel
def cholesky(s, scale):
    """Write the lower square root of scale x P to C; a pivot lost to rounding counts as tiny."""
    for i in range(N):
        for j in range(i + 1):
            total = scale * s[P + N * i + j]
            for k in range(j):
                total -= s[C + N * i + k] * s[C + N * j + k]
            s[C + N * i + j] = math.sqrt(max(total, 1e-30)) if i == j else total / s[C + N * j + j]


@kernel
def spread(s):
    """Write the sigma points of mean and covariance to S, in filterpy's order."""
    cholesky(s, N + LAMBDA)
    for i in range(N):
        s[S + i] = s[X + i]
    for k in range(N):
        for i in range(N):
            side = s[C + N * i + k] if i >= k else 0.0
            s[S + N * (k + 1) + i] = s[X + i] + side
            s[S + N * (k + 1 + N) + i] = s[X + i] - side


@kernel
def propagate(s, at, u_alpha, u_beta, belief, tuning):
    """Take the sigma point at an offset through one Heun step."""
    t, r = tuning.sampling_period, belief.resistance
    a, b, omega, theta = s[at], s[at + 1], s[at + 2], s[at + 3]
    i_alpha, i_beta = stator_current(a, b, theta, belief)
    da, db = u_alpha - r * i_alpha, u_beta - r * i_beta
    n_alpha, n_beta = stator_current(a + t * da, b + t * db, theta + t * omega, belief)
    s[at], s[at + 1] = (
        a + 0.5 * t * (da + u_alpha - r * n_alpha),
        b + 0.5 * t * (db + u_beta - r * n_beta),
    )
    s[at + 3] = theta + t * omega


@kernel
def predict(s, u_alpha, u_beta, belief, tuning):
    """Propagate mean and covariance over one sampling period."""
    spread(s)
    for k in range(POINTS):
        propagate(s, S + N * k, u_alpha, u_beta, belief, tuning)
    for i in range(N):
        total = MEAN_0 * s[S + i]
        for k in range(1, POINTS):
            total += OTHERS * s[S + N * k + i]
        s[X + i] = total
    for i in range(N):
        for j in range(N):
            total = COVARIANCE_0 * (s[S + i] - s[X + i]) * (s[S + j] - s[X + j])
            for k in range(1, POINTS):
                total += OTHERS * (s[S + N * k + i] - s[X + i]) * (s[S + N * k + j] - s[X + j])
            s[P + N * i + j] = total
    blur(s, tuning)
    spread(s)  # anew, so that the points carry the process noise, too


@kernel
def update(s, i_alpha, i_beta, belief, tuning):
    """Correct with one current sample, through points drawn anew after the prediction, as filterpy
    does."""
    z_alpha = z_beta = 0.0
    for k in range(POINTS):
        at, w = S + N * k, OTHERS if k else MEAN_0
        s[Z + 2 * k], s[Z + 2 * k + 1] = stator_current(s[at], s[at + 1], s[at + 3], belief)
        z_alpha += w * s[Z + 2 * k]
        z_beta += w * s[Z + 2 * k + 1]
    s_aa = s_bb = tuning.current_variance
    s_ab = 0.0
    for i in range(N):
        s[C + i] = s[C + N + i] = 0.0  # P_xz: column a, then column b
    for k in range(POINTS):
        w = OTHERS if k else COVARIANCE_0
        e_alpha, e_beta = s[Z + 2 * k] - z_alpha, s[Z + 2 * k + 1] - z_beta
        s_aa, s_ab, s_bb = (
            s_aa + w * e_alpha * e_alpha,
            s_ab + w * e_alpha * e_beta,
            s_bb + w * e_beta * e_beta,
        )
        for i in range(N):
            miss = w * (s[S + N * k + i] - s[X + i])
            s[C + i] += miss * e_alpha
            s[C + N + i] += miss * e_beta
    det = s_aa * s_bb - s_ab * s_ab
    for i in range(N):  # gains: columns a and b
        x, y = s[C + i], s[C + N + i]
        s[C + 8 + i], s[C + 12 + i] = (x * s_bb - y * s_ab) / det, (y * s_aa - x * s_ab) / det
        s[X + i] += s[C + 8 + i] * (i_alpha - z_alpha) + s[C + 12 + i] * (i_beta - z_beta)
    for i in range(N):
        for j in range(N):  # K S K^T = P_xz K^T
            s[P + N * i + j] -= s[C + i] * s[C + 8 + j] + s[C + N + i] * s[C + 12 + j]


@kernel_as(STEP)
def step(state, sample, belief, tuning):
    """Take one sample; see the module's text."""
    if state[PHASE] != TRACKING:
        return started(state, sample, belief, tuning)
    predict(state, sample.u_alpha, sample.u_beta, belief, tuning)
    update(state, sample.i_alpha, sample.i_beta, belief, tuning)
    return estimate_of(state, sample, tuning)


def init(belief, tuning, angle=None):
    """Return the state before starting up, or ready to track from a known angle (rad)."""
    return tell(blank(SIZE), angle)


ESTIMATOR = Estimator(
    "ukf",
    "unscented Kalman filter on flux, speed and angle with the energy model",
    init,
    step,
    type_2=False,
    delay="none of its own: a prediction by the model, corrected each sample",
    speeds="all; at standstill it needs the injection, and R and the inverter's voltage well known",
    source="Wan, van der Merwe, The unscented Kalman filter (2001); model of `ekf`",
)
