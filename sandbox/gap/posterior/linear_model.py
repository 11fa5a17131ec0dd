"""The campaign linearised at a point: equations of all coordinates, and their priors with and
without each effect.

Every effect has a trace, too, a small share of its wide prior: unless a set names an effect, its
columns stay in the equations with that narrow prior (spike and slab).  So a trace of an effect, or
of the simulator's own error that resembles one, is no discovery.  That error grows with what there
is to explain, and the trace with it.  A companion (time constant, frequency) is a shape, not a
size: one prior for both.  Traces may have either sign.

How large a named effect is nobody knows beforehand: its evidence is the mean over `Settings.sizes`,
shares of the wide prior, each on top of the trace.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from model.array_types import Array
from model.effects import library
from model.parameters import Drive
from sandbox.gap.evidence.algebra import Algebra, Prior, prior_of
from sandbox.gap.evidence.extended import extended
from sandbox.gap.evidence.fit import Weights, objective, tried
from sandbox.gap.evidence.normal import NormalEquations, ParameterPoint
from sandbox.gap.evidence.priors import STEPS, Coordinate, of_effect, ordinary
from sandbox.gap.posterior.candidates import Candidate
from sandbox.gap.settings import USUAL, Settings

# steps to the most probable point; promised gain of the objective that ends them
ROUNDS, SETTLED = 8, 0.5
TRACE = 4.0  # deviations that a trace may have, to either side
# of its deviation: how far a candidate of nothing but shapes may move that is not named
HELD = 1e-4


@dataclass(frozen=True)
class LinearModel:
    """Equations at a point, priors where no effect and where every candidate is named, places of
    each candidate's coordinates; of_effects: coordinates that are no ordinary deviation (p,)."""

    point: ParameterPoint
    normal: NormalEquations
    equations: Algebra
    narrow: Prior
    wide: Prior
    candidates: tuple[Candidate, ...]
    places: tuple[tuple[int, ...], ...]
    of_effects: NDArray[np.bool_]
    settings: Settings = USUAL

    @property
    def coordinates(self) -> tuple[Coordinate, ...]:
        """All coordinates, turns last."""
        return self.normal.coordinates

    @cached_property
    def members(self) -> dict[str, tuple[int, ...]]:
        """The places of each effect's coordinates, its first candidate's where it has several."""
        out: dict[str, tuple[int, ...]] = {}
        for c, own in zip(self.candidates, self.places, strict=True):
            out.setdefault(c.effect, own)
        return out

    def prior(self, effects: Sequence[str], *, alone: bool = False) -> Prior:
        """Return the prior of a set of effects: wide for these, narrow for all others (alone: none
        of the others)."""
        named, n, w = self._places(effects), self.narrow, self.wide
        if alone:
            n = n.with_deviation(np.where(self.of_effects, 0.0, n.deviation))
        parts = ((n.mean, w.mean), (n.deviation, w.deviation), (n.low, w.low), (n.high, w.high))
        return Prior(*(np.where(named, b, a) for a, b in parts))

    def log_evidence(self, effects: Sequence[str]) -> float:
        """Return the log evidence of a set of effects, bounds included.

        One effect's size is averaged over at a time, the others' held where they are most probable.
        """
        prior = self.prior(effects)
        traces = self.of_effects & ~self._places(effects) & (prior.deviation < self.wide.deviation)
        reach = TRACE * prior.deviation
        low = np.where(traces, prior.mean - reach, prior.low)
        loose = Prior(
            prior.mean, prior.deviation, low, np.where(traces, prior.mean + reach, prior.high)
        )
        level, averaged = 0.0 if effects else self.equations.log_evidence(loose), 0.0
        for effect in effects:
            sized = [
                loose.with_deviation(self._sized(effect, loose.deviation, x))
                for x in self.settings.sizes
            ]
            evidences = np.array([self.equations.log_evidence(p) for p in sized])
            k = int(np.argmax(evidences))
            if not math.isfinite(evidences[k]):
                return -math.inf
            level, loose = float(evidences[k]), sized[k]
            averaged += float(np.log(np.mean(np.exp(evidences - evidences[k]))))
        return level + averaged

    def _places(self, effects: Sequence[str]) -> NDArray[np.bool_]:
        """Return which coordinates belong to effects (p,)."""
        out = np.zeros(len(self.narrow.mean), dtype=bool)
        for effect in effects:
            out[list(self.members[effect])] = True
        return out

    def _sized(self, effect: str, deviation: Array, share: float) -> Array:
        """Return deviations (p,) with an effect's a share of its wide ones, on top of its
        trace's."""
        own = np.hypot(self.narrow.deviation, share * self.wide.deviation)
        size = self._places([effect]) & (self.narrow.deviation < self.wide.deviation)
        return np.where(size, own, deviation)

    def settled(self, prior: Prior, weights: Weights, workers: int) -> LinearModel:
        """Return the model at its most probable point under a prior, slopes kept.

        All coordinates move together (shapes alone never): a part of the way where the whole one
        leads up.
        """
        t, value, part = self, objective(self.normal, prior, weights), 1.0
        shares = np.array([c.form in STEPS for c in t.coordinates])
        for _ in range(ROUNDS):
            x = np.where(shares, t.normal.x, t.equations.most_probable(prior).x)
            if value - t.equations.objective(x, prior) < SETTLED:
                break
            trial = t.point.moved(t.coordinates, t.normal.x + part * (x - t.normal.x))
            reached, n = tried(t.normal, trial, prior, weights, workers)
            if n is None or reached >= value:
                part *= 0.25
                if part < 0.05:
                    break
                continue
            value, t = reached, replace(t, point=trial, normal=n, equations=equations(n, weights))
        return replace(t, normal=t.normal.bare())


