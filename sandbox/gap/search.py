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
from sandbox.replay.sensitivity import mechanical_only

Array = NDArray[np.float64]
SMALL = 0.03  # of an effect's wide prior: what no bench is free of
FITTED = (5, 4, 3)  # hypotheses fitted at one, two, three effects
PARENTS = 2
MOVES = 1.0  # of an ordinary size: an effect that moves less stays where it is
MOST = 3
POLISH = 3  # Gauss-Newton steps
JUDGED = 5
CLOSE = 1.01  # normalised rms below which small sizes of all effects are told apart by linear screening
WORTH = 3.0  # log evidence that one more effect must bring to be looked at further
BEHIND, RIVAL = 600.0, 0.01  # log evidence, and share of the gap, behind which a fit is no rival
NEAR = 60.0  # log evidence behind the best within which a hypothesis may still be fitted


@dataclass(frozen=True)
class Probe:
    """An effect and the values its companions start from."""

    effect: str
    start: Mapping[str, float]


@dataclass(frozen=True)
class Judged:
    """A fitted hypothesis with the equations of all effects at its point, the prior it holds, and its log evidence.

    bare: log evidence each further effect gains with all others absent; beside: with ordinary sizes of all others; each
    best first, with the best of its probes.
    """

    fit: Fit
    normal: Normal
    equations: Algebra
    prior: Prior
    log_evidence: float
    bare: tuple[tuple[float, Probe], ...]
    beside: tuple[tuple[float, Probe], ...]
    simulations: float

    @property
    def effects(self) -> tuple[str, ...]:
        """The effects of the hypothesis."""
        return self.fit.effects


def probes(point: Point, exclude: Sequence[str] = ()) -> tuple[list[Probe], float]:
    """Return all probes of the library at a point, scanned companions where the residual shows them; simulations."""
    drive = point.prepared.campaign.drive
    out: list[Probe] = []
    cost = 0.0
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
                cost += 2 * len(values) * (free_share(point) if mechanical_only(name) else 1.0)
                choices.append([(name, x) for x in found])
            elif p.fit == "log":
                size = p.typical_for(drive.motor, drive.converter)
                choices.append([(name, s * size) for s in p.starts])
        out += [Probe(effect, dict(c)) for c in product(*choices)]
    return out, cost


def free_share(point: Point) -> float:
    """Return the share of the samples in which the rotor is free."""
    own = point.prepared.recordings
    return sum(len(r.table) for r in own if r.rotor == "free") / point.prepared.samples


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
    """Return a fit judged with all effects beside it: fitted once more with those whose ordinary size matters."""
    first = screen(found, found.point, candidates, weights, workers)
    x, _, _ = first.equations.most_probable(first.prior)
    own = {c.label for c in found.coordinates}
    beside = [
        replace(c, deviation=float(first.prior.deviation[k]))
        for k, c in enumerate(first.normal.coordinates)
        if c.label not in own and abs(x[k] - c.mean) > MOVES * first.prior.deviation[k] > 0.0
    ]
    again = fit(found.point, found.effects, weights, workers=workers, beside=beside, steps=POLISH)
    last = screen(replace(found, point=again.point), again.point, candidates, weights, workers)
    return replace(
        last,
        fit=replace(found, point=again.point),
        simulations=first.simulations + again.simulations + last.simulations,
    )


def screen(found: Fit, point: Point, candidates: Sequence[Probe], weights: Weights, workers: int) -> Judged:
    """Return a fit's evidence by the equations at a point near it, and what each further effect would gain."""
    own = [c for c in found.coordinates if c.form != "lock"]
    added, wide = _columns(found, point, candidates)
    n = normal(point, [*own, *added], workers=workers)
    place = {c.label: k for k, c in enumerate(n.coordinates)}
    given = prior_of(n.coordinates)
    fitted = {c.label for c in found.coordinates}
    alone = np.where([c.label in fitted for c in n.coordinates], given.deviation, 0.0)
    narrow = alone.copy()
    first: set[str] = set()
    for probe, widths in wide:  # of several starts, only the first is an ordinary size
        for name, width in widths.items():
            if name not in fitted and probe.effect not in first and n.coordinates[place[name]].form != "share":
                narrow[place[name]] = SMALL * width
        first.add(probe.effect)
    equations = algebra(n, weights)

    def gains(base: Array) -> tuple[float, tuple[tuple[float, Probe], ...]]:
        level = equations.log_evidence(given.with_deviation(base))
        best: dict[str, tuple[float, Probe]] = {}
        for probe, widths in wide:
            deviation = base.copy()
            for name, width in widths.items():
                deviation[place[name]] = max(width, deviation[place[name]])
            gain = equations.log_evidence(given.with_deviation(deviation)) - level
            if probe.effect not in best or gain > best[probe.effect][0]:
                best[probe.effect] = (gain, probe)
        return level, tuple(sorted(best.values(), key=lambda x: -x[0]))

    _, bare = gains(alone)
    evidence, beside = gains(narrow)
    return Judged(found, n, equations, given.with_deviation(narrow), evidence, bare, beside, n.simulations)


