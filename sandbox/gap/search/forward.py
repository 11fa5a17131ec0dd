"""Which sets of effects explain a campaign: grown one effect at a time, each set fitted, the rivals weighed.

From a fit's point every further effect is screened by algebra: alone, and beside ordinary sizes of all others.  Near
the floor the second tells traces from causes; far from it effects hide each other there, and the first counts, too.
The best are fitted; from the two best of them sets grow on.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from sandbox.gap.evidence.discrepancy import Remainder, allowed, remainder, unlogged_counts
from sandbox.gap.evidence.fit import Fit, Weights, attempted, excess, fit, rms_of
from sandbox.gap.evidence.noise import Noise, noise_of
from sandbox.gap.evidence.normal import Point
from sandbox.gap.evidence.probes import Probe, probe_coordinates, probes
from sandbox.gap.evidence.spike_slab import gains_of, ordinary_share, table
from sandbox.gap.search.judged import Judged, judge
from sandbox.gap.search.multistart import with_sizes
from sandbox.gap.search.neighbours import CLOSE, EXCHANGED, MOST, fitted_again, neighbours, pointed
from sandbox.gap.search.points import own_values, starting, unbent, with_values
from sandbox.gap.search.subsets import possible

Array = NDArray[np.float64]
Set = Mapping[str, float]
Key = tuple[str, ...]
FITTED, PARENTS = (3, 3, 2), 2  # sets fitted at one, two, three effects; parents that grow on
WORTH = 2.0  # log evidence that one more effect must promise
TRIED = 0.5  # share of what slopes promise that a size that was tried has to reach to be started from
FAR = 1.02  # normalised rms above which effects are screened alone, too
BEHIND, RIVAL = 400.0, 0.003  # log evidence, and share of the gap, behind which a fit is no rival
JUDGED = 4
BUDGET, FURTHER = 1350, 1700  # simulations after which sets grow no further; where they have explained most so far
PROMISING = 0.2  # of the excess over noise: a set that leaves less has explained most
LAST = 1500  # simulations after which no effect is exchanged
NEAR = 10.0  # times the best set's excess over noise, up to which another set grows on, too
SETTLES = 0.01  # share of the excess: a set that leaves less ends the fitting of sets that promise less ...
# ... than this share of what was promised of it.  Far from the floor promises err by a third; a dead time promises 0.98
# of what a device drop does.
ALIKE = 0.5


@dataclass(frozen=True)
class Search:
    """What a search found: ordinary deviations alone, judged sets, simulations it took.

    fitted: all sets that were fitted; chosen, share: probes and ordinary sizes of effects, as sets are judged with;
    looked: normalised rms where starts of effects were last looked for; further: values of effects' further parts,
    where some were found (`search.parts`); noise: stated, seen and used; unlogged: squares that rounding of duties may
    leave, by recording (`discrepancy.unlogged_counts`).
    """

    null: Fit
    judged: tuple[Judged, ...]
    simulations: float
    fitted: frozenset[tuple[str, ...]]
    chosen: tuple[Probe, ...]
    share: float
    looked: float = math.inf
    further: Mapping[str, float] = field(default_factory=dict)
    noise: Noise | None = None
    unlogged: Array | None = None

    def remainder(self, after: Fit) -> Remainder:
        """Return what a fit leaves of the gap."""
        return remainder(self.null, after, allowed(after.normal, self.noise, self.unlogged))

    def judge_also(
        self, effects: tuple[str, ...], weights: Weights, workers: int, near: Fit | None = None
    ) -> Judged | None:
        """Return one more set, fitted from ordinary deviations alone and weighed; None where no drive can have it.

        near: the fit of a larger set; its values of these effects are a second start, and the better fit counts.
        """
        alone = starting(unbent(self.null.point), effects, self.chosen)
        told = [attempted(with_values(alone, own_values(effects, self.further)), effects, weights, workers=workers)]
        if near is not None:
            begun = with_values(alone, own_values(effects, near.point.values))
            told.append(attempted(begun, effects, weights, smooth=True, workers=workers))
        fits = [f for f in told if f is not None]
        if not fits:
            return None
        own = judge(min(fits, key=lambda f: f.objective), self.chosen, self.share, weights, workers)
        return replace(own, simulations=own.simulations + sum(f.simulations for f in fits))


@dataclass
class Forward:
    """A search under way: ordinary deviations alone, fits by set, sets that grow on, probes, ordinary size of effects,
    recordings that count, threads, effects left out, what stages are told to, simulations, rms where starts were looked
    for."""

    null: Fit
    fits: dict[Key, Fit]
    parents: list[Fit]
    chosen: list[Probe]
    share: float
    weights: Weights
    workers: int
    exclude: Sequence[str]
    report: Callable[[str], None]
    cost: float
    looked: float = math.inf

    def budget(self) -> int:
        """Return the simulations after which sets grow no further."""
        return FURTHER if min(map(excess, self.fits.values())) < PROMISING * excess(self.null) else BUDGET

    def fitted(self, key: Key, parent: Fit, begin: Set) -> Fit | None:
        """Return the fit of a parent's set with one effect more; None where no drive can have it."""
        self.report(f"fitting {' + '.join(key)}")
        from_here = parent.point if parent.effects else unbent(parent.point)
        at = replace(from_here, values={**from_here.values, **begin})
        leader = min(f.objective for f in self.fits.values())
        found = attempted(at, key, self.weights, smooth=bool(begin), leader=leader, workers=self.workers)
        if found is not None:
            self.fits[key], self.cost = found, self.cost + found.simulations
        return found

    def look(self, at: Fit) -> None:
        """Look for starts of effects at a fit's point, but of its own; near the floor those that were tried at another
        point count no more."""
        if len(at.effects) < MOST and rms_of(at) > FAR:
            again, spent = choose(at, self.exclude, self.weights, self.workers)
            kept = [p for p in self.chosen if p.effect in at.effects]
            self.chosen = kept + [p for p in again if p.effect not in at.effects]
            self.cost, self.looked = self.cost + spent, rms_of(at)
        else:
            self.chosen = [replace(p, sized=None, gain=0.0) for p in self.chosen]

    def judged(self, fits: Sequence[Fit]) -> list[Judged]:
        """Return fits weighed."""
        return [judge(f, self.chosen, self.share, self.weights, self.workers) for f in fits]


