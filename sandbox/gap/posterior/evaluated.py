"""A fitted set of effects, weighed with traces of all other effects beside it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

from sandbox.gap.evidence.algebra import Algebra, Prior
from sandbox.gap.evidence.fit import Fit, Weights
from sandbox.gap.evidence.normal import NormalEquations, equations_of
from sandbox.gap.evidence.priors import STEPS
from sandbox.gap.posterior.candidates import Candidate
from sandbox.gap.posterior.linear_model import Linearisation, LinearModel, linear_model


@dataclass(frozen=True)
class EvaluatedModel:
    """A set of effects fitted and weighed: its fit, the equations of all effects there, prior and
    log evidence."""

    fit: Fit
    model: LinearModel
    prior: Prior
    log_evidence: float

    @property
    def effects(self) -> tuple[str, ...]:
        """The effects of the set."""
        return self.fit.effects

    @property
    def normal(self) -> NormalEquations:
        """Normal equations of all effects at its point."""
        return self.model.normal

    @property
    def equations(self) -> Algebra:
        """The same summed."""
        return self.model.equations


def evaluate(
    found: Fit,
    candidates: Sequence[Candidate],
    how: Linearisation,
    weights: Weights,
    known: NormalEquations | None = None,
) -> EvaluatedModel:
    """Return a fitted set weighed at its own point, traces of all other effects (one candidate
    each) beside it; known: equations that were taken there."""
    model = linear_model(found.point, candidates, found.effects, how, weights, known)
    prior = model.prior(found.effects)
    settled = model.settled(prior, weights, how.workers)
    return EvaluatedModel(found, settled, prior, settled.log_evidence(found.effects))


def by_algebra(near: EvaluatedModel, effects: tuple[str, ...]) -> EvaluatedModel:
    """Return the model of a set of effects from the equations at the point of another one."""
    t = near.model
    prior = t.prior(effects, alone=True)
    kept = [k for k, c in enumerate(t.coordinates) if prior.deviation[k] > 0.0 or c.of_point]
    own = [
        replace(t.coordinates[k], mean=float(prior.mean[k]), deviation=float(prior.deviation[k]))
        for k in kept
    ]
    n = equations_of(t.normal, kept, own, prior.mean)
    x, _, objective = t.equations.most_probable(prior)
    whole = [k for k in kept if t.coordinates[k].form not in STEPS]
    at = t.point.moved([t.coordinates[k] for k in whole], x[whole])
    shapes = [
        c
        for c, own in zip(t.candidates, t.places, strict=True)
        if t.coordinates[own[0]].form == "share"
    ]
    begun = {k: v for c in shapes if c.effect in effects for k, v in c.start.items()}
    at = replace(at, values={**at.values, **begun})
    found = Fit(effects, at, n, objective, 0.0)
    return EvaluatedModel(found, t, t.prior(effects), t.log_evidence(effects))
