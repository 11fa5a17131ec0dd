"""Fit of one hypothesis: damped Gauss-Newton to the most probable point, and the evidence of a hypothesis there.

A hypothesis is a list of effects.  Its coordinates are the ordinary deviations with their narrow priors, and its
effects' with wide ones; the objective is the sum of squared residuals over their floor plus that of deviations over
their priors.  Near the most probable point all is Gaussian:

    log evidence = -1/2 objective - 1/2 log det(A + P^-1) - sum log deviation,

A summed over recordings (Laplace's approximation; MacKay, Neural Comput. 4 (1992) 415).  Checked against direct
integration in tests/sandbox/gap/test_fit.py.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from model.errors import BadInput
from sandbox.gap.evidence import algebra, prior_of
from sandbox.gap.normal import Normal, Point, normal
from sandbox.gap.space import Coordinate, of_effect, ordinary

Array = NDArray[np.float64]
Weights = Mapping[tuple[int, str], float]
TOLERANCE = 0.2  # of the objective: below that a step changes no decision
DAMPING = (0.0, 0.05, 0.3, 2.0, 10.0)  # tried in turn until a step gains
STEPS = 8


@dataclass(frozen=True)
class Fit:
    """A hypothesis at its most probable point; effects (), one or several; simulations it took."""

    effects: tuple[str, ...]
    point: Point
    normal: Normal
    objective: float
    simulations: float

    @property
    def coordinates(self) -> tuple[Coordinate, ...]:
        """Its coordinates, turns last."""
        return self.normal.coordinates


def coordinates_of(point: Point, effects: Sequence[str], within: float = math.inf) -> list[Coordinate]:
    """Return the ordinary coordinates, those that an effect widens replaced, then the effects' others.

    within: how many deviations an ordinary coordinate may move.
    """
    campaign = point.prepared.campaign
    wide: dict[str, Coordinate] = {}
    for effect in effects:
        wide |= {c.label: c for c in of_effect(effect, campaign.drive, point.values)}
    own = [replace(c, within=min(within, c.within)) for c in ordinary(campaign)]
    known = {c.label for c in own}
    return [wide.get(c.label, c) for c in own] + [c for c in wide.values() if c.label not in known]


def fit(
    start: Point,
    effects: Sequence[str],
    weights: Weights,
    *,
    steps: int = STEPS,
    workers: int = 1,
    within: float = math.inf,
    beside: Sequence[Coordinate] = (),
) -> Fit:
    """Return the most probable point of a hypothesis on the recordings that `weights` names, by Gauss-Newton.

    within: how many deviations an ordinary coordinate may move; beside: further coordinates that move, too.
    """
    point = start
    coordinates = [*coordinates_of(start, effects, within), *beside]
    n = normal(point, coordinates, workers=workers)
    value, cost = _objective(n, weights), n.simulations
    last = 0
    for k in range(steps):
        for damping in DAMPING[max(0, last - 1) :]:
            last = DAMPING.index(damping)
            trial = point.moved(n.coordinates, n.x + _step(n, weights, damping))
            reached, at_trial = _tried(trial, coordinates, weights, workers)
            cost += n.simulations
            if reached < value:
                break
        if at_trial is None or not reached < value:
            break
        gained, value, point, n = value - reached, reached, trial, at_trial
        if gained < max(TOLERANCE, 1e-5 * value):
            break
        if k in (1, 3):
            point = point.resmoothed()
            n = normal(point, coordinates, workers=workers)
            value, cost = _objective(n, weights), cost + n.simulations
    return Fit(tuple(effects), point, n, value, cost)


def _tried(
    trial: Point, coordinates: Sequence[Coordinate], weights: Weights, workers: int
) -> tuple[float, Normal | None]:
    """Return the objective and the equations at a trial; infinite where the point is none a drive can have."""
    try:
        n = normal(trial, coordinates, workers=workers)
    except BadInput:
        return math.inf, None
    value = _objective(n, weights)
    return (value, n) if math.isfinite(value) else (math.inf, None)


def _prior(coordinates: Sequence[Coordinate]) -> tuple[Array, Array]:
    return np.array([c.mean for c in coordinates]), np.array([c.deviation for c in coordinates])


def _objective(n: Normal, weights: Weights) -> float:
    mean, deviation = _prior(n.coordinates)
    return n.summed(weights)[2] + float(np.sum(((n.x - mean) / deviation) ** 2))


def _step(n: Normal, weights: Weights, damping: float) -> Array:
    """Return a step: far from the floor as if the noise were as large as the residual, so that priors keep a say."""
    equations = algebra(n, weights)
    count = sum(float(s.n.sum()) for s in n.segments if weights.get((s.recording, s.channel)))
    noise = max(1.0, equations.rr / count)
    return np.asarray(equations.scaled(noise).damped(damping).most_probable(prior_of(n.coordinates))[0] - n.x)
