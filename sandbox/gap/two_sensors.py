"""Noise of current sensors where only two are there: how neighbouring readings differ beyond what
commands explain.

The third reading is made of the other two, so their sum shows nothing.  At a locked rotor a phase's
second difference follows the last LAGS changes of the commanded voltage, nearly linearly over BLOCK
samples.  This part is fitted and taken off; white noise of variance s^2 leaves 6 s^2 a sample, less
what the fitted functions hold of it.

Nothing is said where more than noise is left, or where noise could be taken off with the commands:

- dead time, saturation and counts of the PWM leave more in some blocks than in others, so blocks
  have to scatter as those of white noise do;
- a current controller answers the noise, so its commands would explain it: of blocks whose commands
  do not follow from the commands before, as an injection and slow courses do, none is looked at.

Of 102 opened campaigns with three sensors, whose sum shows the noise as well, 75 say it: 0.9 % too
large in the mean, 1.0 % of scatter, 3.5 % at most.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view

from model.array_types import Array
from sandbox.recordings.campaign import Campaign, CampaignRecording

BLOCK, FEWEST = 100, 40  # samples; blocks of all recordings and both phases
# samples, half a period of the usual injection: of older changes second differences leave little
LAGS = 4
OWN = 8  # samples, a period of the usual injection: changes from which a command has to follow
# of the noise's square: what commands may explain of it that do not follow from those before
ANSWERS = 0.02
# Quartiles of blocks' rms of white noise: a block's mean square scatters by sqrt(2 x 1.944 /
# BLOCK) = 0.197 (second differences are alike over two samples), as chi-squared of 51 degrees of
# freedom, of whose quartiles these are roots.
LOWER, UPPER = 0.9275, 1.0609
# Two deviations of the ratio of both in n blocks, times sqrt(n): 2 x sqrt(2 (1 - 1/3)) x 1.36 x
# 0.0986.
LIKE = 0.31


def two_sensors(campaign: Campaign) -> float | None:
    """Return one sensor's noise (A rms); None where too little, or more than noise, is left of
    readings."""
    own = [x for r in campaign.recordings if r.rotor == "locked" for x in _blocks(r)]
    if len(own) < FEWEST:
        return None
    lower, upper = np.sqrt(np.percentile(own, [25.0, 75.0])) / (LOWER, UPPER)
    alike = 0.0 < upper <= (1.0 + LIKE / math.sqrt(len(own))) * lower
    return float(lower) if alike else None


def _blocks(r: CampaignRecording) -> list[float]:
    """Return the variance (A^2) of a reading that phases a and b show in each block that tells
    it."""
    if len(r.t) < BLOCK + OWN + 2:
        return []
    readings, volts = np.stack([r.i_a, r.i_b], axis=1), np.stack([r.u_alpha, r.u_beta], axis=1)
    moved = np.diff(volts, axis=0)
    # (n - OWN - 1, 2, OWN + 1), the last one is the latest
    past = sliding_window_view(moved, OWN + 1, axis=0)
    # of samples k - 1, k, k + 1: the latest change is that of command k
    second = np.diff(readings, n=2, axis=0)[OWN:]
    out = []
    for first in range(0, len(second) - BLOCK + 1, BLOCK):
        rows = slice(first, first + BLOCK)
        changes = past[rows]
        causes = _with_one(changes[:, :, OWN + 1 - LAGS :])
        size = np.linalg.lstsq(causes, second[rows], rcond=None)[0]
        left = np.mean((second[rows] - causes @ size) ** 2, axis=0) / (6.0 - _taken(causes) / BLOCK)
        before = _with_one(changes[:, :, :OWN])
        fresh = (
            changes[:, :, OWN] - before @ np.linalg.lstsq(before, changes[:, :, OWN], rcond=None)[0]
        )
        by_axis = np.sum(size[:-1].reshape(2, LAGS, 2) ** 2, axis=1)  # (2 axes, 2 phases)
        answers = np.mean(fresh**2, axis=0) @ by_axis
        out += [float(x) for x, y in zip(left, answers, strict=True) if y <= ANSWERS * 6.0 * x]
    return out


def _with_one(changes: Array) -> Array:
    """Return changes (n, 2, k) as columns (n, 2 k + 1), a constant beside them."""
    return np.hstack([changes.reshape(len(changes), -1), np.ones((len(changes), 1))])


def _taken(causes: Array) -> float:
    """Return how much of the square that second differences of white noise of variance 1 have (6 a
    sample) functions (n, p) hold: the trace of P S, P the projection on them, S the band 6, -4,
    1."""
    u, sizes, _ = np.linalg.svd(causes, full_matrices=False)
    own = u[:, sizes > 1e-12 * sizes[0]]
    return float(sum(np.sum(np.convolve(column, (1.0, -2.0, 1.0)) ** 2) for column in own.T))
