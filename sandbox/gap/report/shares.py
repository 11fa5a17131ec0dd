"""How much of the gap each effect explains, and how the gap shrinks as they are added one after the
other.

An effect is added at the size that it has in the best hypothesis, and replayed; meanwhile only
ordinary deviations follow, by algebra.  Those that are effects, too, may still deviate from the
effect's size: a resistance 12 % off is known no better than a right one.
What it then explains depends on which effects are there already: its share is the mean over all
orders of adding (Shapley, Contributions to the Theory of Games II (1953) 307).  Squared residuals
hold effects one by one and in pairs, and then this is the mean of two places, added first (`alone`)
and added last: two replays an effect, of one or two effects half as many.  What three at once or
the drive's nonlinearity add, 2 to 6 % of the gap in three campaigns of four to six effects, is
shared out in proportion, so that shares sum to what is explained.  The interval is a bootstrap over
recordings.

An effect that partly cancels others, so that the gap grows without it, has a negative share.  With
sizes refitted for each set one of two correlated effects would stand in for the other, and get half
of a gap that a bench without it still has
(`experiments.shares_truth`).

Shares are of the fit to all recordings.  The waterfall is of the fit without those held out, on
which it is told: the same fits as `gap.before` and `gap.after`, between which it lies.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from model.array_types import Array
from model.effects import library
from model.errors import BadInput
from sandbox.gap.diagnose import Diagnosis
from sandbox.gap.evidence.algebra import Prior, algebra, prior_of
from sandbox.gap.evidence.gap_size import UNDEFINED, rms
from sandbox.gap.evidence.normal import ParameterPoint, normal
from sandbox.gap.evidence.priors import STEPS, Coordinate, of_effect, ordinary
from sandbox.gap.location.where import held_at_neutral
from sandbox.gap.posterior.evaluated import EvaluatedModel
from sandbox.gap.posterior.holdout import weights_of
from sandbox.gap.posterior.hypotheses import UNKNOWN
from sandbox.gap.settings import USUAL

DRAWS = 400  # of the bootstrap


class Share(NamedTuple):
    """An effect's share of the reducible gap, its interval (NaN where there is none), and what the
    gap loses with this effect and no other."""

    value: float
    low: float
    high: float
    alone: float

    @property
    def ci95(self) -> list[float] | None:
        """The interval, None where there is none."""
        return (
            [self.low, self.high] if math.isfinite(self.low) and math.isfinite(self.high) else None
        )


@dataclass(frozen=True)
class Shares:
    """Shares by effect, largest first, and the normalised rms on the recordings held out after each
    effect of the best hypothesis is added in this order."""

    of: dict[str, Share]
    waterfall: tuple[tuple[str, float], ...]


def shares(d: Diagnosis) -> Shares:
    """Return the shares of the best hypothesis' effects; none where it names none."""
    named = tuple(e for e in d.best.effects if e != UNKNOWN)
    if not named:
        return Shares({}, ())
    found = of_set(d.best.evaluated, d.remainder.explained)
    ranked = dict(sorted(found.items(), key=lambda x: -x[1].value))
    return Shares(ranked, tuple(_waterfall(d, list(ranked))))


def of_set(j: EvaluatedModel, explained: float | None = None) -> dict[str, Share]:
    """Return the shares of a set's effects, at the sizes that they have in it.

    explained: share of the gap that the fit of the set explains, which shares sum to; None where
    the set was not fitted (its equations are those of another one's point): what it explains is
    replayed, too.  One recording has no interval, nor has a gap that so few recordings show that
    more than UNDEFINED of the draws have none.
    """
    kept = dict[frozenset[str], Array]()

    def left(gone: Sequence[str]) -> Array:
        """Return what is left where effects are missing; one effect added first is all others
        missing, of two the other one added last."""
        if (key := frozenset(gone)) not in kept:
            fitted = explained is not None and not gone
            kept[key] = j.fit.normal.by_recording()[0] if fitted else _replayed(j, gone)
        return kept[key]

    return shares_of(j.effects, left, j.fit.normal.by_recording()[1], explained)


def shares_of(
    named: Sequence[str],
    left: Callable[[Sequence[str]], Array],
    counts: Array,
    explained: float | None = None,
) -> dict[str, Share]:
    """Return the shares of effects by the squares that each recording leaves (r,) where some are
    missing; counts: (r,) of its noise; explained: as `of_set`."""
    nothing, full = left(named), left(())
    gap = nothing - counts
    alone = np.array([nothing - left([x for x in named if x != e]) for e in named])
    last = np.array([left([e]) - full for e in named])
    pick = np.random.default_rng(1).integers(full.size, size=(DRAWS, full.size))
    with np.errstate(invalid="ignore", divide="ignore"):
        # the gap as fitted
        scale = 1.0 if explained is None else explained * gap.sum() / (nothing - full).sum()
        drawn = scale * shared_out(
            alone[:, pick].sum(2), last[:, pick].sum(2), (nothing - full)[pick].sum(1)
        )
        low, high = interval_of(drawn / gap[pick].sum(1))
        if (
            full.size < 2
            or np.mean(gap[pick].sum(1) <= USUAL.misses * counts[pick].sum(1)) > UNDEFINED
        ):
            low, high = np.full((2, len(named)), math.nan)
        value = scale * shared_out(alone.sum(1), last.sum(1), (nothing - full).sum()) / gap.sum()
        single = scale * alone.sum(1) / gap.sum()
    return {e: Share(*map(float, x)) for e, *x in zip(named, value, low, high, single, strict=True)}


