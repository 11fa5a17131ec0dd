"""Replay: a recorded campaign drives the plant, many parameter sets side by side.

In: commanded voltages, the link voltage as read, the rotor's motion behind the encoder
(`smoothing`), and the current as read at the first sample (`unread_start`).
Out: what the three current sensors would read at each sample and, for a free rotor, the innovations
of the encoder's reading: predicted torque through the shaft's equations against the measured angle,
one sample ahead.  All effects of the library act (`sandbox.plant`).  With the angle prescribed
nothing feeds back, so predictions stay stable however wrong a set is, and each set costs the same.
Only legs that give volts back are unstable; there readings hold the current
(`negative_resistance`).

    prepared = prepare(read_campaign(folder))
    prediction = replay(prepared, [{}, {"dead_time.time": 2e-6}])
    residual = residuals(prepared, prediction)

Checked: against the switched bench effect by effect, and on recordings of a foreign bench with
known effects (down to the noise); tests/sandbox/replay/test_replay.py.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, field, replace
from typing import NamedTuple

import numpy as np

from model.array_types import Array
from model.errors import BadInput
from model.parameters import Converter, Motor
from model.spline_correction import MapError
from sandbox.plant.sets import batch_of, complete, features_of, readings_at, sampled_at
from sandbox.recordings.campaign import Campaign
from sandbox.replay.grouping import SAMPLED, grouped, room_of
from sandbox.replay.inputs import Inputs, inputs_of, stated_noise_std
from sandbox.replay.negative_resistance import given_back
from sandbox.replay.stretches import Stretch
from sandbox.replay.walking import Block, Running

Set = Mapping[str, float]
STEPS = (1, 2, 4, 8)
ACCURACY = 0.02  # of the noise: largest rms change on halving the plant's step


@dataclass(frozen=True)
class Prepared:
    """A campaign ready for replay: inputs of each recording, plant steps a sampling period,
    standard deviations of readings, base set.

    spare: bytes that a diagnosis may take beside what grows with the campaign anyway
    (`sandbox.replay.memory`);
    colour: of current readings' errors;
    map_error: what the motor's flux map may be off by, and is taken to be off by here.
    """

    campaign: Campaign
    recordings: tuple[Inputs, ...]
    steps: int
    noise_std: float  # A rms of one phase's reading
    base: Set
    spare: float = math.inf
    map_error: MapError | None = None
    colour: tuple[float, ...] = ()

    @property
    def samples(self) -> int:
        """All samples of all recordings."""
        return sum(r.samples for r in self.recordings)

    @property
    def longest_start(self) -> int:
        """Samples over which the longest unread start shows: no stretch ends before."""
        return max((len(r.start.shape) for r in self.recordings if r.start is not None), default=0)

    @property
    def angles(self) -> list[str]:
        """Names of the angles that recordings are turned by, one a recording
        (`Inputs.angle_name`)."""
        return list(dict.fromkeys(r.angle_name for r in self.recordings))


@dataclass(frozen=True)
class Prediction:
    """What sets predict, per recording: currents (n, 3, sets) in A; motion (n, sets), innovations
    in standard deviations (free rotor, else None); angle (n, sets), the encoder's reading in rad
    (driven rotor, else None)."""

    currents: tuple[Array, ...]
    motion: tuple[Array | None, ...]
    angle: tuple[Array | None, ...]


class Shown(NamedTuple):
    """What a block predicts for a stretch: currents (m, 3, lanes) in A; innovations and encoder's
    readings (m, lanes) as in `Prediction`, or None."""

    current: Array
    motion: Array | None
    angle: Array | None


@dataclass(frozen=True)
class Residual:
    """One recording's residuals over the readings' standard deviations: current (n, 3, sets);
    motion, angle (n, sets) or None."""

    file: str
    rotor: str
    current: Array
    motion: Array | None
    angle: Array | None

    def rms(self) -> Array:
        """Return the current residual's rms of each set (sets,); 1 is noise."""
        return np.asarray(np.sqrt(np.mean(self.current**2, axis=(0, 1))))


def prepare(
    campaign: Campaign,
    base: Set | None = None,
    *,
    files: Sequence[str] | None = None,
    steps: int | None = None,
) -> Prepared:
    """Return a campaign's inputs for `replay`.

    base: parameter set at which a free rotor's angle is smoothed (its torque helps the encoder;
    repeat where a fit has moved far).  files: which recordings, all by default.  steps: plant steps
    a sampling period; by default the least whose halving moves no recording's prediction by more
    than ACCURACY of the noise. BadInput where no recording is left, or its values cannot be
    replayed.
    """
    drive = campaign.drive
    complete(drive.motor, drive.converter, base)
    chosen = campaign.recordings if files is None else tuple(campaign[f] for f in files)
    if not chosen:
        raise BadInput("no recording to replay; name at least one file of the campaign")
    wanted = STEPS if steps is None else (steps,)
    first = tuple(inputs_of(campaign, r, dict(base or {})) for r in chosen)
    prepared = Prepared(
        campaign, first, wanted[0], stated_noise_std(drive.converter), dict(base or {})
    )
    if steps is not None:
        return prepared
    for _ in STEPS[1:]:
        if max(halving_error(prepared)) <= ACCURACY:
            break
        prepared = with_steps(prepared, 2 * prepared.steps)
    return prepared


