"""Parameters of a hypothesis with intervals that allow for residuals alike within a block, or within a recording."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from model.effects import library
from sandbox.gap.evidence.algebra import Prior, algebra, between_segments, prior_of, sandwich
from sandbox.gap.search.judged import Judged

Array = NDArray[np.float64]
Z = 1.959964
SPREAD = 1.15  # of standard deviations: what the largest of three estimates still falls short of
TRACES = 0.5  # of the move that traces of other effects bring, taken as one standard deviation


@dataclass(frozen=True)
class Estimate:
    """A parameter by its public name: value, 95 % interval, unit; whether it is held at a bound of the search."""

    value: float
    low: float
    high: float
    unit: str
    at_bound: bool = False


class Spread(NamedTuple):
    """A fit's values x (p,), standard deviations, ends of 95 % intervals, places by label, and which are free."""

    x: Array
    sd: Array
    ends: tuple[Array, Array]
    place: dict[str, int]
    free: NDArray[np.bool_]


def estimates(j: Judged) -> dict[str, Estimate]:
    """Return the parameters of a hypothesis' effects, by public name.

    Values are those of the hypothesis alone; the interval also allows for what ordinary traces of all other effects
    would move them by.  Where a value is held at its bound, the interval reaches from there as far as its tail.
    """
    s = spread(j)
    out: dict[str, Estimate] = {}
    for effect in j.effects:
        out |= _of_effect(effect, j, s.x, s.sd, s.ends, s.place, s.free)
    return out


def of_motor(j: Judged) -> dict[str, Estimate]:
    """Return the motor's values at a hypothesis' fit by their names in [motor], effects on them and ordinary deviations
    taken together."""
    s, motor, out = spread(j), j.fit.point.prepared.campaign.drive.motor, dict[str, Estimate]()
    for name, key in {**library.OF_MOTOR, **library.SCALES_OF_MOTOR}.items():
        if name in s.place:
            k, unit = s.place[name], type(motor).__dataclass_fields__[key].metadata["unit"]
            size = getattr(motor, key) if name in library.SCALES_OF_MOTOR else 1.0
            c = j.fit.coordinates[k]
            value, *ends = (size * public(c.form, c.bounded(float(to[k]))) for to in (s.x, *s.ends))
            out[key] = Estimate(value, min(ends), max(ends), unit, not s.free[k])
    return out


def spread(j: Judged) -> Spread:
    """Return a hypothesis' most probable values and how far each may be off."""
    own, prior = algebra(j.fit.normal), prior_of(j.fit.coordinates)
    x, free, _ = own.most_probable(prior)
    plain = own.covariance(prior)
    robust = sandwich(j.fit.normal, x, plain)
    apart = between_segments(j.fit.normal, x, plain)
    place = {c.label: k for k, c in enumerate(j.fit.coordinates)}
    beside, _, _ = j.equations.most_probable(j.prior)
    there = {c.label: float(y) for c, y in zip(j.normal.coordinates, beside, strict=True)}
    traces = np.array([there.get(c.label, y) - y for c, y in zip(j.fit.coordinates, x, strict=True)])
    variance = np.max([np.diag(c) for c in (plain, robust, apart)], axis=0)
    held = (prior.deviation > 0.0) & ~free  # as uncertain as if they were free: a bound is no measurement
    variance = np.where(held, np.diag(own.covariance(unbounded(prior))), variance)
    wider = np.sqrt(SPREAD**2 * variance + (TRACES * traces) ** 2)
    tails = own.tails(prior)
    below = np.where(x > prior.low, tails, 0.0) + Z * wider
    above = np.where(x < prior.high, tails, 0.0) + Z * wider
    return Spread(x, wider, (x - below, x + above), place, free)


def unbounded(prior: Prior) -> Prior:
    """Return a prior without bounds."""
    return Prior(prior.mean, prior.deviation, np.full_like(prior.low, -np.inf), np.full_like(prior.high, np.inf))


def _of_effect(
    effect: str,
    j: Judged,
    x: Array,
    sd: Array,
    reach: tuple[Array, Array],
    place: Mapping[str, int],
    free: NDArray[np.bool_],
) -> dict[str, Estimate]:
    card = library.load_effect(effect)
    out: dict[str, Estimate] = {}
    for p in card.parameters:
        name = f"{effect}.{p.name}"
        own = p.same_as or name
        if card.polar and p.name == card.polar[0] and f"{name} cosine" in place:
            phase = f"{effect}.{card.polar[1]}"
            c, s = place[f"{name} cosine"], place[f"{name} sine"]
            size, around = math.hypot(x[c], x[s]), max(math.hypot(x[c], x[s]), 1e-300)
            radial = math.hypot(x[c] * sd[c], x[s] * sd[s]) / around
            across = math.hypot(x[s] * sd[c], x[c] * sd[s]) / around
            angle = math.atan2(x[s], x[c])
            turn = min(across / around, math.pi)
            out[name] = Estimate(size, max(0.0, size - Z * radial), size + Z * radial, p.unit)
            out[phase] = Estimate(angle, angle - Z * turn, angle + Z * turn, "rad")
        elif own in place:
            k = place[own]
            ends = (j.fit.coordinates[k].bounded(float(to[k])) for to in (x, *reach))
            value, low, high = (public(p.fit, y) for y in ends)
            out[name] = Estimate(value, min(low, high), max(low, high), p.unit, not free[k])
        elif p.scan and name in j.fit.point.values and p.fit == "fixed":
            value = j.fit.point.values[name]
            out[name] = Estimate(value, value, value, p.unit)
    return out


def public(form: str, x: float) -> float:
    """Return a parameter from its coordinate."""
    if form == "log":
        return math.exp(x)
    if form == "reciprocal":
        return 1.0 / x if x > 0.0 else math.inf
    return x
