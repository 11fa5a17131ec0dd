"""Parameters of a hypothesis with intervals that allow for residuals alike within a block, or
within a recording."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from model.array_types import Array
from model.confidence import Z95
from model.effects import library
from model.effects.card import Effect
from sandbox.gap.evidence.algebra import (
    Algebra,
    Prior,
    algebra,
    between_segments,
    prior_of,
    sandwich,
)
from sandbox.gap.evidence.priors import REACHED, Coordinate, ordinary
from sandbox.gap.posterior.evaluated import EvaluatedModel
from sandbox.plant.sets import BENCH

SPREAD = 1.15  # of standard deviations: what the largest of three estimates still falls short of
TRACES = 0.5  # of the move that traces of other effects bring, taken as one standard deviation


@dataclass(frozen=True)
class Estimate:
    """A parameter by its public name: value, 95 % interval, unit; whether it is held at a bound of
    the search."""

    value: float
    low: float
    high: float
    unit: str
    at_bound: bool = False


class Spread(NamedTuple):
    """Coordinates, a set, and of each coordinate value, standard deviation, ends of the 95 %
    interval, and whether it is inside its bounds (p,)."""

    coordinates: Sequence[Coordinate]
    values: Mapping[str, float]
    x: Array
    sd: Array
    ends: tuple[Array, Array]
    free: NDArray[np.bool_]

    @property
    def place(self) -> dict[str, int]:
        """Places of coordinates by label."""
        return {c.label: k for k, c in enumerate(self.coordinates)}


def estimates(j: EvaluatedModel) -> dict[str, Estimate]:
    """Return the parameters of a hypothesis' effects, by public name.

    Values are those of the hypothesis alone; the interval also allows for what ordinary traces of
    all other effects would move them by.  Where a value is held at its bound, the interval reaches
    from there as far as its tail.
    """
    s = spread(j)
    return {name: e for effect in j.effects for name, e in _of_effect(effect, s).items()}


def estimates_with(j: EvaluatedModel, equations: Algebra) -> dict[str, Estimate]:
    """Return the same by other equations of its table: those with a free regression integrated out
    (`beside`).

    An interval is as much wider than the ordinary one as the regression makes the plain covariance,
    so that residuals that are alike, recordings that disagree and traces count as ever.
    """
    ordinary, own = spread(j), unbounded(j.prior)
    x, free, _ = equations.most_probable(j.prior)
    with_, without = (np.sqrt(np.diag(e.covariance(own))) for e in (equations, j.equations))
    wider = np.divide(with_, without, out=np.ones_like(with_), where=without > 0.0)
    place = ordinary.place
    usual = [ordinary.sd[place[c.label]] if c.label in place else 0.0 for c in j.model.coordinates]
    sd = np.maximum(wider * np.array(usual), SPREAD * with_)
    s = Spread(j.model.coordinates, j.model.point.values, x, sd, (x - Z95 * sd, x + Z95 * sd), free)
    return {name: e for effect in j.effects for name, e in _of_effect(effect, s).items()}


def of_motor(j: EvaluatedModel) -> dict[str, Estimate]:
    """Return the motor's values at a hypothesis' fit by their names in [motor], effects on them and
    ordinary deviations taken together."""
    s, motor, out = spread(j), j.fit.point.prepared.campaign.drive.motor, dict[str, Estimate]()
    place = s.place
    for name, key in {**library.replaced(), **library.scaled()}.items():
        if name in place:
            k, unit = place[name], type(motor).__dataclass_fields__[key].metadata["unit"]
            size = getattr(motor, key) if name in library.scaled() else 1.0
            c = j.fit.coordinates[k]
            value, *ends = (size * public(c.form, c.bounded(float(to[k]))) for to in (s.x, *s.ends))
            out[key] = Estimate(value, min(ends), max(ends), unit, not s.free[k])
    return out


def spread(j: EvaluatedModel) -> Spread:
    """Return a hypothesis' most probable values and how far each may be off."""
    own, prior = algebra(j.fit.normal), prior_of(j.fit.coordinates)
    x, free, _ = own.most_probable(prior)
    plain = own.covariance(prior)
    robust = sandwich(j.fit.normal, x, plain)
    apart = between_segments(j.fit.normal, x, plain)
    with_traces, _, _ = j.equations.most_probable(j.prior)
    there = {c.label: float(y) for c, y in zip(j.normal.coordinates, with_traces, strict=True)}
    traces = np.array(
        [there.get(c.label, y) - y for c, y in zip(j.fit.coordinates, x, strict=True)]
    )
    variance = np.max([np.diag(c) for c in (plain, robust, apart)], axis=0)
    variance = _as_if_free(own, prior, free, variance)
    wider = np.sqrt(SPREAD**2 * variance + (TRACES * traces) ** 2)
    tails = own.tails(prior)
    below = np.where(x > prior.low, tails, 0.0) + Z95 * wider
    above = np.where(x < prior.high, tails, 0.0) + Z95 * wider
    return Spread(j.fit.coordinates, j.fit.point.values, x, wider, (x - below, x + above), free)


