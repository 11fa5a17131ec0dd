"""Normal equations of a campaign at one point: how readings answer to every coordinate, block by block in time.

A segment is one channel (currents, motion, angle) of one recording; its residuals over the noise floor are cut into
blocks of BLOCK seconds, and each block keeps A = J'J, g = J'r and r'r.  Everything after the replay (fits, evidence,
held-out errors, robust covariances) is algebra on these, no further simulation.

A fit takes many steps on the slopes of one point: `Normal.at` replays another point and keeps the slopes.

Every recording has an angle of its own beside the encoder's offset: a locked rotor stands somewhere within a count, and
counts that beat with the sampling leave a bias in a motion, too: coordinate "turn:FILE" of that recording only.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from model.errors import BadInput
from model.parameters import Drive
from sandbox.gap.evidence.priors import FARTHEST, Coordinate
from sandbox.plant.sets import ANGLE_OFFSET, complete
from sandbox.replay.inputs import inputs_of
from sandbox.replay.replay import Prepared, Residual, replay, residuals
from sandbox.replay.sensitivity import slopes

Array = NDArray[np.float64]
BLOCK = 0.05  # s: several electrical time constants
STEP = 1e-4  # of a coordinate's prior deviation: the difference a slope is taken over
MOVING = 0.3  # of a reading's rms: bias that counts leave in the smoothed angle of a moving rotor
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
    """All segments at a point: coordinates (turns last), their values x (p,), the cost in simulations of
    the whole campaign; rows: slopes (n c, q) of each segment, as long as `at` is wanted."""

    coordinates: tuple[Coordinate, ...]
    x: Array
    segments: tuple[Segment, ...]
    simulations: float
    rows: tuple[Array, ...] = ()

    def at(self, point: Point, *, workers: int = 1) -> Normal:
        """Return the equations at another point with the slopes of this one: one simulation.

        BadInput where the point is none a drive can have.
        """
        return self.at_each([point], workers=workers)[0]

    def at_each(self, points: Sequence[Point], *, workers: int = 1) -> list[Normal]:
        """Return `at` for points of one campaign turned alike, side by side: one simulation each."""
        drive = points[0].prepared.campaign.drive
        sets = [complete(drive.motor, drive.converter, p.values) for p in points]
        prepared = points[0].turned()
        shown = residuals(prepared, replay(prepared, sets, workers=workers))
        return [self._with(p, v, shown, k) for k, (p, v) in enumerate(zip(points, sets, strict=True))]

    def _with(self, point: Point, values: Mapping[str, float], shown: Sequence[Residual], k: int) -> Normal:
        """Return the equations for the residuals of set k."""
        cut = block_length(point.prepared)
        segments = []
        for s, rows in zip(self.segments, self.rows, strict=True):
            r = _channel(shown[s.recording], s.channel, k)
            g, rr = np.empty_like(s.g), np.empty_like(s.rr)
            for b, (first, last) in enumerate(blocks(len(r), cut)):
                own = r[first:last].ravel()
                wide = own.size // (last - first)
                with np.errstate(over="ignore", invalid="ignore"):  # of an absurd set: nothing is probable there
                    g[b], rr[b] = own @ rows[first * wide : last * wide], own @ own
            segments.append(replace(s, g=g, rr=rr))
        x = [point.turns.get(c.names[0], 0.0) if c.form == "turn" else c.value(values) for c in self.coordinates]
        return replace(self, x=np.array(x), segments=tuple(segments), simulations=1.0)

    def bare(self) -> Normal:
        """Return the same without slopes, which are large."""
        return replace(self, rows=())

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
    """Where a fit stands: the prepared campaign, a completed set, and how far (rad) recordings' angles are turned."""

    prepared: Prepared
    values: Mapping[str, float]
    turns: Mapping[str, float] = field(default_factory=dict)

    def moved(self, coordinates: Sequence[Coordinate], x: Array) -> Point:
        """Return the point whose coordinates have the values x, each inside its bounds."""
        values, turns = dict(self.values), dict(self.turns)
        for c, to in zip(coordinates, x, strict=True):
            if c.form == "turn":
                turns[c.names[0]] = c.bounded(float(to))
            else:
                values |= c.changes(values, c.bounded(float(to)))
        return Point(self.prepared, values, turns)

    def turned(self) -> Prepared:
        """Return the prepared campaign with its recordings' angles turned."""
        period = self.prepared.campaign.drive.converter.sampling_period
        recordings = []
        for r in self.prepared.recordings:
            shift = self.turns.get(r.file, 0.0)
            recordings.append(r.along(replace(r.motion, angle=r.motion.angle + shift), period) if shift else r)
        return replace(self.prepared, recordings=tuple(recordings))

    def resmoothed(self) -> Point:
        """Return the point with the motion of free rotors smoothed again, by the torque of its own set."""
        p = self.prepared
        base = {k: v for k, v in self.values.items() if v == v}
        recordings = tuple(
            inputs_of(p.campaign, p.campaign[r.file], base) if r.rotor == "free" else r for r in p.recordings
        )
        return Point(replace(p, recordings=recordings, base=base), self.values, self.turns)


