"""Fits with planted scatter of blocks, and the size of their gap."""

from types import SimpleNamespace

import numpy as np

from sandbox.gap.evidence.gap_size import size_of

BLOCKS, COUNT, SCATTER = 400, 10, 0.2


def fit_with(squares, effects=()):
    """Return what is read of a fit: one recording, mean squares (b,) of its blocks over their
    floor."""
    segment = SimpleNamespace(
        recording=0, rr=COUNT * squares, n=np.full(len(squares), float(COUNT))
    )
    return SimpleNamespace(normal=SimpleNamespace(segments=(segment,)), effects=effects)


def size_at(deviations):
    """Return the size of a gap whose J^2 - 1 is so many standard deviations of its own; half of it
    closes."""
    apart = SCATTER * np.where(np.arange(BLOCKS) % 2, 1.0, -1.0)
    excess = deviations * SCATTER / BLOCKS**0.5
    before = fit_with(1.0 + excess + apart)
    return size_of(before.normal, before, fit_with(1.0 + 0.5 * excess + apart, ("x",)), [0], ["a"])
