"""One effect in the place of several: sizes that vanish together where an absent effect takes a size of its own.

A link 4 % off what the controller believes looks like a gain, a resistance, inductances and a magnet flux, each off by
4 or 7 %.  Such a set is fitted well, and no exchange of one effect for another leads from it to the one cause.  The
equations at its point tell the way there: with the absent effect at a size, all others go to where they fit best.  They
do not tell how well the set at its end fits, since on so long a way slopes change; so that set is fitted and weighed.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from model.errors import BadInput
from sandbox.gap.evidence.algebra import Prior
from sandbox.gap.evidence.fit import Weights, attempted
from sandbox.gap.search.forward import Search
from sandbox.gap.search.judged import Judged, judge
from sandbox.gap.search.needless import SIZES
from sandbox.gap.search.neighbours import POINTS
from sandbox.gap.search.parts.adding import level
from sandbox.gap.search.points import towards
from sandbox.gap.search.posterior import ACCURATE
from sandbox.gap.search.subsets import possible

Array = NDArray[np.float64]
SEVERAL = 2  # effects that one has to make vanish
FITTED = 2  # ways that are followed from one set: each is a fit of all its effects
# Of its way to nothing that a size may lack, as slopes change along it.  From 0.04 to 0.3 the ways are the same where a
# link was 4 % off (w003 of seed 20262703).
BENT = 0.15


@dataclass(frozen=True)
class Way:
    """Which effects vanish where an absent one takes a size: all coordinates there (p,), and the new one's place.

    A direction is a way on which none has vanished, its coordinates for a step of 1.
    """

    effect: str
    gone: tuple[str, ...]
    x: Array
    place: int

    def key(self, j: Judged) -> tuple[str, ...]:
        """Return the set at its end."""
        return tuple(sorted({*j.effects, self.effect} - set(self.gone)))


def with_one_for_several(
    found: Search, raw: float, weights: Weights, *, workers: int = 1, report: Callable[[str], None] = lambda _: None
) -> Search:
    """Return a search whose best set is weighed with one effect in the place of several; begun again from the new best
    set, as long as there is one.  raw: normalised rms of the nominal model."""
    t, sets, spent = 1.0 + raw / ACCURATE, {j.effects: j for j in found.judged}, 0.0
    while True:
        best = max(sets.values(), key=lambda j: level(j, t))
        left = [w for w in ways(best, t) if w.key(best) not in sets]
        for way in left[:FITTED]:
            report(f"fitting {' + '.join(way.key(best))}")
            own = _followed(best, way, found, weights, workers)
            spent += 0.0 if own is None else own.simulations + own.fit.simulations
            sets |= {} if own is None else {own.effects: own}
        if max(sets.values(), key=lambda j: level(j, t)) is best:
            break
    fitted = found.fitted | set(sets)
    return replace(found, judged=tuple(sets.values()), simulations=found.simulations + spent, fitted=fitted)


def ways(j: Judged, t: float) -> list[Way]:
    """Return the ways on which several effects of a set vanish together, those with most of them first; t: for how much
    less the data counts.

    On a way the recordings must lose less than they would if the same effects went without the new one.
    """
    sizes = {e: _sizes(j, e) for e in j.table.members}
    told: dict[tuple[str, ...], tuple[int, float, Way]] = {}
    for effect in sorted(set(j.table.members) - set(j.effects)):
        prior = j.table.prior((*j.effects, effect))
        for place in (k for k in sizes[effect] if prior.deviation[k] > 0.0 and possible((*j.effects, effect))):
            leads = _best_step(j, prior, {place: 1.0}, t)
            for way in _on(j, Way(effect, (), leads, place), {e: sizes[e] for e in j.effects}):
                lost, key = _lost(j, way.x - j.equations.x, t), way.key(j)
                if lost < _lost(j, _without(j, way.gone, sizes, t), t) and (key not in told or lost < told[key][1]):
                    told[key] = (-len(way.gone), lost, way)
    return [way for *_, way in sorted(told.values(), key=lambda x: x[:2])]


def _sizes(j: Judged, effect: str) -> tuple[int, ...]:
    """Return the places of an effect's coordinates that are sizes, no shapes."""
    return tuple(k for k in j.table.members[effect] if j.table.coordinates[k].form in SIZES)


def _best_step(j: Judged, prior: Prior, given: Mapping[int, float], t: float) -> Array:
    """Return a step (p,) of all coordinates, some of it given by place, the rest where it fits best."""
    own, steps = np.array(list(given), dtype=int), np.array(list(given.values()))
    free = np.flatnonzero((prior.deviation > 0.0) & ~np.isin(np.arange(len(prior.deviation)), own))
    a, size, out = j.equations.a / t, prior.deviation[free], np.zeros(len(prior.deviation))
    out[own] = steps
    hessian = size[:, None] * a[np.ix_(free, free)] * size + np.eye(len(free))
    out[free] = -size * np.linalg.solve(hessian, size * (a[np.ix_(free, own)] @ steps))
    return out


def _without(j: Judged, gone: Sequence[str], sizes: Mapping[str, tuple[int, ...]], t: float) -> Array:
    """Return the step (p,) on which some effects of a set go, the rest where it fits best."""
    given = {k: j.table.narrow.mean[k] - j.equations.x[k] for e in gone for k in sizes[e]}
    return _best_step(j, j.table.prior(j.effects), given, t)


def _lost(j: Judged, step: Array, t: float) -> float:
    """Return the log evidence that the recordings lose on a step (p,) from where a set fits them."""
    return float(0.5 * step @ j.equations.a @ step) / t


def _on(j: Judged, leads: Way, sizes: Mapping[str, tuple[int, ...]]) -> list[Way]:
    """Return the ways along a direction that end where a size of the set is nothing and several effects vanish."""
    nothing, x, prior = j.table.narrow.mean, j.equations.x, j.table.prior((*j.effects, leads.effect))
    near = np.maximum(POINTS * j.table.narrow.deviation, BENT * np.abs(x - nothing))
    there = [e for e, own in sizes.items() if any(abs(x[k] - nothing[k]) > near[k] for k in own)]
    out = []
    for end in (k for e in there for k in sizes[e] if leads.x[k] != 0.0):
        at = x + (nothing[end] - x[end]) / leads.x[end] * leads.x
        gone = tuple(e for e in there if all(abs(at[k] - nothing[k]) <= near[k] for k in sizes[e]))
        if len(gone) >= SEVERAL and prior.low[leads.place] <= at[leads.place] <= prior.high[leads.place]:
            out.append(Way(leads.effect, gone, at, leads.place))
    return out


def _followed(j: Judged, way: Way, found: Search, weights: Weights, workers: int) -> Judged | None:
    """Return the set at the end of a way, fitted from there and weighed; None where no drive can have it."""
    coordinates, key = j.table.coordinates, way.key(j)
    try:
        at = j.fit.point.moved(coordinates, way.x)
        begun = towards(replace(j.fit, point=at), key, found.chosen)
        start = begun.moved([coordinates[way.place]], way.x[[way.place]])
        fit = attempted(start, key, weights, leader=j.fit.objective, workers=workers)
        return None if fit is None else judge(fit, found.chosen, found.share, weights, workers)
    except BadInput:  # at its point, or beside it, some effect leaves a drive that none can be
        return None
