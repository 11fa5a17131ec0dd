"""Hypotheses: sets of effects, each with and without something outside the library beside it."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

from sandbox.gap.posterior.evaluated import EvaluatedModel, by_algebra
from sandbox.gap.posterior.inference import Inference
from sandbox.gap.posterior.marginalized import marginalized
from sandbox.gap.posterior.sets import Set, SetPosterior
from sandbox.gap.posterior.unmodeled import unmodeled
from sandbox.gap.shortened import shortened

UNKNOWN = "unknown"
LIKELY = 0.5  # chance of `unknown` from which on effects have to stand beside a regression
LISTED = 1e-4  # probability from which a set is a hypothesis of its own
# of them, the likeliest that were not fitted: each takes 0.1 s and 5 MB where a recording has
# 65,000 samples, and one that tells little may have thousands
MOST_LISTED = 200


@dataclass(frozen=True)
class Hypothesis:
    """Effects (perhaps with `unknown`), probability, and the model behind the named ones."""

    effects: tuple[str, ...]
    probability: float
    evaluated: EvaluatedModel


def hypotheses(found: Inference, noise: float, *, workers: int = 1) -> list[Hypothesis]:
    """Return hypotheses, the most probable first; probabilities sum to 1.

    P(set, unknown) = P(unknown) P(set | unknown), with P(unknown) from what every fitted set leaves
    (a set that was not fitted leaves what the best one does).  Where something outside is likely, a
    free regression stands beside the effects in P(set | unknown), so that a name which only
    imitates it has no place.
    noise: by how much of itself the noise's square may be misstated.
    """
    outside = {k: unmodeled(found.null, e.fit, noise) for k, e in found.evaluated.items()}
    usual = outside[found.best.effects]
    inside = {(): 0.0} | {k: p * (1.0 - outside.get(k, usual)) for k, p in found.sets.items()}
    chance = 1.0 - sum(inside.values()) / sum(found.sets.values())
    given = {(): 0.0} | {k: p * outside.get(k, usual) for k, p in found.sets.items()}
    if chance >= LIKELY and found.best.effects:
        given = {(): 0.0} | (with_regression(found, workers) or given)
    scale = chance / (sum(given.values()) or 1.0)
    every = [(k, k, p) for k, p in inside.items()]
    every += [((*k, UNKNOWN), k, p * scale) for k, p in given.items()]
    models = models_of(found, [(k, p) for _, k, p in every])
    out = [Hypothesis(e, p, models[k]) for e, k, p in every if k in models and worth(found, k, p)]
    total = sum(h.probability for h in out)
    normalized = [Hypothesis(h.effects, h.probability / total, h.evaluated) for h in out]
    return sorted(normalized, key=lambda h: (-h.probability, h.effects))


def models_of(found: Inference, entries: Sequence[tuple[Set, float]]) -> dict[Set, EvaluatedModel]:
    """Return the model of each set that is worth a line: its own, or, of the MOST_LISTED likeliest
    that were not fitted, by algebra."""
    out, made = dict(found.evaluated), 0
    for key, p in sorted(entries, key=lambda x: -x[1]):
        known = all(e in found.best.model.members for e in key)
        room = made < MOST_LISTED or not key
        if key not in out and known and room and worth(found, key, p):
            out[key] = by_algebra(found.best, key)
            made += 1
    return out


def worth(found: Inference, key: Set, probability: float) -> bool:
    """Return whether a set is a hypothesis of its own."""
    return key in found.evaluated or not key or probability >= LISTED


def with_regression(found: Inference, workers: int) -> dict[Set, float]:
    """Return the probability of sets beside a free regression, which is integrated out; none where
    it predicts nothing."""
    best = found.best
    short = replace(best.model, point=shortened(best.model.point))
    freed = marginalized(short, best.prior, workers=workers)
    if freed is None:
        return {}
    sets = SetPosterior(replace(best.model, equations=freed.equations.scaled(found.mean_variance)))
    sets.enumerate([k for k, e in enumerate(sets.effects) if e in best.effects])
    # nothing more: it may be imitated
    levels = {k: v for k, v in sets.by_name().items() if len(k) <= len(best.effects)}
    top = max(levels.values())
    return {k: math.exp(v - top) for k, v in levels.items()}


def named(effects: tuple[str, ...]) -> Set:
    """Return the effects of a hypothesis without `unknown`."""
    return tuple(e for e in effects if e != UNKNOWN)


def sets_of(found: list[Hypothesis]) -> Mapping[Set, float]:
    """Return the probability of every set of named effects."""
    out: dict[Set, float] = {}
    for h in found:
        out[named(h.effects)] = out.get(named(h.effects), 0.0) + h.probability
    return out