def _as_if_free(own: Algebra, prior: Prior, free: NDArray[np.bool_], variance: Array) -> Array:
    """Return variances (p,), those of values held at a bound as if they were free: a bound is no
    measurement."""
    held = (prior.deviation > 0.0) & ~free
    return np.where(held, np.diag(own.covariance(unbounded(prior))), variance)


class Held(NamedTuple):
    """An ordinary deviation that stands at its bound: public name, value with interval, and how
    many standard deviations the bound is away from the value that the campaign states."""

    name: str
    estimate: Estimate
    deviations: float


def held_ordinary(j: EvaluatedModel) -> list[Held]:
    """Return the ordinary deviations of a hypothesis' fit that stand at their bound, those that an
    effect has made wide left out; a recording's angle as `angles.<file>`, as in effects.toml."""
    s = spread(j)
    usual = {c.label: c for c in ordinary(j.fit.point.prepared.campaign, j.fit.point.values)}
    out = []
    for k, c in enumerate(s.coordinates):
        narrow = c.deviation > 0.0 and (c.form == "turn" or usual.get(c.label) == c)
        if not narrow or s.free[k] or abs(s.x[k] - c.mean) < REACHED * c.within * c.deviation:
            continue
        name = f"angles.{c.names[0]}" if c.form == "turn" else c.names[0]
        value, *ends = (public(c.form, c.bounded(float(to[k]))) for to in (s.x, *s.ends))
        out.append(
            Held(
                name, Estimate(value, min(ends), max(ends), unit_of(name), at_bound=True), c.within
            )
        )
    return out


def unit_of(name: str) -> str:
    """Return the unit of a parameter by its public name; of an angle of a recording the radian."""
    known = BENCH.get(name) or library.parameters().get(name)
    return "rad" if known is None else known.unit


def unbounded(prior: Prior) -> Prior:
    """Return a prior without bounds."""
    return Prior(
        prior.mean,
        prior.deviation,
        np.full_like(prior.low, -np.inf),
        np.full_like(prior.high, np.inf),
    )


def _of_effect(effect: str, s: Spread) -> dict[str, Estimate]:
    """Return an effect's parameters by public name, those of its further parts behind."""
    card = library.load_effect(effect)
    labels = tuple(s.place)
    on = [
        k
        for k in range(2, card.repeats + 1)
        if any(x.startswith(card.public(k, "")) for x in labels)
    ]
    return {name: e for k in [1, *on] for name, e in _of_part(card, k, s).items()}


def _of_part(card: Effect, k: int, s: Spread) -> dict[str, Estimate]:
    """Return the parameters of an effect's k-th part by public name."""
    place, x, sd, part = s.place, s.x, s.sd, card.part(k)
    out: dict[str, Estimate] = {}
    for p in part.parameters:
        name = card.public(k, p.name)
        own = p.same_as or name
        if part.polar and p.name == part.polar[0] and f"{name} cosine" in place:
            phase = card.public(k, part.polar[1])
            u, v = place[f"{name} cosine"], place[f"{name} sine"]
            size, around = math.hypot(x[u], x[v]), max(math.hypot(x[u], x[v]), 1e-300)
            radial = math.hypot(x[u] * sd[u], x[v] * sd[v]) / around
            across = math.hypot(x[v] * sd[u], x[u] * sd[v]) / around
            angle = math.atan2(x[v], x[u])
            turn = min(across / around, math.pi)
            held = not (s.free[u] and s.free[v])
            out[name] = Estimate(
                size, max(0.0, size - Z95 * radial), size + Z95 * radial, p.unit, held
            )
            out[phase] = Estimate(angle, angle - Z95 * turn, angle + Z95 * turn, "rad", held)
        elif own in place:
            at = place[own]
            ends = (s.coordinates[at].bounded(float(to[at])) for to in (x, *s.ends))
            value, low, high = (public(p.fit, y) for y in ends)
            out[name] = Estimate(value, min(low, high), max(low, high), p.unit, not s.free[at])
        elif p.scan and name in s.values and p.fit == "fixed":
            value = s.values[name]
            out[name] = Estimate(value, value, value, p.unit)
    return out


def public(form: str, x: float) -> float:
    """Return a parameter from its coordinate."""
    if form == "log":
        return math.exp(x)
    if form == "reciprocal":
        return 1.0 / x if x > 0.0 else math.inf
    return x
