"""Further parts that an effect no longer needs: taken out where the set is more probable without them.

A part is added where it explains most of what the set of that time leaves.  Once more effects stand beside it, it may
explain nothing any more, and a page would list its values, all of which may be zero.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import replace

from model.effects import library
from model.effects.card import Effect
from sandbox.gap.evidence.fit import Weights, attempted
from sandbox.gap.evidence.normal import Point
from sandbox.gap.evidence.probes import Probe
from sandbox.gap.search.estimates import estimates
from sandbox.gap.search.forward import Search
from sandbox.gap.search.judged import Judged, judge
from sandbox.gap.search.parts.adding import level
from sandbox.gap.search.posterior import ACCURATE
from sandbox.gap.search.selection import DOUBTED
from sandbox.plant.sets import further_parts

Parts = tuple[tuple[str, int], ...]  # effect, number of the part


def on(j: Judged) -> Parts:
    """Return the parts that a set may lose: further ones, and a first one whose place one of these takes."""
    point, out = j.fit.point, list[tuple[str, int]]()
    neutral = library.neutral(point.prepared.campaign.drive.motor)
    for card in map(library.load_effect, j.effects):
        there = further_parts(card, point.values, neutral) if card.repeats > 1 else []
        out += [(card.name, k) for k in ([1, *there] if there and alike(card) else there)]
    return tuple(out)


def alike(card: Effect) -> bool:
    """Return whether further parts of an effect have the parameters of the first."""
    return [p.name for p in card.part(2).parameters] == [p.name for p in card.parameters]


def without_idle(
    found: Search, raw: float, weights: Weights, *, workers: int = 1, report: Callable[[str], None] = lambda _: None
) -> Search:
    """Return a search whose best set has no parts that it is more probable without; never an effect without a part.

    Tried are parts whose every size may be zero by its interval: all of them at once, then each alone, and so on from
    the better set.  Sets near the best one lose the same parts where they, too, are more probable so.  raw: normalised
    rms of the nominal model.
    """
    t = 1.0 + raw / ACCURATE
    first = best = max(found.judged, key=lambda j: level(j, t))
    cost, taken = 0.0, set[tuple[str, int]]()
    while idle(best):
        report("taking out parts that do nothing")
        new, gone, spent = _fewer(best, found, t, weights, workers)
        cost, taken = cost + spent, taken | set(gone)
        if new is best:
            break
        best = new
    judged = []
    for j in found.judged:
        near = j is not first and level(j, t) > level(first, t) - DOUBTED
        own = tuple(sorted(taken & set(on(j)))) if near else ()
        new, spent = _better(j, own, found, t, weights, workers) if own else (best if j is first else j, 0.0)
        judged.append(new)
        cost += spent
    further = {k: v for k, v in best.fit.point.values.items() if library.is_further(k)} if taken else found.further
    return replace(
        found, judged=tuple(judged), simulations=found.simulations + cost, further=further,
        chosen=standing(found.chosen, best.fit.point, taken),
    )  # fmt: skip


def idle(j: Judged) -> Parts:
    """Return the parts of a set that it may lose and whose every size may be zero by its 95 % interval."""
    found, out = estimates(j), []
    for effect, k in on(j):
        card = library.load_effect(effect)
        part = card.part(k)
        names = [card.public(k, n) for n in part.switches or tuple(p.name for p in part.parameters)]
        sizes = [found[n] for n in names if n in found]
        if sizes and all(s.low <= 0.0 <= s.high for s in sizes):
            out.append((effect, k))
    return tuple(out)


def _fewer(
    best: Judged, found: Search, temperature: float, weights: Weights, workers: int
) -> tuple[Judged, Parts, float]:
    """Return a set without all its parts that do nothing, where it is less probable so without one of them, where that
    is less probable, too, the set itself; what was taken out, and simulations.

    Where nothing of an effect would be left, no more than one of its parts is taken out at a time.
    """
    parts, cost = idle(best), 0.0
    there = set(on(best))
    left = {e for e, k in there if k == 1} <= {e for e, _ in there - set(parts)}
    for choices in ([parts] if len(parts) > 1 and left else [], [(p,) for p in parts]):
        told: list[tuple[Judged, Parts]] = [(best, ())]
        for gone in choices:
            new, spent = _better(best, gone, found, temperature, weights, workers)
            cost, told = cost + spent, [*told, (new, () if new is best else gone)]
        new, gone = max(told, key=lambda x: level(x[0], temperature))
        if new is not best:
            return new, gone, cost
    return best, (), cost


def _better(
    j: Judged, gone: Parts, found: Search, temperature: float, weights: Weights, workers: int
) -> tuple[Judged, float]:
    """Return a set, or the same without parts where it is more probable so; and simulations."""
    new = _without(j, gone, found, weights, workers)
    if new is None:
        return j, 0.0
    return (new if level(new, temperature) > level(j, temperature) else j), new.simulations + new.fit.simulations


def _without(best: Judged, gone: Parts, found: Search, weights: Weights, workers: int) -> Judged | None:
    """Return a set with parts neutral, fitted and weighed; None where no drive can have it."""
    at = best.fit.point
    for effect, k in sorted(gone, reverse=True):  # the first part last: the others have made room by then
        at = without_part(at, library.load_effect(effect), k)
    fitted = attempted(at, best.effects, weights, leader=best.fit.objective, workers=workers)
    chosen = standing(found.chosen, at, gone)
    return None if fitted is None else judge(fitted, chosen, found.share, weights, workers)


def standing(chosen: Sequence[Probe], point: Point, gone: Iterable[tuple[str, int]]) -> tuple[Probe, ...]:
    """Return probes with the starts of effects whose first part is gone at what took its place."""
    first = {effect for effect, k in gone if k == 1}
    return tuple(replace(p, start={n: point.values[n] for n in p.start}) if p.effect in first else p for p in chosen)


def without_part(point: Point, card: Effect, k: int) -> Point:
    """Return a point with a part neutral; in the place of the first one the next that is there, if there is one."""
    neutral = library.neutral(point.prepared.campaign.drive.motor)
    values, others = dict(point.values), further_parts(card, point.values, neutral)
    if k == 1:
        if not others:
            return point
        k = others[0]
        values |= {card.public(1, p.name): values[card.public(k, p.name)] for p in card.parameters}
    values |= {card.public(k, p.name): neutral[card.public(k, p.name)] for p in card.part(k).parameters}
    return replace(point, values=values)