def equations(n: NormalEquations, weights: Weights) -> Algebra:
    """Return the equations summed over segments with their weights."""
    a, g, ssr = n.summed(weights)
    return Algebra(a, g, ssr, n.x)


class Linearisation(NamedTuple):
    """How equations are taken: share of the wide prior that a trace has, settings, threads."""

    trace: float
    settings: Settings = USUAL
    workers: int = 1


def linear_model(
    point: ParameterPoint,
    candidates: Sequence[Candidate],
    active: Sequence[str],
    how: Linearisation,
    weights: Weights,
    known: NormalEquations | None = None,
) -> LinearModel:
    """Return the equations of all candidates at a point.

    active: effects that are on there, of which no other candidate counts (but further parts);
    weights: of segments; known: equations that were taken at this very point.
    """
    usual = {c.label: c for c in ordinary(point.prepared.campaign, point.values)}
    columns = _Columns(point.values, usual, dict(usual), dict(usual), [], [])
    count = {
        e: sum(c.effect == e and c.part == 1 for c in candidates) for e in library.effect_names()
    }
    for effect in active:
        first = next(
            (c for c in candidates if c.effect == effect and c.part == 1), Candidate(effect)
        )
        drive = point.prepared.campaign.drive
        columns.add(first, _active(first, drive, point.values), how.trace)
    for k, c in enumerate(candidates):
        if c.effect not in active or c.part > 1:
            label = f"@{k}" if columns.has(c) else ""
            share = how.trace / math.sqrt(max(1, count[c.effect]))
            columns.add(c, c.coordinates(point, label), share)
    return columns.model(point, weights, how.settings, known, how.workers)


def _active(known: Candidate, drive: Drive, values: Mapping[str, float]) -> list[Coordinate]:
    """Return the coordinates of an effect that is on; of one that has no size, whether it is
    there."""
    # of the form that is on
    start = {k: x for k, x in known.start.items() if (x == 0.0) == (values[k] == 0.0)}
    own = of_effect(known.effect, drive, {**values, **start}, values)
    if any(c.form != "log" for c in own):
        return own
    neutral = library.neutral(drive.motor)
    off = tuple((k, v) for k, v in neutral.items() if k.startswith(f"{known.effect}."))
    return [*own, Coordinate(f"{known.effect} present", 0.0, 1.0, "presence", own[0].names, off)]


@dataclass
class _Columns:
    """Columns as they come in: values at the point, ordinary coordinates; by label with their
    narrow and wide priors; candidates with their labels."""

    values: Mapping[str, float]
    usual: Mapping[str, Coordinate]
    narrow: dict[str, Coordinate]
    wide: dict[str, Coordinate]
    candidates: list[Candidate]
    labels: list[list[str]]

    def has(self, candidate: Candidate) -> bool:
        """Return whether another candidate of the same part of an effect has columns already."""
        return any(
            (c.effect, c.part) == (candidate.effect, candidate.part) for c in self.candidates
        )

    def add(self, candidate: Candidate, own: Sequence[Coordinate], trace: float) -> None:
        """Add a candidate's columns; those that are ordinary deviations are there already.

        Another column of such a parameter (a finite change of it) is a trace beside it, and none at
        the point: what the parameter has there the ordinary one has.
        """
        share = trace * library.load_effect(candidate.effect).trace
        for c in own:
            shape = c.form == "log" or (c.form not in STEPS and c.names[0] in candidate.start)
            held = HELD if c.form in STEPS else share
            narrow = c if shape else replace(c, deviation=held * c.deviation)
            if c.label not in self.usual and c.names[0] in self.usual:
                narrow = replace(narrow, mean=c.value(self.values))
            self.narrow.setdefault(c.label, narrow)
            if c.deviation >= self.wide.get(c.label, c).deviation:
                self.wide[c.label] = c
        self.candidates.append(candidate)
        self.labels.append([c.label for c in own])

    def model(
        self,
        point: ParameterPoint,
        weights: Weights,
        settings: Settings,
        known: NormalEquations | None,
        workers: int,
    ) -> LinearModel:
        """Return the equations of all columns: of those that are known, else taken at the point."""
        own = [self.wide[label] for label in self.narrow]
        n = extended(known, point, own, workers=workers)
        place = {c.label: k for k, c in enumerate(n.coordinates)}
        other = np.array([c.label not in self.usual and not c.of_point for c in n.coordinates])
        return LinearModel(
            point,
            n,
            equations(n, weights),
            prior_of([self.narrow.get(c.label, c) for c in n.coordinates]),
            prior_of(n.coordinates),
            tuple(self.candidates),
            tuple(tuple(place[x] for x in own) for own in self.labels),
            other,
            settings,
        )
