"""Which sets of effects explain a campaign: grown one effect at a time, each set fitted, the rivals weighed.

From a fit's point every further effect is screened by algebra: alone, and beside ordinary sizes of all others.  Near
the floor the second tells traces from causes; far from it effects hide each other there, and the first counts, too.
The best are fitted; from the two best of them sets grow on.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from model.effects import library
from model.errors import BadInput
from sandbox.gap.evidence import Algebra, Prior
from sandbox.gap.fit import Fit, Weights, fit
from sandbox.gap.normal import Normal, Point
from sandbox.gap.probes import Probe, probes
from sandbox.gap.table import Table, gains_of, settled, table

Array = NDArray[np.float64]
FITTED, MOST, PARENTS = (3, 3, 2), 3, 2  # sets fitted at one, two, three effects; parents that grow on
WORTH = 4.0  # log evidence that one more effect must promise
FAR = 1.02  # normalised rms above which effects are screened alone, too
BEHIND, RIVAL = 400.0, 0.003  # log evidence, and share of the gap, behind which a fit is no rival
JUDGED = 4
LITTLE = 150.0  # log evidence: an effect whose loss costs less may be none


@dataclass(frozen=True)
class Judged:
    """A set of effects fitted and weighed: its fit, the equations of all effects there, prior and log evidence."""

    fit: Fit
    table: Table
    prior: Prior
    log_evidence: float
    simulations: float

    @property
    def effects(self) -> tuple[str, ...]:
        """The effects of the hypothesis."""
        return self.fit.effects

    @property
    def normal(self) -> Normal:
        """Normal equations of all effects at its point."""
        return self.table.normal

    @property
    def equations(self) -> Algebra:
        """The same summed."""
        return self.table.equations


@dataclass(frozen=True)
class Search:
    """What a search found: judged sets and the simulations it took."""

    judged: tuple[Judged, ...]
    simulations: float


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
    parents = [null]
    for depth in range(MOST):
        ranked, spent = _candidates(parents, set(fits), chosen, weights, workers)
        cost += spent
        new: list[Fit] = []
        for key, parent, probe in ranked[: FITTED[depth]]:
            report(f"fitting {' + '.join(key)}")
            at = replace(parent.point, values={**parent.point.values, **probe.start})
            try:
                new.append(fit(at.resmoothed() if probe.start else at, key, weights, workers=workers))
            except BadInput:
                continue
            fits[key] = new[-1]
            cost += new[-1].simulations
        if not new:
            break
        least = min(new, key=lambda f: f.objective)
        before = min(f.objective for k, f in fits.items() if len(k) <= depth)
        if before - least.objective < 2.0 * WORTH and depth:
            break
        parents = [least, *(f for f in new[:PARENTS] if f is not least)][:PARENTS]
        if depth < MOST - 1 and _rms(least) > FAR:
            again, spent = choose(least, exclude, weights, workers)
            kept = [p for p in chosen if p.effect in least.effects]
            chosen = kept + [p for p in again if p.effect not in least.effects]
            cost += spent
    report("weighing hypotheses")
    leader = min(f.objective for f in fits.values())
    gate = leader + 2.0 * BEHIND + RIVAL * max(0.0, null.objective - leader)
    rivals = sorted((f for f in fits.values() if f.objective <= gate), key=lambda f: f.objective)[:JUDGED]
    judged = [judge(f, chosen, weights, workers) for f in rivals]
    for _ in range(MOST - 1):
        best, known = max(judged, key=lambda j: j.log_evidence), {j.effects for j in judged}
        fewer = [f for f in _without_one(best, fits, weights, workers) if f.effects not in known]
        cost += sum(f.simulations for f in fewer if f.effects not in fits)
        fits |= {f.effects: f for f in fewer}
        judged += [judge(f, chosen, weights, workers) for f in fewer]
    return Search(tuple(judged), cost + sum(j.simulations for j in judged))


def _without_one(best: Judged, fits: Mapping[tuple[str, ...], Fit], weights: Weights, workers: int) -> list[Fit]:
    """Return fits of the best set with one effect left out, where algebra says that little is lost."""
    out, neutral = [], library.neutral(best.fit.point.prepared.campaign.drive.motor)
    for effect in best.effects:
        rest = tuple(e for e in best.effects if e != effect)
        if best.table.log_evidence(rest) < best.log_evidence - LITTLE:
            continue
        values = {k: neutral[k] if k.partition(".")[0] == effect else v for k, v in best.fit.point.values.items()}
        out.append(fits.get(rest) or fit(replace(best.fit.point, values=values), rest, weights, workers=workers))
    return out


def _rms(f: Fit) -> float:
    return float(np.sqrt(sum(s.rr.sum() for s in f.normal.segments) / sum(s.n.sum() for s in f.normal.segments)))


def choose(found: Fit, exclude: Sequence[str], weights: Weights, workers: int) -> tuple[list[Probe], float]:
    """Return the best probe of each effect at a fit's point, and simulations."""
    many, cost = probes(found.point, exclude)
    several = [p for p in many if sum(q.effect == p.effect for q in many) > 1]
    gains, spent = gains_of(found, several, weights, workers) if several else ([], 0.0)
    best: dict[str, tuple[float, Probe]] = {p.effect: (0.0, p) for p in many if p not in several}
    for gain, probe in zip(gains, several, strict=True):
        if probe.effect not in best or gain > best[probe.effect][0]:
            best[probe.effect] = (gain, probe)
    return [p for _, p in best.values()], cost + spent


def _candidates(
    parents: Sequence[Fit], tried: set[tuple[str, ...]], chosen: Sequence[Probe], weights: Weights, workers: int
) -> tuple[list[tuple[tuple[str, ...], Fit, Probe]], float]:
    """Return the sets one effect larger than their parents that promise most, by turns of both ways of screening."""
    lists, cost = [], 0.0
    for parent in parents:
        own = table(parent.point, chosen, parent.effects, weights, workers)
        cost += own.normal.simulations
        for alone in (False, True) if _rms(parent) > FAR else (False,):
            level = own.log_evidence(parent.effects, alone=alone)
            wider = [p for p in chosen if p.effect not in parent.effects]
            ranked = [
                (own.log_evidence((*parent.effects, p.effect), alone=alone) - level, k, p) for k, p in enumerate(wider)
            ]
            lists.append([(gain, probe, parent) for gain, _, probe in sorted(ranked, key=lambda x: -x[0])])
    out: dict[tuple[str, ...], tuple[Fit, Probe]] = {}
    for turn in zip(*lists, strict=False):
        for gain, probe, parent in turn:
            key = tuple(sorted((*parent.effects, probe.effect)))
            if gain > WORTH and key not in tried and key not in out:
                out[key] = (parent, probe)
    return [(key, parent, probe) for key, (parent, probe) in out.items()], cost


def judge(found: Fit, chosen: Sequence[Probe], weights: Weights, workers: int) -> Judged:
    """Return a fit weighed with all effects beside it, at the point to which their ordinary sizes move it."""
    first = table(found.point, chosen, found.effects, weights, workers)
    prior = first.prior(found.effects)
    last, cost = settled(first, prior, weights, workers)
    return Judged(found, last, prior, last.log_evidence(found.effects), cost + first.normal.simulations)
