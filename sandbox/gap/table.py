"""Equations of all effects at one point, and the evidence of any set of effects by algebra.

Every effect has an ordinary size, too (SMALL of the wide prior): unless a hypothesis claims an effect, its coordinates
stay in the equations with that narrow prior.  So a trace of an effect, or a trace of the simulator's own error that
resembles one, is no discovery.  A companion (time constant, frequency) is a shape, not a size: one prior for both.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from sandbox.gap.evidence import Algebra, Prior, algebra, prior_of
from sandbox.gap.fit import Fit, Weights
from sandbox.gap.normal import Normal, Point, normal
from sandbox.gap.probes import Probe, probe_coordinates
from sandbox.gap.space import Coordinate, of_effect, ordinary

Array = NDArray[np.float64]
SMALL = 0.03  # of an effect's wide prior: what no bench is free of


@dataclass(frozen=True)
class Table:
    """Equations at a point; narrow and wide priors (p,); members: places of each effect's coordinates."""

    point: Point
    normal: Normal
    equations: Algebra
    narrow: Prior
    wide: Array
    members: Mapping[str, tuple[int, ...]]

    @property
    def coordinates(self) -> tuple[Coordinate, ...]:
        """All coordinates, lock angles last."""
        return self.normal.coordinates

    def prior(self, effects: Sequence[str]) -> Prior:
        """Return the prior of a set of effects: wide for these, narrow for all others."""
        deviation = self.narrow.deviation.copy()
        for effect in effects:
            own = list(self.members[effect])
            deviation[own] = self.wide[own]
        return self.narrow.with_deviation(deviation)

    def log_evidence(self, effects: Sequence[str]) -> float:
        """Return the log evidence of a set of effects."""
        return self.equations.log_evidence(self.prior(effects))


def is_shape(c: Coordinate, probe: Probe) -> bool:
    """Return whether a coordinate of an effect is a companion rather than a size."""
    return c.form == "log" or c.names[0] in probe.start


def table(point: Point, chosen: Sequence[Probe], active: Sequence[str], weights: Weights, workers: int) -> Table:
    """Return the equations of all effects (one probe each) at a point; active: effects that are on there."""
    campaign = point.prepared.campaign
    coordinates = ordinary(campaign)
    narrow = {c.label: c.deviation for c in coordinates}
    wide, groups = dict(narrow), {}
    place = {c.label: k for k, c in enumerate(coordinates)}
    for probe in chosen:
        if probe.effect in active:
            own = of_effect(probe.effect, campaign.drive, {**point.values, **probe.start})
        else:
            own = probe_coordinates(point, probe, "")
        for c in own:
            if c.label not in place:
                place[c.label] = len(coordinates)
                coordinates.append(c)
                size = 0.0 if c.form == "share" else SMALL * c.deviation
                narrow[c.label] = c.deviation if is_shape(c, probe) and c.form != "share" else size
                wide[c.label] = c.deviation
            else:
                wide[c.label] = max(wide[c.label], c.deviation)
        groups[probe.effect] = tuple(place[c.label] for c in own)
    n = normal(point, coordinates, workers=workers)
    every = [replace(c, deviation=narrow.get(c.label, c.deviation)) for c in n.coordinates]
    widths = np.array([wide.get(c.label, c.deviation) for c in n.coordinates])
    return Table(point, n, algebra(n, weights), prior_of(every), widths, groups)


def probe_gains(found: Fit, candidates: Sequence[Probe], weights: Weights, workers: int) -> tuple[list[float], float]:
    """Return the log evidence each probe would add to a fit, by the equations at its point; simulations."""
    own = [c for c in found.coordinates if c.form != "lock"]
    parts = [
        [replace(c, label=f"{c.label}@{k}") for c in probe_coordinates(found.point, probe, "")]
        for k, probe in enumerate(candidates)
    ]
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
    return gains, n.simulations
