"""Growing hypotheses: screen every effect from the equations of one point, fit the promising ones, grow the best.

Each effect is one or several probes: values its companions (time constants, frequencies, orders) start from.  A probe
is screened linearly, beside all ordinary deviations; only the best are fitted.  A hypothesis grows by one effect at a
time while the evidence grows; two parents are kept, so that an imitator of two effects does not hide them.

Every effect has an ordinary size, too (SMALL of a typical one): unless a hypothesis widens its prior, its coordinates
stay in the equations with that narrow one.  So a trace of an effect, or a trace of the simulator's own error that
resembles one, is no discovery.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import product

import numpy as np
from numpy.typing import NDArray

from model.effects import library
from model.errors import BadInput
from sandbox.gap.evidence import Algebra, Prior, algebra, prior_of
from sandbox.gap.fit import Fit, Weights, fit
from sandbox.gap.normal import Normal, Point, normal
from sandbox.gap.space import Coordinate, of_effect
from sandbox.gap.spectrum import best_values, link_lines

Array = NDArray[np.float64]
SMALL = 0.03  # of an effect's wide prior: what no bench is free of
FITTED = (4, 4, 3)  # hypotheses fitted at one, two, three effects
PARENTS = 2
MOVES = 0.5  # of an ordinary size: an effect that moves less stays where it is
MOST = 3
WORTH = 3.0  # log evidence that one more effect must bring to be looked at further
NEAR = 60.0  # log evidence behind the best within which a hypothesis may still be fitted


@dataclass(frozen=True)
class Probe:
    """An effect and the values its companions start from."""

    effect: str
    start: Mapping[str, float]


@dataclass(frozen=True)
class Judged:
    """A fitted hypothesis with the equations of all effects at its point, the prior it holds, and its log evidence."""

    fit: Fit
    normal: Normal
    equations: Algebra
    prior: Prior
    log_evidence: float
    screened: tuple[tuple[float, Probe], ...]  # log evidence gained by each further effect, best first

    @property
    def effects(self) -> tuple[str, ...]:
        """The effects of the hypothesis."""
        return self.fit.effects


def probes(point: Point, exclude: Sequence[str] = ()) -> list[Probe]:
    """Return all probes of the library at a point; scanned companions start at what the residual shows."""
    drive = point.prepared.campaign.drive
    out = []
    for effect in library.effect_names():
        if effect in exclude:
            continue
        card = library.load_effect(effect)
        choices: list[list[tuple[str, float]]] = []
        for p in card.parameters:
            name = f"{effect}.{p.name}"
            if p.scan and card.polar:
                low, high, step = p.scan
                pair = (f"{effect}.{card.polar[0]}", f"{effect}.{card.polar[1]}")
                values = np.arange(low, high + 0.5 * step, step).tolist() if step else []
                found = best_values(point, pair, name, values) if step else link_lines(point, low, high)
                choices.append([(name, x) for x in found])
            elif p.fit == "log":
                size = p.typical_for(drive.motor, drive.converter)
                choices.append([(name, s * size) for s in p.starts])
        out += [Probe(effect, dict(c)) for c in product(*choices)]
    return out


def probes_at_typical(point: Point, exclude: Sequence[str] = ()) -> list[Probe]:
    """Return one probe an effect, its companions at typical values: what can be known before looking at residuals."""
    drive = point.prepared.campaign.drive
    out = []
    for effect in library.effect_names():
        own = library.load_effect(effect).parameters
        start = {f"{effect}.{p.name}": p.typical_for(drive.motor, drive.converter) for p in own if p.fit == "log"}
        if effect not in exclude:
            out.append(Probe(effect, start))
    return out


def probe_coordinates(point: Point, probe: Probe, label: str) -> list[Coordinate]:
    """Return what a probe adds to a screening: coordinates that act at neutral, or one straight way to its start."""
    own = of_effect(probe.effect, point.prepared.campaign.drive, {**point.values, **probe.start})
    off = [c for c in own if c.form != "log" and c.names[0] not in probe.start]
    along = tuple(probe.start.items())
    if not off:
        return [Coordinate(f"{probe.effect}{label}", 0.0, 1.0, "share", (next(iter(probe.start)),), along)]
    return [replace(c, label=f"{c.label}{label}", along=along) if along else c for c in off]


def judge(found: Fit, candidates: Sequence[Probe], weights: Weights, workers: int) -> Judged:
    """Return a fit judged with all effects beside it, and what each further effect would gain.

    Twice, the second time from where the ordinary sizes of all effects have moved the point.
    """
    first = _judge(found, found.point, candidates, weights, workers)
    x, _, _ = first.equations.most_probable(first.prior)
    own = {c.label for c in found.coordinates}
    moves = np.abs(x - first.prior.mean) > MOVES * first.prior.deviation
    fitted = np.array([c.label in own for c in first.normal.coordinates])
    ways = np.array([c.form == "share" for c in first.normal.coordinates])
    to = np.where(fitted | (moves & ~ways), x, first.normal.x)
    return _judge(found, found.point.moved(first.normal.coordinates, to), candidates, weights, workers)


def _judge(found: Fit, point: Point, candidates: Sequence[Probe], weights: Weights, workers: int) -> Judged:
    own = [c for c in found.coordinates if c.form != "lock"]
    known = {c.label for c in own}
    added: list[Coordinate] = []
    wide: list[tuple[Probe, dict[str, float]]] = []
    for k, probe in enumerate(candidates):
        if probe.effect in found.effects:
            continue
        coordinates = probe_coordinates(point, probe, f"@{k}" if probe.start else "")
        added += [c for c in coordinates if c.label not in known]
        known |= {c.label for c in coordinates}
        wide.append((probe, {c.label: c.deviation for c in coordinates}))
    n = normal(point, [*own, *added], workers=workers)
    place = {c.label: k for k, c in enumerate(n.coordinates)}
    given = prior_of(n.coordinates)
    narrow = given.deviation.copy()
    first: set[str] = set()
    for probe, widths in wide:  # of several starts, only the first is an ordinary size
        for name, width in widths.items():
            if name in {c.label for c in own}:
                continue
            held = probe.effect in first or n.coordinates[place[name]].form == "share"
            narrow[place[name]] = 0.0 if held else SMALL * width
        first.add(probe.effect)
    prior = given.with_deviation(narrow)
    equations = algebra(n, weights)
    base = equations.log_evidence(prior)
    best: dict[str, tuple[float, Probe]] = {}
    for probe, widths in wide:
        deviation = narrow.copy()
        for name, width in widths.items():
            deviation[place[name]] = max(width, deviation[place[name]])
        gain = equations.log_evidence(given.with_deviation(deviation)) - base
        if probe.effect not in best or gain > best[probe.effect][0]:
            best[probe.effect] = (gain, probe)
    ranked = tuple(sorted(best.values(), key=lambda x: -x[0]))
    return Judged(found, n, equations, prior, base, ranked)


def search(
    start: Point, fitted: Weights, judged_on: Weights, *, exclude: Sequence[str] = (), workers: int = 1,
    report: Callable[[str], None] = lambda _: None,
) -> tuple[list[Judged], int]:  # fmt: skip
    """Return the hypotheses that were worth judging (the empty one first) and the simulations they took.

    fitted: recordings that move parameters; judged_on: recordings whose evidence counts.
    """
    report("ordinary deviations")
    null = fit(start, (), fitted, workers=workers)
    judged = [judge(null, probes(null.point, exclude), judged_on, workers)]
    tried: set[tuple[str, ...]] = {()}
    cost = null.simulations + 2 * judged[0].normal.simulations
    parents = judged[:1]
    for depth in range(MOST):
        best = max(j.log_evidence for j in judged)
        wanted: dict[tuple[str, ...], tuple[float, Judged, Probe]] = {}
        for parent in parents:
            for gain, probe in parent.screened:
                key = tuple(sorted((*parent.effects, probe.effect)))
                total = parent.log_evidence + gain
                if (
                    gain > WORTH
                    and total > best + WORTH - NEAR
                    and key not in tried
                    and total > wanted.get(key, (-np.inf,))[0]
                ):
                    wanted[key] = (total, parent, probe)
        new: list[Fit] = []
        for key, (_, parent, probe) in sorted(wanted.items(), key=lambda x: -x[1][0])[: FITTED[depth]]:
            report(f"fitting {' + '.join(key)}")
            tried.add(key)
            point = parent.fit.point
            try:
                new.append(fit(Point(point.prepared, {**point.values, **probe.start}), key, fitted, workers=workers))
            except BadInput:
                continue
            cost += new[-1].simulations
        fresh = [judge(f, probes(f.point, exclude), judged_on, workers) for f in new]
        cost += sum(2 * j.normal.simulations for j in fresh)
        judged += fresh
        parents = sorted(fresh, key=lambda j: -j.log_evidence)[:PARENTS]
        if not parents or parents[0].log_evidence < best + WORTH:
            break
    return judged, cost
