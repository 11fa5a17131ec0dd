"""What the residual has beside noise, by recording and frequency, and how far it makes the data count for less.

Readings of one channel of one recording have the noise's variance 1 and, in each band of frequency, a further variance
e >= 0 of what the model misses there.  Its most likely value is the power in the band less 1 (the periodogram of white
noise is chi-square), taken as 0 where chance alone makes as much.  A model that leaves nothing of it gains
1/2 n log(1 + e), n numbers in the band.  With fixed weights 1/v it gains 1/2 n e/v: the same for v = e / log(1 + e),
which is 1 + e/2 where little is missed.  A cause that looks like what is missed has its spectrum, and meets the mean

    sum v e n / sum e n

over the bands in which it lies.  A slow error in a thousandth of the frequencies makes estimates as uncertain as white
noise of a thousand times its power would, not less.  The bands are thirds of an octave of a recording's
discrete cosine transform, so they scale with its length and sampling.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray
from scipy.fft import dct
from scipy.stats import chi2

from sandbox.gap.evidence.normal import Point
from sandbox.gap.evidence.spectrum import shown
from sandbox.gap.posterior.settings import USUAL
from sandbox.replay.segments import channel

Array = NDArray[np.float64]
CHANCE = 1e-4  # of a band that white noise alone has more: one in 20 campaigns has one such band of 500
BANDS = 3  # an octave


def misfit(point: Point) -> dict[tuple[int, str], float]:
    """Return the variance that estimates meet in every (recording, channel), in units of the noise's; 1 is noise."""
    out = {}
    for k, r in enumerate(shown(point)):
        for name in ("current", "motion", "angle"):
            if name == "current" or getattr(r, name) is not None:
                out[k, name] = met(channel(r, name))
    return out


def met(residual: Array, shapes: float = USUAL.shapes) -> float:
    """Return the variance that a cause meets in residuals (n, c)."""
    n, c = residual.shape
    squares = np.sum(dct(residual, axis=0, norm="ortho") ** 2, axis=1)
    white = max(1.0, float(np.median(squares)) / float(chi2.median(c)))
    lines = squares > white * chi2.isf(CHANCE / n, c)
    power, count = octaves(np.where(lines, 0.0, squares), np.where(lines, 0.0, float(c)))
    there = power > white * chi2.isf(CHANCE, np.maximum(count, 1.0))
    excess = float(np.sum(squares[lines] - white * c) + np.sum((power - white * count)[there]))
    return white + excess / shapes


def octaves(*numbers: Array) -> list[Array]:
    """Return sums of numbers (n,) over thirds of an octave."""
    n = len(numbers[0])
    steps = np.arange(BANDS * max(1, int(np.log2(max(2, n)))))
    edges = np.unique([0, 1, 2, *np.round(2.0 ** (1.0 + steps / BANDS)).astype(int).tolist()])
    return [np.add.reduceat(x, edges[edges < n]) for x in numbers]


def weights(variance: Mapping[tuple[int, str], float]) -> dict[tuple[int, str], float]:
    """Return the weights of segments whose variance is known."""
    return {k: 1.0 / v for k, v in variance.items()}
