"""Which sets of effects explain a campaign: one fit of everything at once, algebra over sets, then fits of the best.

Near the truth readings are close to linear in all coordinates together, whatever effect is at work, so one fit with
every effect free (held by its prior) brings the point there.  From its equations the evidence of any set of effects is
algebra; sets grow by one effect at a time, the best few are kept.  Those that stand a chance are fitted for themselves
and weighed at their own points.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from model.effects import library
from model.errors import BadInput
from sandbox.gap.evidence import Algebra, Prior
from sandbox.gap.fit import Fit, Weights, fit
from sandbox.gap.normal import Normal, Point
from sandbox.gap.posterior import log_prior, misfit
from sandbox.gap.probes import Probe, probes, probes_at_typical
from sandbox.gap.table import Table, is_shape, probe_gains, table

Array = NDArray[np.float64]
WORTH = 10.0  # log evidence a search must bring for its effect to join the fit of everything
MOVES = 1.0  # of an ordinary size: an effect that moves less stays where it is
BEAM, MOST = 6, 3  # sets kept while growing; effects in a set
NEAR, JUDGED = 12.0, 4  # tempered log probability behind the best, and number, of sets that are fitted for themselves
FIRST, THEN, POLISH = 3, 4, 3  # Gauss-Newton steps


@dataclass(frozen=True)
class Judged:
    """A set of effects fitted and weighed: its fit, the equations of all effects there, prior and log evidence."""

    fit: Fit
    table: Table
    prior: Prior
    log_evidence: float

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
    """What a search found: judged sets, the table of everything, simulations it took."""

    judged: tuple[Judged, ...]
    everything: Table
    simulations: float


def search(
    start: Point, fitted: Weights, judged_on: Weights, *, exclude: Sequence[str] = (), workers: int = 1,
    report: Callable[[str], None] = lambda _: None,
) -> Search:  # fmt: skip
    """Return the hypotheses that stand a chance, judged.

    fitted: recordings that move parameters in the fit of everything; judged_on: recordings whose evidence counts.
    """
    report("fitting all effects at once")
    at, chosen, active, cost = everything(start, fitted, exclude, workers)
    whole = table(at, chosen, active, judged_on, workers)
    cost += whole.normal.simulations
    temperature = misfit(whole.normal, whole.equations, whole.prior(()))
    judged: dict[tuple[str, ...], Judged] = {}
    source = whole
    for _ in range(2):
        ranked = grown(source, temperature)
        top = ranked[0][0]
        for score, effects in ranked[:JUDGED]:
            if score < top - NEAR or effects in judged:
                continue
            report(f"weighing {' + '.join(effects) or 'no effect'}")
            try:
                judged[effects] = judge(source, effects, chosen, judged_on, workers)
            except BadInput:
                continue
            cost += judged[effects].fit.simulations + judged[effects].normal.simulations
        if not judged:
            judged[()] = judge(source, (), chosen, judged_on, workers)
        best = max(judged.values(), key=lambda j: j.log_evidence / temperature + log_prior(j.effects))
        source = best.table
        temperature = misfit(source.normal, source.equations, best.prior)
    return Search(tuple(judged.values()), whole, cost)


def everything(
    start: Point, weights: Weights, exclude: Sequence[str], workers: int
) -> tuple[Point, list[Probe], list[str], float]:
    """Return the point at which all effects fit together, each effect's probe, which are on there, and simulations."""
    typical = {p.effect: p for p in probes_at_typical(start, exclude)}
    searched = [e for e in typical if needs_search(e)]
    plain = [e for e in typical if e not in searched]
    values = dict(start.values)
    for effect in plain:
        values |= typical[effect].start
    first = fit(Point(start.prepared, values), plain, weights, workers=workers, steps=FIRST)
    found, cost = probes(first.point, [e for e in library.effect_names() if e not in searched])
    gains, spent = probe_gains(first, found, weights, workers)
    cost += first.simulations + spent
    active, at = list(plain), first.point
    for effect in searched:
        own = [(g, k) for k, (g, p) in enumerate(zip(gains, found, strict=True)) if p.effect == effect]
        if not own:
            continue
        gain, k = max(own)
        typical[effect] = found[k]
        if gain > WORTH:
            active.append(effect)
            at = Point(at.prepared, {**at.values, **found[k].start})
    if len(active) > len(plain):
        at = at.resmoothed()
    last = fit(at, active, weights, workers=workers, steps=THEN)
    return last.point, list(typical.values()), active, cost + last.simulations


def needs_search(effect: str) -> bool:
    """Return whether an effect must be looked for by many starts before a fit can find it."""
    own = library.load_effect(effect).parameters
    return any(p.scan for p in own) or all(p.fit in ("log", "fixed") for p in own)


def grown(source: Table, temperature: float) -> list[tuple[float, tuple[str, ...]]]:
    """Return (tempered log probability, set) of all sets met while growing from none, the most probable first."""
    names = list(source.members)
    scores: dict[tuple[str, ...], float] = {}

    def score(effects: tuple[str, ...]) -> float:
        if effects not in scores:
            scores[effects] = source.log_evidence(effects) / temperature + log_prior(effects)
        return scores[effects]

    level: list[tuple[str, ...]] = [()]
    score(())
    for _ in range(MOST):
        wider = {tuple(sorted((*s, e))) for s in level for e in names if e not in s}
        level = sorted(wider, key=lambda s: -score(s))[:BEAM]
    return sorted(((v, k) for k, v in scores.items()), reverse=True)


def judge(source: Table, effects: tuple[str, ...], chosen: Sequence[Probe], weights: Weights, workers: int) -> Judged:
    """Return a set of effects fitted from the values that algebra gives it, and weighed with all effects beside it.

    Effects whose ordinary size matters move in the fit, too.
    """
    prior = source.prior(effects)
    x, _, _ = source.equations.most_probable(prior)
    own = {k for e in effects for k in source.members[e]}
    to, beside, on = x.copy(), [], list(effects)
    values = dict(source.point.values)
    for effect, places in source.members.items():
        if effect in effects:
            continue
        probe = next(p for p in chosen if p.effect == effect)
        mine = [k for k in places if k not in own and source.narrow.deviation[k] < source.wide[k]]
        shapes = [k for k in places if is_shape(source.coordinates[k], probe)]
        if any(abs(x[k] - prior.mean[k]) > MOVES * prior.deviation[k] for k in mine):
            beside += [replace(source.coordinates[k], deviation=float(prior.deviation[k])) for k in (*mine, *shapes)]
            on.append(effect)
        else:
            to[mine] = prior.mean[mine]
    ways = [e for e in effects if any(source.coordinates[k].form == "share" for k in source.members[e])]
    for effect in ways:
        values |= dict(next(p for p in chosen if p.effect == effect).start)
    move = [k for k, c in enumerate(source.coordinates) if c.form != "share"]
    at = Point(source.point.prepared, values).moved([source.coordinates[k] for k in move], to[move])
    found = fit(at.resmoothed() if ways else at, effects, weights, workers=workers, beside=beside, steps=POLISH)
    end = table(found.point, chosen, on, weights, workers)
    return Judged(found, end, end.prior(effects), end.log_evidence(effects))