def _columns(
    found: Fit, point: Point, candidates: Sequence[Probe]
) -> tuple[list[Coordinate], list[tuple[Probe, dict[str, float]]]]:
    """Return the coordinates of all effects that a fit has not, and of each probe the widths of its own."""
    known = {c.label for c in found.coordinates}
    added: list[Coordinate] = []
    wide: list[tuple[Probe, dict[str, float]]] = []
    for k, probe in enumerate(candidates):
        if probe.effect in found.effects:
            continue
        coordinates = probe_coordinates(point, probe, f"@{k}" if probe.start else "")
        added += [c for c in coordinates if c.label not in known]
        known |= {c.label for c in coordinates}
        wide.append((probe, {c.label: c.deviation for c in coordinates}))
    return added, wide


def search(
    start: Point, fitted: Weights, judged_on: Weights, *, exclude: Sequence[str] = (), workers: int = 1,
    report: Callable[[str], None] = lambda _: None,
) -> tuple[list[Judged], float]:  # fmt: skip
    """Return the hypotheses that stand a chance, judged, and the simulations all this took.

    fitted: recordings that move parameters; judged_on: recordings whose evidence counts.
    """
    report("ordinary deviations")
    null = fit(start, (), fitted, workers=workers)
    fits: dict[tuple[str, ...], Fit] = {(): null}
    candidates, cost = probes(null.point, exclude)
    parents = [screen(null, null.point, candidates, fitted, workers)]
    cost += null.simulations + parents[0].simulations
    for depth in range(MOST):
        new: list[Fit] = []
        ranked = _worth_fitting(parents, set(fits))[: FITTED[depth]]
        for key, parent, probe in ranked:
            report(f"fitting {' + '.join(key)}")
            at = Point(parent.fit.point.prepared, {**parent.fit.point.values, **probe.start})
            try:
                new.append(fit(at.resmoothed() if probe.start else at, key, fitted, workers=workers))
            except BadInput:
                continue
            fits[key] = new[-1]
            cost += new[-1].simulations
        if not new or depth == MOST - 1:
            break
        least = min(new, key=lambda f: f.objective)
        before = min(f.objective for k, f in fits.items() if len(k) <= depth)
        candidates, spent = probes(least.point, exclude)
        promising = max((q for q in ranked if q[0] in fits), key=lambda q: q[1].log_evidence + _gain(q[1], q[2]))[0]
        chosen = [least, *(f for f in (fits[promising],) if f is not least)]
        parents = [screen(f, f.point, candidates, fitted, workers) for f in chosen]
        cost += spent + sum(p.simulations for p in parents)
        if before - least.objective < 2.0 * WORTH:
            break
    report("weighing hypotheses")
    leader = min(f.objective for f in fits.values())
    gate = leader + 2.0 * BEHIND + RIVAL * max(0.0, null.objective - leader)
    rivals = [f for f in fits.values() if f.objective <= gate]
    seen = [screen(f, f.point, candidates, judged_on, workers) for f in rivals]
    best = max(j.log_evidence for j in seen)
    close = sorted((j for j in seen if j.log_evidence > best - NEAR), key=lambda j: -j.log_evidence)[:JUDGED]
    judged = [judge(j.fit, candidates, judged_on, workers) for j in close]
    return judged, cost + sum(j.simulations for j in (*seen, *judged))


def _gain(parent: Judged, probe: Probe) -> float:
    return next(gain for gain, p in parent.beside if p.effect == probe.effect)


def _worth_fitting(
    parents: Sequence[Judged], tried: set[tuple[str, ...]]
) -> list[tuple[tuple[str, ...], Judged, Probe]]:
    """Return the sets one effect larger than their parents that promise most, by turns of both ways of screening.

    Beside ordinary sizes of all others counts where a fit is near the floor; far from it these hide each other.
    """
    lists = []
    for p in parents:
        lists.append([(gain, probe, p) for gain, probe in p.beside])
        if rms(p.normal) > CLOSE:
            lists.append([(gain, probe, p) for gain, probe in p.bare])
    out: dict[tuple[str, ...], tuple[Judged, Probe]] = {}
    for turn in zip(*lists, strict=False):
        for gain, probe, parent in turn:
            key = tuple(sorted((*parent.effects, probe.effect)))
            if gain > WORTH and key not in tried and key not in out:
                out[key] = (parent, probe)
    return [(key, parent, probe) for key, (parent, probe) in out.items()]


def rms(n: Normal) -> float:
    """Return the normalised rms of all residuals at a point."""
    return float(np.sqrt(sum(s.rr.sum() for s in n.segments) / sum(s.n.sum() for s in n.segments)))
