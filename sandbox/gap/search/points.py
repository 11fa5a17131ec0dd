"""Points that fits of other sets begin from."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

from model.effects import library
from sandbox.gap.evidence.fit import Fit
from sandbox.gap.evidence.normal import Point
from sandbox.gap.evidence.priors import ordinary, with_usual_sign
from sandbox.gap.evidence.probes import Probe


def towards(best: Fit, key: Sequence[str], chosen: Sequence[Probe]) -> Point:
    """Return a fit's point with the effects that another set lacks at neutral, and those it has more begun."""
    campaign = best.point.prepared.campaign
    neutral, kept = library.neutral(campaign.drive.motor), {c.label for c in ordinary(campaign)}
    gone = tuple(f"{e}." for e in best.effects if e not in key)
    first = library.same_numbers()
    used = kept | {first.get(k, k) for k in neutral if k.partition(".")[0] in key}
    owns = {first.get(k, k) for k in neutral if k.startswith(gone)} - used
    off = {k: x for own in owns for k, x in library.moved(own, neutral[own]).items()}
    start = replace(best.point, values={**best.point.values, **off})
    return starting(start, [e for e in key if e not in best.effects], chosen)


def own_values(effects: Sequence[str], values: Mapping[str, float]) -> dict[str, float]:
    """Return those of a set's values that belong to some effects, and their doubles: a set holds both or neither."""
    first, out = library.same_numbers(), dict[str, float]()
    for name, value in values.items():
        if name.partition(".")[0] in effects:
            out |= library.moved(first.get(name, name), value)
    return out


def with_values(point: Point, values: Mapping[str, float]) -> Point:
    """Return a point with some values exchanged."""
    return replace(point, values={**point.values, **values})


def starting(point: Point, effects: Sequence[str], chosen: Sequence[Probe]) -> Point:
    """Return a point with the companions of effects where their probes start."""
    begun = {k: v for p in chosen if p.effect in effects for k, v in p.start.items()}
    return with_values(point, begun)


def unbent(point: Point) -> Point:
    """Return a point without effects whose currents' signs are the usual ones: where a fit with effects begins."""
    return replace(point, values=with_usual_sign(point.values, point.prepared.campaign.drive.motor))
