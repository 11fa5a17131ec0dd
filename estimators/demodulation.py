"""Synchronous demodulation, and the memory that every injection estimator shares.

Currents in the injection frame are i = mean + Gamma_hat (u F), F the sampled zero-mean primitive of the injected
waveform.  Over a whole period sum F = 0, so  sum i F / sum F^2  is the ripple and the plain average the mean.
Normalising by the *sampled* F matters: the continuous factor is 5 % off at eight samples a period.

A current that rises through the window would still pass for ripple, with a sign that turns every half period (F
does).  So the results of two windows half a period apart are averaged: weights 1/2, 1, 1/2 over three half
periods, exact for a steady ripple on a linear trend.
"""

from __future__ import annotations

import math

import numpy as np

from estimators.contract import MAX_PERIOD
from model.compiled import kernel

# Slots of the state array.
COUNT, PHASE, AXIS, OMEGA, OFFSET, FLUX_D, FLUX_Q, CURSOR = range(8)
SUM_D, SUM_Q, M_11, M_21, RISE = range(8, 13)
RING_A = 16
RING = 3 * MAX_PERIOD // 2
RING_B = RING_A + RING
RING_F = RING_B + RING
FREE = RING_F + RING  # from here on an estimator's own


def blank(own: int = 0) -> np.ndarray:
    """Return a zero state with `own` slots for the estimator itself."""
    return np.zeros(FREE + own)


@kernel
def demodulate(state, sample, axis, omega, tuning):
    """Take one sample; return mean_d, mean_q (A) and ripple y_d, y_q (1/H) in the axis' frame.

    The whole window is looked at from one frame, the present axis turned back at the estimated speed.  Frames
    remembered from sample to sample would carry the tracking loop's own jitter into the window, and the mean
    current times that jitter comes out as ripple: enough to make the loop ring at high load.
    """
    half = tuning.period // 2
    n = 3 * half
    j = int(state[CURSOR])
    state[RING_A + j], state[RING_B + j], state[RING_F + j] = sample.i_alpha, sample.i_beta, sample.carrier
    state[CURSOR] = (j + 1) % n
    c, s = math.cos(axis), math.sin(axis)
    turn = tuning.sampling_period * omega
    dc, ds = math.cos(turn), math.sin(turn)
    mean_d = mean_q = y_d = y_q = 0.0
    for k in range(n):  # from the newest sample back
        weight = 1.0 if half <= k < 2 * half else 0.5
        i_d = weight * (c * state[RING_A + j] + s * state[RING_B + j])
        i_q = weight * (c * state[RING_B + j] - s * state[RING_A + j])
        mean_d += i_d
        mean_q += i_q
        y_d += i_d * state[RING_F + j]
        y_q += i_q * state[RING_F + j]
        c, s = c * dc + s * ds, s * dc - c * ds
        j = j - 1 if j > 0 else n - 1
    scale = 1.0 / (tuning.amplitude * tuning.power)
    return mean_d / (2 * half), mean_q / (2 * half), y_d * scale, y_q * scale