def with_steps(prepared: Prepared, steps: int) -> Prepared:
    """Return the same with another number of plant steps a sampling period; BadInput where that is
    none."""
    if isinstance(steps, bool) or not isinstance(steps, int) or steps < 1:
        raise BadInput(
            f"steps = {steps!r} is no number of plant steps a period; give a whole number >= 1"
        )
    return replace(prepared, steps=steps)


def halving_error(prepared: Prepared) -> list[float]:
    """Return per recording the rms change of the readings over their noise's standard deviation
    when the plant's step is halved."""
    out = []
    for r in prepared.recordings:  # one by one: two predictions of everything would be large
        own = replace(prepared, recordings=(r,))
        (coarse,), (fine,) = (
            replay(p, [prepared.base]).currents for p in (own, with_steps(own, 2 * own.steps))
        )
        out.append(float(np.sqrt(np.mean((coarse - fine) ** 2))) / prepared.noise_std)
    return out


def replay(prepared: Prepared, sets: Sequence[Set], *, workers: int = 1) -> Prediction:
    """Return what parameter sets predict for the recordings; workers: threads (bit-identical
    results for any number).

    A set is a mapping such as {"dead_time.time": 2e-6, "bench.lock_angle": 1e-3}; what is not named
    is neutral. BadInput without a set, or for one that cannot be.
    """
    if not sets:
        raise BadInput("no parameter set to replay; give at least one ({} for the nominal model)")
    blocks = plan(prepared, sets)
    width = sum(b.lanes for b in blocks)
    first = np.cumsum([0, *(b.lanes for b in blocks)])
    shapes = [(r.samples, width) for r in prepared.recordings]
    currents = [np.empty((n, 3, width)) for n, width in shapes]
    free = [r.rotor == "free" for r in prepared.recordings]
    moved = [np.empty(shape if f else (1, 1)) for f, shape in zip(free, shapes, strict=True)]

    def task(job: tuple[int, int]) -> None:
        """Fill in what one block of sets predicts for one recording."""
        r, b = job
        run_block(prepared, prepared.recordings[r], blocks[b], currents[r], moved[r], int(first[b]))

    in_threads(
        task, [(r, b) for r in range(len(prepared.recordings)) for b in range(len(blocks))], workers
    )
    order = np.empty(len(sets), dtype=int)
    for b, block in enumerate(blocks):
        order[list(block.members)] = first[b] + np.arange(len(block.members))
    pick = slice(0, len(sets)) if np.array_equal(order, np.arange(len(sets))) else order
    turned = [
        np.concatenate([r.encoder(b.batch)[:, : len(b.members)] for b in blocks], axis=1)
        if r.rotor == "driven"
        else None
        for r in prepared.recordings
    ]
    back = np.argsort(np.concatenate([b.members for b in blocks]))
    return Prediction(
        tuple(c[:, :, pick] for c in currents),
        tuple(m[:, pick] if f else None for f, m in zip(free, moved, strict=True)),
        tuple(None if t is None else t[:, back] for t in turned),
    )


def residuals(prepared: Prepared, prediction: Prediction) -> list[Residual]:
    """Return each recording's residuals (read less predicted) over the readings' standard
    deviations."""
    parts = zip(prediction.currents, prediction.motion, prediction.angle, strict=True)
    n = [r.samples for r in prepared.recordings]
    return [
        residual_of(prepared, Stretch(k, 0, n[k], n[k]), Shown(*x)) for k, x in enumerate(parts)
    ]


def residual_of(prepared: Prepared, s: Stretch, shown: Shown) -> Residual:
    """Return the residuals over a stretch of what is predicted there."""
    r, own = prepared.recordings[s.recording], slice(s.first, s.last)
    turned = (
        None if shown.angle is None else (r.angle_read[own, None] - shown.angle) / r.angle_noise_std
    )
    current = (r.read[own, :, None] - shown.current) / prepared.noise_std
    if r.start is not None and not s.first:
        r.start.taken_off(current)
    return Residual(
        r.file,
        r.rotor,
        current,
        shown.motion,
        turned,
    )


