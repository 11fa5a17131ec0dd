"""Fits with planted scatter of blocks, and the size of their gap."""

import numpy as np

from sandbox.gap.evidence.fit import Fit
from sandbox.gap.evidence.gap_size import size_of
from sandbox.gap.evidence.normal import NormalEquations, Segment

BLOCKS, COUNT, SCATTER = 400, 10, 0.2


def left_by(*squares, count=COUNT):
    """Return equations without coordinates: of each recording mean squares (b,) of its currents'
    blocks over their floor."""
    own = tuple(
        Segment(
            k,
            "current",
            np.arange(0),
            np.zeros((len(x), 0, 0)),
            np.zeros((len(x), 0)),
            count * x,
            np.full(len(x), float(count)),
        )
        for k, x in enumerate(squares)
    )
    return NormalEquations((), np.zeros(0), own, 0.0)


def fit_with(squares, effects=()):
    """Return a fit, of which no point is asked: one recording, mean squares (b,) of its blocks over
    their floor."""
    return Fit(effects, None, left_by(squares), float(COUNT * np.sum(squares)), 0.0)


def size_at(deviations):
    """Return the size of a gap whose J^2 - 1 is so many standard deviations of its own; half of it
    closes."""
    apart = SCATTER * np.where(np.arange(BLOCKS) % 2, 1.0, -1.0)
    excess = deviations * SCATTER / BLOCKS**0.5
    before = fit_with(1.0 + excess + apart)
    return size_of(before.normal, before, fit_with(1.0 + 0.5 * excess + apart, ("x",)), [0], ["a"])
