"""Which effects recordings could tell, before any residual is looked at: slopes at typical size
beside the noise.

An effect's typical size is worth z standard deviations of what ordinary deviations leave of it.
Only an excerpt of each recording is replayed; z grows with the root of the samples.  What an
encoder's misalignment of any size would do as well is no sign of another error of its reading: at a
rotor that never turns an eccentric disc is not told.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from model.array_types import Array
from model.effects.library import effect_names, load_effect
from sandbox.gap.evidence.fit import coordinates_of
from sandbox.gap.evidence.normal import ParameterPoint, normal
from sandbox.gap.evidence.priors import WIDE, Coordinate
from sandbox.gap.excerpts import excerpt, rows_to_settle
from sandbox.gap.posterior.candidates import at_typical
from sandbox.plant.sets import ANGLE_OFFSET, complete
from sandbox.recordings.campaign import Campaign, CampaignRecording
from sandbox.replay.replay import prepare

EXCERPT = 500  # samples of a recording
CLEAR, FAINT = 6.0, 2.0  # standard deviations of a typical size
ALIKE = 0.98  # cosine from which two effects look the same here


@dataclass(frozen=True)
class Visible:
    """How many standard deviations each effect's typical size is worth, largest first, and which
    two look alike."""

    sizes: dict[str, float]
    alike: tuple[tuple[str, str, float], ...]

    def words(self, effect: str) -> str:
        """Return 'clear', 'faint' or 'not'."""
        z = self.sizes[effect]
        return "clear" if z >= CLEAR else "faint" if z >= FAINT else "not"


def visible(campaign: Campaign, *, workers: int = 1) -> Visible:
    """Return what a campaign's recordings could tell; BadInput where they cannot be replayed."""
    period = campaign.drive.converter.sampling_period
    settling = rows_to_settle(campaign.drive.motor, period)
    parts = tuple(excerpt_of(r, settling, period) for r in campaign.recordings)
    share = sum(len(r.t) for r in campaign.recordings) / max(sum(len(r.t) for r in parts), 1)
    short = replace(campaign, recordings=parts)
    prepared = prepare(short)
    start = ParameterPoint(prepared, complete(campaign.drive.motor, campaign.drive.converter))
    own = coordinates_of(start, ())
    groups: dict[str, list[str]] = {}
    moved: dict[str, list[Coordinate]] = {}
    added = {c.label: c for c in own}
    for probe in at_typical(start):
        coordinates = probe.coordinates(start)
        added |= {c.label: c for c in coordinates if c.label not in added}
        groups[probe.effect], moved[probe.effect] = [c.label for c in coordinates], coordinates
    n = normal(start, list(added.values()), workers=workers)
    a, _, _ = n.summed()
    place = {c.label: k for k, c in enumerate(n.coordinates)}
    ordinary = {c.label for c in own} | {c.label for c in n.coordinates if c.of_point}
    size = {
        e: typical_move(own_, {c.label: k for k, c in enumerate(own_)}, groups[e])
        for e, own_ in moved.items()
    }
    precision = np.array([c.deviation**-2 if c.label in ordinary else 0.0 for c in n.coordinates])
    aligned = misaligned(precision, place, moved)
    left = {
        e: left_of(share * a, aligned if reads_angle(e) else precision, [place[x] for x in labels])
        for e, labels in groups.items()
    }
    sizes = {e: math.sqrt(max(float(size[e] @ left[e] @ size[e]), 0.0)) for e in groups}
    order = dict(sorted(sizes.items(), key=lambda x: -x[1]))
    return Visible(order, alike_pairs(share * a, precision, groups, place, size, sizes))


def excerpt_of(r: CampaignRecording, settling: int, period: float) -> CampaignRecording:
    """Return the stretch of a recording in which currents and angle move most, of at most EXCERPT
    samples, after so many in which states settle."""
    n = len(r.t)
    if n <= EXCERPT:
        return r
    starts = range(0, n - EXCERPT + 1, EXCERPT // 2)
    spread = [
        float(np.ptp(r.i_a[k : k + EXCERPT])) + 1e-3 * float(np.ptp(r.theta[k : k + EXCERPT]))
        for k in starts
    ]
    k = list(starts)[int(np.argmax(spread))]
    return excerpt(r, slice(k, k + EXCERPT), settling, period)


def typical_move(
    coordinates: Sequence[Coordinate], place: dict[str, int], labels: list[str]
) -> Array:
    """Return a typical move along an effect's coordinates."""
    own = [coordinates[place[x]] for x in labels]
    return np.array([1.0 if c.form == "share" else c.deviation / WIDE for c in own])


def reads_angle(effect: str) -> bool:
    """Return whether an effect is an error of the angle's reading that depends on the angle."""
    return effect in effect_names() and any(at.port == "angle" for at in load_effect(effect).at)


def misaligned(
    precision: Array, place: dict[str, int], moved: dict[str, list[Coordinate]]
) -> Array:
    """Return the precisions of ordinary deviations with an encoder that may be as far off as the
    effect has it."""
    out = precision.copy()
    for c in moved.get(ANGLE_OFFSET.partition(".")[0], ()):
        out[place[c.label]] = c.deviation**-2
    return out


def left_of(a: Array, precision: Array, places: list[int]) -> Array:
    """Return the information about some coordinates that ordinary deviations leave."""
    own = np.array(places, dtype=np.int64)
    others = np.setdiff1d(np.flatnonzero(precision > 0.0), own)
    inner = a[np.ix_(others, others)] + np.diag(precision[others])
    across = a[np.ix_(others, own)]
    return np.asarray(a[np.ix_(own, own)] - across.T @ np.linalg.solve(inner, across))


def alike_pairs(
    a: Array,
    precision: Array,
    groups: dict[str, list[str]],
    place: dict[str, int],
    size: dict[str, Array],
    sizes: dict[str, float],
) -> tuple[tuple[str, str, float], ...]:
    """Return pairs of effects, both to be seen, whose typical moves look the same beside ordinary
    deviations."""
    shown = [e for e in groups if sizes[e] >= FAINT]
    out = []
    for k, e in enumerate(shown):
        for f in shown[k + 1 :]:
            own, other = [place[x] for x in groups[e]], [place[x] for x in groups[f]]
            if set(own) & set(other):
                continue
            joint = left_of(a, precision, [*own, *other])
            n, d, g = len(own), size[e], size[f]
            whole = float(d @ joint[:n, :n] @ d) * float(g @ joint[n:, n:] @ g)
            if (
                whole > 0.0
                and (cosine := abs(float(d @ joint[:n, n:] @ g)) / math.sqrt(whole)) > ALIKE
            ):
                out.append((e, f, cosine))
    return tuple(sorted(out, key=lambda x: -x[2]))
