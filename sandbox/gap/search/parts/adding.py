"""Further parts of effects that can have several: the next order of a harmonic, of the cogging torque.

A search names an effect by its first part, or by none where only another order is there.  So once it has ended, every
order that a card scans is weighed by algebra beside the best set, the best one is fitted, and so on until no order is
worth its place: a part has to bring what an effect has to, and as much more as so many orders were tried.

An effect that is not in the set may have to begin with several orders at once (`parts/together.py`).
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from functools import partial
from itertools import product

from model.effects import library
from model.effects.card import Part
from sandbox.gap.evidence.fit import Weights, attempted, excess, rms_of
from sandbox.gap.evidence.normal import Point
from sandbox.gap.evidence.priors import of_part
from sandbox.gap.evidence.probes import scanned
from sandbox.gap.evidence.spectrum import best_values
from sandbox.gap.evidence.spike_slab import gains_of
from sandbox.gap.search.forward import WORTH, Search
from sandbox.gap.search.judged import Judged, judge
from sandbox.gap.search.parts.together import Screened, Start, together
from sandbox.gap.search.points import towards
from sandbox.gap.search.posterior import ACCURATE
from sandbox.gap.search.selection import CLOSES, DOUBTED, OPEN, PROMISED, SPENT
from sandbox.gap.search.subsets import log_prior
from sandbox.plant.sets import further_parts

BEGUN = 1e-3  # of an amplitude's typical size: a part that a fit begins with is on, and hardly more


def with_parts(
    found: Search, raw: float, weights: Weights, *, exclude: Sequence[str] = (), workers: int = 1,
    report: Callable[[str], None] = lambda _: None,
) -> Search:  # fmt: skip
    """Return a search whose best set has as many parts of its effects as the recordings show.

    Where the set leaves a gap that `unknown` may have to explain, orders of effects that are not in it are tried, too:
    one that is there must close half of it.  raw: normalised rms of the nominal model.
    """
    t = 1.0 + raw / ACCURATE
    grown, cost = _grown(found, t, exclude, weights, workers, report)
    values: Mapping[str, float] = grown[-1].fit.point.values if grown else {}
    if grown:
        report("weighing hypotheses")
        others = _without(grown[-1], found, t, weights, workers)
        cost += sum(j.simulations + j.fit.simulations for j in others)
        grown += others
    sets: dict[tuple[str, ...], Judged] = {}
    for j in (*found.judged, *grown):
        if j.effects not in sets or j.fit.objective < sets[j.effects].fit.objective:
            sets[j.effects] = j
    further = {k: v for k, v in values.items() if library.is_further(k)} or found.further
    return replace(
        found, judged=tuple(sets.values()), simulations=found.simulations + cost, fitted=found.fitted | set(sets),
        further=further,
    )  # fmt: skip


def in_parts(found: Search) -> tuple[str, ...]:
    """Return the effects of a search's best set that can have several parts."""
    best = max(found.judged, key=lambda j: j.log_evidence)
    return tuple(e for e in best.effects if library.load_effect(e).repeats > 1)


def _grown(
    found: Search, t: float, exclude: Sequence[str], weights: Weights, workers: int, report: Callable[[str], None]
) -> tuple[list[Judged], float]:
    """Return the best set with one part more, and one more than that, as long as each is worth it; and simulations.

    t: for how much less the data counts.
    """
    best, cost, out = max(found.judged, key=lambda j: j.log_evidence), 0.0, list[Judged]()
    while cost < SPENT:
        tried, looked = starts(best.fit.point, candidates(best, found, exclude))
        if not tried:
            break
        gains, n, prior = gains_of(best.fit, [s.coordinates for s in tried], weights, workers)
        cost, price = cost + n.simulations, WORTH + math.log(looked)
        worth = price * max(t, rms_of(best.fit) ** 2)
        promising = _promising(best, tried, gains, worth)
        promising += together(best, tried, Screened(n, prior, weights), worth)
        ranked = [start for _, start in sorted(promising, key=lambda x: -x[0])]
        new, spent = _tried(best, ranked, price, found, t, weights, workers, report)
        cost += spent
        if new is None:
            break
        best = new
        out.append(new)
    return out, cost


def _promising(best: Judged, tried: Sequence[Start], gains: Sequence[float], worth: float) -> list[tuple[float, Start]]:
    """Return the starts whose log evidence promises what they must be worth, with what they promise; of an effect that
    is not in the set one that promises as much of the gap as it has to close."""
    half = 0.5 * (1.0 - CLOSES[0]) * excess(best.fit)
    told = zip(gains, tried, strict=True)
    return [(g, s) for g, s in told if g > worth and (s.effect in best.effects or g > half)]


def _tried(
    best: Judged, promising: Sequence[Start], price: float, found: Search, temperature: float, weights: Weights,
    workers: int, report: Callable[[str], None],
) -> tuple[Judged | None, float]:  # fmt: skip
    """Return the best set with the first part that is worth its price, at most PROMISED fitted; and simulations."""
    cost = 0.0
    for start in promising[:PROMISED]:
        report(f"fitting another part of {start.effect}")
        new = _with(best, start, found, weights, workers)
        cost += new.simulations + new.fit.simulations if new else 0.0
        if new is not None and _worth(new, best, price * start.parts, temperature):
            return new, cost
    return None, cost


