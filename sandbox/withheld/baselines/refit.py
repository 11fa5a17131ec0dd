"""Least squares of a replayed campaign for the baselines, on the nuisances and normal equations of
the diagnosis.

Ordinary deviations have the means, deviations and bounds that a campaign states
(`priors.ordinary`), every recording its own angle (`normal.turns`), an effect its wide prior.
Plain Gauss-Newton: of each step the largest share is taken that lowers the cost, and intervals
assume white residuals.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any, NamedTuple

import numpy as np

from model.array_types import Array
from model.effects import library
from model.errors import BadInput, PhysicsError
from sandbox.gap.evidence.algebra import Prior, algebra, prior_of
from sandbox.gap.evidence.normal import NormalEquations, ParameterPoint, normal
from sandbox.gap.evidence.priors import Coordinate, of_effect, ordinary
from sandbox.gap.posterior.candidates import Candidate, possible
from sandbox.gap.posterior.estimates import public
from sandbox.plant.sets import complete
from sandbox.recordings.campaign import Campaign
from sandbox.replay.replay import prepare

SHARES = (1.0, 0.5, 0.25, 0.1)  # of a step, tried in turn
# of the cost, and of its excess over noise: a step that gains less ends a fit
LITTLE, SHARE = 0.5, 1e-3
ROUNDS = 3  # of Gauss-Newton
CHORDS = 2  # steps on the slopes of one point
Z95 = 1.96
UNFITTED = (BadInput, PhysicsError, np.linalg.LinAlgError)  # what a fit may end with


@dataclass(frozen=True)
class Refit:
    """A fit: where it ended, the normal equations there, their priors, the cost (residual and prior
    terms)."""

    point: ParameterPoint
    normal: NormalEquations
    prior: Prior
    cost: float
    simulations: float

    @property
    def rms(self) -> float:
        """Residual over the floor, all recordings and channels."""
        return rms(self.normal)

    def error(self) -> Array:
        """Return the standard deviations of all coordinates (p,)."""
        return np.sqrt(np.diag(algebra(self.normal).covariance(self.prior)))

    def estimates(self) -> Estimates:
        """Return what it found."""
        return Estimates(self.normal.coordinates, self.normal.x, self.error())


def usual(campaign: Campaign) -> list[Coordinate]:
    """Return the ordinary coordinates that baselines move: the zone of a current's sign stays about
    zero current, as ROUNDS are too few to find its place beside a missing effect."""
    return [c for c in ordinary(campaign) if c.label != "bench.soft_center"]


def nuisances(campaign: Campaign) -> tuple[Refit, float]:
    """Return the fit of the ordinary deviations alone, and the raw gap."""
    start = ParameterPoint(
        prepare(campaign, steps=1), complete(campaign.drive.motor, campaign.drive.converter)
    )
    return refit(start, usual(campaign), ROUNDS), rms(normal(start, ()))


def rms(n: NormalEquations) -> float:
    """Return the residual over the floor at a point."""
    return math.sqrt(sum(float(s.ssr.sum()) for s in n.segments) / readings(n))


def readings(n: NormalEquations) -> float:
    """Return how many readings normal equations rest on."""
    return sum(float(s.n.sum()) for s in n.segments)


def refit(point: ParameterPoint, coordinates: Sequence[Coordinate], rounds: int) -> Refit:
    """Return the fit of coordinates and all turns after so many rounds of Gauss-Newton, fewer where
    nothing gains.

    After each of them the motion of free rotors is smoothed again, by the torque of what was found.
    BadInput or LinAlgError where the equations cannot be had at the point itself.
    """
    spent = 0.0
    for k in range(rounds):
        if k:
            point = point.resmoothed()
        n = normal(point, coordinates)
        prior = prior_of(n.coordinates)
        first = cost = cost_of(n, prior)
        spent += n.simulations
        for _ in range(CHORDS):
            before = cost
            point, n, cost, tries = stepped(point, n, prior, cost)
            spent += tries
            if before - cost < little(n, cost):
                break
        if first - cost < little(n, cost):
            break
    return Refit(point, n.bare(), prior, cost, spent)


def little(n: NormalEquations, cost: float) -> float:
    """Return a gain of the cost that is not worth another step."""
    return max(LITTLE, SHARE * (cost - readings(n)))


def stepped(
    point: ParameterPoint, n: NormalEquations, prior: Prior, cost: float
) -> tuple[ParameterPoint, NormalEquations, float, int]:
    """Return point, equations and cost after the largest share of a step that lowers the cost;
    simulations it took.

    All as it was where no share does.
    """
    step = algebra(n).most_probable(prior).x - n.x
    for tries, share in enumerate(SHARES, 1):
        trial = point.moved(n.coordinates, n.x + share * step)
        try:
            reached = n.at(trial)
            value = cost_of(reached, prior)
        except (BadInput, np.linalg.LinAlgError):
            # no drive has these values: a shorter step may do
            continue
        if math.isfinite(value) and value < cost:
            return trial, reached, value, tries
    return point, n, cost, len(SHARES)


def cost_of(n: NormalEquations, prior: Prior) -> float:
    """Return the sum of squared residuals and of squared deviations from the priors' means."""
    return algebra(n).objective(n.x, prior)


