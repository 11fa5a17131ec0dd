"""A set of effects that was not fitted, by the equations at the point of another one."""

from __future__ import annotations

from dataclasses import replace

from sandbox.gap.evidence.fit import Fit
from sandbox.gap.evidence.normal import equations_of
from sandbox.gap.evidence.priors import STEPS
from sandbox.gap.posterior.evaluated import EvaluatedModel


def by_algebra(near: EvaluatedModel, effects: tuple[str, ...]) -> EvaluatedModel:
    """Return the model of a set of effects from the equations at the point of another one."""
    t = near.model
    prior = t.prior(effects, alone=True)
    kept = [k for k, c in enumerate(t.coordinates) if prior.deviation[k] > 0.0 or c.form == "turn"]
    own = [replace(t.coordinates[k], mean=float(prior.mean[k]), deviation=float(prior.deviation[k])) for k in kept]
    n = equations_of(t.normal, kept, own, prior.mean)
    x, _, objective = t.equations.most_probable(prior)
    whole = [k for k in kept if t.coordinates[k].form not in STEPS]
    at = t.point.moved([t.coordinates[k] for k in whole], x[whole])
    shapes = [c for c, own in zip(t.candidates, t.places, strict=True) if t.coordinates[own[0]].form == "share"]
    begun = {k: v for c in shapes if c.effect in effects for k, v in c.start.items()}
    at = replace(at, values={**at.values, **begun})
    found = Fit(effects, at, n, objective, 0.0)
    return EvaluatedModel(found, t, t.prior(effects), t.log_evidence(effects))