def candidates(best: Judged, found: Search, exclude: Sequence[str]) -> list[str]:
    """Return the effects of which another part is looked for: those of the best set, and where it leaves a gap those
    that a search of first parts may have missed.

    The latter only where a rotor turns: at one that stands every order is a constant and looks like a saturation.
    """
    turns = any(r.rotor != "locked" for r in best.fit.point.prepared.recordings)
    if not turns or found.remainder(best.fit).unknown < OPEN:
        return list(best.effects)
    others = [
        e for e in library.effect_names() if e not in {*best.effects, *exclude} and library.load_effect(e).further
    ]
    return [*best.effects, *others]


def _worth(new: Judged, best: Judged, price: float, temperature: float) -> bool:
    """Return whether a set with one part more is better by the price of a part, one with another effect also by half of
    the gap."""
    t = max(temperature, rms_of(best.fit) ** 2)
    return level(new, t) - level(best, t) >= price and (
        new.effects == best.effects or excess(new.fit) < CLOSES[0] * excess(best.fit)
    )


def _without(best: Judged, found: Search, temperature: float, weights: Weights, workers: int) -> list[Judged]:
    """Return the best set without each effect that its parts may have made needless, fitted and weighed; and the same
    of the best of these, as long as one is better.

    All but those about which the recordings are clear.  Of an effect with a frequency or an order the equations of one
    point do not say what is left without it: they would hold the frequency where the search once began.
    """
    out: list[Judged] = []
    while True:
        rests = []
        for gone in best.effects:
            rest = tuple(e for e in best.effects if e != gone)
            told = best.table.log_evidence(rest, temperature=temperature) + log_prior(rest)
            if shaped(gone) or told > level(best, temperature) - DOUBTED:
                at, leader = towards(best.fit, rest, found.chosen), best.fit.objective
                own = attempted(at, rest, weights, leader=leader, workers=workers)
                rests += [] if own is None else [judge(own, found.chosen, found.share, weights, workers)]
        out += rests
        first = max(rests, key=lambda j: level(j, temperature), default=best)
        if level(first, temperature) <= level(best, temperature):
            return out
        best = first


def shaped(effect: str) -> bool:
    """Return whether an effect has a frequency or an order that is looked for beside its size."""
    return any(p.scan for p in library.load_effect(effect).parameters)


def starts(point: Point, effects: Sequence[str]) -> tuple[list[Start], int]:
    """Return the parts that effects may have beyond those that are on at a point; and how many were looked at."""
    out, looked = list[Start](), 0
    for effect in effects:
        card = library.load_effect(effect)
        on = further_parts(card, point.values, library.neutral(point.prepared.campaign.drive.motor))
        k = next((k for k in range(2, card.repeats + 1) if k not in on), None)
        if k is not None:
            told, count = _scanned(point, card.part(k), partial(card.public, k))
            own = [_begun(point, effect, k, values) for values in told]
            out += [s for s in own if s.coordinates]
            looked += count - sum(not s.coordinates for s in own)
    return out, looked


def _scanned(point: Point, part: Part, public: Callable[[str], str]) -> tuple[list[dict[str, float]], int]:
    """Return the values at which a part is tried: those of an amplitude with a phase that explain most, else all; and
    how many values there are."""
    choices, looked = [], 1
    for p in part.parameters:
        if p.scan and p.scan[2]:
            values = scanned(p, point.prepared.campaign.drive.motor.pole_pairs)
            looked *= len(values)
            if part.polar:
                values = best_values(point, (public(part.polar[0]), public(part.polar[1])), public(p.name), values)
            choices.append([(public(p.name), x) for x in values])
    return ([dict(c) for c in product(*choices)], looked) if choices else ([], 0)


def _begun(point: Point, effect: str, k: int, values: Mapping[str, float]) -> Start:
    """Return the start of an effect's k-th part at scanned values."""
    drive, card = point.prepared.campaign.drive, library.load_effect(effect)
    part, along = card.part(k), tuple(values.items())
    own = of_part(card, k, drive, {**point.values, **values})
    moved = {c.names[0] for c in own}
    sizes = {
        card.public(k, p.name): BEGUN * p.typical_for(drive.motor, drive.converter)
        for p in part.parameters if p.name in part.switches and card.public(k, p.name) in moved
    }  # fmt: skip
    return Start(effect, {**values, **sizes}, tuple(replace(c, along=along) for c in own), k)


def _with(best: Judged, start: Start, found: Search, weights: Weights, workers: int) -> Judged | None:
    """Return the best set with one part more, fitted and weighed; None where no drive can have it."""
    at = replace(best.fit.point, values={**best.fit.point.values, **start.begun})
    key, leader = tuple(sorted({*best.effects, start.effect})), best.fit.objective
    new = attempted(at, key, weights, leader=leader, workers=workers)
    return None if new is None else judge(new, found.chosen, found.share, weights, workers)


def level(j: Judged, temperature: float) -> float:
    """Return the log posterior of a set, as hypotheses are weighed."""
    return j.tempered(temperature) + log_prior(j.effects)
