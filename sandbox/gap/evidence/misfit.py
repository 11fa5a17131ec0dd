"""What the residual has beside noise, by recording, and how far it makes the data count for less.

What a wrong model misses is no noise: it follows the operating point, so in one recording it takes
few independent shapes, however many readings there are.  A residual with the excess E (sum of
squares beyond noise, in the noise's variance) that takes d shapes alike puts E/d on each of them.
A cause that is sought moves readings along one shape, so its estimate meets the variance

    v = w + E/d,

w the white part.  White is what all frequencies of the recording's discrete cosine transform have
alike (their median): noise, and what is as rough as noise.  E is what lines, and thirds of an
octave of the rest, have beyond it and by more than chance.  Most likely values would have v = 1 + e
with e the mean excess of a reading: that is the case d = n, noise of another size, and it made a
few per cent of misfit in a long recording worth thousands of nats.

d is a number of the settings (`Settings.shapes`): sizes of absent effects, as a fit's residual
shows them, have z^2 = 1 + E/d in the mean.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from scipy.fft import dct
from scipy.stats import chi2

from model.array_types import Array
from sandbox.gap.evidence.normal import ParameterPoint
from sandbox.gap.evidence.spectrum import shown
from sandbox.gap.settings import USUAL
from sandbox.replay.segments import Colour, channel, colour_of, whiten
from sandbox.replay.stretches import Stretch

# of a band that white noise alone has more: one in 20 campaigns has one such band of 500
CHANCE = 1e-4
BANDS = 3  # an octave


def misfit(point: ParameterPoint) -> dict[tuple[int, str], float]:
    """Return the variance that estimates meet in every (recording, channel), in units of the
    noise's; 1 is noise.  Coloured noise is none less: residuals are whitened as they are where
    they are squared."""
    prepared, out = point.prepared, {}
    for k, r in enumerate(shown(point)):
        for name in ("current", "motion", "angle"):
            if name == "current" or getattr(r, name) is not None:
                out[k, name] = met(whitened(channel(r, name), colour_of(prepared, name)))
    return out


def whitened(residual: Array, colour: Colour) -> Array:
    """Return residuals (n, c) without what their errors' colour makes alike in neighbours."""
    out, n = residual.copy(), len(residual)
    whiten(out, colour, Stretch(0, 0, n, n), n)
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
