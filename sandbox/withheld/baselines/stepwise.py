"""A stronger simple method: stepwise selection by Schwarz' criterion, every set refitted to all
recordings.

BIC(S) = r'r + prior terms + k_S log n, with r the normalised residual of the nonlinear fit, k_S the
effects' own coordinates and n readings (Schwarz, Annals of Statistics 6 (1978) 461).  Effects are
added one at a time as long as BIC falls, then dropped as long as it falls, and so on until neither
does (Efroymson 1960).  Sets that were fitted have weights exp(-BIC/2) (Raftery, Sociological
Methodology 25 (1995) 111).
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Iterable, Sequence
from contextlib import suppress
from dataclasses import dataclass, field, replace
from functools import partial
from pathlib import Path
from typing import Any, NamedTuple

from sandbox.gap.evidence.normal import ParameterPoint, counted
from sandbox.gap.evidence.priors import Coordinate, with_usual_sign
from sandbox.gap.posterior.candidates import Candidate, candidates
from sandbox.recordings.campaign import read_folder
from sandbox.withheld.baselines import refit as fit
from sandbox.withheld.baselines.answer import Answer, answer
from sandbox.withheld.baselines.refit import ROUNDS, UNFITTED, Refit
from sandbox.withheld.baselines.screening import (
    Promise,
    barred,
    cleared,
    count,
    lesser,
    screened,
    staying,
)

REFINED = 3  # effects that are fitted in full after a screening, as `bic` does
# simulations: a single effect takes some 500, the way up to six or seven effects all of them
MAX_SIMULATIONS = 3000
NEGLIGIBLE = 1400.0  # of BIC behind the best: weights below exp(-700) are none
MAX_BEHIND = 20.0  # of BIC behind the best up to which intervals are worked out: weights above 5e-5


class Visited(NamedTuple):
    """A set of effects that was fitted, and its criterion."""

    effects: tuple[str, ...]
    fit: Refit
    criterion: float


def by_stepwise(folder: Path, exclude: tuple[str, ...] = ()) -> Answer:
    """Answer by the set of effects that no added and no dropped effect betters."""
    started, campaign, spent = time.perf_counter(), read_folder(folder), list[float]()
    with counted(spent.append):
        null, raw = fit.nuisances(campaign)
        search = Search(exclude, lambda: sum(spent) > MAX_SIMULATIONS)
        best = searched(search, Visited((), null, null.cost))
    gaps = (raw, null.rms, best.fit.rms)
    return answer(campaign, ranked(search.seen.values()), gaps, started, round(sum(spent)))


@dataclass
class Search:
    """Which effects may not be added, whether too much was simulated, and all sets fitted so
    far."""

    exclude: tuple[str, ...]
    tired: Callable[[], bool]
    seen: dict[frozenset[str], Visited] = field(default_factory=dict)

    def tried(self, effects: Iterable[str], fitted: Callable[[], Visited]) -> Visited | None:
        """Return a set fitted, once only; None where it cannot be fitted."""
        key = frozenset(effects)
        if key not in self.seen:
            with suppress(*UNFITTED):
                self.seen[key] = fitted()
        return self.seen.get(key)


def searched(search: Search, best: Visited) -> Visited:
    """Return where adding and dropping effects ends."""
    search.seen[frozenset(best.effects)] = best
    while True:
        before = best.criterion
        for step in (grown, shrunk):
            while not search.tired():
                found = step(search, best)
                if found is None or found.criterion >= best.criterion:
                    break
                best = found
        if best.criterion >= before or search.tired():
            return best


def grown(search: Search, best: Visited) -> Visited | None:
    """Return the best set with one effect more; None where slopes promise no gain.

    A candidate that promises less than another has reached already is not fitted.  One that
    contains an effect of the set takes its place; one that is part of an effect of the set is none.
    """
    point, out = best.fit.point, None
    choices = candidates(point, (*search.exclude, *barred(best.effects)), left=0.0)
    listed = screened(point, best.fit.normal.coordinates, choices, best.effects)
    own = best.criterion - best.fit.cost  # k log n of the set as it is
    unbent = replace(
        point, values=with_usual_sign(point.values, point.prepared.campaign.drive.motor)
    )
    for promise in firsts(listed):
        if promise.criterion + own >= (best if out is None else out).criterion:
            break
        probe, others = promise.probe, staying(best.effects, promise.probe.effect)
        found = search.tried((*others, probe.effect), partial(visited, unbent, probe, others))
        if found is not None and (out is None or found.criterion < out.criterion):
            out = found
    return out


def firsts(listed: Sequence[Promise]) -> list[Promise]:
    """Return the most promising probe of each of the REFINED most promising effects."""
    first: dict[str, Promise] = {}
    for promise in listed:
        first.setdefault(promise.probe.effect, promise)
    return list(first.values())[:REFINED]


def shrunk(search: Search, best: Visited) -> Visited | None:
    """Return the best set with one effect less, or with a part of it in its place; None where there
    is none to drop."""
    found = [
        search.tried(rest, partial(reduced, best, rest))
        for rest in lesser(best.effects, search.exclude)
    ]
    return min((f for f in found if f is not None), key=lambda v: v.criterion, default=None)


def visited(point: ParameterPoint, probe: Candidate, others: Sequence[str] = ()) -> Visited:
    """Return the fit of an effect beside others that a point has already."""
    begin, coordinates = fit.with_effect(point, probe, others)
    return _fitted(begin, (*others, probe.effect), coordinates)


def reduced(whole: Visited, rest: tuple[str, ...]) -> Visited:
    """Return the fit of what is left of a set, from where the set stood."""
    begin = cleared(whole.fit.point, whole.effects, rest)
    return _fitted(begin, rest, fit.with_effects(begin, rest))


def _fitted(
    begin: ParameterPoint, effects: tuple[str, ...], coordinates: Sequence[Coordinate]
) -> Visited:
    """Return a set fitted in full, and its criterion."""
    one = fit.refit(begin, coordinates, ROUNDS)
    return Visited(
        effects, one, one.cost + count(effects, coordinates) * math.log(fit.readings(one.normal))
    )


def ranked(found: Iterable[Visited]) -> list[tuple[tuple[str, ...], float, dict[str, Any]]]:
    """Return sets of effects, the best first, with their weights and the parameters of those that
    have any weight."""
    order = sorted(found, key=lambda v: v.criterion)
    out = []
    for v in order:
        far, own = v.criterion - order[0].criterion, {}
        if far <= MAX_BEHIND:
            with suppress(*UNFITTED):
                estimates = v.fit.estimates()
                own = {k: x for e in v.effects for k, x in fit.intervals(estimates, e).items()}
        out.append((v.effects, math.exp(-0.5 * min(far, NEGLIGIBLE)), own))
    return out
