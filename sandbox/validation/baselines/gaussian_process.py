"""A stronger simple method: effects beside a Gaussian process for all that no effect explains.

The discrepancy's scales are learnt on the residual that ordinary deviations leave (`discrepancy_process.py`).  Then the
effect whose set has most evidence beside the process joins, one at a time, as long as evidence grows; each set's
evidence is that of its own linearisation, with the amplitudes out of FACTORS that suit it best.  Every effect has the
prior odds of one among all that the library has.  What the parameters leave, the process' part included, is `unknown`.
"""

from __future__ import annotations

import math
import time
from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from model.effects.library import effect_names
from sandbox.gap.evidence.algebra import Algebra, prior_of
from sandbox.gap.evidence.normal import Point, counted, normal
from sandbox.gap.evidence.priors import Coordinate, ordinary, with_usual_sign
from sandbox.gap.evidence.probes import Probe, probes
from sandbox.recordings.campaign import read_campaign
from sandbox.validation.baselines import discrepancy_process as gp
from sandbox.validation.baselines import refit as fit
from sandbox.validation.baselines.answer import Answer, answer
from sandbox.validation.baselines.refit import UNFITTED, Estimates
from sandbox.validation.baselines.screening import Columns, columns, held_but, owner

SAMPLED, TRIES = 4000, 100  # readings that scales are learnt from, and how often they are weighed: some seconds
BEGIN = gp.Scales(1.0, 1.0, 0.5, 0.5, 0.7)  # a floor; half of rated current and top speed; a sixth of a turn
FACTORS = (1.0, 0.3, 0.1, 0.03, 0.01)  # of the amplitudes: they fall as effects take over
TRIED = 2  # effects that are fitted, should the first not keep what slopes promise
ROUNDS, SHARES = 2, (1.0, 0.5, 0.25)  # of Gauss-Newton; of a step, tried in turn
MOST = 3000  # simulations, as `stepwise`


@dataclass(frozen=True)
class Process:
    """A campaign's discrepancy: operating points, random frequencies, scales, and effects that may not be named."""

    where: Sequence[gp.Where]
    drawn: gp.Array
    scales: gp.Scales
    exclude: tuple[str, ...]

    def beside(self, point: Point, coordinates: Sequence[Coordinate]) -> gp.Beside:
        """Return the equations of a point and the products of features there."""
        n = normal(point, coordinates)
        return gp.Beside(n.bare(), gp.grams_of(gp.parts_of(point, n, self.where), len(n.x), self.scales, self.drawn))


class Stand(NamedTuple):
    """A set of effects at its own linearisation: equations of its coordinates and of all that may join; amplitudes and
    log evidence, prior odds included."""

    effects: tuple[str, ...]
    point: Point
    columns: Columns
    equations: gp.Beside
    scales: gp.Scales
    evidence: float

    @property
    def free(self) -> dict[str, Coordinate]:
        """The coordinates that move, by label."""
        return {c.label: c for c in self.columns.known}


class Named(NamedTuple):
    """A set with its log evidence and its parameters."""

    effects: tuple[str, ...]
    evidence: float
    own: Mapping[str, Any]


def by_gaussian_process(folder: Path, exclude: tuple[str, ...] = ()) -> Answer:
    """Answer by the effects that have most evidence beside a Gaussian process."""
    started, campaign, spent = time.perf_counter(), read_campaign(folder), list[float]()
    with counted(spent.append):
        null, raw = fit.nuisances(campaign)
        process = process_of(null.point, exclude)
        path = [stand(process, null.point, ())]
        while sum(spent) < MOST and (found := grown(process, path[-1])) is not None:
            path.append(found)
    last = path[-1]
    named = [*neighbours(last), *(Named(s.effects, s.evidence, {}) for s in path[:-1])]
    most = max(s.evidence for s in named)
    best = {frozenset(s.effects): s for s in sorted(named, key=lambda s: s.evidence)}  # of two of one set the better
    ranked = [(s.effects, math.exp(max(s.evidence - most, -700.0)), s.own) for s in best.values()]
    return answer(campaign, ranked[::-1], (raw, null.rms, left(last)), started, round(sum(spent)))


def process_of(point: Point, exclude: tuple[str, ...]) -> Process:
    """Return the discrepancy whose scales suit what ordinary deviations leave at a point."""
    where, drawn = gp.places_of(point), gp.frequencies()
    n = normal(point, ordinary(point.prepared.campaign))
    parts = gp.thinned(gp.parts_of(point, n, where), SAMPLED)
    scales = gp.learnt(parts, n.x, prior_of(n.coordinates), drawn, BEGIN, TRIES)
    return Process(where, drawn, scales, exclude)


