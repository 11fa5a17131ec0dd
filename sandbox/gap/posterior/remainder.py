"""What remains of the gap after the best hypothesis, as shares with an interval."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from sandbox.gap.evidence.fit import Fit
from sandbox.gap.evidence.gap_size import DRAWS, FEWEST, UNDEFINED, rms, squares
from sandbox.gap.evidence.normal import NormalEquations
from sandbox.gap.posterior.unmodeled import map_left
from sandbox.gap.settings import USUAL, Settings


@dataclass(frozen=True)
class Unexplained:
    """Share of the gap that nothing in the library explains, 0 to 1, what the simulator is known to
    miss taken off; its 95 % interval, None where a gap is too near to what the simulator misses for
    one."""

    value: float
    ci95: tuple[float, float] | None


@dataclass(frozen=True)
class Remainder:
    """Excess J^2 - 1 before and after on all recordings, share of it explained; share that nothing
    explains, None where no gap stands above what the simulator is known to miss."""

    before: float
    after: float
    explained: float
    share: Unexplained | None = None


def remainder(before: Fit, after: Fit, noise: float, settings: Settings = USUAL) -> Remainder:
    """Return what remains of the gap on all recordings; before, after: fits to all of them, without
    and with the best hypothesis; noise: by how much of itself the noise's square may be
    misstated."""
    every = range(1 + max(s.recording for s in before.normal.segments))
    j0, j1 = rms(before.normal, every) ** 2 - 1.0, rms(after.normal, every) ** 2 - 1.0
    explained = min(1.0, max(0.0, 1.0 - j1 / j0)) if j0 > 0.0 else 0.0
    count = sum(float(s.n.sum()) for s in after.normal.segments)
    misses = settings.misses + map_left(after.point.prepared.map_error)
    least = math.hypot(misses, math.sqrt(2.0 / count), noise)
    return Remainder(j0, j1, explained, unexplained(before.normal, after.normal, least, settings))


def unexplained(
    before: NormalEquations,
    after: NormalEquations,
    least: float,
    settings: Settings = USUAL,
    seed: int = 0,
) -> Unexplained | None:
    """Return the share of the gap on all recordings that is left beyond what the simulator misses.

    least: excess J^2 that it may leave.  None without a gap beyond that.  The interval is a
    bootstrap over blocks of time, as that of the share closed; draws without a gap have no share,
    and where these are more than UNDEFINED, or of fewer than FEWEST blocks, there is no interval.
    """
    every = range(1 + max(s.recording for s in before.segments))
    (a, n), (b, _) = squares(before, every), squares(after, every)
    pick = np.random.default_rng(seed).integers(len(n), size=(DRAWS, len(n)))
    pick = np.concatenate([np.arange(len(n))[None], pick])  # first of all the recordings themselves
    gap, left = (x[pick].sum(1) / n[pick].sum(1) - 1.0 for x in (a, b))
    there = gap > least
    if not there[0] or not np.isfinite(left[0]):
        return None
    share = np.clip(
        (left - least) / np.where(there, gap, np.nan) - settings.misses_of_gap, 0.0, 1.0
    )
    low, high = (float(x) for x in np.nanpercentile(share[1:], [2.5, 97.5]))
    bounded = len(n) >= FEWEST and np.mean(~there) <= UNDEFINED
    return Unexplained(float(share[0]), (low, high) if bounded else None)
