"""Why two hypotheses cannot be told apart here: how alike their effects look, how flat the
likelihood is between them.

Cosine of an effect with its rivals, by the equations at the fit that has it.  Its slopes s along
the fitted size leave r'r beside ordinary deviations and shared effects, and less where the rival
can step in,

    cos^2 = 1 - [r'r left beside all that and the rival] / [r'r left beside all that],

1: the same thing on these recordings.  The likelihood is that of simulations on the straight way
from one fit to the other, all parameters going along: a lower bound of the profile likelihood, flat
where the
recordings cannot choose.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from model.array_types import Array
from model.errors import BadInput
from sandbox.gap.diagnose import Diagnosis
from sandbox.gap.evidence.algebra import Algebra, Prior
from sandbox.gap.evidence.fit import coordinates_of
from sandbox.gap.evidence.normal import ParameterPoint, normal
from sandbox.gap.evidence.priors import Coordinate
from sandbox.gap.posterior.evaluated import EvaluatedModel
from sandbox.gap.posterior.hypotheses import UNKNOWN
from sandbox.replay.map_error import with_map_error
from sandbox.replay.replay import Prepared

WAY = np.linspace(0.0, 1.0, 9)  # shares of the way from the second fit to the first


@dataclass(frozen=True)
class Alike:
    """Two hypotheses that were not told apart: each effect that they do not share with its cosine,
    and log likelihoods (0: the best) where a simulation stands a `share` of the way from the second
    fit to the first."""

    first: tuple[str, ...]
    second: tuple[str, ...]
    cosines: dict[str, float]
    share: tuple[float, ...]
    log_likelihood: tuple[float, ...]


def alike(d: Diagnosis) -> Alike | None:
    """Return how alike the two most probable fitted hypotheses of an ambiguity set are; None where
    there is one only (what is too slight to fit has no fit to go to), or where both are the same
    but for how large an ordinary deviation may be: then the prior decides."""
    fitted = {id(j) for j in d.evaluated}
    named = [h for h in d.ambiguity_set if UNKNOWN not in h.effects and id(h.evaluated) in fitted]
    if len(named) < 2:
        return None
    a, b = (h.evaluated for h in named[:2])
    cosines = _cosines(a, b.effects) | _cosines(b, a.effects)
    if not cosines:
        return None
    gains = _way(a, b) / d.variance
    kept = np.isfinite(gains)
    shares, gains = WAY[kept], gains[kept] - gains[kept].max()
    return Alike(a.effects, b.effects, cosines, tuple(map(float, shares)), tuple(map(float, gains)))


def _cosines(j: EvaluatedModel, other: Sequence[str]) -> dict[str, float]:
    """Return the cosine of each effect that only this hypothesis has with what only the other
    has."""
    rival = tuple(e for e in other if e not in j.effects)
    found = {e: _cosine(j, e, rival) for e in j.effects if e not in other}
    return {e: c for e, c in found.items() if c is not None}


def _cosine(j: EvaluatedModel, effect: str, rival: tuple[str, ...]) -> float | None:
    """Return one cosine; with ordinary deviations where there is no rival; None where the effect is
    one but for its size, or has no size at the fit."""
    t, equations = j.model, j.equations
    if any(e not in t.members for e in rival):
        return None
    rest = tuple(e for e in j.effects if e != effect)
    without, with_ = t.prior(rest), t.prior((*rest, *rival))
    wide = t.prior(j.effects)
    sizes = t.of_effects & (without.deviation < wide.deviation)
    places = np.array([k for k in t.members[effect] if sizes[k]], dtype=np.int64)
    move = equations.most_probable(wide).x[places] - wide.mean[places]
    whole = float(move @ equations.a[np.ix_(places, places)] @ move)
    if not whole > 0.0:
        return None
    left = [left_by(equations, places, move, p) for p in (without, with_)]
    share = left[1] / left[0] if rival else left[0] / whole
    return math.sqrt(max(0.0, 1.0 - share))


def left_by(equations: Algebra, places: NDArray[np.int64], move: Array, prior: Prior) -> float:
    """Return the squares of a move's slopes that the other coordinates, within their prior, cannot
    take up."""
    others = np.setdiff1d(np.flatnonzero(prior.deviation > 0.0), places)
    slopes = equations.a[np.ix_(others, places)] @ move
    m = equations.a[np.ix_(others, others)] + np.diag(prior.deviation[others] ** -2)
    whole = float(move @ equations.a[np.ix_(places, places)] @ move)
    return whole - float(slopes @ np.linalg.solve(m, slopes))


def _way(a: EvaluatedModel, b: EvaluatedModel) -> Array:
    """Return the log likelihood at shares WAY of the way from b's fit to a's, -inf where no drive
    can be."""
    both = tuple(dict.fromkeys((*a.effects, *b.effects)))
    own = {k: v for k, v in b.fit.point.values.items() if k.partition(".")[0] in b.effects}
    base = ParameterPoint(
        a.fit.point.prepared,
        {**a.fit.point.values, **own},
        {**b.fit.point.turns, **a.fit.point.turns},
    )
    coordinates = coordinates_of(base, both)
    ends = [np.array([_at(j, c, both) for c in coordinates]) for j in (a, b)]
    out = []
    for share in WAY:
        point = base.moved(coordinates, share * ends[0] + (1.0 - share) * ends[1])
        turned = {
            f: share * a.fit.point.turns.get(f, 0.0) + (1.0 - share) * b.fit.point.turns.get(f, 0.0)
            for f in point.turns
        }
        try:
            shown = normal(replace(point, turns=turned, prepared=_between(a, b, share)), ())
            out.append(-0.5 * sum(float(s.ssr.sum()) for s in shown.segments))
        except BadInput:
            out.append(-math.inf)
    return np.array(out)


def _between(a: EvaluatedModel, b: EvaluatedModel, share: float) -> Prepared:
    """Return the campaign with a flux map's error at a share of the way from b's to a's."""
    ends = [j.fit.point.prepared.map_error for j in (a, b)]
    if ends[0] is None or ends[1] is None:
        return a.fit.point.prepared
    own = replace(ends[0], x=share * ends[0].x + (1.0 - share) * ends[1].x)
    return with_map_error(a.fit.point.prepared, own)


def _at(j: EvaluatedModel, c: Coordinate, effects: Sequence[str]) -> float:
    """Return a coordinate at a fit; of an effect that it lacks, neutral (or where a companion
    starts: its mean)."""
    missing = any(c.names[0].startswith(f"{e}.") for e in effects if e not in j.effects)
    kept = c.label in {k.label for k in j.fit.coordinates}
    return c.mean if missing and not kept else c.value(j.fit.point.values)
