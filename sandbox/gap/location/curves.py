"""Curves that a hypothesis' effects are, with what they may be off by: the picture where no simpler
form is named."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from model.confidence import Z95
from model.effects import library
from sandbox.gap.evidence.algebra import algebra, prior_of
from sandbox.gap.posterior.estimates import spread
from sandbox.gap.posterior.evaluated import EvaluatedModel

STEP = 1e-4  # of a coordinate's standard deviation: the difference a curve's slope is taken over


@dataclass(frozen=True)
class CurveFound:
    """An effect's curve: what stands at its axes, with units; value and ends of its 95 % band at
    places in rising order; in words, what it is in simpler forms."""

    effect: str
    across: str
    unit_across: str
    of: str
    unit: str
    at: tuple[float, ...]
    value: tuple[float, ...]
    low: tuple[float, ...]
    high: tuple[float, ...]
    text: str


def curves_found(j: EvaluatedModel) -> tuple[CurveFound, ...]:
    """Return the curves of a hypothesis' effects."""
    return tuple(found for effect in j.effects if (found := _curve(effect, j)) is not None)


def _curve(effect: str, j: EvaluatedModel) -> CurveFound | None:
    card, drive = library.load_effect(effect), j.fit.point.prepared.campaign.drive
    if card.curve is None:
        return None
    s, values = spread(j), dict(j.fit.point.values)
    here = (effect, *card.curve.simpler_forms)
    own = [k for k, c in enumerate(s.coordinates) if not c.of_point and c.effect in here]
    for k in own:
        c = s.coordinates[k]
        values |= c.changes(values, c.bounded(float(s.x[k])))
    at = card.curve.places(values, drive.motor)
    value, slopes = card.curve.value(values, drive.motor, drive.converter, at), []
    for k in own:
        c, step = s.coordinates[k], STEP * float(s.sd[k])
        there = {**values, **c.changes(values, c.value(values) + step)}
        moved = card.curve.value(there, drive.motor, drive.converter, at)
        slopes.append((moved - value) / step if step else np.zeros(len(at)))
    plain = algebra(j.fit.normal).covariance(prior_of(j.fit.coordinates))[np.ix_(own, own)]
    size = np.sqrt(np.diag(plain))
    # as the parameters' own intervals
    wider = np.divide(s.sd[own], size, out=np.zeros(len(own)), where=size > 0.0)
    covariance = plain * np.outer(wider, wider)
    off = Z95 * np.sqrt(np.maximum(np.einsum("ki,kl,li->i", slopes, covariance, slopes), 0.0))
    low, high = (tuple(map(float, value + sign * off)) for sign in (-1.0, 1.0))
    said = card.curve.said(values, drive.motor, drive.converter)
    about = (card.curve.across, card.curve.unit_across, card.curve.of, card.curve.unit)
    return CurveFound(
        effect, *about, tuple(map(float, at)), tuple(map(float, value)), low, high, said
    )
