"""Errors of readings that go together from one reading to the next, and how they are whitened.

Of each residual what the ones before foretell is taken off, and what is left is divided by its
standard deviation (Durbin, Rev. Int. Stat. Inst. 28 (1960) 233, whose recursion gives the
coefficients from the errors' autocorrelations).  Slopes go the same way.  Then sums of squares are
those of the inverse covariance: of an autoregressive process of the order that is known.  A block
of time begins anew, so that blocks stay independent.
"""

from __future__ import annotations

import math
from functools import cache

import numpy as np
from numpy.typing import NDArray

from sandbox.replay.stretches import Stretch, blocks

Array = NDArray[np.float64]
Colour = tuple[float, ...]  # autocorrelations over 1, 2, ... readings; () of white noise


def whiten(x: Array, colour: Colour, s: Stretch, cut: int) -> None:
    """Whiten residuals or slopes (m, ...) over a stretch, block by block, in place; cut: samples of
    a block."""
    if not colour:
        return
    for first, last in blocks(s.n, cut):
        if s.first <= first and last <= s.last:
            own = x[first - s.first : last - s.first]
            read, known = own.copy(), predictors(colour)
            for k, (weights, deviation) in enumerate(known):
                # the last one foretells all readings that have so many before them
                end = k + 1 if k + 1 < len(known) else len(own)
                for j, weight in enumerate(weights, 1):
                    own[k:end] -= weight * read[k - j : end - j]
                own[k:end] /= deviation


@cache
def predictors(colour: Colour) -> list[tuple[Array, float]]:
    """Return weights of the readings before, the latest first, by which 0, 1, ... of them foretell
    an error best, and the standard deviation of what they leave; up to the order from which no
    noise has such autocorrelations."""
    weights, square = np.zeros(0), 1.0
    out = [(weights, 1.0)]
    for k in range(len(colour)):
        more = float(colour[k] - weights @ np.array(colour[:k][::-1])) / square
        if not abs(more) < 1.0:
            break
        weights = np.append(weights - more * weights[::-1], more)
        square *= 1.0 - more * more
        out.append((weights, math.sqrt(square)))
    return out
