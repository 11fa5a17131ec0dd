"""Effects that a set no longer needs: the set without them is weighed beside it.

An effect is added where it explains most of what the set of that time leaves.  Once more effects stand beside it, it
may explain nothing any more.  The rivals that algebra holds best at the set's point may all lack an effect that is
needed, where algebra takes a trace of that effect for enough; then no rival lacks only what does nothing.

Slopes also overrate an effect that stands for a common scale of others: an error of the link beside inductances 10 %
off was worth a log evidence of 24 by algebra at its point, and 2 where the set without it was fitted.
"""

from __future__ import annotations

from collections.abc import Callable, Collection
from dataclasses import replace

from model.errors import BadInput
from sandbox.gap.evidence.fit import Weights, attempted
from sandbox.gap.evidence.priors import of_effect
from sandbox.gap.search.estimates import spread
from sandbox.gap.search.forward import Search
from sandbox.gap.search.judged import Judged, judge
from sandbox.gap.search.parts.adding import level
from sandbox.gap.search.points import towards
from sandbox.gap.search.posterior import ACCURATE
from sandbox.gap.search.selection import DOUBTED, STRANGE
from sandbox.gap.search.subsets import Subsets

SIZES = ("linear", "reciprocal", "cosine", "sine")  # forms of coordinates that are sizes, no shapes


def with_fewer(
    found: Search, raw: float, weights: Weights, *, workers: int = 1, report: Callable[[str], None] = lambda _: None
) -> Search:
    """Return a search whose best set is weighed without the effects that do nothing in it, too.

    Without all of them; where that is less probable, without each, and without each that is in doubt.  Begun again from
    the new best set, as long as there is one.  raw: normalised rms of the nominal model.
    """
    t, sets, spent, needed = 1.0 + raw / ACCURATE, {j.effects: j for j in found.judged}, 0.0, set[str]()
    while True:
        best = max(sets.values(), key=lambda j: level(j, t))
        nothing = needless(best)
        strange = found.remainder(best.fit).unknown >= STRANGE
        asked = [e for e in (() if strange else doubted(best, t)) if e not in needed]
        for keys in ([_without(best, nothing)], [_without(best, (e,)) for e in dict.fromkeys((*nothing, *asked))]):
            new = [k for k in dict.fromkeys(keys) if k not in sets]
            for key in new:
                report(f"fitting {' + '.join(key) or 'ordinary deviations'}")
                own = _fewer(best, key, found, weights, workers)
                spent += 0.0 if own is None else own.simulations + own.fit.simulations
                sets |= {} if own is None else {key: own}
            if any(k in sets and level(sets[k], t) > level(best, t) for k in keys):
                break
        gone = {e: sets.get(_without(best, (e,))) for e in asked}
        needed |= {e for e, j in gone.items() if j is not None and level(j, t) < level(best, t) - DOUBTED}
        if max(sets.values(), key=lambda j: level(j, t)) is best:
            break
    fitted = found.fitted | set(sets)
    return replace(found, judged=tuple(sets.values()), simulations=found.simulations + spent, fitted=fitted)


def _without(j: Judged, gone: Collection[str]) -> tuple[str, ...]:
    """Return the effects of a set that are not gone."""
    return tuple(e for e in j.effects if e not in gone)


def needless(j: Judged) -> tuple[str, ...]:
    """Return the effects of a set, of two or more, whose every size may be nothing by its 95 % interval; never one that
    has shapes only, as a shaft."""
    s, point = spread(j), j.fit.point
    place, drive, out = s.place, point.prepared.campaign.drive, []
    for effect in j.effects if len(j.effects) > 1 else ():
        own = [c for c in of_effect(effect, drive, point.values) if c.form in SIZES and c.label in place]
        ends = [(s.ends[0][place[c.label]], c.mean, s.ends[1][place[c.label]]) for c in own]
        if ends and all(low <= nothing <= high for low, nothing, high in ends):
            out.append(effect)
    return tuple(out)


def doubted(j: Judged, t: float) -> tuple[str, ...]:
    """Return the effects of a set, of two or more, without which it is hardly less probable by the equations at its
    point; t: for how much less the data counts."""
    near, several = Subsets(j.table, t), j.effects if len(j.effects) > 1 else ()
    level = near.weigh(j.effects)
    return tuple(e for e in several if near.weigh(_without(j, (e,))) > level - DOUBTED)


def _fewer(best: Judged, key: tuple[str, ...], found: Search, weights: Weights, workers: int) -> Judged | None:
    """Return a smaller set, fitted from the best one's values and weighed; None where no drive can have it."""
    at, leader = towards(best.fit, key, found.chosen), best.fit.objective
    fit = attempted(at, key, weights, leader=leader, workers=workers) if key else found.null
    try:
        return None if fit is None else judge(fit, found.chosen, found.share, weights, workers)
    except BadInput:  # beside its point some effect leaves a drive that none can be
        return None
