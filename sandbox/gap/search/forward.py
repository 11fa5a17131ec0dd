"""Which sets of effects explain a campaign: grown one effect at a time, each set fitted, the rivals weighed.

From a fit's point every further effect is screened by algebra: alone, and beside ordinary sizes of all others.  Near
the floor the second tells traces from causes; far from it effects hide each other there, and the first counts, too.
The best are fitted; from the two best of them sets grow on.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from model.effects import library
from model.errors import BadInput
from sandbox.gap.evidence.fit import Fit, Weights, fit, stray
from sandbox.gap.evidence.normal import Point
from sandbox.gap.evidence.priors import ordinary, with_usual_sign
from sandbox.gap.evidence.probes import Probe, probes
from sandbox.gap.evidence.spike_slab import gains_of, ordinary_share, table
from sandbox.gap.search.judged import Judged, judge
from sandbox.gap.search.multistart import with_sizes
from sandbox.gap.search.subsets import possible

Array = NDArray[np.float64]
Set = Mapping[str, float]
FITTED, MOST, PARENTS = (3, 3, 2), 3, 2  # sets fitted at one, two, three effects; parents that grow on
WORTH = 2.0  # log evidence that one more effect must promise
TRIED = 0.5  # share of what slopes promise that a size that was tried has to reach to be started from
FAR = 1.02  # normalised rms above which effects are screened alone, too
BEHIND, RIVAL = 400.0, 0.003  # log evidence, and share of the gap, behind which a fit is no rival
JUDGED = 4
BUDGET, FURTHER = 1350, 1700  # simulations after which sets grow no further; where they have explained most so far
PROMISING = 0.2  # of the excess over noise: a set that leaves less has explained most
LAST = 1500  # simulations after which no effect is exchanged
LITTLE = 150.0  # log evidence: an effect whose loss costs less may be none
CLOSE, EXCHANGED = 60.0, 2  # log evidence within which another effect may stand in one's place; most of them tried
BETTER = 1.0  # of the objective: a fit from another start that is better by less is the same
POINTS = 3.3  # standard deviations (one in a thousand) beyond which an ordinary deviation points to its effect
NEAR = 10.0  # times the best set's excess over noise, up to which another set grows on, too
SETTLES = 0.01  # share of the excess: a set that leaves less ends the fitting of sets that promise less


@dataclass(frozen=True)
class Search:
    """What a search found: ordinary deviations alone, judged sets, simulations it took.

    fitted: all sets that were fitted; chosen, share: probes and ordinary sizes of effects, as sets are judged with.
    """

    null: Fit
    judged: tuple[Judged, ...]
    simulations: float
    fitted: frozenset[tuple[str, ...]]
    chosen: tuple[Probe, ...]
    share: float

    def judge_also(self, effects: tuple[str, ...], weights: Weights, workers: int) -> Judged | None:
        """Return one more set, fitted from ordinary deviations alone and weighed; None where no drive can have it."""
        try:
            start = starting(unbent(self.null.point), effects, self.chosen)
            found = fit(start, effects, weights, workers=workers)
        except BadInput:
            return None
        own = judge(found, self.chosen, self.share, weights, workers)
        return replace(own, simulations=own.simulations + found.simulations)


def search(
    start: Point, weights: Weights, *, exclude: Sequence[str] = (), workers: int = 1,
    report: Callable[[str], None] = lambda _: None,
) -> Search:  # fmt: skip
    """Return the hypotheses that stand a chance, judged, on the recordings that `weights` names."""
    report("fitting ordinary deviations")
    null = fit(start, (), weights, workers=workers)
    fits: dict[tuple[str, ...], Fit] = {(): null}
    chosen, cost = choose(null, exclude, weights, workers)
    cost += null.simulations
    parents, share = [null], ordinary_share(rms_of(null))
    for depth in range(MOST):
        budget = FURTHER if min(map(excess, fits.values())) < PROMISING * excess(null) else BUDGET
        if cost > budget and depth != 1:  # a second effect is always tried
            break
        ranked, spent = _candidates(parents, set(fits), chosen, share, weights, workers)
        both = _both_best(fits, null) if depth == 1 else []
        ranked = [*both, *(r for r in ranked if r[0] not in {key for key, *_ in both})]
        cost += spent
        new: list[Fit] = []
        for key, parent, begin, promised in ranked[: FITTED[depth]]:
            if new and (cost > budget or _settles(new, null, promised)):
                break
            report(f"fitting {' + '.join(key)}")
            from_here = parent.point if parent.effects else unbent(parent.point)
            at = replace(from_here, values={**from_here.values, **begin})
            try:
                new.append(fit(at.resmoothed() if begin else at, key, weights, workers=workers))
            except BadInput:
                continue
            cost += new[-1].simulations
            if math.isfinite(new[-1].objective):
                fits[key] = new[-1]
            else:
                new.pop()
        if not new:
            break
        least = min(new, key=lambda f: f.objective)
        before = min(f.objective for k, f in fits.items() if len(k) <= depth)
        if before - least.objective < 2.0 * WORTH and depth:
            break
        others = [f for f in new if f is not least and excess(f) < NEAR * excess(least)]
        parents = [least, *others][:PARENTS]
        if depth < MOST - 1 and rms_of(least) > FAR:
            again, spent = choose(least, exclude, weights, workers)
            kept = [p for p in chosen if p.effect in least.effects]
            chosen = kept + [p for p in again if p.effect not in least.effects]
            cost += spent
        else:
            chosen = [replace(p, sized=None, gain=0.0) for p in chosen]  # they were tried at another point
    report("weighing hypotheses")
    leader = min(f.objective for f in fits.values())
    gate = leader + 2.0 * BEHIND + RIVAL * max(0.0, null.objective - leader)
    rivals = sorted((f for f in fits.values() if f.objective <= gate), key=lambda f: f.objective)[:JUDGED]
    judged = [judge(f, chosen, share, weights, workers) for f in rivals]
    for turn in range(MOST - 1):
        exchange = EXCHANGED if cost + sum(j.simulations for j in judged) < LAST else 0
        best, known = max(judged, key=lambda j: j.log_evidence), {j.effects for j in judged}
        others = _neighbours(best, fits, known, chosen, exchange, weights, workers)
        others += fitted_again(best, {j.effects: j.fit for j in judged}, null, chosen, weights, workers)
        if not turn and excess(best.fit) < PROMISING * excess(null):
            others += _pointed(best, fits, known | {f.effects for f in others}, chosen, weights, workers)
        cost += sum(f.simulations for f in others if fits.get(f.effects) is not f)
        fits |= {f.effects: f for f in others}
        judged = [j for j in judged if j.effects not in {f.effects for f in others}]
        judged += [judge(f, chosen, share, weights, workers) for f in others]
    cost += sum(j.simulations for j in judged)
    return Search(null, tuple(judged), cost, frozenset(fits), tuple(chosen), share)


def _both_best(fits: Mapping[tuple[str, ...], Fit], null: Fit) -> list[tuple[tuple[str, ...], Fit, Set, float]]:
    """Return the two effects that alone explain most, together, where neither settles it: beside the first one's fit,
    ordinary deviations bent, slopes may hide the second."""
    first, second, *_ = [*sorted((f for k, f in fits.items() if len(k) == 1), key=lambda f: f.objective), null, null]
    key = tuple(sorted((*first.effects, *second.effects)))
    if len(key) < 2 or not possible(key) or excess(first) < SETTLES * excess(null):
        return []
    own = {k: v for k, v in second.point.values.items() if k.startswith(f"{second.effects[0]}.")}
    return [(key, first, own, 0.5 * (null.objective - second.objective))]


def _neighbours(
    best: Judged,
    fits: Mapping[tuple[str, ...], Fit],
    known: set[tuple[str, ...]],
    chosen: Sequence[Probe],
    exchange: int,
    weights: Weights,
    workers: int,
) -> list[Fit]:
    """Return fits of the best set with one effect left out, or exchanged for another, where algebra says that little
    is lost."""
    out = []
    for effect in best.effects:
        rest = tuple(e for e in best.effects if e != effect)
        keys = [rest]
        if best.table.log_evidence(rest) < best.log_evidence - LITTLE:
            others = [tuple(sorted((*rest, e))) for e in best.table.members if e not in best.effects]
            told = {k: best.table.log_evidence(k) for k in others}
            keys = [k for k in sorted(told, key=lambda k: -told[k]) if told[k] > best.log_evidence - CLOSE][:exchange]
        for key in keys:
            if key not in known:
                with suppress(BadInput):  # none a drive can have
                    out.append(fits.get(key) or fit(towards(best.fit, key, chosen), key, weights, workers=workers))
    return out


def fitted_again(
    best: Judged, fits: Mapping[tuple[str, ...], Fit], null: Fit, chosen: Sequence[Probe], weights: Weights,
    workers: int,
) -> list[Fit]:  # fmt: skip
    """Return better fits of sets that were fitted and lack one effect of the best: from its point, and from ordinary
    deviations alone.  A rival that is left out is not dismissed for the minimum that its first fit ended in."""
    out = []
    for effect in best.effects if len(best.effects) > 1 else ():
        rest = tuple(e for e in best.effects if e != effect)
        old = fits.get(rest)
        if old is None:
            continue
        for start in (towards(best.fit, rest, chosen), starting(unbent(null.point), rest, chosen)):
            with suppress(BadInput):  # none a drive can have
                found = fit(start, rest, weights, workers=workers)
                if found.objective < old.objective - BETTER:
                    old = found
        if old is not fits[rest]:
            out.append(old)
    return out


def _pointed(
    best: Judged,
    fits: Mapping[tuple[str, ...], Fit],
    known: set[tuple[str, ...]],
    chosen: Sequence[Probe],
    weights: Weights,
    workers: int,
) -> list[Fit]:
    """Return a fit of the best set with the effect of an ordinary deviation beyond POINTS, added or in
    another's place, as algebra says: such a deviation is what is left to a cause that is not in the set."""
    far = {c.effect for c, z in stray(best.fit).values() if abs(z) > POINTS}
    told: dict[tuple[str, ...], float] = {}
    for effect in sorted(far & set(best.table.members) - set(best.effects)):
        keys = [tuple(sorted({*best.effects, effect} - {e})) for e in best.effects]
        keys += [tuple(sorted((*best.effects, effect)))] if len(best.effects) < MOST else []
        told |= {k: best.table.log_evidence(k) for k in keys if k not in known}
    if not told:
        return []
    key = max(told, key=lambda k: told[k])
    try:
        return [fits.get(key) or fit(towards(best.fit, key, chosen), key, weights, workers=workers)]
    except BadInput:  # none a drive can have
        return []


