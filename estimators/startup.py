"""Initial position with polarity, at standstill without load.

1. Inject along alpha, then along beta: the ripples are the columns of R(theta) Gamma R(-theta) at
   zero current, whose principal axis is theta modulo pi, in closed form (no loop that could hang at
   90 degrees).
2. Inject along that axis while holding +bias, then -bias, along it: the magnet's own direction
   saturates, so the ripple is larger there (a saturated belief says which way, a linear one takes
   that for granted).
"""

from __future__ import annotations

import math

import numpy as np

from estimators.contract import Estimate
from estimators.demodulation import (
    AXIS,
    COUNT,
    M_11,
    M_21,
    OMEGA,
    PHASE,
    RISE,
    SUM_D,
    SUM_Q,
    demodulate,
)
from model.compiled import kernel
from model.energy import flux_newton, hessian
from model.frames import wrap

ALONG_ALPHA, ALONG_BETA, BIAS_PLUS, BIAS_MINUS, TRACKING, TOLD = range(6)


def tell(state: np.ndarray, angle: float | None) -> np.ndarray:
    """Return a blank state that skips starting up where the rotor's angle (rad) is known."""
    if angle is not None:
        state[PHASE], state[AXIS] = TOLD, angle
    return state


def start_periods(settle: int, average: int) -> int:
    """Return the number of injection periods that starting up takes."""
    return 4 * (settle + average)


@kernel
def polarity_rise(energy, bias):
    """Return Gamma_dd (1/H) at +bias less that at -bias (A) on the d axis: how much larger the
    ripple is there."""
    d_plus, q_plus, _ = flux_newton(energy, bias, 0.0, 0.0, 0.0)
    d_minus, q_minus, _ = flux_newton(energy, -bias, 0.0, 0.0, 0.0)
    return hessian(energy, d_plus, q_plus)[0] - hessian(energy, d_minus, q_minus)[0]


@kernel
def next_phase(state, belief, tuning, y_d, y_q):
    """Move on to the next measurement, y being the averaged ripple of the one that ends."""
    phase = int(state[PHASE])
    if phase == ALONG_ALPHA:
        state[M_11], state[M_21] = y_d, y_q
        state[AXIS] = 0.5 * math.pi
    elif phase == ALONG_BETA:  # here d is beta and q is minus alpha
        sign = 1.0 if belief.energy.gamma_d >= belief.energy.gamma_q else -1.0
        state[AXIS] = 0.5 * math.atan2(sign * (state[M_21] - y_q), sign * (state[M_11] - y_d))
    elif phase == BIAS_PLUS:
        state[RISE] = y_d
    else:
        expected = -1.0 if polarity_rise(belief.energy, tuning.bias) < 0.0 else 1.0
        if (state[RISE] - y_d) * expected < 0.0:
            state[AXIS] = wrap(state[AXIS] + math.pi)
        state[OMEGA] = 0.0
    state[PHASE] = phase + 1
    state[COUNT] = state[SUM_D] = state[SUM_Q] = 0.0


@kernel
def start(state, sample, belief, tuning):
    """Take one sample while starting up; state[PHASE] reaches TRACKING when position and polarity
    are known."""
    axis = state[AXIS]
    if state[PHASE] == TOLD:
        state[PHASE] = TRACKING
        return Estimate(axis, 0.0, axis, 0.0, 0.0, 0.0, 0.0, 1.0)
    _, _, y_d, y_q = demodulate(state, sample, axis, 0.0, tuning)
    bias = 0.0
    if state[PHASE] == BIAS_PLUS:
        bias = tuning.bias
    elif state[PHASE] == BIAS_MINUS:
        bias = -tuning.bias
    state[COUNT] += 1.0
    if state[COUNT] > tuning.settle * tuning.period:
        state[SUM_D] += y_d
        state[SUM_Q] += y_q
    if state[COUNT] >= (tuning.settle + tuning.average) * tuning.period:
        n = tuning.average * tuning.period
        next_phase(state, belief, tuning, state[SUM_D] / n, state[SUM_Q] / n)
        if state[PHASE] != TRACKING:
            bias = 0.0
    amplitude = tuning.amplitude * tuning.peak
    return Estimate(state[AXIS], 0.0, state[AXIS], bias, 0.0, y_d * amplitude, y_q * amplitude, 1.0)