def interval_of(drawn: Array) -> Array:
    """Return the ends (2, n) of 95 % intervals of draws (n, draws); NaN for what no draw has a
    share of."""
    out, known = np.full((2, len(drawn)), math.nan), ~np.isnan(drawn).all(1)
    out[:, known] = np.nanpercentile(drawn[known], [2.5, 97.5], axis=1)
    return out


def shared_out(first: Array, last: Array, whole: Array) -> Array:
    """Return the means of the first and the last place (n, ...), together `whole` (...)."""
    mean = 0.5 * (first + last)
    size = np.abs(mean)
    return np.asarray(mean + (whole - mean.sum(0)) * size / size.sum(0))


def _values(j: EvaluatedModel, gone: Sequence[str]) -> Array:
    """Return the values (p,) where effects are missing, by algebra."""
    best = j.equations.most_probable(held_at_neutral(j, [])).x
    return j.equations.most_probable(only_ordinary(j, gone, best)).x


def only_ordinary(j: EvaluatedModel, gone: Sequence[str], best: Array) -> Prior:
    """Return the prior under which ordinary deviations alone are free: effects that are `gone` held
    at neutral, the others of the hypothesis at `best` (p,).  Where one is an ordinary deviation,
    too, it deviates from there."""
    prior, narrow = held_at_neutral(j, gone), j.model.narrow
    missing = {k for e in gone for k in j.model.members[e]}
    held = [k for e in j.effects if e not in gone for k in j.model.members[e] if k not in missing]
    moved = best[held] - narrow.mean[held]
    prior.mean[held] = best[held]
    prior.deviation[held] = np.where(j.model.of_effects[held], 0.0, narrow.deviation[held])
    prior.low[held], prior.high[held] = narrow.low[held] + moved, narrow.high[held] + moved
    return prior


def _replayed(j: EvaluatedModel, gone: Sequence[str]) -> Array:
    """Return the squares that each recording leaves (r,) where effects are missing; by algebra
    where that point is none that a drive can have."""
    try:
        found = normal(without(j, gone), ()).by_recording()[0]
    except BadInput:
        found = np.array([math.nan])
    return found if np.isfinite(found).all() else _predicted(j, gone)


def _predicted(j: EvaluatedModel, gone: Sequence[str]) -> Array:
    """Return the same by the equations at the best point."""
    out, shift = j.normal.by_recording()[0], _values(j, gone) - j.normal.x
    for s in j.normal.segments:
        x = shift[s.places]
        out[s.recording] += x @ s.a.sum(0) @ x - 2.0 * x @ s.g.sum(0)
    return out


def _waterfall(d: Diagnosis, ranked: Sequence[str]) -> list[tuple[str, float]]:
    """Return each effect with the normalised rms once it and those before it are added; the last is
    the fit's own."""
    chosen = list(d.held_out) or list(range(len(d.start.prepared.recordings)))
    out = []
    for k, effect in enumerate(ranked[:-1]):
        try:
            n = normal(with_part(d, ranked[k + 1 :]), ())
            out.append((effect, rms(n, chosen)))
        except BadInput:  # extrapolated: none that a drive can have
            out.append((effect, math.nan))
    return [*out, (ranked[-1], d.size.after)]


def with_part(d: Diagnosis, gone: Sequence[str]) -> ParameterPoint:
    """Return the point at which effects are missing of the fit without the recordings held out: the
    others' sizes are that fit's.  Ordinary deviations follow by its equations, which have not seen
    those recordings either; where one is an effect, too, it deviates from that effect's size."""
    n, campaign, values = d.after.normal, d.campaign, d.after.point.values
    usual = {c.label: c for c in ordinary(campaign, values)}
    own = {e: of_effect(e, campaign.drive, values) for e in d.after.effects}
    missing = {c.label: c for e in gone for c in own[e]}
    claimed = {c.label for e in own if e not in gone for c in own[e]}
    chosen = []
    for c, x in zip(n.coordinates, n.x, strict=True):
        if c.label in missing:
            chosen.append(usual.get(c.label, replace(missing[c.label], deviation=0.0)))
        elif c.label in claimed:
            chosen.append(replace(usual.get(c.label, replace(c, deviation=0.0)), mean=float(x)))
        else:
            chosen.append(c)
    weights = weights_of(len(d.start.prepared.recordings), d.held_out)
    x = algebra(n, weights).most_probable(prior_of(chosen)).x
    shapes = [e for e in gone if all(c.form == "log" for c in own[e])]
    return _brought(d.after.point, n.coordinates, x, shapes)


def is_shape_only(j: EvaluatedModel, effect: str) -> bool:
    """Return whether an effect has no size that could be taken to neutral on the way (a shaft's
    stiffness)."""
    return all(j.model.coordinates[k].form in ("log", "presence") for k in j.model.members[effect])


def without(j: EvaluatedModel, gone: Sequence[str]) -> ParameterPoint:
    """Return the point at which effects are missing and ordinary deviations follow by algebra;
    shapes at neutral."""
    shapes = [e for e in gone if is_shape_only(j, e)]
    return _brought(j.model.point, j.normal.coordinates, _values(j, gone), shapes)


def _brought(
    point: ParameterPoint, coordinates: Sequence[Coordinate], x: Array, shapes: Sequence[str]
) -> ParameterPoint:
    """Return a point with coordinates at x (p,), and effects that are nothing but shapes at
    neutral."""
    moved = [(c, to) for c, to in zip(coordinates, x, strict=True) if c.form not in STEPS]
    point = point.moved([c for c, _ in moved], np.array([to for _, to in moved]))
    neutral = library.neutral(point.prepared.campaign.drive.motor)
    begun = tuple(f"{e}." for e in shapes)
    off = {k: v for k, v in neutral.items() if begun and k.startswith(begun)}
    return replace(point, values={**point.values, **off})