def search(
    start: Point, weights: Weights, *, exclude: Sequence[str] = (), workers: int = 1,
    report: Callable[[str], None] = lambda _: None,
) -> Search:  # fmt: skip
    """Return the hypotheses that stand a chance, judged, on the recordings that `weights` names."""
    report("fitting ordinary deviations")
    null = fit(start, (), weights, workers=workers)
    chosen, cost = choose(null, exclude, weights, workers)
    share, cost = ordinary_share(rms_of(null)), cost + null.simulations
    s = Forward(null, {(): null}, [null], chosen, share, weights, workers, exclude, report, cost, rms_of(null))
    for depth in range(MOST):
        if not grown(s, depth):
            break
    report("weighing hypotheses")
    judged = weighed(s)
    cost = s.cost + sum(j.simulations for j in judged)
    return Search(
        null, tuple(judged), cost, frozenset(s.fits), tuple(s.chosen), share, s.looked,
        noise=noise_of(start.prepared.campaign), unlogged=unlogged_counts(start.prepared),
    )  # fmt: skip


def grown(s: Forward, depth: int) -> bool:
    """Fit the best sets with one effect more than `depth`, and choose those that grow on; return whether one does."""
    budget = s.budget()
    if s.cost > budget and depth != 1:  # a second effect is always tried
        return False
    ranked, spent = _candidates(s)
    both = _both_best(s.fits, s.null) if depth == 1 else []
    ranked = [*both, *(r for r in ranked if r[0] not in {key for key, *_ in both})]
    s.cost += spent
    new: list[Fit] = []
    told = {key: promised for key, _, _, promised in ranked}
    for key, parent, begin, promised in ranked[: FITTED[depth]]:
        if new and (s.cost > budget or _settles(new, s.null, promised, told)):
            break
        found = s.fitted(key, parent, begin)
        new += [] if found is None else [found]
    if not new:
        return False
    least = min(new, key=lambda f: f.objective)
    before = min(f.objective for k, f in s.fits.items() if len(k) <= depth)
    if before - least.objective < 2.0 * WORTH and depth:
        return False
    others = [f for f in new if f is not least and excess(f) < NEAR * excess(least)]
    s.parents = [least, *others][:PARENTS]
    s.look(least)
    return True