def towards(best: Fit, key: Sequence[str], chosen: Sequence[Probe]) -> Point:
    """Return a fit's point with the effects that another set lacks at neutral, and those it has more begun."""
    campaign = best.point.prepared.campaign
    neutral, kept = library.neutral(campaign.drive.motor), {c.label for c in ordinary(campaign)}
    gone = tuple(f"{e}." for e in best.effects if e not in key)
    own = [k for k in neutral if k.startswith(gone) and k not in kept]
    off = {k: neutral[k] for k in own if k.partition(".")[2] not in library.SHARED}
    start = replace(best.point, values={**best.point.values, **off})
    return starting(start, [e for e in key if e not in best.effects], chosen)


def starting(point: Point, effects: Sequence[str], chosen: Sequence[Probe]) -> Point:
    """Return a point with the companions of effects where their probes start."""
    begun = {k: v for p in chosen if p.effect in effects for k, v in p.start.items()}
    return replace(point, values={**point.values, **begun})


def unbent(point: Point) -> Point:
    """Return a point without effects whose currents' signs are the usual ones: where a fit with effects begins."""
    return replace(point, values=with_usual_sign(point.values, point.prepared.campaign.drive.motor))


def _settles(new: Sequence[Fit], null: Fit, promised: float) -> bool:
    """Return whether a fit explains nearly all, more than slopes promise of the next."""
    least = min(new, key=lambda f: f.objective)
    gained = 0.5 * (null.objective - least.objective)
    return excess(least) < SETTLES * excess(null) and promised < gained - CLOSE