def odds(effects: Sequence[str]) -> float:
    """Return the log prior odds of a set: each effect is one among all."""
    return -len(effects) * math.log(len(effect_names()))


def stand(process: Process, point: Point, effects: tuple[str, ...]) -> Stand:
    """Return a set linearised at a point, beside all that may join it."""
    choices, _ = probes(point, (*process.exclude, *effects))
    cols = columns(point, fit.with_effects(point, effects), choices)
    found = process.beside(point, cols.every)
    prior = held_but(found.normal, {c.label: c for c in cols.known})
    each = [process.scales.times(f) for f in FACTORS]
    value, scales = max((found.log_evidence(s, prior), s) for s in each)
    return Stand(effects, point, cols, found, scales, value + odds(effects))


def grown(process: Process, here: Stand) -> Stand | None:
    """Return the set with one effect more that has more evidence where it is fitted; None where there is none."""
    for probe, promised in joined(here)[:TRIED]:
        if promised <= here.evidence:
            return None
        unbent = with_usual_sign(here.point.values, here.point.prepared.campaign.drive.motor)
        begin, coordinates = fit.with_effect(replace(here.point, values=unbent), probe, here.effects)
        with suppress(*UNFITTED):
            point = moved(process, begin, coordinates, here.scales)
            found = stand(process, point.resmoothed(), (*here.effects, probe.effect))
            if found.evidence > here.evidence:
                return found
    return None


def joined(here: Stand) -> list[tuple[Probe, float]]:
    """Return by effect its best probe and the evidence that its joining promises, the best first."""
    a, more = here.equations.marginal(here.scales)
    best: dict[str, tuple[Probe, float]] = {}
    for probe, own in here.columns.own:
        effects = (*here.effects, probe.effect)
        found = a.log_evidence(held_but(here.equations.normal, {**here.free, **own})) + more + odds(effects)
        if probe.effect not in best or found > best[probe.effect][1]:
            best[probe.effect] = probe, found
    return sorted(best.values(), key=lambda x: -x[1])


def moved(process: Process, point: Point, coordinates: Sequence[Coordinate], scales: gp.Scales) -> Point:
    """Return where some rounds of Gauss-Newton beside the process lead."""
    here = process.beside(point, coordinates)
    prior = prior_of(here.normal.coordinates)
    a, _ = here.marginal(scales)
    for _ in range(ROUNDS):
        x, before = a.most_probable(prior).x, a.objective(a.x, prior)
        for share in SHARES:
            trial = point.moved(here.normal.coordinates, a.x + share * (x - a.x))
            with suppress(*UNFITTED):
                there, _ = process.beside(trial, coordinates).marginal(scales)
                if there.objective(there.x, prior) < before:
                    point, a = trial, there
                    break
        else:
            return point
    return point


def neighbours(here: Stand) -> list[Named]:
    """Return the set with its parameters, and those with one effect less or more, by the algebra of its own point."""
    n = here.equations.normal
    a, more = here.equations.marginal(here.scales)
    out = [Named(here.effects, here.evidence, parameters(here, a))]
    for effect in here.effects:
        rest = tuple(e for e in here.effects if e != effect)
        known = {c.label: c for c in fit.with_effects(here.point, rest)}
        gone = {c.label: replace(c, deviation=0.0) for c in here.columns.known if c.effect == owner(effect)}
        out.append(Named(rest, a.log_evidence(held_but(n, {**gone, **known})) + more + odds(rest), {}))
    return [*out, *(Named((*here.effects, p.effect), promised, {}) for p, promised in joined(here))]


def parameters(here: Stand, a: Algebra) -> dict[str, Any]:
    """Return the parameters of a set's effects with 95 % intervals."""
    prior = held_but(here.equations.normal, here.free)
    deviation = np.sqrt(np.diag(a.covariance(prior)))
    found = Estimates(here.equations.normal.coordinates, a.most_probable(prior).x, deviation)
    with suppress(*UNFITTED):
        return {k: x for e in here.effects for k, x in fit.intervals(found, e).items()}
    return {}


def left(here: Stand) -> float:
    """Return the residual over the floor that a set's parameters leave, the process' part included."""
    n = here.equations.normal
    x = here.equations.marginal(here.scales)[0].most_probable(held_but(n, here.free)).x
    sums = n.summed()
    shift = x - n.x
    squares = sums.rr - 2.0 * shift @ sums.g + shift @ sums.a @ shift
    return math.sqrt(max(0.0, float(squares)) / fit.readings(n))
