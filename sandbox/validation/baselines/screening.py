"""Which effects a fit's own slopes promise most of: the screening that the simple methods share."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import NamedTuple

from model.effects.library import load_effect
from sandbox.gap.evidence.algebra import Prior, algebra, prior_of
from sandbox.gap.evidence.normal import Normal, Point, normal
from sandbox.gap.evidence.priors import Coordinate
from sandbox.gap.evidence.probes import Probe, probe_coordinates
from sandbox.validation.baselines.refit import readings


class Columns(NamedTuple):
    """What a screening linearises: the fit's own coordinates, and by probe what it adds, under names of their own."""

    known: Sequence[Coordinate]
    own: Sequence[tuple[Probe, Mapping[str, Coordinate]]]

    @property
    def every(self) -> list[Coordinate]:
        """All of them once, the fit's own first."""
        out = {c.label: c for c in self.known}
        for _, more in self.own:
            out = {**more, **out}
        return list(out.values())


class Promise(NamedTuple):
    """What one step beside a fit would reach: Schwarz' criterion of the effect's set, and where the effect begins."""

    criterion: float
    probe: Probe


def columns(point: Point, known: Sequence[Coordinate], probes: Sequence[Probe]) -> Columns:
    """Return what to linearise for probes beside a fit's own coordinates.

    Probes with companions (a time constant, an order) have columns of their own each; others share the coordinate of
    their name, which may be an ordinary deviation.
    """
    own = [
        (probe, {c.label: c for c in probe_coordinates(point, probe, f" #{k}" if probe.start else "")})
        for k, probe in enumerate(probes)
    ]
    return Columns([c for c in known if c.form != "turn"], own)


def held_but(n: Normal, free: Mapping[str, Coordinate]) -> Prior:
    """Return the priors under which coordinates of some labels move, and all turns; the others stay where they are."""
    chosen = [free.get(c.label, c) for c in n.coordinates]
    loose = [c.label in free or c.form == "turn" for c in chosen]
    held = [replace(c, mean=float(x), deviation=0.0) for c, x in zip(chosen, n.x, strict=True)]
    return prior_of([c if f else h for c, f, h in zip(chosen, loose, held, strict=True)])


def screened(point: Point, known: Sequence[Coordinate], probes: Sequence[Probe]) -> list[Promise]:
    """Return probes by the criterion that one step from a point promises, the best first.

    known: the coordinates that move in any case, whose number counts for no effect here.
    """
    cols = columns(point, known, probes)
    n = normal(point, cols.every)
    a, size = algebra(n), math.log(readings(n))
    free = {c.label: c for c in cols.known}
    out = [
        Promise(a.most_probable(held_but(n, {**free, **more})).objective + len(more) * size, probe)
        for probe, more in cols.own
    ]
    return sorted(out, key=lambda p: p.criterion)


def count(effects: Sequence[str], coordinates: Sequence[Coordinate]) -> int:
    """Return how many coordinates are the effects' own, the cross part under saturation's names."""
    names = {f"{owner(e)}.{p.name}" for e in effects for p in load_effect(e).parameters}
    return sum(c.names[0] in names for c in coordinates)


def owner(effect: str) -> str:
    """Return under whose names an effect's parameters stand."""
    return "saturation" if effect == "cross_saturation" else effect
