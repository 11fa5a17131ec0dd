"""Synchronous demodulation, and the memory that every injection estimator shares.

Currents in the injection frame are i = mean + Gamma_hat (u F), F the sampled zero-mean primitive of
the injected waveform.  Over a whole period sum F = 0, so  sum i F / sum F^2  is the ripple and the
plain average the mean.
Normalising by the *sampled* F matters: the continuous factor is 5 % off at eight samples a period.

A current that rises through the window would still pass for ripple, with a sign that turns every
half period (F does).  So the results of two windows half a period apart are averaged: weights 1/2,
1, 1/2 over three half periods, exact for a steady ripple on a linear trend.
"""

from __future__ import annotations

import math

import numpy as np

from estimators.contract import MAX_PERIOD
from model.compiled import kernel

# Slots of the state array.
COUNT, PHASE, AXIS, OMEGA, OFFSET, FLUX_D, FLUX_Q, CURSOR = range(8)
SUM_D, SUM_Q, M_11, M_21, RISE, OUTSIDE, ACCELERATION, LOAD_TORQUE, SLOW_OMEGA = range(8, 17)
RING_ALPHA = 20
RING = 3 * MAX_PERIOD // 2
RING_BETA, RING_F, RING_C, RING_S = (RING_ALPHA + k * RING for k in range(1, 5))
FREE = RING_S + RING  # from here on an estimator's own


def blank(own: int = 0) -> np.ndarray:
    """Return a zero state with `own` slots for the estimator itself."""
    return np.zeros(FREE + own)


@kernel
def demodulate(state, sample, axis, omega, tuning):
    """Take one sample; return mean_d, mean_q (A) and ripple y_d, y_q (1/H) in the axis' frame.

    The mean is looked at from one frame, the present axis turned back at the estimated speed, and
    taken off first: in frames that carry the tracking loop's jitter, mean current times jitter
    would come out
    as ripple. The ripple is then looked at from the present frame or from the axis of its own time
    (`tuning.present`).
    """
    half = tuning.period // 2
    n = 3 * half
    newest = int(state[CURSOR])
    state[RING_ALPHA + newest], state[RING_BETA + newest], state[RING_F + newest] = (
        sample.i_alpha,
        sample.i_beta,
        sample.carrier,
    )
    state[RING_C + newest], state[RING_S + newest] = math.cos(axis), math.sin(axis)
    state[CURSOR] = (newest + 1) % n
    dc, ds = math.cos(tuning.sampling_period * omega), math.sin(tuning.sampling_period * omega)
    c, s, j = state[RING_C + newest], state[RING_S + newest], newest
    mean_d = mean_q = y_d = y_q = 0.0
    for k in range(n):  # from the newest sample back
        weight = 1.0 if half <= k < 2 * half else 0.5
        mean_d += weight * (c * state[RING_ALPHA + j] + s * state[RING_BETA + j])
        mean_q += weight * (c * state[RING_BETA + j] - s * state[RING_ALPHA + j])
        c, s = c * dc + s * ds, s * dc - c * ds
        j = j - 1 if j > 0 else n - 1
    mean_d, mean_q = mean_d / (2 * half), mean_q / (2 * half)
    c, s, j = state[RING_C + newest], state[RING_S + newest], newest
    for k in range(n):
        weight = state[RING_F + j] if half <= k < 2 * half else 0.5 * state[RING_F + j]
        r_alpha = weight * (state[RING_ALPHA + j] - (c * mean_d - s * mean_q))
        r_beta = weight * (state[RING_BETA + j] - (s * mean_d + c * mean_q))
        v_c, v_s = (c, s) if tuning.present else (state[RING_C + j], state[RING_S + j])
        y_d += v_c * r_alpha + v_s * r_beta
        y_q += v_c * r_beta - v_s * r_alpha
        c, s = c * dc + s * ds, s * dc - c * ds
        j = j - 1 if j > 0 else n - 1
    scale = 1.0 / (tuning.amplitude * tuning.power)
    return mean_d, mean_q, y_d * scale, y_q * scale