def plan(prepared: Prepared, sets: Sequence[Set]) -> list[Block]:
    """Return the blocks in which sets run: those that need the same effects together, so that none
    pays for others."""
    drive = prepared.campaign.drive
    complete_sets = [complete(drive.motor, drive.converter, s) for s in sets]
    needs = [needs_of(drive.motor, drive.converter, v) for v in complete_sets]
    out = []
    delay_periods = [whole_periods(drive.motor, drive.converter, v) for v in complete_sets]
    for periods in sorted(set(delay_periods)):
        own = [k for k in range(len(sets)) if delay_periods[k] == periods]
        together = grouped([needs[k] for k in own])
        out += [block_of(prepared, [own[k] for k in group], complete_sets) for group in together]
    return out


def needs_of(motor: Motor, converter: Converter, v: Set) -> int:
    """Return what a completed set needs beside the bare plant, as blocks are chosen by
    (`grouping`)."""
    return features_of(motor, v) | (SAMPLED if sampled_at(motor, converter, v) else 0)


def whole_periods(motor: Motor, converter: Converter, v: Set) -> int:
    """Return by how many whole periods a completed set's voltage comes later than its sample is
    taken."""
    return max(0, math.floor(-sampled_at(motor, converter, v) / converter.update_period))


def block_of(prepared: Prepared, members: Sequence[int], complete_sets: Sequence[Set]) -> Block:
    """Return one block of sets, as many whole periods late as the first of them; free lanes repeat
    that one."""
    drive = prepared.campaign.drive
    motor, converter = drive.motor, drive.converter
    own = [complete_sets[k] for k in members]
    features = 0
    for v in own:
        features |= features_of(motor, v)
    lanes = room_of(len(own))
    own += [own[0]] * (lanes - len(own))
    lock = np.array([v["bench.lock_angle"] for v in own])
    batch, delay_periods = (
        batch_of(motor, converter, own, lanes),
        whole_periods(motor, converter, own[0]),
    )
    if delay_periods:
        batch["delay"] -= delay_periods * converter.update_period
        batch["sample"] += delay_periods * converter.update_period
        batch["when"] = readings_at(batch["sample"], converter.update_period)
    given = given_back(motor, converter, own, batch["supply"])
    return Block(tuple(members), batch, lock, features, given, delay_periods)


def run_block(
    prepared: Prepared, r: Inputs, block: Block, out: Array, moved: Array, first: int
) -> None:
    """Replay one recording through one block into columns first ... of out (n, 3, ...) and moved
    (n, ...)."""
    Running.begun(prepared.campaign.drive, prepared.steps, r, block).on(
        r.samples, out, moved, first
    )


@dataclass(frozen=True)
class StreamingReplay:
    """Blocks of sets on their way through a campaign, stretch by stretch."""

    prepared: Prepared
    running: dict[tuple[int, int], Running] = field(default_factory=dict)
    torques: dict[tuple[int, int], Array] = field(default_factory=dict)

    def over(self, s: Stretch, block: Block) -> Shown:
        """Return what a block predicts for a stretch, the one after that asked for before."""
        r, state, key = self._at(s, block, settled=True)
        m, ahead = s.last - s.first, s.last < s.n
        current = np.empty((m + ahead, 3, block.lanes))
        moved = np.empty((m, block.lanes)) if r.rotor == "free" else np.empty((1, 1))
        state.on(s.last, current, moved)
        self.torques[key] = state.torque
        if ahead:
            self.running[key] = state
        turned = r.encoder(block.batch, s.first, s.last) if r.rotor == "driven" else None
        return Shown(current[:m], moved if r.rotor == "free" else None, turned)

    def turned(self, s: Stretch, block: Block, driver: Block) -> Array:
        """Return innovations (m, lanes) of a free rotor that a block of sets predicts which differ
        from another one's first in nothing but the motion; that one has gone over the stretch, and
        its torque drives them all."""
        _, state, key = self._at(s, block, settled=False)
        moved = np.empty((s.last - s.first, block.lanes))
        state.turn(s.last, self.torques[s.recording, id(driver)], moved)
        if s.last < s.n:
            self.running[key] = state
        return moved

    def _at(
        self, s: Stretch, block: Block, *, settled: bool
    ) -> tuple[Inputs, Running, tuple[int, int]]:
        """Return the recording, a block's state before a stretch, begun where there is none yet,
        and what it is kept by."""
        r, key = self.prepared.recordings[s.recording], (s.recording, id(block))
        state = self.running.pop(key, None)
        if state is None:
            state = Running.begun(
                self.prepared.campaign.drive, self.prepared.steps, r, block, settled=settled
            )
        return r, state, key


def in_threads(task, jobs, workers: int) -> None:
    """Run task(job) for all jobs on so many threads; compiled code releases the interpreter;
    BadInput for less than one."""
    if workers < 1:
        raise BadInput(f"workers = {workers} is no number of threads; give 1 or more")
    if workers == 1:
        for job in jobs:
            task(job)
        return
    with ThreadPoolExecutor(workers) as pool:
        for _ in pool.map(task, jobs):
            pass
