"""Hypotheses: sets of effects, each with and without something outside the library beside it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from sandbox.gap.posterior.evaluated import EvaluatedModel
from sandbox.gap.posterior.inference import Inference
from sandbox.gap.posterior.set_prior import Set
from sandbox.gap.posterior.unfitted import by_algebra
from sandbox.gap.posterior.unmodeled import unmodeled

UNKNOWN = "unknown"
LISTED = 1e-4  # probability from which a set is a hypothesis of its own


@dataclass(frozen=True)
class Hypothesis:
    """Effects (perhaps with `unknown`), probability, and the model behind the named ones."""

    effects: tuple[str, ...]
    probability: float
    evaluated: EvaluatedModel


def hypotheses(found: Inference, noise: float) -> list[Hypothesis]:
    """Return hypotheses, the most probable first; probabilities sum to 1.

    P(set, unknown) = P(set) P(unknown | what the set leaves).  A set that was not fitted leaves what the best one does.
    noise: by how much of itself the noise's square may be misstated.
    """
    outside = {k: unmodeled(found.null, e.fit, noise) for k, e in found.evaluated.items()}
    best = found.best
    models = dict(found.evaluated) | {
        k: by_algebra(best, k)
        for k, p in found.sets.items()
        if p > LISTED and k not in found.evaluated and all(e in best.model.members for e in k)
    }
    out = []
    for key, model in models.items():
        p, u = found.sets.get(key, 0.0), outside.get(key, outside[best.effects])
        out.append(Hypothesis(key, p * (1.0 - u), model))
        out.append(Hypothesis((*key, UNKNOWN), p * u, model))
    total = sum(h.probability for h in out)
    told = [Hypothesis(h.effects, h.probability / total, h.evaluated) for h in out]
    return sorted(told, key=lambda h: (-h.probability, h.effects))


def named(effects: tuple[str, ...]) -> Set:
    """Return the effects of a hypothesis without `unknown`."""
    return tuple(e for e in effects if e != UNKNOWN)


def sets_of(found: list[Hypothesis]) -> Mapping[Set, float]:
    """Return the probability of every set of named effects."""
    out: dict[Set, float] = {}
    for h in found:
        out[named(h.effects)] = out.get(named(h.effects), 0.0) + h.probability
    return out
