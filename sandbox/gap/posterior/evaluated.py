"""A fitted set of effects, weighed with traces of all other effects beside it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from sandbox.gap.evidence.algebra import Algebra, Prior
from sandbox.gap.evidence.fit import Fit, Weights
from sandbox.gap.evidence.normal import Normal
from sandbox.gap.posterior.candidates import Candidate
from sandbox.gap.posterior.linear_model import LinearModel, linear_model
from sandbox.gap.posterior.settings import USUAL, Settings


@dataclass(frozen=True)
class EvaluatedModel:
    """A set of effects fitted and weighed: its fit, the equations of all effects there, prior and log evidence."""

    fit: Fit
    model: LinearModel
    prior: Prior
    log_evidence: float

    @property
    def effects(self) -> tuple[str, ...]:
        """The effects of the set."""
        return self.fit.effects

    @property
    def normal(self) -> Normal:
        """Normal equations of all effects at its point."""
        return self.model.normal

    @property
    def equations(self) -> Algebra:
        """The same summed."""
        return self.model.equations


def evaluate(
    found: Fit,
    candidates: Sequence[Candidate],
    trace: float,
    weights: Weights,
    *,
    settings: Settings = USUAL,
    workers: int = 1,
) -> EvaluatedModel:
    """Return a fitted set weighed at its own point, traces of all other effects (one candidate each) beside it."""
    model = linear_model(found.point, candidates, found.effects, trace, weights, settings=settings, workers=workers)
    prior = model.prior(found.effects)
    settled = model.settled(prior, weights, workers)
    return EvaluatedModel(found, settled, prior, settled.log_evidence(found.effects))
