"""q-null with its offset from a table instead of a flux inversion: self-consistent, computed once
from the belief.

The table holds, over the mean current seen from the axis of injection, the offset o with
o = null(R(-o) i), the slope of the ripple there and the speed's share of the offset: the fixed
point that `qnull` approaches sample by sample. Bilinear between points 0.2 of rated current apart.
"""

from __future__ import annotations

import math

from estimators.believed import tracked
from estimators.contract import STEP, Estimator
from estimators.demodulation import (
    AXIS,
    FREE,
    OFFSET,
    OMEGA,
    OUTSIDE,
    PHASE,
    SLOW_OMEGA,
    blank,
    demodulate,
)
from estimators.startup import TRACKING, start, tell
from estimators.tracking import correct, predict
from model.compiled import kernel, kernel_as
from model.energy import SOLVED, flux_newton, hessian
from model.frames import rotate
from model.saliency import null_angle

SIDE = 29  # points a side
REACH = 2.8  # of rated current
FIXED_POINT_STEPS = 40
ANGLES, SLOPES, TURNS = FREE, FREE + SIDE * SIDE, FREE + 2 * SIDE * SIDE


@kernel
def entry(energy, x, y, start):
    """Return offset (rad), slope (1/H) and (Gamma_dd + Gamma_qq) Gamma_qq / slope at a current (A)
    of the axis' frame.

    The fixed point is sought from `start` (rad); NaN where the belief has no flux on the way.
    """
    sign = 1.0 if energy.gamma_d >= energy.gamma_q else -1.0
    offset, d, q = start, 0.0, 0.0
    slope = turn = 0.0
    for _ in range(FIXED_POINT_STEPS):
        i_d, i_q = rotate(x, y, -offset)
        d, q, status = flux_newton(energy, i_d, i_q, d, q)
        if status != SOLVED:
            return math.nan, math.nan, math.nan
        dd, dq, qq = hessian(energy, d, q)
        slope = sign * math.hypot(dd - qq, 2.0 * dq)
        turn = (dd + qq) * qq / slope
        new = null_angle(dd, dq, qq, sign)
        offset += 0.7 * (new - offset)
    return offset, slope, turn


@kernel
def fill(state, energy, rated):
    """Compute the table for currents up to REACH times rated (A)."""
    for j in range(SIDE):
        for k in range(SIDE):
            x, y = (
                REACH * rated * (2.0 * j / (SIDE - 1) - 1.0),
                REACH * rated * (2.0 * k / (SIDE - 1) - 1.0),
            )
            angle, slope, turn = entry(energy, x, y, 0.0)
            (
                state[ANGLES + SIDE * j + k],
                state[SLOPES + SIDE * j + k],
                state[TURNS + SIDE * j + k],
            ) = angle, slope, turn


@kernel
def look_up(state, where, u, v):
    """Return the bilinear value at table coordinates u, v in [0, SIDE - 1]."""
    j, k = min(int(u), SIDE - 2), min(int(v), SIDE - 2)
    a, b, at = u - j, v - k, where + SIDE * j + k
    low = state[at] + b * (state[at + 1] - state[at])
    high = state[at + SIDE] + b * (state[at + SIDE + 1] - state[at + SIDE])
    return low + a * (high - low)


@kernel_as(STEP)
def step(state, sample, belief, tuning):
    """Take one sample; see the module's text."""
    if state[PHASE] != TRACKING:
        return start(state, sample, belief, tuning)
    axis = predict(state, tuning)
    mean_d, mean_q, y_d, y_q = demodulate(state, sample, axis, state[OMEGA], tuning)
    scale = (SIDE - 1) / (2.0 * REACH * tuning.bias)
    u = min(max(mean_d * scale + 0.5 * (SIDE - 1), 0.0), SIDE - 1.0)
    v = min(max(mean_q * scale + 0.5 * (SIDE - 1), 0.0), SIDE - 1.0)
    slope = look_up(state, SLOPES, u, v)
    state[OUTSIDE] = 1.0 if math.isnan(slope) else 0.0
    if state[OUTSIDE] == 0.0:
        turned = tuning.lag * belief.resistance * state[SLOW_OMEGA] * look_up(state, TURNS, u, v)
        state[OFFSET] = look_up(state, ANGLES, u, v) + turned
    else:  # beyond the belief: the last offset, the slope of zero current
        slope = belief.energy.gamma_d - belief.energy.gamma_q
    correct(state, y_q / slope, tuning)
    return tracked(state, state[AXIS] + state[OFFSET], y_d, y_q, tuning)


def init(belief, tuning, angle=None):
    """Return the state before starting up, or ready to track from a known angle (rad)."""
    state = blank(3 * SIDE * SIDE)
    fill(state, belief.energy, tuning.bias)
    return tell(state, angle)


ESTIMATOR = Estimator(
    "table",
    "q-null with a self-consistent table of offsets instead of a flux inversion",
    init,
    step,
    delay="0.75 N - 0.5 samples of demodulation (N samples an injection period)",
    speeds="0 to where the current loop behind the injection's average holds",
    source="Guglielmi, Pastorelli, Vagati, Cross-saturation effects in IPM motors, IEEE Trans. "
    "Ind. Appl. 42 (2006)",
)
