"""What remains after the best hypothesis, and how likely it is that something outside the library is at work.

Named effects can imitate a missing one until nothing remains: of 24 single effects taken out of the library on an
opened check three were imitated by three others, none by two, so three at once are believed less (IMITATED; one in
twenty campaigns taken to have something outside the library, `posterior.NUMBER`, rounded).  Ordinary deviations then
often have to help, further than they usually go: one of them, it is not known which, is drawn from a Gaussian of
STRETCHED standard deviations rather than one.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from sandbox.gap.evidence import prior_of
from sandbox.gap.fit import Fit
from sandbox.gap.size import rms

FLOOR = 0.012  # of J^2: what the simulator misses of a bench without a gap
SHARE = 3e-4  # of the gap before: what it misses of an effect it knows
IMITATED = (0.0, 0.004, 0.01, 0.1)  # odds that so many named effects only imitate what is missing
STRETCHED = 4.0
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
    odds = math.exp(WEIGHTS[0] + WEIGHTS[1] * math.log(ratio))
    if after.effects:
        odds += IMITATED[len(after.effects)] * stretched(after)
    unknown = odds / (1.0 + odds)
    explained = min(1.0, max(0.0, 1.0 - j1 / j0)) if j0 > 0.0 else 0.0
    return Remainder(j0, j1, explained, unknown)


def stretched(after: Fit) -> float:
    """Return how much likelier the ordinary deviations of a fit are if one of them was stretched than if none was."""
    prior = prior_of(after.coordinates)
    own = [
        k for k, c in enumerate(after.coordinates)
        if prior.deviation[k] > 0.0 and c.form != "turn" and c.effect not in after.effects
    ]  # fmt: skip
    if not own:
        return 0.0
    z = (after.normal.x - prior.mean)[own] / prior.deviation[own]
    return float(np.mean(np.exp(0.5 * z**2 * (1.0 - STRETCHED**-2)) / STRETCHED))
