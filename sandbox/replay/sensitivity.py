"""Sensitivities of a replayed campaign: d(predicted reading)/d(parameter), by differences side by
side.

Each block of lanes carries the base set in its first lane and one displaced set in each other, so a
difference is between numbers of the same code; steps are SHARE of the parameter's typical size (or
of what a bench deviates by). Replay is in strict double precision, so so small a step costs no
digits that matter: the error is the second derivative's, SHARE / 2 of the typical effect's own
curvature (checked against Richardson's extrapolation).

Where an effect is off, its other parameters (a ripple's frequency, a cogging order, ...) are at
their typical values, which changes no bit of the base and lets its size be screened.  A neutral
value of infinity is left along the reciprocal: `coordinates` then says "1/...".
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from model.array_types import Array
from model.compiled import kernel
from model.effects import library
from model.errors import BadInput, unknown
from sandbox.plant import additions
from sandbox.plant.sets import BENCH, complete, parameter_names
from sandbox.replay.grouping import ROOMS, grouped
from sandbox.replay.replay import (
    Prepared,
    Set,
    Shown,
    StreamingReplay,
    block_of,
    in_threads,
    needs_of,
)
from sandbox.replay.stretches import Stretch, stretches

SHARE = 1e-4


@dataclass(frozen=True)
class Sensitivity:
    """Derivatives per recording: currents (n, 3, p) in A, motion (n, p) in standard deviations
    (free, else None), angle (n, p) in rad (driven, else None), each per unit of the parameter's
    coordinate.

    names: (p,); coordinates: (p,) a name, or "1/name"; steps: (p,) differences taken in the
    coordinate; typical: (p,) the coordinate's change at typical size; base: the completed set.
    """

    names: tuple[str, ...]
    coordinates: tuple[str, ...]
    steps: Array
    typical: Array
    base: Set
    currents: tuple[Array, ...]
    motion: tuple[Array | None, ...]
    angle: tuple[Array | None, ...]


def all_parameters() -> tuple[str, ...]:
    """Return every parameter that moves a prediction: all but pure noise, doubles of one number,
    what neither fits nor has a size, and further parts of effects."""
    known = library.parameters()
    sized = {n for n, p in known.items() if p.typical or p.fit not in ("fixed", "log")}
    silent = {n for n, p in known.items() if not p.predicted or p.same_as or n not in sized}
    return tuple(n for n in parameter_names() if n not in silent and not library.is_further(n))


def base_set(prepared: Prepared, base: Set | None = None) -> dict[str, float]:
    """Return the completed set, typical values given to the companions of effects that are off (see
    above)."""
    drive = prepared.campaign.drive
    out = complete(drive.motor, drive.converter, prepared.base if base is None else base)
    neutral = library.neutral(drive.motor)
    for card in map(library.load_effect, library.effect_names()):
        if card.switches and card.switched_off(out, neutral):
            for name, value in library.typical(card.name, drive.motor, drive.converter).items():
                if name.partition(".")[2] not in card.switches and out[name] == neutral[name]:
                    out[name] = value
    return out


def typical_change(prepared: Prepared, name: str, value: float) -> float:
    """Return the size of a parameter's typical change in its coordinate (the reciprocal where it is
    infinite)."""
    motor, converter = prepared.campaign.drive.motor, prepared.campaign.drive.converter
    if name in BENCH:
        if name == "bench.soft_current":
            return 0.2 * value
        if name == "bench.common_offset":
            return 1e-2 * motor.rated_current
        return 1e-2 * (motor.rated_torque if name.endswith("torque_offset") else 1.0)
    p = library.parameters()[name]
    neutral, size = p.neutral_for(motor), p.typical_for(motor, converter)
    if math.isinf(neutral):
        return 1.0 / size if math.isinf(value) else size
    if p.resolved_by == "time":  # a radian at the end of the longest recording
        return 1.0 / (
            math.tau * converter.sampling_period * max(r.samples for r in prepared.recordings)
        )
    if p.resolved_by == "turns":  # likewise
        free = [float(np.ptp(r.motion.angle)) for r in prepared.recordings if r.rotor == "free"]
        return min(1.0, motor.pole_pairs / max(1.0, *free, 1.0))
    return p.away_for(motor, converter)


class Displaced(NamedTuple):
    """A set with one parameter moved, by which step, and the name of the coordinate that moved."""

    values: dict[str, float]
    step: float
    coordinate: str


def displaced(prepared: Prepared, base: Set, name: str, share: float) -> Displaced:
    """Return a set with one parameter moved by a share of its typical change."""
    value, size = base[name], typical_change(prepared, name, base[name])
    step = share * size
    if math.isinf(value):
        step = max(abs(share), library.parameters()[name].secant) * size
        return Displaced({**base, name: 1.0 / step}, step, f"1/{name}")
    p = BENCH.get(name) or library.parameters()[name]
    if value + step > p.high:
        step = -step
    return Displaced({**base, **library.moved(name, value + step)}, step, name)


def sensitivities(
    prepared: Prepared,
    names: Sequence[str] | None = None,
    base: Set | None = None,
    *,
    workers: int = 1,
    share: float = SHARE,
) -> Sensitivity:
    """Return d(reading)/d(parameter) of the whole campaign at a base set (default: the prepared
    one).

    names: parameters, all by default; workers: threads, any number gives the same bits; share: step
    over typical size. BadInput for an unknown name, or a share that is none.
    """
    chosen = all_parameters() if names is None else tuple(names)
    for name in chosen:
        if name not in parameter_names():
            raise unknown("parameter", name, parameter_names())
    if not chosen or not 0.0 < abs(share) <= 1.0:
        raise BadInput(
            f"{len(chosen)} parameters, share = {share!r}; give at least one name and a "
            "share in (0, 1]"
        )
    at = base_set(prepared, base)
    moves = [displaced(prepared, at, name, share) for name in chosen]
    steps = np.array([m.step for m in moves])
    mechanical = [mechanical_only(name) for name in chosen]
    every = stretches([r.samples for r in prepared.recordings], math.inf)
    found = [
        x
        for _, x in slopes(
            prepared,
            Moves(at, [m.values for m in moves], steps, mechanical),
            every,
            workers=workers,
        )
    ]
    typical = np.array([typical_change(prepared, name, at[name]) for name in chosen])
    currents, motion, angle = (
        tuple(getattr(x, name) for x in found) for name in ("current", "motion", "angle")
    )
    return Sensitivity(
        chosen, tuple(m.coordinate for m in moves), steps, typical, at, currents, motion, angle
    )


class Slopes(NamedTuple):
    """Slopes over a stretch (`Sensitivity`): current (m, 3, p), motion and angle (m, p) or None;
    base: what the set itself predicts there, of one set."""

    current: Array
    motion: Array | None
    angle: Array | None
    base: Shown


@dataclass(frozen=True)
class Moves:
    """Displaced sets `to` (p,), beside the set `at`; steps: (p,) in any unit; mechanical: (p,) this
    one acts on free rotors only; map_modes: columns (0) of a flux map's modes, which are left to
    the caller, behind those of the sets."""

    at: Set
    to: Sequence[Set]
    steps: Array
    mechanical: Sequence[bool]
    map_modes: int = 0


def slopes(
    prepared: Prepared, moves: Moves, groups: Sequence[Sequence[Stretch]], *, workers: int = 1
) -> Iterator[tuple[Stretch, Slopes]]:
    """Yield (reading at a moved set - reading at the set) / step for each stretch; a group of them
    at a time.

    Sets that act on the motion alone have the base set's torque: only their shafts are moved.
    """
    streaming, sets = StreamingReplay(prepared), [moves.at, *moves.to]
    both = [[k for k, m in enumerate(moves.mechanical) if m == only] for only in (False, True)]
    electrical, mechanical = _blocks(prepared, sets, both[0]), _shafts(prepared, sets, both[1])
    for group in groups:
        results = {s: _empty(prepared, s, len(moves.to) + moves.map_modes) for s in group}
        jobs = []
        for s in group:
            jobs += [(s, block, columns, k == 0) for k, (block, columns) in enumerate(electrical)]
        jobs.sort(key=lambda job: -(job[0].last - job[0].first) * job[1].features.bit_count())

        def task(job, results=results) -> None:
            """Fill in the slopes of one block of sets on one stretch."""
            s, block, columns, first = job
            shown, out, inverse = streaming.over(s, block), results[s], 1.0 / moves.steps[columns]
            m = s.last - s.first
            differences(
                shown.current.reshape(3 * m, -1), inverse, columns, out.current.reshape(3 * m, -1)
            )
            if shown.motion is not None:
                differences(shown.motion, inverse, columns, out.motion)
            if shown.angle is not None:
                out.angle[:, columns] = (
                    shown.angle[:, 1 : len(columns) + 1] - shown.angle[:, :1]
                ) * inverse
            if first:
                for own, base in zip(out.base, shown, strict=True):
                    if base is not None:
                        own[:] = base[..., :1]

        def turned(job, results=results) -> None:
            """Fill in the slopes of innovations of one block of shafts on one stretch."""
            s, block, columns = job
            moved = streaming.turned(s, block, electrical[0][0])
            differences(moved, 1.0 / moves.steps[columns], columns, results[s].motion)

        in_threads(task, jobs, workers)
        free = [s for s in group if prepared.recordings[s.recording].rotor == "free"]
        in_threads(turned, [(s, *own) for s in free for own in mechanical], workers)
        yield from results.items()


def mechanical_only(name: str) -> bool:
    """Return whether a parameter acts on the motion of a free rotor only."""
    if name in BENCH:
        return name.startswith("bench.load_torque")
    return library.load_effect(name.partition(".")[0]).subsystem == "mechanics"


def _empty(prepared: Prepared, s: Stretch, p: int) -> Slopes:
    rotor, m = prepared.recordings[s.recording].rotor, s.last - s.first

    def room(p: int) -> Shown:
        """Return room for p sets."""
        motion, angle = (np.zeros((m, p)) if rotor == kind else None for kind in ("free", "driven"))
        return Shown(np.zeros((m, 3, p)), motion, angle)

    return Slopes(*room(p), room(1))


def _blocks(prepared: Prepared, sets: Sequence[Mapping[str, float]], columns: Sequence[int]):
    """Return blocks of the base and displaced sets, with their columns."""
    drive = prepared.campaign.drive
    base, *needs = (
        needs_of(drive.motor, drive.converter, sets[k]) for k in (0, *(k + 1 for k in columns))
    )
    found = [np.array([columns[k] for k in group]) for group in grouped(needs, base)]
    return [
        (block_of(prepared, [0, *(own + 1)], sets), own)
        for own in found or [np.empty(0, dtype=int)]
    ]


def _shafts(prepared: Prepared, sets: Sequence[Mapping[str, float]], columns: Sequence[int]):
    """Return the same of sets that move shafts alone: rigid shafts apart from compliant ones, which
    cost more."""
    motor, converter = prepared.campaign.drive.motor, prepared.campaign.drive.converter
    twists = [k for k in columns if needs_of(motor, converter, sets[k + 1]) & additions.TWIST]
    rigid, most = [k for k in columns if k not in twists], ROOMS[-1] - 1
    found = [
        np.array(own[k : k + most]) for own in (rigid, twists) for k in range(0, len(own), most)
    ]
    return [(block_of(prepared, [0, *(own + 1)], sets), own) for own in found]


@kernel
def differences(values, inverse, columns, out):
    """Write (values[:, j + 1] - values[:, 0]) inverse[j] to out[:, columns[j]]."""
    for k in range(len(values)):
        base = values[k, 0]
        for j in range(len(columns)):
            out[k, columns[j]] = (values[k, j + 1] - base) * inverse[j]
