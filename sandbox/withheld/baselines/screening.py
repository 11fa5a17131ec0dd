"""Which effects a fit's own slopes promise most of: the screening that the simple methods share."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from typing import NamedTuple

from model.effects.library import load_effect, moved, neutral
from sandbox.gap.evidence.algebra import Prior, algebra, prior_of
from sandbox.gap.evidence.normal import NormalEquations, ParameterPoint, normal
from sandbox.gap.evidence.priors import Coordinate
from sandbox.gap.posterior.candidates import Candidate
from sandbox.gap.posterior.sets import contained
from sandbox.withheld.baselines.refit import readings


class Columns(NamedTuple):
    """What a screening linearises: the fit's own coordinates, and by probe what it adds, under
    names of their own."""

    known: Sequence[Coordinate]
    own: Sequence[tuple[Candidate, Mapping[str, Coordinate]]]

    @property
    def every(self) -> list[Coordinate]:
        """All of them once, the fit's own first."""
        out = {c.label: c for c in self.known}
        for _, more in self.own:
            out = {**more, **out}
        return list(out.values())


class Promise(NamedTuple):
    """What one step beside a fit would reach: Schwarz' criterion of the effect's set, and where the
    effect begins."""

    criterion: float
    probe: Candidate


def columns(
    point: ParameterPoint, known: Sequence[Coordinate], probes: Sequence[Candidate]
) -> Columns:
    """Return what to linearise for probes beside a fit's own coordinates.

    Probes with companions (a time constant, an order) have columns of their own each; others share
    the coordinate of their name, which may be an ordinary deviation.
    """
    own = [
        (probe, {c.label: c for c in probe.coordinates(point, f" #{k}" if probe.start else "")})
        for k, probe in enumerate(probes)
    ]
    return Columns([c for c in known if not c.of_point], own)


def held_but(n: NormalEquations, free: Mapping[str, Coordinate]) -> Prior:
    """Return the priors under which coordinates of some labels move, and all turns; the others stay
    where they are."""
    chosen = [free.get(c.label, c) for c in n.coordinates]
    loose = [c.label in free or c.of_point for c in chosen]
    held = [replace(c, mean=float(x), deviation=0.0) for c, x in zip(chosen, n.x, strict=True)]
    return prior_of([c if f else h for c, f, h in zip(chosen, loose, held, strict=True)])


def screened(
    point: ParameterPoint,
    known: Sequence[Coordinate],
    probes: Sequence[Candidate],
    effects: Sequence[str] = (),
) -> list[Promise]:
    """Return probes by the criterion that one step from a point promises, the best first.

    known: the coordinates that move in any case, whose number counts for no effect here; effects:
    those that the point has, whose coordinates are counted elsewhere and so not once more for a
    probe that shares them.
    """
    cols = columns(point, known, probes)
    n = normal(point, cols.every)
    a, size = algebra(n), math.log(readings(n))
    free = {c.label: c for c in cols.known}
    out = []
    for probe, more in cols.own:
        reached = a.most_probable(held_but(n, {**free, **more})).objective
        out.append(Promise(reached + new(effects, more.values()) * size, probe))
    return sorted(out, key=lambda p: p.criterion)


def new(effects: Sequence[str], coordinates: Iterable[Coordinate]) -> int:
    """Return how many coordinates are none of the effects' own."""
    counted = names_of(effects)
    return sum(c.names[0] not in counted for c in coordinates)


def count(effects: Sequence[str], coordinates: Sequence[Coordinate]) -> int:
    """Return how many coordinates are the effects' own, the cross part under saturation's names."""
    names = names_of(effects)
    return sum(c.names[0] in names for c in coordinates)


def names_of(effects: Sequence[str]) -> set[str]:
    """Return the parameters of effects, the cross part's under saturation's names."""
    return {f"{owner(e)}.{p.name}" for e in effects for p in load_effect(e).parameters}


def owner(effect: str) -> str:
    """Return under whose names an effect's parameters stand."""
    return "saturation" if effect == "cross_saturation" else effect


def barred(effects: Sequence[str]) -> tuple[str, ...]:
    """Return the effects that cannot join a set: its own, and those that are a part of one of
    them."""
    return (*effects, *(part for e in effects for part in sorted(contained(e))))


def staying(effects: Sequence[str], effect: str) -> tuple[str, ...]:
    """Return the effects of a set that stay when one joins: it takes the place of those that are a
    part of it."""
    return tuple(e for e in effects if e not in contained(effect))


def lesser(effects: Sequence[str], exclude: Sequence[str]) -> list[tuple[str, ...]]:
    """Return the sets with one effect less, or with a part of it in its place unless that is
    excluded."""
    out = []
    for gone in effects:
        rest = tuple(e for e in effects if e != gone)
        out += [rest, *((*rest, part) for part in sorted(contained(gone)) if part not in exclude)]
    return out


def cleared(point: ParameterPoint, effects: Sequence[str], left: Sequence[str]) -> ParameterPoint:
    """Return a point of a set of effects with neutral values for all that those left do not
    have."""
    usual, values = neutral(point.prepared.campaign.drive.motor), dict(point.values)
    for name in names_of(effects) - names_of(left):
        values |= moved(name, usual[name])
    return replace(point, values=values)
