"""Further parts that an effect no longer needs: taken out where the set is more probable without them.

A part is added where it explains most of what the set of that time leaves.  Once more effects stand beside it, it may
explain nothing any more, and a page would list its values, all of which may be zero.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import replace

from model.effects import library
from sandbox.gap.evidence.fit import Weights, attempted
from sandbox.gap.search.estimates import estimates
from sandbox.gap.search.forward import Search
from sandbox.gap.search.judged import Judged, judge
from sandbox.gap.search.parts.adding import level
from sandbox.gap.search.posterior import ACCURATE
from sandbox.plant.sets import further_parts

Parts = tuple[tuple[str, int], ...]  # effect, number of the part


def without_idle(
    found: Search, raw: float, weights: Weights, *, workers: int = 1, report: Callable[[str], None] = lambda _: None
) -> Search:
    """Return a search whose best set has no further parts that it is more probable without.

    Tried are parts whose every size may be zero by its interval: all of them at once, then each alone.  raw:
    normalised rms of the nominal model.
    """
    t = 1.0 + raw / ACCURATE
    first = best = max(found.judged, key=lambda j: level(j, t))
    cost = 0.0
    for gone in _choices(idle(best)):
        if set(gone) & set(idle(best)):
            report("taking out parts that do nothing")
            new = _without(best, gone, found, weights, workers)
            cost += new.simulations + new.fit.simulations if new else 0.0
            if new is not None and level(new, t) > level(best, t):
                best = new
    if best is first:
        return replace(found, simulations=found.simulations + cost)
    judged = tuple(best if j is first else j for j in found.judged)
    further = {k: v for k, v in best.fit.point.values.items() if library.is_further(k)}
    return replace(found, judged=judged, simulations=found.simulations + cost, further=further)


def idle(j: Judged) -> Parts:
    """Return the further parts of a set whose every size may be zero by its 95 % interval."""
    drive, values = j.fit.point.prepared.campaign.drive, j.fit.point.values
    found, neutral, out = estimates(j), library.neutral(drive.motor), []
    for card in map(library.load_effect, j.effects):
        for k in further_parts(card, values, neutral) if card.repeats > 1 else ():
            part = card.part(k)
            names = [card.public(k, n) for n in part.switches or tuple(p.name for p in part.parameters)]
            sizes = [found[n] for n in names if n in found]
            if sizes and all(s.low <= 0.0 <= s.high for s in sizes):
                out.append((card.name, k))
    return tuple(out)


def _choices(parts: Parts) -> Iterator[Parts]:
    """Give what to take out: all parts at once, then each alone."""
    if len(parts) > 1:
        yield parts
    yield from ((p,) for p in parts)


def _without(best: Judged, gone: Parts, found: Search, weights: Weights, workers: int) -> Judged | None:
    """Return a set with parts neutral, fitted and weighed; None where no drive can have it."""
    point = best.fit.point
    neutral = library.neutral(point.prepared.campaign.drive.motor)
    named = {
        card.public(k, p.name) for e, k in gone for card in [library.load_effect(e)] for p in card.part(k).parameters
    }
    at = replace(point, values={n: neutral[n] if n in named else x for n, x in point.values.items()})
    fitted = attempted(at, best.effects, weights, leader=best.fit.objective, workers=workers)
    return None if fitted is None else judge(fitted, found.chosen, found.share, weights, workers)
