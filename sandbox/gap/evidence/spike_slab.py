"""Equations of all effects at one point, and the evidence of any set of effects by algebra.

Every effect has an ordinary size, too, a small share of the wide prior: unless a hypothesis claims an effect, its
coordinates stay in the equations with that narrow prior.  So a trace of an effect, or a trace of the simulator's own
error that resembles one, is no discovery.  That error grows with what there is to explain, and the share with it.
A companion (time constant, frequency) is a shape, not a size: one prior for both.

How large a claimed effect is nobody knows beforehand: its evidence is the mean over SIZES, shares of the wide prior,
each on top of the ordinary size.  So a small effect is not held against a large one's prior.  Traces may have either
sign: an error of the simulator need not keep to an effect's bounds.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from model.effects import library
from sandbox.gap.evidence.algebra import Algebra, Prior, algebra, prior_of
from sandbox.gap.evidence.fit import Fit, Weights, objective, tried
from sandbox.gap.evidence.normal import Normal, Point, normal
from sandbox.gap.evidence.priors import Coordinate, of_effect, ordinary
from sandbox.gap.evidence.probes import Probe, probe_coordinates

Array = NDArray[np.float64]
ROUNDS, SETTLED = 8, 0.5  # steps to a table's most probable point; promised gain of the objective that ends them
SIZES = (1.0, 0.5, 0.25, 0.125)  # shares of an effect's wide prior, alike in probability
TRACE = 4.0  # deviations that a trace may have, to either side
# Shares of the wide prior; normalised rms that doubles the smallest.  Two to three times the error that was measured
# (rms, its tail is heavy): experiments/ordinary_size.py.
SMALL, LARGEST, GROWS = 0.01, 0.06, 7.0


@dataclass(frozen=True)
class Table:
    """Equations at a point, priors where no effect and where all are claimed, places of each effect's coordinates."""

    point: Point
    normal: Normal
    equations: Algebra
    narrow: Prior
    wide: Prior
    members: Mapping[str, tuple[int, ...]]
    of_effects: NDArray[np.bool_]  # coordinates that are no ordinary deviation

    @property
    def coordinates(self) -> tuple[Coordinate, ...]:
        """All coordinates, turns last."""
        return self.normal.coordinates

    def prior(self, effects: Sequence[str], *, alone: bool = False) -> Prior:
        """Return the prior of a set of effects: wide for these, narrow for all others (alone: none of the others)."""
        claimed = self._places(effects)
        n, w = self.narrow, self.wide
        if alone:
            n = n.with_deviation(np.where(self.of_effects, 0.0, n.deviation))
        parts = ((n.mean, w.mean), (n.deviation, w.deviation), (n.low, w.low), (n.high, w.high))
        return Prior(*(np.where(claimed, b, a) for a, b in parts))

    def log_evidence(self, effects: Sequence[str], *, alone: bool = False, temperature: float = 1.0) -> float:
        """Return the log evidence of a set of effects; temperature: the data counts for as much less, priors do not.

        One effect's size is averaged over at a time, the others' held where they are most probable.
        """
        equations, prior = self.equations.scaled(temperature), self.prior(effects, alone=alone)
        traces = self.of_effects & ~self._places(effects) & (prior.deviation < self.wide.deviation)
        reach = TRACE * prior.deviation
        loose = Prior(
            prior.mean, prior.deviation, np.where(traces, prior.mean - reach, prior.low),
            np.where(traces, prior.mean + reach, prior.high),
        )  # fmt: skip
        level, averaged = equations.log_evidence(loose), 0.0
        for effect in effects:
            sized = [loose.with_deviation(self._sized(effect, loose.deviation, share)) for share in SIZES]
            told = np.array([level, *(equations.log_evidence(p) for p in sized[1:])])
            k = int(np.argmax(told))
            if not math.isfinite(told[k]):
                return -math.inf
            level, loose = float(told[k]), sized[k]
            averaged += float(np.log(np.mean(np.exp(told - told[k]))))
        return level + averaged

    def _places(self, effects: Sequence[str]) -> NDArray[np.bool_]:
        """Return which coordinates belong to effects (p,)."""
        out = np.zeros(len(self.narrow.mean), dtype=bool)
        for effect in effects:
            out[list(self.members[effect])] = True
        return out

    def _sized(self, effect: str, deviation: Array, share: float) -> Array:
        """Return deviations (p,) with an effect's a share of its wide ones, on top of its ordinary ones."""
        own = np.hypot(self.narrow.deviation, share * self.wide.deviation)
        size = self._places([effect]) & (self.narrow.deviation < self.wide.deviation) & (share < 1.0)
        return np.where(size, own, deviation)


