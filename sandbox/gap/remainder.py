"""What remains after the best hypothesis, and how likely it is that something outside the library is at work."""

from __future__ import annotations

import math
from dataclasses import dataclass

from sandbox.gap.fit import Fit
from sandbox.gap.size import rms

FLOOR = 0.012  # of J^2: what the simulator misses of a bench without a gap
SHARE = 3e-4  # of the gap before: what it misses of an effect it knows
WEIGHTS = (-3.3, 4.0)  # logistic: constant, slope against the logarithm of the remainder over what it misses


@dataclass(frozen=True)
class Remainder:
    """Excess J^2 - 1 before and after on all recordings, share explained, P(unknown)."""

    before: float
    after: float
    explained: float
    unknown: float


def remainder(before: Fit, after: Fit) -> Remainder:
    """Return what remains of the gap, on all recordings; before, after: fits to all of them, without and with the best
    hypothesis."""
    every = range(1 + max(s.recording for s in before.normal.segments))
    j0, j1 = rms(before.normal, every) ** 2 - 1.0, rms(after.normal, every) ** 2 - 1.0
    ratio = max(j1, 1e-4) / (FLOOR + SHARE * max(j0, 0.0))
    unknown = 1.0 / (1.0 + math.exp(-(WEIGHTS[0] + WEIGHTS[1] * math.log(ratio))))
    explained = min(1.0, max(0.0, 1.0 - j1 / j0)) if j0 > 0.0 else 0.0
    return Remainder(j0, j1, explained, unknown)