def excess(f: Fit) -> float:
    """Return the objective above what noise alone makes of it, at least its standard deviation."""
    count = float(sum(s.n.sum() for s in f.normal.segments))
    return float(max(f.objective - count, np.sqrt(2.0 * count)))


def rms_of(f: Fit) -> float:
    """Return the normalised rms of a fit over all segments."""
    return float(np.sqrt(sum(s.rr.sum() for s in f.normal.segments) / sum(s.n.sum() for s in f.normal.segments)))


def choose(found: Fit, exclude: Sequence[str], weights: Weights, workers: int) -> tuple[list[Probe], float]:
    """Return the best probe of each effect at a fit's point, far from the floor with a size to start from; and
    simulations."""
    many, cost = probes(found.point, exclude)
    several = [p for p in many if sum(q.effect == p.effect for q in many) > 1]
    gains, n, prior = gains_of(found, several, weights, workers)
    best: dict[str, tuple[float, Probe]] = {p.effect: (0.0, p) for p in many if p not in several}
    for gain, probe in zip(gains, several, strict=True):
        if probe.effect not in best or gain > best[probe.effect][0]:
            best[probe.effect] = (gain, probe)
    chosen, spent = [p for _, p in best.values()], 0.0
    if rms_of(found) > FAR:
        wider = [p for p in chosen if p.effect not in found.effects]
        sized, spent = with_sizes(found, wider, n, prior, weights, workers)
        chosen = [p for p in chosen if p.effect in found.effects] + sized
    return chosen, cost + n.simulations + spent


