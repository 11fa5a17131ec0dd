"""What remains after the best hypothesis, and how likely it is that something outside the library is at work."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from sandbox.gap.fit import Fit
from sandbox.gap.search import Judged
from sandbox.gap.size import rms

FLOOR = 0.015  # of J^2: what the simulator misses of a bench without a gap
SHARE = 0.003  # of the gap before: what it misses of an effect it knows
WEIGHTS = (-4.0, 2.5)  # logistic: constant, slope against the logarithm of the remainder over what it misses


@dataclass(frozen=True)
class Remainder:
    """Excess J^2 - 1 before and after, share explained, P(unknown)."""

    before: float
    after: float
    explained: float
    ratio: float
    strain: float
    unknown: float


def remainder(best: Judged, before: Fit, after: Fit, temperature: float) -> Remainder:
    """Return what remains of the gap on all recordings; a deviation beyond what is ordinary counts as remaining."""
    every = range(1 + max(s.recording for s in before.normal.segments))
    j0, j1 = rms(before.normal, every) ** 2 - 1.0, rms(after.normal, every) ** 2 - 1.0
    missed = FLOOR + SHARE * max(j0, 0.0)
    ratio = max(j1, 1e-4) / missed
    x = best.equations.most_probable(best.prior)[0]
    own = best.prior.deviation > 0.0
    strain = float(np.max(np.abs((x - best.prior.mean)[own] / best.prior.deviation[own])))
    unknown = 1.0 / (1.0 + math.exp(-(WEIGHTS[0] + WEIGHTS[1] * math.log(ratio))))
    explained = min(1.0, max(0.0, 1.0 - j1 / j0)) if j0 > 0.0 else 0.0
    return Remainder(j0, j1, explained, ratio, strain, unknown)