def settled(t: Table, prior: Prior, weights: Weights, workers: int) -> tuple[Table, float, float]:
    """Return a table at its most probable point under a prior, slopes kept, what slopes promise there that no step
    could gain (of the objective), and simulations.

    All coordinates move together (never a share): a part of the way where the whole one leads up.
    """
    value, cost = objective(t.normal, prior, weights), 0.0
    shares = np.array([c.form == "share" for c in t.coordinates])
    part, promised = 1.0, 0.0
    for _ in range(ROUNDS):
        x = np.where(shares, t.normal.x, t.equations.most_probable(prior).x)
        promised = value - t.equations.objective(x, prior)
        if promised < SETTLED:
            promised = 0.0
            break
        trial = t.point.moved(t.coordinates, t.normal.x + part * (x - t.normal.x))
        reached, n = tried(t.normal, trial, prior, weights, workers)
        cost += 1.0
        if n is None or reached >= value:
            part *= 0.25
            if part < 0.05:
                break
            continue
        promised -= value - reached
        value = reached
        t = replace(t, point=trial, normal=n, equations=algebra(n, weights))
    return replace(t, normal=t.normal.bare()), max(0.0, promised), cost


def is_shape(c: Coordinate, probe: Probe) -> bool:
    """Return whether a coordinate of an effect is a companion rather than a size."""
    return c.form in ("log", "share") or c.names[0] in probe.start


def ordinary_share(rms: float) -> float:
    """Return the ordinary size of effects, a share of their wide priors, where ordinary deviations leave that rms."""
    return min(LARGEST, SMALL * (1.0 + rms / GROWS))


def table(
    point: Point, chosen: Sequence[Probe], active: Sequence[str], share: float, weights: Weights, workers: int
) -> Table:
    """Return the equations of all effects (one probe each) at a point; active: effects that are on there; share:
    ordinary size of the others."""
    campaign = point.prepared.campaign
    narrow = {c.label: c for c in ordinary(campaign)}
    usual, claimed = set(narrow), dict(narrow)
    groups = {}
    probed = {p.effect for p in chosen}
    for probe in [*chosen, *(Probe(e, {}) for e in active if e not in probed)]:
        if probe.effect in active:
            own = of_effect(probe.effect, campaign.drive, {**point.values, **probe.start})
        else:
            own = probe_coordinates(point, probe, "")
        for c in own:
            own_share = share * library.load_effect(probe.effect).trace
            narrow.setdefault(c.label, c if is_shape(c, probe) else replace(c, deviation=own_share * c.deviation))
            if c.deviation >= claimed.get(c.label, c).deviation:
                claimed[c.label] = c
        groups[probe.effect] = [c.label for c in own]
    n = normal(point, [claimed[label] for label in narrow], workers=workers)
    place = {c.label: k for k, c in enumerate(n.coordinates)}
    unclaimed = [narrow.get(c.label, c) for c in n.coordinates]
    unclaimed = [replace(c, deviation=0.0) if c.form == "share" else c for c in unclaimed]
    other = np.array([c.label not in usual and c.form != "turn" for c in n.coordinates])
    members = {effect: tuple(place[label] for label in labels) for effect, labels in groups.items()}
    return Table(point, n, algebra(n, weights), prior_of(unclaimed), prior_of(n.coordinates), members, other)


def gains_of(
    found: Fit, candidates: Sequence[Sequence[Coordinate]], weights: Weights, workers: int
) -> tuple[list[float], Normal, Prior]:
    """Return the log evidence that each candidate's coordinates would add to a fit, the equations at its point, and the
    fit's own prior."""
    own = [c for c in found.coordinates if c.form != "turn"]
    parts = [[replace(c, label=f"{c.label}@{k}") for c in part] for k, part in enumerate(candidates)]
    n = normal(found.point, [*own, *(c for part in parts for c in part)], workers=workers)
    place = {c.label: k for k, c in enumerate(n.coordinates)}
    prior, equations = prior_of(n.coordinates), algebra(n, weights)
    base = prior.deviation.copy()
    base[[place[c.label] for part in parts for c in part]] = 0.0
    level = equations.log_evidence(prior.with_deviation(base))
    gains = []
    for part in parts:
        deviation, mine = base.copy(), [place[c.label] for c in part]
        deviation[mine] = prior.deviation[mine]
        gains.append(equations.log_evidence(prior.with_deviation(deviation)) - level)
    return gains, n, prior.with_deviation(base)