def _candidates(
    parents: Sequence[Fit],
    tried: set[tuple[str, ...]],
    chosen: Sequence[Probe],
    share: float,
    weights: Weights,
    workers: int,
) -> tuple[list[tuple[tuple[str, ...], Fit, Mapping[str, float], float]], float]:
    """Return the sets one effect larger than their parents that promise most, by turns of both ways of screening,
    with the parent, the values of the new effect that a fit starts from, and the promised log evidence."""
    lists, cost = [], 0.0
    wider = {p.effect: p for p in chosen}
    for parent in parents:
        own = table(parent.point, chosen, parent.effects, share, weights, workers)
        cost += own.normal.simulations
        for alone in (False, True) if rms_of(parent) > FAR else (False,):
            level = own.log_evidence(parent.effects, alone=alone)
            gains = {
                e: own.log_evidence((*parent.effects, e), alone=alone) - level
                for e in wider if e not in parent.effects
            }  # fmt: skip
            lists.append([(g, e, parent) for e, g in sorted(gains.items(), key=lambda x: -x[1])])
        if len(lists) > 1 and parent is parents[0]:
            lists.append(sorted(((p.gain, e, parent) for e, p in wider.items() if e in gains), key=lambda x: -x[0]))
    out: dict[tuple[str, ...], tuple[Fit, Mapping[str, float], float]] = {}
    for turn in zip(*lists, strict=False):
        for gain, effect, parent in turn:
            key = tuple(sorted((*parent.effects, effect)))
            if gain > WORTH and key not in tried and key not in out:
                out[key] = (parent, begin(wider[effect], gain), gain)
    return [(key, *rest) for key, rest in out.items()], cost


def begin(probe: Probe, promised: float) -> Mapping[str, float]:
    """Return the values a fit starts from: the size that was tried, unless slopes promise much more."""
    return probe.sized if probe.sized is not None and probe.gain > TRIED * promised else probe.start
