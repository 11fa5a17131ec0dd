"""Probabilities over hypotheses: evidence tempered by the simulator's own misfit, a prior on the number of effects.

Blocks of residuals that are alike carry less information than their samples; the data counts for as much less as they
widen the variance of estimates at the best hypothesis (Pauli, Racugno, Ventura, Stat. Sinica 21 (2011) 149, for
composite likelihoods).  `unknown` beside or instead of named effects: how likely what remains is no effect of the
library, from its size against what the simulator is known to miss (`discrepancy`).
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from model.errors import BadInput
from sandbox.gap.evidence.algebra import Algebra, Prior, sandwich
from sandbox.gap.evidence.normal import Normal
from sandbox.gap.search.judged import Judged
from sandbox.gap.search.subsets import log_prior

Array = NDArray[np.float64]
UNKNOWN = "unknown"
ACCURATE = 10.0  # floors of residual up to which the simulator's own error stays below them


@dataclass(frozen=True)
class Hypothesis:
    """Effects (perhaps with `unknown`), probability, and the judged fit behind the named ones."""

    effects: tuple[str, ...]
    probability: float
    judged: Judged


def misfit(n: Normal, equations: Algebra, prior: Prior) -> float:
    """Return by how much residuals that are alike within a block widen estimates' variance, mean over coordinates."""
    x, free, _ = equations.most_probable(prior)
    plain = equations.covariance(prior)
    robust = sandwich(n, x, plain)
    told = np.diag(equations.a) * np.where(free, prior.deviation, 1.0) ** 2 > 1.0
    own = np.flatnonzero(free & told)
    return max(1.0, float(np.mean(np.diag(robust)[own] / np.diag(plain)[own]))) if own.size else 1.0


def tempered(judged: Sequence[Judged], raw: float) -> tuple[list[tuple[float, Judged]], float]:
    """Return (probability, hypothesis), the most probable first, without regard to `unknown`; and the temperature.

    raw: normalised rms at the nominal model; what a simulator gets wrong grows with what it has to explain.
    """
    judged = [j for j in judged if math.isfinite(j.log_evidence)]
    if not judged:
        raise BadInput(
            "no hypothesis predicts finite readings for this campaign; check the units of [motor] and of the recordings"
        )
    best = max(judged, key=lambda j: j.log_evidence)
    temperature = misfit(best.normal, best.equations, best.prior) * (1.0 + raw / ACCURATE)
    score = np.array([j.tempered(temperature) + log_prior(j.effects) for j in judged])
    p = np.exp(score - score.max())
    return sorted(zip((p / p.sum()).tolist(), judged, strict=True), key=lambda x: -x[0]), temperature


def with_unknown(
    ranked: Sequence[tuple[float, Judged]], unknown: float, explained: float, beside: Judged | None = None
) -> list[Hypothesis]:
    """Return hypotheses with `unknown` beside them, the most probable first; probabilities sum to 1.

    unknown: probability that something outside the library is at work; beside: what may stand beside it (the best
    hypothesis if nothing is given); explained: share of the gap that this closes, which is how much of `unknown` goes
    beside it rather than stand alone.
    """
    out = [Hypothesis(j.effects, p * (1.0 - unknown), j) for p, j in ranked]
    best = ranked[0][1] if beside is None else beside
    alone = unknown if not best.effects else unknown * (1.0 - explained)
    out.append(Hypothesis((UNKNOWN,), alone, best))
    if best.effects:
        out.append(Hypothesis((*best.effects, UNKNOWN), unknown * explained, best))
    return sorted(out, key=lambda h: -h.probability)