def widened(coordinates: Sequence[Coordinate], factor: float) -> list[Coordinate]:
    """Return coordinates with priors so many times wider and no bounds but their parameters' own.

    The bench's own, which no effect is named by, stay as they are: a sign's width far off leads
    nowhere.
    """
    return [
        c if c.effect == "bench" else replace(c, deviation=factor * c.deviation, within=math.inf)
        for c in coordinates
    ]


def beginning(point: ParameterPoint, effect: str) -> Candidate:
    """Return an effect with its companions (time constants, frequencies, orders) at typical values;
    BadInput where the drive cannot have these."""
    drive = point.prepared.campaign.drive
    own = [p for p in library.load_effect(effect).parameters if p.fit == "log" or p.scan]
    probe = Candidate(
        effect, {f"{effect}.{p.name}": p.typical_for(drive.motor, drive.converter) for p in own}
    )
    if not possible(point, probe.start):
        raise BadInput(f"{effect}: typical values {dict(probe.start)} are none this drive can have")
    return probe


def with_effect(
    point: ParameterPoint, probe: Candidate, others: Sequence[str] = ()
) -> tuple[ParameterPoint, list[Coordinate]]:
    """Return where an effect's fit begins, and the ordinary coordinates with its own (wide) ones;
    beside: effects that the point has already, which move with it."""
    begin = replace(point, values={**point.values, **probe.start})
    return begin, with_effects(begin, (*others, probe.effect))


def with_effects(point: ParameterPoint, effects: Sequence[str]) -> list[Coordinate]:
    """Return the ordinary coordinates with the (wide) ones of effects, companions about where the
    point has them."""
    campaign = point.prepared.campaign
    out = {c.label: c for c in usual(campaign)}
    for effect in effects:
        out |= {c.label: c for c in of_effect(effect, campaign.drive, point.values)}
    return list(out.values())


class Estimates(NamedTuple):
    """Coordinates of a fit, their values x (p,) and standard deviations (p,)."""

    coordinates: Sequence[Coordinate]
    x: Array
    deviation: Array


def intervals(fit: Estimates, effect: str) -> dict[str, Any]:
    """Return an effect's parameters by public name with 95 % intervals."""
    card, out = library.load_effect(effect), {}
    place = {c.label: k for k, c in enumerate(fit.coordinates)}
    sd = fit.deviation
    for p in card.parameters:
        name = f"{effect}.{p.name}"
        own = f"saturation.{p.name}" if effect == "cross_saturation" else name
        if card.polar and p.name == card.polar[0]:
            c, s = place[f"{name} cosine"], place[f"{name} sine"]
            x, y = fit.x[c], fit.x[s]
            size = max(math.hypot(x, y), 1e-300)
            out[name] = interval(size, Z95 * math.hypot(x * sd[c], y * sd[s]) / size)
            turn = min(math.hypot(y * sd[c], x * sd[s]) / size**2, math.pi)
            out[f"{effect}.{card.polar[1]}"] = interval(math.atan2(y, x), Z95 * turn)
        elif own in place:
            k = place[own]
            found = interval(float(fit.x[k]), Z95 * float(sd[k]))
            value, *ends = (public(p.fit, z) for z in (found["value"], *found["ci95"]))
            out[name] = {"value": value, "ci95": sorted(ends)}
    return out


def interval(value: float, half: float) -> dict[str, Any]:
    """Return a parameter with its 95 % interval."""
    return {"value": value, "ci95": [value - half, value + half]}


def inverse_root(diagonal: Array) -> Array:
    """Return what scales a matrix' diagonal to 1; 0 where a column moves nothing, which leaves it
    out;
    diagonal: (p,)."""
    least = 1e-24 * float(np.max(diagonal, initial=1e-200))
    return np.where(diagonal > least, 1.0 / np.sqrt(np.maximum(diagonal, least)), 0.0)