def weighed(s: Forward) -> list[Judged]:
    """Return the sets that stand a chance, and those near the best of them, weighed."""
    leader = min(f.objective for f in s.fits.values())
    gate = leader + 2.0 * BEHIND + RIVAL * max(0.0, s.null.objective - leader)
    judged = s.judged(sorted((f for f in s.fits.values() if f.objective <= gate), key=lambda f: f.objective)[:JUDGED])
    tried: set[tuple[Key, Key]] = set()
    for turn in range(MOST - 1):
        exchange = EXCHANGED if s.cost + sum(j.simulations for j in judged) < LAST else 0
        best, known = max(judged, key=lambda j: j.log_evidence), {j.effects for j in judged}
        others = neighbours(best, s.fits, known, s.chosen, exchange, s.weights, s.workers)
        others += fitted_again(best, {j.effects: j.fit for j in judged}, s.null, s.chosen, tried, s.weights, s.workers)
        if not turn and excess(best.fit) < PROMISING * excess(s.null):
            others += pointed(best, s.fits, known | {f.effects for f in others}, s.chosen, s.weights, s.workers)
        s.cost += sum(f.simulations for f in others if s.fits.get(f.effects) is not f)
        s.fits |= {f.effects: f for f in others}
        judged = [j for j in judged if j.effects not in {f.effects for f in others}] + s.judged(others)
    return judged


def _both_best(fits: Mapping[Key, Fit], null: Fit) -> list[tuple[Key, Fit, Set, float]]:
    """Return the two effects that alone explain most, together, where neither settles it: beside the first one's fit,
    ordinary deviations bent, slopes may hide the second."""
    first, second, *_ = [*sorted((f for k, f in fits.items() if len(k) == 1), key=lambda f: f.objective), null, null]
    key = tuple(sorted((*first.effects, *second.effects)))
    if len(key) < 2 or not possible(key) or excess(first) < SETTLES * excess(null):
        return []
    own = own_values(second.effects, second.point.values)
    return [(key, first, own, 0.5 * (null.objective - second.objective))]


def _settles(new: Sequence[Fit], null: Fit, promised: float, told: Mapping[Key, float]) -> bool:
    """Return whether a fit explains nearly all, and more than the next set promises: less than it gained, and much less
    than had been promised of it; of effects that look alike each one explains nearly all.

    told: what was promised of each set.
    """
    least = min(new, key=lambda f: f.objective)
    gained = 0.5 * (null.objective - least.objective)
    behind = promised < min(gained - CLOSE, ALIKE * told[least.effects])
    return excess(least) < SETTLES * excess(null) and behind


def choose(found: Fit, exclude: Sequence[str], weights: Weights, workers: int) -> tuple[list[Probe], float]:
    """Return the best probe of each effect at a fit's point, far from the floor with a size to start from; and
    simulations."""
    many, cost = probes(found.point, exclude)
    several = [p for p in many if sum(q.effect == p.effect for q in many) > 1]
    gains, n, prior = gains_of(found, [probe_coordinates(found.point, p, "") for p in several], weights, workers)
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


def _candidates(s: Forward) -> tuple[list[tuple[Key, Fit, Set, float]], float]:
    """Return the sets one effect larger than their parents that promise most, by turns of both ways of screening,
    with the parent, the values of the new effect that a fit starts from, and the promised log evidence."""
    lists, cost = [], 0.0
    wider = {p.effect: p for p in s.chosen}
    for parent in s.parents:
        own = table(parent.point, s.chosen, parent.effects, s.share, s.weights, s.workers)
        cost += own.normal.simulations
        for alone in (False, True) if rms_of(parent) > FAR else (False,):
            level = own.log_evidence(parent.effects, alone=alone)
            gains = {
                e: own.log_evidence((*parent.effects, e), alone=alone) - level
                for e in wider if e not in parent.effects
            }  # fmt: skip
            lists.append([(g, e, parent) for e, g in sorted(gains.items(), key=lambda x: -x[1])])
        if len(lists) > 1 and parent is s.parents[0]:
            lists.append(sorted(((p.gain, e, parent) for e, p in wider.items() if e in gains), key=lambda x: -x[0]))
    out: dict[Key, tuple[Fit, Set, float]] = {}
    for turn in zip(*lists, strict=False):
        for gain, effect, parent in turn:
            key = tuple(sorted((*parent.effects, effect)))
            if gain > WORTH and key not in s.fits and key not in out:
                out[key] = (parent, begin(wider[effect], gain), gain)
    return [(key, *rest) for key, rest in out.items()], cost


def begin(probe: Probe, promised: float) -> Set:
    """Return the values a fit starts from: the size that was tried, unless slopes promise much more."""
    return probe.sized if probe.sized is not None and probe.gain > TRIED * promised else probe.start
