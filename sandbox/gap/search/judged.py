"""A fitted set of effects, weighed with all other effects beside it."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

from model.errors import BadInput
from sandbox.gap.evidence.algebra import Algebra, Prior
from sandbox.gap.evidence.fit import Fit, Weights, excess_of
from sandbox.gap.evidence.normal import Normal
from sandbox.gap.evidence.probes import Probe
from sandbox.gap.evidence.spike_slab import Table, settled, table

# Share of the residual beyond noise (at least one standard deviation of noise's own square) that slopes may promise and
# no step reach: where they promise more they are taken anew, so many times in all.
LEFT, TAKEN = 0.02, 3


@dataclass(frozen=True)
class Judged:
    """A set of effects fitted and weighed: its fit, the equations of all effects there, prior and log evidence."""

    fit: Fit
    table: Table
    prior: Prior
    log_evidence: float
    unmet: float  # of the objective: what slopes still promise, counted against it
    simulations: float

    @property
    def effects(self) -> tuple[str, ...]:
        """The effects of the hypothesis."""
        return self.fit.effects

    @property
    def normal(self) -> Normal:
        """Normal equations of all effects at its point."""
        return self.table.normal

    @property
    def equations(self) -> Algebra:
        """The same summed."""
        return self.table.equations

    def tempered(self, temperature: float) -> float:
        """Return the log evidence where the data counts for as much less."""
        return self.table.log_evidence(self.effects, temperature=temperature) - 0.5 * self.unmet / temperature


def judge(found: Fit, chosen: Sequence[Probe], share: float, weights: Weights, workers: int) -> Judged:
    """Return a fit weighed with all effects beside it, at the point to which their ordinary sizes move it.

    Slopes are taken anew on the way there where they promise much of what the fit leaves and no step reaches it.
    """
    first = table(found.point, chosen, found.effects, share, weights, workers)
    last, unmet, cost = settled(first, prior := first.prior(found.effects), weights, workers)
    cost += first.normal.simulations
    for _ in range(TAKEN - 1):
        if unmet <= LEFT * _beyond_noise(last.normal, weights) or last.point is first.point:
            break
        try:
            first = table(last.point, chosen, found.effects, share, weights, workers)
        except BadInput:  # beside the settled point some effect leaves a drive that none can be
            break
        last, unmet, spent = settled(first, prior := first.prior(found.effects), weights, workers)
        cost += first.normal.simulations + spent
    log_evidence = last.log_evidence(found.effects) - 0.5 * unmet
    return Judged(found, last, prior, log_evidence, unmet, cost)


def _beyond_noise(n: Normal, weights: Weights) -> float:
    """Return the squared residual beyond noise, at least one standard deviation of what noise alone makes of it."""
    count = sum(float(s.n.sum()) for s in n.segments)
    return max(excess_of(n, weights), math.sqrt(2.0 * count))