def turns(prepared: Prepared) -> list[Coordinate]:
    """Return one coordinate per recording: its angle is known to a count, or to what counts leave of a motion."""
    share = {r.file: 1.0 if r.rotor == "locked" else MOVING for r in prepared.recordings}
    return [Coordinate(f"turn:{r.file}", 0.0, share[r.file] * r.angle_floor, "turn", (r.file,), within=FARTHEST)
            for r in prepared.recordings]  # fmt: skip


def normal(point: Point, coordinates: Sequence[Coordinate], *, workers: int = 1) -> Normal:
    """Return the normal equations of a campaign at a point for the coordinates and all turns.

    BadInput where the point is none a drive can have (masses, delays that bound each other).
    """
    drive = point.prepared.campaign.drive
    complete(drive.motor, drive.converter, point.values)
    prepared, values = point.turned(), point.values
    own_turns = turns(prepared)
    x = np.array([c.value(values) for c in coordinates])
    moves, steps = [], []
    for c, at in zip(coordinates, x, strict=True):
        step = 1.0 if c.form == "share" else STEP * c.deviation
        ahead, back = ({**values, **c.changes(values, at + s)} for s in (step, -step))
        if c.bounded(at + step) != at + step or (not possible(drive, ahead) and possible(drive, back)):
            ahead, step = back, -step
        moves.append(ahead)
        steps.append(step)
    mechanical = [c.mechanical for c in coordinates]
    for name in (LOCK, ANGLE_OFFSET):  # how every recording answers to a turn of its own angle
        steps.append(STEP * own_turns[0].deviation)
        moves.append({**values, name: values[name] + steps[-1]})
        mechanical.append(False)
    (current, motion, angle), base = slopes(prepared, values, moves, np.array(steps), mechanical, workers=workers)
    shown = residuals(prepared, base)
    p = len(coordinates)
    cut = block_length(prepared)
    segments, rows = [], []
    for k, (r, res) in enumerate(zip(prepared.recordings, shown, strict=True)):
        turn, sign = (p, 1.0) if r.rotor == "locked" else (p + 1, -1.0)
        columns, places = np.array([*range(p), turn]), np.array([*range(p), p + k])
        scale = np.append(np.ones(p), sign)
        parts = [("current", current[k], scale / prepared.floor)]
        moved, turned = motion[k], angle[k]
        if moved is not None:  # innovations are normalised already
            parts.append(("motion", moved[:, None, :], -scale))
        if turned is not None:
            turned[:, turn] = sign  # the reading turns with the angle itself, not with the encoder's offset
            parts.append(("angle", turned[:, None, :], scale / r.angle_floor))
        for channel, j, size in parts:
            own = _acting(j, columns, size)
            segments.append(_segment(k, channel, own[0], places[own[1]], _channel(res, channel), cut))
            rows.append(own[0])
    x = np.append(x, [point.turns.get(r.file, 0.0) for r in prepared.recordings])
    free = sum(r.samples for r in prepared.recordings if r.rotor == "free") / prepared.samples
    cost = 1.0 + sum(free if m else 1.0 for m in mechanical)
    return Normal((*coordinates, *own_turns), x, tuple(segments), cost, tuple(rows))


def possible(drive: Drive, values: Mapping[str, float]) -> bool:
    """Return whether a drive can have a set: parameters that bound each other (masses, delays) keep apart."""
    try:
        complete(drive.motor, drive.converter, values)
    except BadInput:
        return False
    return True


def block_length(prepared: Prepared) -> int:
    """Return the samples of a block."""
    return max(1, round(BLOCK / prepared.campaign.drive.converter.sampling_period))


def blocks(n: int, cut: int) -> list[tuple[int, int]]:
    """Return first and last sample of each block of n samples; the last block is half to one and a half long."""
    starts = range(0, max(1, n - cut // 2), cut)
    return [(first, n if first == starts[-1] else first + cut) for first in starts]


def _channel(r: Residual, channel: str, k: int = 0) -> Array:
    """Return a channel's residuals of set k, (n, c)."""
    if channel == "current":
        return r.current[:, :, k]
    shown = r.motion if channel == "motion" else r.angle
    assert shown is not None
    return shown[:, k : k + 1]


def _acting(j: Array, columns: NDArray[np.int64], scale: Array) -> tuple[Array, NDArray[np.int64]]:
    """Return the slopes (n c, q) of those coordinates that act on a channel, scaled, and which of them they are."""
    flat = j.reshape(-1, j.shape[-1])
    acts = np.flatnonzero(np.asarray(flat.any(axis=0))[columns])
    return flat[:, columns[acts]] * scale[acts], acts


def _segment(k: int, channel: str, j: Array, places: NDArray[np.int64], r: Array, cut: int) -> Segment:
    """Cut residuals r (n, c) and slopes j (n c, q) into blocks and square them."""
    wide, q = r.shape[1], j.shape[1]
    cuts = blocks(len(r), cut)
    a, g = np.empty((len(cuts), q, q)), np.empty((len(cuts), q))
    rr, count = np.empty(len(cuts)), np.empty(len(cuts))
    for b, (first, last) in enumerate(cuts):
        jb, rb = j[first * wide : last * wide], r[first:last].ravel()
        with np.errstate(over="ignore", invalid="ignore"):
            a[b], g[b] = jb.T @ jb, rb @ jb
            rr[b], count[b] = rb @ rb, rb.size
    return Segment(k, channel, places, a, g, rr, count)
