"""A stronger simple method: effects beside a Gaussian process for all that no effect explains.

The discrepancy's scales are learnt on the residual that ordinary deviations leave
(`discrepancy_process.py`).  Then the effect whose set has most evidence beside the process joins,
one at a time, as long as evidence grows; each set's evidence is that of its own linearisation, with
the amplitudes out of FACTORS that suit it best.  Every effect has the prior odds of one among all
that the library has.  What the parameters leave, the process' part included, is `unknown`.

Slopes of a set promise the evidence of its neighbours (an effect more, or less); what promises more
is fitted, the best first, and counts with what its fit has.  So the set that is named has been
fitted; neighbours that promise less are ranked behind it unfitted, without parameters.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from model.effects.library import causes
from sandbox.gap.evidence.algebra import prior_of
from sandbox.gap.evidence.normal import ParameterPoint, counted, normal
from sandbox.gap.evidence.priors import Coordinate, with_usual_sign
from sandbox.gap.posterior.candidates import Candidate, candidates
from sandbox.recordings.campaign import read_folder
from sandbox.withheld.baselines import discrepancy_process as gp
from sandbox.withheld.baselines import refit as fit
from sandbox.withheld.baselines.answer import Answer, answer
from sandbox.withheld.baselines.refit import UNFITTED, Estimates
from sandbox.withheld.baselines.screening import (
    Columns,
    barred,
    cleared,
    columns,
    held_but,
    lesser,
    names_of,
    staying,
)

# readings that scales are learnt from, and how often they are weighed: some seconds
SAMPLED, TRIES = 4000, 100
# a floor; half of rated current and top speed; a sixth of a turn
BEGIN = gp.Scales(1.0, 1.0, 0.5, 0.5, 0.7)
FACTORS = (1.0, 0.3, 0.1, 0.03, 0.01)  # of the amplitudes: they fall as effects take over
ROUNDS, SHARES = 2, (1.0, 0.5, 0.25)  # of Gauss-Newton; of a step, tried in turn
MAX_SIMULATIONS = 3000  # simulations, as `stepwise`


@dataclass(frozen=True)
class Process:
    """A campaign's discrepancy: operating points, random frequencies, scales, and effects that may
    not be named."""

    where: Sequence[gp.Where]
    drawn: gp.Array
    scales: gp.Scales
    exclude: tuple[str, ...]

    def with_discrepancy(
        self, point: ParameterPoint, coordinates: Sequence[Coordinate]
    ) -> gp.WithDiscrepancy:
        """Return the equations of a point and the products of features there."""
        n = normal(point, coordinates)
        return gp.WithDiscrepancy(
            n.bare(),
            gp.grams_of(gp.parts_of(point, n, self.where), len(n.x), self.scales, self.drawn),
        )


class Stand(NamedTuple):
    """A set of effects at its own linearisation: equations of its coordinates and of all that may
    join; amplitudes and log evidence, prior odds included."""

    effects: tuple[str, ...]
    point: ParameterPoint
    columns: Columns
    equations: gp.WithDiscrepancy
    scales: gp.Scales
    evidence: float

    @property
    def free(self) -> dict[str, Coordinate]:
        """The coordinates that move, by label."""
        return {c.label: c for c in self.columns.known}


class Move(NamedTuple):
    """A neighbouring set, the evidence that slopes promise, and where the fit of an effect that
    joins begins."""

    effects: tuple[str, ...]
    promised: float
    probe: Candidate | None = None


@dataclass
class Search:
    """Whether too much was simulated, and the sets fitted so far; None: it cannot be fitted."""

    process: Process
    tired: Callable[[], bool]
    seen: dict[frozenset[str], Stand | None] = field(default_factory=dict)


def by_gaussian_process(folder: Path, exclude: tuple[str, ...] = ()) -> Answer:
    """Answer by the effects that have most evidence beside a Gaussian process."""
    started, campaign, spent = time.perf_counter(), read_folder(folder), list[float]()
    with counted(spent.append):
        null, raw = fit.nuisances(campaign)
        search = Search(process_of(null.point, exclude), lambda: sum(spent) > MAX_SIMULATIONS)
        best = searched(search, stand(search.process, null.point, ()))
    return answer(
        campaign, ranked(search, best), (raw, null.rms, left(best)), started, round(sum(spent))
    )


def searched(search: Search, best: Stand) -> Stand:
    """Return the set of most evidence of all that were fitted, from which no neighbour leads on."""
    search.seen[frozenset(best.effects)] = best
    while (found := better(search, best)) is not None:
        best = found
    return best


def better(search: Search, here: Stand) -> Stand | None:
    """Return a neighbour that has more evidence where it is fitted; None where none is left that
    promises it."""
    for move in moves(search.process, here):
        if search.tired() or move.promised <= here.evidence:
            return None
        key = frozenset(move.effects)
        if key not in search.seen:
            search.seen[key] = found = fitted(search.process, here, move)
            if found is not None and found.evidence > here.evidence:
                return found
    return None


def ranked(search: Search, best: Stand) -> list[tuple[tuple[str, ...], float, Mapping[str, Any]]]:
    """Return sets with their weights, the best first: those fitted with their parameters, and the
    best one's neighbours that promise less.  What promises more and was not fitted in time is not
    ranked."""
    known = sorted((s for s in search.seen.values() if s is not None), key=lambda s: -s.evidence)
    others = (m for m in moves(search.process, best) if frozenset(m.effects) not in search.seen)
    listed: list[tuple[tuple[str, ...], float, Mapping[str, Any]]]
    listed = [(s.effects, s.evidence, parameters(s)) for s in known]
    listed += [(m.effects, m.promised, {}) for m in others if m.promised <= best.evidence]
    return [
        (e, math.exp(max(x - best.evidence, -700.0)), own)
        for e, x, own in sorted(listed, key=lambda t: -t[1])
    ]


def process_of(point: ParameterPoint, exclude: tuple[str, ...]) -> Process:
    """Return the discrepancy whose scales suit what ordinary deviations leave at a point."""
    where, drawn = gp.places_of(point), gp.frequencies()
    n = normal(point, fit.usual(point.prepared.campaign))
    parts = gp.thinned(gp.parts_of(point, n, where), SAMPLED)
    scales = gp.learnt(parts, n.x, prior_of(n.coordinates), drawn, BEGIN, TRIES)
    return Process(where, drawn, scales, exclude)


def odds(effects: Sequence[str]) -> float:
    """Return the log prior odds of a set: each effect is one among all."""
    return -len(effects) * math.log(len(causes()))


def stand(process: Process, point: ParameterPoint, effects: tuple[str, ...]) -> Stand:
    """Return a set linearised at a point, beside all that may join it."""
    choices = candidates(point, (*process.exclude, *barred(effects)), left=0.0)
    cols = columns(point, fit.with_effects(point, effects), choices)
    found = process.with_discrepancy(point, cols.every)
    prior = held_but(found.normal, {c.label: c for c in cols.known})
    each = [process.scales.times(f) for f in FACTORS]
    value, scales = max((found.log_evidence(s, prior), s) for s in each)
    return Stand(effects, point, cols, found, scales, value + odds(effects))


def fitted(process: Process, here: Stand, move: Move) -> Stand | None:
    """Return a neighbour where it is fitted; None where it cannot be."""
    with suppress(*UNFITTED):
        if move.probe is None:
            begin = cleared(here.point, here.effects, move.effects)
            coordinates = fit.with_effects(begin, move.effects)
        else:
            unbent = with_usual_sign(here.point.values, here.point.prepared.campaign.drive.motor)
            begin, coordinates = fit.with_effect(
                replace(here.point, values=unbent), move.probe, move.effects[:-1]
            )
        point = moved(process, begin, coordinates, here.scales)
        return stand(process, point.resmoothed(), move.effects)
    return None


def moves(process: Process, here: Stand) -> list[Move]:
    """Return the neighbours of a set by the algebra of its own point, those that promise most
    first."""
    return sorted([*joining(here), *leaving(process, here)], key=lambda m: -m.promised)


def joining(here: Stand) -> list[Move]:
    """Return the sets with one effect more, each by its best probe."""
    a, more = here.equations.marginal(here.scales)
    best: dict[str, Move] = {}
    for probe, own in here.columns.own:
        effects = (*staying(here.effects, probe.effect), probe.effect)
        found = (
            a.log_evidence(held_but(here.equations.normal, {**here.free, **own}))
            + more
            + odds(effects)
        )
        if probe.effect not in best or found > best[probe.effect].promised:
            best[probe.effect] = Move(effects, found, probe)
    return list(best.values())


def leaving(process: Process, here: Stand) -> list[Move]:
    """Return the sets with one effect less, or with a part of it in its place."""
    n = here.equations.normal
    a, more = here.equations.marginal(here.scales)
    out = []
    for rest in lesser(here.effects, process.exclude):
        lost = names_of(here.effects) - names_of(rest)
        gone = {
            c.label: replace(c, deviation=0.0) for c in here.columns.known if c.names[0] in lost
        }
        kept = {c.label: c for c in fit.with_effects(here.point, rest)}
        out.append(Move(rest, a.log_evidence(held_but(n, {**gone, **kept})) + more + odds(rest)))
    return out


def moved(
    process: Process, point: ParameterPoint, coordinates: Sequence[Coordinate], scales: gp.Scales
) -> ParameterPoint:
    """Return where some rounds of Gauss-Newton beside the process lead."""
    here = process.with_discrepancy(point, coordinates)
    prior = prior_of(here.normal.coordinates)
    a, _ = here.marginal(scales)
    for _ in range(ROUNDS):
        x, before = a.most_probable(prior).x, a.objective(a.x, prior)
        for share in SHARES:
            trial = point.moved(here.normal.coordinates, a.x + share * (x - a.x))
            with suppress(*UNFITTED):
                there, _ = process.with_discrepancy(trial, coordinates).marginal(scales)
                if there.objective(there.x, prior) < before:
                    point, a = trial, there
                    break
        else:
            return point
    return point


def parameters(here: Stand) -> dict[str, Any]:
    """Return the parameters of a set's effects with 95 % intervals."""
    a, _ = here.equations.marginal(here.scales)
    prior = held_but(here.equations.normal, here.free)
    deviation = np.sqrt(np.diag(a.covariance(prior)))
    found = Estimates(here.equations.normal.coordinates, a.most_probable(prior).x, deviation)
    with suppress(*UNFITTED):
        return {k: x for e in here.effects for k, x in fit.intervals(found, e).items()}
    return {}


def left(here: Stand) -> float:
    """Return the residual over the floor that a set's parameters leave, the process' part
    included."""
    n = here.equations.normal
    x = here.equations.marginal(here.scales)[0].most_probable(held_but(n, here.free)).x
    sums = n.summed()
    shift = x - n.x
    squares = sums.ssr - 2.0 * shift @ sums.g + shift @ sums.a @ shift
    return math.sqrt(max(0.0, float(squares)) / fit.readings(n))
