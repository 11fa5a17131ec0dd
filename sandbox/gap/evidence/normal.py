"""Normal equations of a campaign at one point: how readings answer to every coordinate, block by
block in time.

A segment is one channel (currents, motion, angle) of one recording; its residuals over the noise
are cut into blocks of BLOCK seconds, and each block keeps A = J'J, g = J'r and r'r.
Everything after the replay (fits, evidence, held-out errors, robust covariances) is algebra on
these, no further simulation.

A fit takes many steps on the slopes of one point: `NormalEquations.at` replays another
point and keeps the slopes.

Every recording has an angle of its own beside the encoder's offset: a locked rotor stands somewhere
within a count, and counts that beat with the sampling leave a bias in a motion, too: coordinate
"turn:FILE" of that recording only.  What a flux map may be off by has coordinates, too ("map:1",
...), in units of their prior (`sandbox.replay.map_error`).
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from contextvars import ContextVar
from dataclasses import dataclass, field, replace
from typing import Any, NamedTuple

import numpy as np

from model.array_types import Array
from model.errors import BadInput
from model.parameters import Drive
from sandbox.gap.evidence.priors import FARTHEST, Coordinate
from sandbox.plant.sets import ANGLE_OFFSET, complete
from sandbox.replay.grouping import ROOMS
from sandbox.replay.inputs import inputs_of
from sandbox.replay.map_error import with_map_error
from sandbox.replay.memory import SHARE
from sandbox.replay.replay import Prepared, StreamingReplay, in_threads, plan, residual_of
from sandbox.replay.segments import Segment, channel, colour_of, squared, squared_slopes
from sandbox.replay.sensitivity import Moves
from sandbox.replay.stretches import Stretch, stretches, whole_blocks
from sandbox.replay.walking import Block

BLOCK = 0.05  # s: several electrical time constants
STEP = 1e-4  # of a coordinate's prior deviation: the difference a slope is taken over
# blocks of a campaign: of a longer one (100 s) they grow, since each holds equations of its own
MANY = 2000
MOVING = 0.3  # of a reading's rms: bias that counts leave in the smoothed angle of a moving rotor
LOCK = "bench.lock_angle"
_COUNT: ContextVar[Callable[[float], None]] = ContextVar("count", default=lambda _: None)


@contextmanager
def counted(count: Callable[[float], None]) -> Iterator[None]:
    """Call `count` with the cost of everything simulated here from now on, in simulations of the
    whole campaign; who counted already goes on doing so."""
    outer = _COUNT.get()

    def both(cost: float) -> None:
        """Tell both."""
        outer(cost)
        count(cost)

    before = _COUNT.set(both)
    try:
        yield
    finally:
        _COUNT.reset(before)


@contextmanager
def part_of(share: float) -> Iterator[None]:
    """Count what is simulated here as so large a share: of a campaign of which only a part is
    looked at."""
    outer = _COUNT.get()
    before = _COUNT.set(lambda cost: outer(share * cost))
    try:
        yield
    finally:
        _COUNT.reset(before)


def simulated(cost: float) -> None:
    """Count something simulated elsewhere, in simulations of the whole campaign."""
    _COUNT.get()(cost)


class Sums(NamedTuple):
    """Normal equations: A (p, p), g (p,) and r'r, as the residual's squares are r'r - 2 g'dx + dx'A
    dx."""

    a: Array
    g: Array
    ssr: float


@dataclass(frozen=True)
class NormalEquations:
    """All segments at a point: coordinates (those of the point last), their values x (p,), the cost
    in simulations of the whole campaign; rows: slopes (n c, q) of each segment, as long as `at` is
    wanted; values: where these were taken."""

    coordinates: tuple[Coordinate, ...]
    x: Array
    segments: tuple[Segment, ...]
    simulations: float
    rows: tuple[Any, ...] = ()  # of `Rows`, which are sliced and reshaped like arrays
    values: Mapping[str, float] = field(default_factory=dict)

    def at(self, point: ParameterPoint, *, workers: int = 1) -> NormalEquations:
        """Return the equations at another point with the slopes of this one: one simulation.

        BadInput where the point is none a drive can have.
        """
        return self.at_each([point], workers=workers)[0]

    def at_each(
        self, points: Sequence[ParameterPoint], *, workers: int = 1
    ) -> list[NormalEquations]:
        """Return `at` for points of one campaign turned alike, side by side: one simulation
        each."""
        drive = points[0].prepared.campaign.drive
        sets = [complete(drive.motor, drive.converter, p.values) for p in points]
        prepared = points[0].turned()
        streaming, together, cut = (
            StreamingReplay(prepared),
            plan(prepared, sets),
            block_length(prepared),
        )
        out = [
            [replace(s, g=np.empty_like(s.g), ssr=np.empty_like(s.ssr)) for s in self.segments]
            for _ in points
        ]

        def task(job: tuple[Stretch, Block]) -> None:
            """Square one block of sets on one stretch with the slopes of every channel there."""
            stretch, block = job
            shown = residual_of(prepared, stretch, streaming.over(stretch, block))
            for k, (s, rows) in enumerate(zip(self.segments, self.rows, strict=True)):
                if s.recording == stretch.recording:
                    each = [
                        (channel(shown, s.channel, j), out[m][k])
                        for j, m in enumerate(block.members)
                    ]
                    squared(each, rows, colour_of(prepared, s.channel), stretch, cut)

        a_sample = 8 * 2 * 4 * ROOMS[-1] * workers  # its predictions and residuals
        for group in stretches(
            [r.samples for r in prepared.recordings],
            SHARE * prepared.spare / a_sample,
            whole_blocks(prepared.longest_start, cut),
        ):
            in_threads(task, [(stretch, block) for stretch in group for block in together], workers)
        _COUNT.get()(float(len(points)))
        return [self._with(*x) for x in zip(points, sets, out, strict=True)]

    def _with(
        self, point: ParameterPoint, values: Mapping[str, float], segments: Sequence[Segment]
    ) -> NormalEquations:
        """Return the equations with segments squared at a point."""
        x = [point.own(c) if c.of_point else c.value(values) for c in self.coordinates]
        return replace(self, x=np.array(x), segments=tuple(segments), simulations=1.0)

    def bare(self) -> NormalEquations:
        """Return the same without slopes, which are large."""
        return replace(self, rows=())

    def of(self, coordinates: Sequence[Coordinate]) -> NormalEquations | None:
        """Return the equations of some of the coordinates and all of the point's own, with their
        slopes; None where one of these has no column here.

        A column is told by how its coordinate moves the parameters: its label and its prior do not
        matter.
        """
        own = {self.move(c): k for k, c in enumerate(self.coordinates) if not c.of_point}
        turns = [k for k, c in enumerate(self.coordinates) if c.of_point]
        moves = [self.move(c) for c in coordinates]
        if not self.rows or any(m not in own for m in moves):
            return None
        kept = np.array([*(own[m] for m in moves), *turns])
        segments, rows = [], []
        for s, r in zip(self.segments, self.rows, strict=True):
            place = {int(k): m for m, k in enumerate(s.places)}
            new = np.array([m for m, k in enumerate(kept) if int(k) in place], dtype=np.int64)
            old = np.array([place[int(kept[m])] for m in new], dtype=np.int64)
            segments.append(replace(s, places=new, a=s.a[:, old][:, :, old], g=s.g[:, old]))
            rows.append(r[:, old] if isinstance(r, np.ndarray) else r.of(old))
        whole = (*coordinates, *(self.coordinates[k] for k in turns))
        return replace(
            self,
            coordinates=whole,
            x=self.x[kept],
            segments=tuple(segments),
            rows=tuple(rows),
            simulations=0.0,
        )

    def move(self, c: Coordinate) -> tuple[object, ...]:
        """Return what tells one column from another; parameters along with it that are there
        already move nothing."""
        return c.form, c.names, tuple((k, v) for k, v in c.along if self.values.get(k) != v), c.step

    def summed(self, weights: Mapping[tuple[int, str], float] | None = None) -> Sums:
        """Return A (p, p), g (p,) and r'r over all segments; weights: per (recording, channel), 0
        leaves one out."""
        p = len(self.x)
        a, g, ssr = np.zeros((p, p)), np.zeros(p), 0.0
        for s in self.segments:
            w = 1.0 if weights is None else weights.get((s.recording, s.channel), 0.0)
            if w:
                a[np.ix_(s.places, s.places)] += w * s.a.sum(0)
                g[s.places] += w * s.g.sum(0)
                ssr += w * float(s.ssr.sum())
        return Sums(a, g, ssr)

    def by_recording(self) -> tuple[Array, Array]:
        """Return the squares that each recording leaves (r,), all its channels together, and how
        many readings it has (r,)."""
        out = np.zeros((2, 1 + max(s.recording for s in self.segments)))
        for s in self.segments:
            out[:, s.recording] += float(s.ssr.sum()), float(s.n.sum())
        return out[0], out[1]


def equations_of(
    n: NormalEquations, kept: Sequence[int], coordinates: Sequence[Coordinate], held: Array
) -> NormalEquations:
    """Return normal equations of some coordinates, the others held at values (p,); coordinates:
    what to call these."""
    place = {k: m for m, k in enumerate(kept)}
    shift = held - n.x
    segments = []
    for s in n.segments:
        inside = np.array([m for m, k in enumerate(s.places) if int(k) in place], dtype=np.int64)
        move = shift[s.places]
        move[inside] = 0.0
        g = s.g - s.a @ move
        ssr = s.ssr - (s.g + g) @ move
        places = np.array([place[int(s.places[m])] for m in inside], dtype=np.int64)
        segments.append(
            Segment(
                s.recording, s.channel, places, s.a[:, inside][:, :, inside], g[:, inside], ssr, s.n
            )
        )
    return NormalEquations(tuple(coordinates), n.x[list(kept)], tuple(segments), 0.0)


@dataclass(frozen=True)
class ParameterPoint:
    """Where a fit stands: the prepared campaign, a completed set, and how far (rad) recordings'
    angles are turned."""

    prepared: Prepared
    values: Mapping[str, float]
    turns: Mapping[str, float] = field(default_factory=dict)

    def moved(self, coordinates: Sequence[Coordinate], x: Array) -> ParameterPoint:
        """Return the point whose coordinates have the values x, each inside its bounds."""
        values, turns, prepared = dict(self.values), dict(self.turns), self.prepared
        for c, to in zip(coordinates, x, strict=True):
            if c.form == "turn":
                turns[c.names[0]] = c.bounded(float(to))
            elif not c.of_point:
                values |= c.changes(values, c.bounded(float(to)))
        sizes = {
            int(c.names[0]): float(to)
            for c, to in zip(coordinates, x, strict=True)
            if c.form == "map"
        }
        if sizes and prepared.map_error is not None:
            prepared = with_map_error(prepared, prepared.map_error.moved(sizes))
        return ParameterPoint(prepared, values, turns)

    def own(self, c: Coordinate) -> float:
        """Return the value of a coordinate that is none of the parameters'
        (`Coordinate.of_point`)."""
        if c.form == "turn":
            return self.turns.get(c.names[0], 0.0)
        assert self.prepared.map_error is not None
        return float(self.prepared.map_error.x[int(c.names[0])])

    def turned(self) -> Prepared:
        """Return the prepared campaign with its recordings' angles turned."""
        period = self.prepared.campaign.drive.converter.sampling_period
        recordings = []
        for r in self.prepared.recordings:
            shift = self.turns.get(r.angle_name, 0.0)
            recordings.append(r.turned(shift, period) if shift else r)
        return replace(self.prepared, recordings=tuple(recordings))

    def resmoothed(self) -> ParameterPoint:
        """Return the point with the motion of free rotors smoothed again, by the torque of its own
        set."""
        p = self.prepared
        base = {k: v for k, v in self.values.items() if v == v}
        recordings = tuple(
            replace(inputs_of(p.campaign, p.campaign[r.file], base), start=r.start, hold=r.hold)
            if r.rotor == "free"
            else r
            for r in p.recordings
        )
        return ParameterPoint(replace(p, recordings=recordings, base=base), self.values, self.turns)


