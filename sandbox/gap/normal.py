"""Normal equations of a campaign at one point: how readings answer to every coordinate, block by block in time.

A segment is one channel (currents, motion, angle) of one recording; its residuals over the noise floor are cut into
blocks of BLOCK seconds, and each block keeps A = J'J, g = J'r and r'r.  Everything after the replay (fits, evidence,
held-out errors, robust covariances) is algebra on these, no further simulation.

Each locked rotor has its own angle within an encoder count: coordinate "lock:FILE" of that recording only.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from sandbox.gap.space import Coordinate
from sandbox.replay.inputs import Inputs, inputs_of
from sandbox.replay.replay import Prepared, residuals
from sandbox.replay.sensitivity import slopes

Array = NDArray[np.float64]
BLOCK = 0.05  # s: several electrical time constants
STEP = 1e-4  # of a coordinate's prior deviation: the difference a slope is taken over
LOCK = "bench.lock_angle"


@dataclass(frozen=True)
class Segment:
    """One channel of one recording: places (p,) of its columns; per block A (b, p, p), g (b, p), rr (b,), n (b,)."""

    recording: int
    channel: str
    places: NDArray[np.int64]
    a: Array
    g: Array
    rr: Array
    n: Array


@dataclass(frozen=True)
class Normal:
    """All segments at a point: coordinates (lock angles last), their values x (p,), the cost in simulations of
    the whole campaign."""

    coordinates: tuple[Coordinate, ...]
    x: Array
    segments: tuple[Segment, ...]
    simulations: float

    def summed(self, weights: Mapping[tuple[int, str], float] | None = None) -> tuple[Array, Array, float]:
        """Return A (p, p), g (p,) and r'r over all segments; weights: per (recording, channel), 0 leaves one out."""
        p = len(self.x)
        a, g, rr = np.zeros((p, p)), np.zeros(p), 0.0
        for s in self.segments:
            w = 1.0 if weights is None else weights.get((s.recording, s.channel), 0.0)
            if w:
                a[np.ix_(s.places, s.places)] += w * s.a.sum(0)
                g[s.places] += w * s.g.sum(0)
                rr += w * float(s.rr.sum())
        return a, g, rr


@dataclass(frozen=True)
class Point:
    """Where a fit stands: the prepared campaign (its lock angles and smoothed motion included) and a completed set."""

    prepared: Prepared
    values: Mapping[str, float]

    def moved(self, coordinates: Sequence[Coordinate], x: Array) -> Point:
        """Return the point whose coordinates have the values x, each inside its bounds."""
        values, locks = dict(self.values), {}
        for c, to in zip(coordinates, x, strict=True):
            if c.form == "lock":
                locks[c.names[0]] = float(to)
            else:
                values |= c.changes(values, c.bounded(float(to)))
        recordings = tuple(_locked_at(r, locks[r.file]) if r.file in locks else r for r in self.prepared.recordings)
        return Point(replace(self.prepared, recordings=self._turned(recordings)), values)

    def _turned(self, recordings: Sequence[Inputs]) -> tuple[Inputs, ...]:
        period = self.prepared.campaign.drive.converter.sampling_period
        old = self.prepared.recordings
        steps = self.prepared.steps
        return tuple(r if r is o else r.with_steps(period, steps) for r, o in zip(recordings, old, strict=True))

    def resmoothed(self) -> Point:
        """Return the point with the motion of free rotors smoothed again, by the torque of its own set."""
        p = self.prepared
        base = {k: v for k, v in self.values.items() if v == v}
        recordings = tuple(
            inputs_of(p.campaign, p.campaign[r.file], base, p.steps) if r.rotor == "free" else r for r in p.recordings
        )
        return Point(replace(p, recordings=recordings, base=base), self.values)


def lock_angle(r: Inputs) -> float:
    """Return how far (rad) a locked recording's angle was moved from its reading."""
    return float(r.motion.angle[0] - np.mean(r.table[:, 9]))


