"""Synchronous demodulation over one injection period, and the memory that every injection estimator shares.

Currents in the injection frame are i = mean + Gamma_hat (u F), F the sampled zero-mean primitive of the injected
waveform.  Over a whole period sum F = 0, so  sum i F / sum F^2  is the ripple and the plain average the mean.
Normalising by the *sampled* F matters: the continuous factor is 5 % off at eight samples a period.
"""

from __future__ import annotations

import numpy as np

from estimators.contract import MAX_PERIOD
from model.compiled import kernel

# Slots of the state array.
COUNT, PHASE, AXIS, OMEGA, OFFSET, FLUX_D, FLUX_Q, CURSOR = range(8)
SUM_D, SUM_Q, M_11, M_21, RISE = range(8, 13)
RING_D = 16
RING_Q = RING_D + MAX_PERIOD
RING_F = RING_Q + MAX_PERIOD
FREE = RING_F + MAX_PERIOD  # from here on an estimator's own


def blank(own: int = 0) -> np.ndarray:
    """Return a zero state with `own` slots for the estimator itself."""
    return np.zeros(FREE + own)


@kernel
def demodulate(state, i_d, i_q, carrier, tuning):
    """Take one sample in the injection frame; return mean_d, mean_q (A) and ripple y_d, y_q (1/H) of the last period."""
    n = tuning.period
    j = int(state[CURSOR])
    state[RING_D + j], state[RING_Q + j], state[RING_F + j] = i_d, i_q, carrier
    state[CURSOR] = (j + 1) % n
    mean_d = mean_q = y_d = y_q = 0.0
    for k in range(n):
        mean_d += state[RING_D + k]
        mean_q += state[RING_Q + k]
        y_d += state[RING_D + k] * state[RING_F + k]
        y_q += state[RING_Q + k] * state[RING_F + k]
    scale = 1.0 / (tuning.amplitude * tuning.power)
    return mean_d / n, mean_q / n, y_d * scale, y_q * scale