def turns(prepared: Prepared) -> list[Coordinate]:
    """Return one coordinate for each of `Prepared.angles`: known to a count, or to what counts
    leave of a motion, and to the zero of one that was made."""
    own = {
        r.angle_name: math.hypot(
            (1.0 if r.rotor == "locked" else MOVING) * r.angle_noise_std, r.zero
        )
        for r in prepared.recordings
    }
    return [
        Coordinate(f"turn:{name}", 0.0, size, "turn", (name,), within=FARTHEST)
        for name, size in own.items()
    ]


def modes(prepared: Prepared) -> list[Coordinate]:
    """Return one coordinate for each mode of what a flux map may be off by."""
    count = 0 if prepared.map_error is None else len(prepared.map_error.x)
    return [Coordinate(f"map:{k + 1}", 0.0, 1.0, "map", (str(k),)) for k in range(count)]


def normal(
    point: ParameterPoint, coordinates: Sequence[Coordinate], *, workers: int = 1
) -> NormalEquations:
    """Return the normal equations of a campaign at a point for the coordinates and all of the
    point's own.

    BadInput where the point is none a drive can have (masses, delays that bound each other).
    """
    drive = point.prepared.campaign.drive
    complete(drive.motor, drive.converter, point.values)
    prepared, values = point.turned(), point.values
    own_turns = turns(prepared)
    own = [*own_turns, *modes(prepared)]
    x = np.array([c.value(values) for c in coordinates])
    moves, steps = [], []
    for c, at in zip(coordinates, x, strict=True):
        step = {"share": 1.0, "presence": -1.0}.get(c.form, c.step or STEP * c.deviation)
        ahead, back = ({**values, **c.changes(values, at + s)} for s in (step, -step))
        if c.bounded(at + step) != at + step or (
            not possible(drive, ahead) and possible(drive, back)
        ):
            ahead, step = back, -step
        moves.append(ahead)
        steps.append(step)
    mechanical = [c.mechanical for c in coordinates]
    for name in (LOCK, ANGLE_OFFSET):  # how every recording answers to a turn of its own angle
        steps.append(STEP * own_turns[0].deviation)
        moves.append({**values, name: values[name] + steps[-1]})
        mechanical.append(False)
    parts = squared_slopes(
        prepared, Moves(values, moves, np.array(steps), mechanical), block_length(prepared), workers
    )
    x = np.append(x, [point.own(c) for c in own])
    free = sum(r.samples for r in prepared.recordings if r.rotor == "free") / prepared.samples
    cost = 1.0 + sum(free if m else 1.0 for m in mechanical)
    cost += 0.0 if prepared.map_error is None else 1.0  # the plant's transitions
    _COUNT.get()(cost)
    segments, rows = zip(*parts, strict=True)
    return NormalEquations((*coordinates, *own), x, segments, cost, rows, values)


def possible(drive: Drive, values: Mapping[str, float]) -> bool:
    """Return whether a drive can have a set: parameters that bound each other (masses, delays) keep
    apart."""
    try:
        complete(drive.motor, drive.converter, values)
    except BadInput:
        return False
    return True


def block_length(prepared: Prepared) -> int:
    """Return the samples of a block: BLOCK seconds, longer where there would be more than MANY of
    them."""
    usual = max(1, round(BLOCK / prepared.campaign.drive.converter.sampling_period))
    return max(usual, math.ceil(prepared.samples / MANY))