def _locked_at(r: Inputs, angle: float) -> Inputs:
    shift = angle - lock_angle(r)
    return replace(r, motion=replace(r.motion, angle=r.motion.angle + shift)) if shift else r


def locks(prepared: Prepared) -> list[Coordinate]:
    """Return one coordinate per locked recording: its angle is known to a count of the encoder."""
    locked = [r for r in prepared.recordings if r.rotor == "locked"]
    return [Coordinate(f"lock:{r.file}", 0.0, r.angle_floor, "lock", (r.file,)) for r in locked]


def normal(point: Point, coordinates: Sequence[Coordinate], *, workers: int = 1) -> Normal:
    """Return the normal equations of a campaign at a point for the coordinates and all lock angles."""
    prepared, values = point.prepared, point.values
    own = locks(prepared)
    x = np.array([c.value(values) for c in coordinates])
    moves, steps = [], []
    for c, at in zip(coordinates, x, strict=True):
        step = 1.0 if c.form == "share" else STEP * c.deviation
        if c.bounded(at + step) != at + step:
            step = -step
        moves.append({**values, **c.changes(values, at + step)})
        steps.append(step)
    mechanical = [c.mechanical for c in coordinates]
    if own:
        moves.append({**values, LOCK: values[LOCK] + STEP * own[0].deviation})
        steps.append(STEP * own[0].deviation)
        mechanical.append(False)
    (current, motion, angle), base = slopes(prepared, values, moves, np.array(steps), mechanical, workers=workers)
    shown = residuals(prepared, base)
    period = prepared.campaign.drive.converter.sampling_period
    p = len(coordinates)
    cut = max(1, round(BLOCK / period))
    segments = []
    for k, (r, res) in enumerate(zip(prepared.recordings, shown, strict=True)):
        lock = [p + j for j, c in enumerate(own) if c.names[0] == r.file]
        places = np.array([*range(p), *lock])
        j = current[k].reshape(len(r.table), 3, -1)
        segments.append(_segment(k, "current", places, j, 1.0 / prepared.floor, res.current[:, :, 0], cut))
        moved, turned = motion[k], angle[k]
        if moved is not None and res.motion is not None:  # innovations are normalised already
            segments.append(_segment(k, "motion", places, moved[:, None, :], -1.0, res.motion, cut))
        if turned is not None and res.angle is not None:
            segments.append(_segment(k, "angle", places, turned[:, None, :], 1.0 / r.angle_floor, res.angle, cut))
    x = np.append(x, [lock_angle(r) for r in prepared.recordings if r.rotor == "locked"])
    free = sum(len(r.table) for r in prepared.recordings if r.rotor == "free") / prepared.samples
    cost = 1.0 + sum(free if m else 1.0 for m in mechanical)
    return Normal((*coordinates, *own), x, tuple(segments), cost)


def _segment(k: int, channel: str, places: NDArray[np.int64], j: Array, scale: float, r: Array, cut: int) -> Segment:
    """Cut residuals r (n, c) and slopes scale j (n, c, p) into blocks and square them; idle columns are dropped."""
    n, c, _ = j.shape
    p = len(places)
    starts = range(0, max(1, n - cut // 2), cut)
    a, g = np.empty((len(starts), p, p)), np.empty((len(starts), p))
    rr, count = np.empty(len(starts)), np.empty(len(starts))
    for b, first in enumerate(starts):
        last = n if b == len(starts) - 1 else first + cut
        jb, rb = j[first:last, :, :p].reshape((last - first) * c, p), r[first:last].ravel()
        a[b], g[b] = jb.T @ jb, rb @ jb
        rr[b], count[b] = rb @ rb, rb.size
    acts = np.flatnonzero(np.einsum("bii->i", a) > 0.0)
    a, g = scale * scale * a[:, acts[:, None], acts], scale * g[:, acts]
    return Segment(k, channel, places[acts], a, g, rr, count)
