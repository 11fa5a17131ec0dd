"""How large the gap is: residuals over the noise, before and after an effect is added, on
recordings held out.

`before` lets ordinary deviations move as far as ordinary goes (`priors.ORDINARY` standard
deviations): what would only fit with a resistance ten deviations off is a gap, not a deviation.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from model.array_types import Array
from sandbox.gap.evidence.fit import Fit
from sandbox.gap.evidence.normal import NormalEquations

DRAWS = 400
# blocks of time: of 8 a bootstrap is 0.78 as wide as Student's interval, of 4 half as wide
FEWEST = 8
UNDEFINED = 0.05  # of the draws, without a gap to close: more, and there is no interval


class OfRecording(NamedTuple):
    """The normalised rms of one recording before and after, and whether it was held out."""

    file: str
    before: float
    after: float
    held_out: bool


@dataclass(frozen=True)
class Size:
    """Normalised rms on the recordings held out: of the nominal model, before, after, share
    closed (or None) and its interval (or None), and of each recording; blocks: of time, as many as
    there are to draw from."""

    nominal_nrmse: float
    before: float
    after: float
    closed: float | None
    closed_ci95: tuple[float, float] | None
    recordings: tuple[OfRecording, ...]
    blocks: int = FEWEST


def squares(n: NormalEquations, recordings: Sequence[int]) -> tuple[Array, Array]:
    """Return sums of squares and counts (b,) of all blocks of time; channels read at one time
    scatter together."""
    own = [[s for s in n.segments if s.recording == k] for k in recordings]
    ssr = [np.sum([s.ssr for s in x], axis=0) for x in own if x]
    count = [np.sum([s.n for s in x], axis=0) for x in own if x]
    return np.concatenate(ssr), np.concatenate(count)


def rms(n: NormalEquations, recordings: Sequence[int]) -> float:
    """Return the normalised rms over all channels of some recordings."""
    ssr, count = squares(n, recordings)
    return float(np.sqrt(ssr.sum() / count.sum()))


def share_closed(before: float, after: float) -> float:
    """Return (J0^2 - J1^2) / (J0^2 - 1)."""
    return (before**2 - after**2) / (before**2 - 1.0)


def size_of(
    nominal: NormalEquations,
    before: Fit,
    after: Fit,
    held_out: Sequence[int],
    files: Sequence[str],
    seed: int = 0,
) -> Size:
    """Return how large the gap is; without recordings held out, on all.

    The interval is a bootstrap over blocks of time, where there are FEWEST.  Draws without a gap
    (rms at most 1) have no share; where these are more than UNDEFINED of all there is no interval,
    since the rest would tell one given that there is a gap.
    """
    chosen = list(held_out) or list(range(len(files)))
    j0, j1 = rms(before.normal, chosen), rms(after.normal, chosen)
    each = tuple(
        OfRecording(f, rms(before.normal, [k]), rms(after.normal, [k]), k in held_out)
        for k, f in enumerate(files)
    )
    closed = interval = None
    (a, n), (b, _) = squares(before.normal, chosen), squares(after.normal, chosen)
    if after is not before and j0 > 1.0:
        closed = share_closed(j0, j1)
        pick = np.random.default_rng(seed).integers(len(n), size=(DRAWS, len(n)))
        total = n[pick].sum(1)
        excess = a[pick].sum(1) / total - 1.0
        drawn = (a[pick] - b[pick]).sum(1) / total / np.where(excess > 0.0, excess, np.nan)
        if len(n) >= FEWEST and np.mean(excess <= 0.0) <= UNDEFINED:
            low, high = np.nanpercentile(drawn, [2.5, 97.5])
            interval = (float(low), float(high))
    return Size(rms(nominal, chosen), j0, j1, closed, interval, each, len(n))
