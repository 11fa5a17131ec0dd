"""Noise of current sensors where only two are there: neighbouring readings of a locked rotor, the commands' part off.

The third reading is made of the other two, so their sum shows nothing.  At a locked rotor a phase's second difference
follows the last LAGS changes of the commanded voltage, nearly linearly over BLOCK samples: that part is fitted and
taken off, and what white noise of variance s^2 leaves has the mean square 6 s^2.  Dead time, saturation and counts of
the PWM leave more in some blocks than in others, so blocks have to scatter as those of white noise do; else nothing is
said.

Of 102 opened campaigns with three sensors, whose sum shows the noise as well, 53 say it: 0.8 % too large in the mean,
1.2 % of scatter, 4.9 % at most.  The others, most with less than 4 mA of noise, say nothing.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from sandbox.recordings.campaign import Campaign, CampaignRecording

Array = NDArray[np.float64]
BLOCK, FEWEST = 100, 40  # samples; blocks of all recordings and both phases
LAGS = 4  # samples, half a period of the usual injection: of older changes second differences leave little
# Quartiles of blocks' rms of white noise: a block's mean square scatters by sqrt(2 x 1.944 / BLOCK) = 0.197 (second
# differences are alike over two samples), as chi-squared of 51 degrees of freedom, of whose quartiles these are roots.
LOWER, UPPER = 0.9275, 1.0609
# Two deviations of the ratio of both in n blocks, times sqrt(n): 2 x sqrt(2 (1 - 1/3)) x 1.36 x 0.0986.
LIKE = 0.31


def two_sensors(campaign: Campaign) -> float | None:
    """Return one sensor's noise (A rms); None where too little, or more than noise, is left of readings."""
    own = [_blocks(r) for r in campaign.recordings if r.rotor == "locked"]
    squares = np.concatenate(own) if own else np.empty(0)
    if squares.size < FEWEST:
        return None
    lower, upper = np.sqrt(np.percentile(squares, [25.0, 75.0])) / (LOWER, UPPER)
    alike = 0.0 < upper <= (1.0 + LIKE / math.sqrt(squares.size)) * lower
    return float(lower) if alike else None


def _blocks(r: CampaignRecording) -> Array:
    """Return the variance (A^2) of a reading that each block of phases a and b shows."""
    readings, volts = np.stack([r.i_a, r.i_b], axis=1), np.stack([r.u_alpha, r.u_beta], axis=1)
    second, moved = np.diff(readings, n=2, axis=0)[LAGS - 1 :], np.diff(volts, axis=0)
    before = [moved[LAGS - 1 - k : len(moved) - 1 - k] for k in range(LAGS)]
    follows = np.hstack([*before, np.ones((len(second), 1))])
    out = []
    for first in range(0, len(second) - BLOCK + 1, BLOCK):
        part, causes = second[first : first + BLOCK], follows[first : first + BLOCK]
        size, _, rank, _ = np.linalg.lstsq(causes, part, rcond=None)
        out.append(np.sum((part - causes @ size) ** 2, axis=0) / (6.0 * (BLOCK - rank)))
    return np.concatenate(out) if out else np.empty(0)
