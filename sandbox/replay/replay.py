"""Replay: a recorded campaign drives the plant, many parameter sets side by side.

In: commanded voltages, the link voltage as read, and the rotor's motion behind the encoder (`smoothing`).
Out: what the three current sensors would read at each sample and, for a free rotor, the innovations of the encoder's
reading: predicted torque through the shaft's equations against the measured angle, one sample ahead.  All 26 effects
act (`sandbox.plant`).  With the angle prescribed nothing feeds back, so predictions stay
stable however wrong a set is, and each set costs the same.

    prepared = prepare(read_campaign(folder))
    prediction = replay(prepared, [{}, {"dead_time.time": 2e-6}])
    residual = residuals(prepared, prediction)

Checked: against the switched bench effect by effect, and on recordings of a foreign bench with known effects (noise
floor); tests/sandbox/replay/test_replay.py.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from model.compiled import kernel
from model.energy import SOLVED, AnyEnergy, Energy, flux_newton
from model.errors import BadInput
from model.frames import stationary
from model.parameters import Converter, Motor
from model.spline import SplineEnergy
from sandbox.plant import additions, ports
from sandbox.plant.batch import blank_room
from sandbox.plant.sets import batch_of, complete, features_of, readings_at, rows_of, timing_of
from sandbox.recordings.campaign import Campaign
from sandbox.replay.blocks import grouped, room_of
from sandbox.replay.inputs import Inputs, inputs_of, noise_floor, readings_off, with_columns
from sandbox.replay.kernel import run

Array = NDArray[np.float64]
Set = Mapping[str, float]
STEPS = (1, 2, 4, 8)
ENERGY_ROWS = (
    ("gamma_d", 1), ("gamma_q", 1), ("cubic_d", 3), ("cubic_q", 1), ("quartic_d", 4), ("quartic_dq", 1),
    ("quartic_q", 4),
)  # fmt: skip
ACCURACY = 0.02  # of the noise floor: largest rms change on halving the plant's step


@dataclass(frozen=True)
class Prepared:
    """A campaign ready for replay: inputs of each recording, plant steps a sampling period, floors, base set."""

    campaign: Campaign
    recordings: tuple[Inputs, ...]
    steps: int
    floor: float  # A rms of one phase's reading
    base: Set

    @property
    def samples(self) -> int:
        """All samples of all recordings."""
        return sum(r.samples for r in self.recordings)


@dataclass(frozen=True)
class Prediction:
    """What sets predict, per recording: currents (n, 3, sets) in A; motion (n, sets), innovations in standard
    deviations (free rotor, else None); angle (n, sets), the encoder's reading in rad (driven rotor, else None)."""

    currents: tuple[Array, ...]
    motion: tuple[Array | None, ...]
    angle: tuple[Array | None, ...]


@dataclass(frozen=True)
class Residual:
    """One recording's residuals over their noise floors: current (n, 3, sets); motion, angle (n, sets) or None."""

    file: str
    rotor: str
    current: Array
    motion: Array | None
    angle: Array | None

    def rms(self) -> Array:
        """Return the current residual's rms of each set (sets,); 1 is noise."""
        return np.asarray(np.sqrt(np.mean(self.current**2, axis=(0, 1))))


def prepare(
    campaign: Campaign, base: Set | None = None, *, files: Sequence[str] | None = None, steps: int | None = None
) -> Prepared:
    """Return a campaign's inputs for `replay`.

    base: parameter set at which a free rotor's angle is smoothed (its torque helps the encoder; repeat where a fit has
    moved far).  files: which recordings, all by default.  steps: plant steps a sampling period; by default the least
    whose halving moves no recording's prediction by more than ACCURACY of the noise floor.
    """
    drive = campaign.drive
    complete(drive.motor, drive.converter, base)
    chosen = campaign.recordings if files is None else tuple(campaign[f] for f in files)
    if not chosen:
        raise BadInput("no recording to replay; name at least one file of the campaign")
    floor = noise_floor(drive.converter)
    wanted = STEPS if steps is None else (steps,)
    first = tuple(inputs_of(campaign, r, dict(base or {})) for r in chosen)
    prepared = Prepared(campaign, first, wanted[0], floor, dict(base or {}))
    if steps is not None:
        return prepared
    for _ in STEPS[1:]:
        if max(halving_error(prepared)) <= ACCURACY:
            break
        prepared = with_steps(prepared, 2 * prepared.steps)
    return prepared


def with_steps(prepared: Prepared, steps: int) -> Prepared:
    """Return the same with another number of plant steps a sampling period."""
    if isinstance(steps, bool) or not isinstance(steps, int) or steps < 1:
        raise BadInput(f"steps = {steps!r} is no number of plant steps a period; give a whole number >= 1")
    return replace(prepared, steps=steps)


def halving_error(prepared: Prepared, values: Set | None = None) -> list[float]:
    """Return per recording the rms change of the readings, in noise floors, when the plant's step is halved."""
    values = prepared.base if values is None else values
    coarse = replay(prepared, [values]).currents
    fine = replay(with_steps(prepared, 2 * prepared.steps), [values]).currents
    return [float(np.sqrt(np.mean((a - b) ** 2))) / prepared.floor for a, b in zip(coarse, fine, strict=True)]


def replay(prepared: Prepared, sets: Sequence[Set], *, workers: int = 1) -> Prediction:
    """Return what parameter sets predict for the recordings; workers: threads (bit-identical results for any number).

    A set is a mapping such as {"dead_time.time": 2e-6, "bench.lock_angle": 1e-3}; what is not named is neutral.
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

    in_threads(task, [(r, b) for r in range(len(prepared.recordings)) for b in range(len(blocks))], workers)
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
    """Return each recording's residuals (read less predicted) over their noise floors."""
    out = []
    for r, current, motion, angle in zip(
        prepared.recordings, prediction.currents, prediction.motion, prediction.angle, strict=True
    ):
        turned = None if angle is None else (r.track["read"][:, None] - angle) / r.angle_floor
        out.append(Residual(r.file, r.rotor, (r.read[:, :, None] - current) / prepared.floor, motion, turned))
    return out


@dataclass(frozen=True)
class Block:
    """Sets that run together: their places, the batch, lock angles, common features; late: whole periods
    by which the voltage of all of them comes later."""

    members: tuple[int, ...]
    batch: Any
    lock: Array
    features: int
    late: int = 0

    @property
    def lanes(self) -> int:
        """Sets that its batch has room for."""
        return len(self.batch["offset"])


def plan(prepared: Prepared, sets: Sequence[Set]) -> list[Block]:
    """Return the blocks in which sets run: those that need the same effects together, so that none pays for others."""
    drive = prepared.campaign.drive
    complete_sets = [complete(drive.motor, drive.converter, s) for s in sets]
    needs = [features_of(drive.motor, v) for v in complete_sets]
    out = []
    late = [whole_periods(drive.motor, drive.converter, v) for v in complete_sets]
    for periods in sorted(set(late)):
        own = [k for k in range(len(sets)) if late[k] == periods]
        together = grouped([needs[k] for k in own])
        out += [block_of(prepared, [own[k] for k in group], complete_sets) for group in together]
    return out


def whole_periods(motor: Motor, converter: Converter, v: Set) -> int:
    """Return by how many whole periods a completed set's voltage comes later than its sample is taken."""
    return max(0, math.floor(-rows_of(motor, converter, v)["sample"] / converter.sampling_period))


def block_of(prepared: Prepared, members: Sequence[int], complete_sets: Sequence[Set]) -> Block:
    """Return one block of sets, as many whole periods late as the first of them; free lanes repeat that one."""
    drive = prepared.campaign.drive
    motor, converter = drive.motor, drive.converter
    own = [complete_sets[k] for k in members]
    features = 0
    for v in own:
        features |= features_of(motor, v)
    lanes = room_of(len(own))
    own += [own[0]] * (lanes - len(own))
    lock = np.array([v["bench.lock_angle"] for v in own])
    batch, late = batch_of(motor, converter, own, lanes), whole_periods(motor, converter, own[0])
    if late:
        batch["delay"] -= late * converter.sampling_period
        batch["sample"] += late * converter.sampling_period
        batch["when"] = readings_at(batch["sample"], converter.sampling_period)
    return Block(tuple(members), batch, lock, features, late)


def run_block(prepared: Prepared, r: Inputs, block: Block, out: Array, moved: Array, first: int) -> None:
    """Replay one recording through one block into columns first ... of out (n, 3, ...) and moved (n, ...)."""
    w, drive = block.batch.copy(), prepared.campaign.drive
    if r.rotor == "locked":
        w["offset"] -= block.lock
        w["off_c"], w["off_s"] = np.cos(w["offset"]), np.sin(w["offset"])
    energy = drive.motor.energy
    flux_map = energy if isinstance(energy, SplineEnergy) else None
    features = block.features | (additions.MOTION if r.rotor == "free" else 0)
    _start(w, r, flux_map)
    timing = timing_of(w, drive.converter.sampling_period, prepared.steps)
    track = later(r.track, block.late)
    run(w, flux_map, timing, features, blank_room(block.lanes), track, r.motion.eccentric, out, moved, first)


def later(track: Any, periods: int) -> Any:
    """Return a track whose commands act so many whole periods later; before them, none."""
    if not periods:
        return track
    columns = {}
    for name in ("d_a", "d_b", "d_c"):
        columns[name] = np.concatenate([np.full(periods, 0.5), track[name]])[: len(track)]
    return with_columns(track, columns)


def _start(w: Any, r: Inputs, flux_map: SplineEnergy | None) -> None:
    """Set the states at the first sample: without current, or (`Inputs.loaded`) with the current as read."""
    lanes = len(w["offset"])
    off = np.zeros((1, lanes))
    for _ in range(2):  # the deviation at the true angle
        turn = r.motion.angle[:1] / r.pole_pairs - np.mean(w["offset"] + off[0]) / r.pole_pairs
        off[:] = 0.0
        if r.motion.eccentric:
            readings_off(w, turn, off)
    theta = r.motion.angle[0] - w["offset"] - off[0]
    c, s = np.cos(theta), np.sin(theta)
    rest = np.zeros((2, lanes))
    at_rest(w, c, s, rest)
    for j in range(lanes):
        d = q = 0.0
        if r.loaded:
            d, q = _flux_as_read(w, j, r, c[j], s[j], flux_map)
        d, q = d + w["magnet"][j] + rest[0, j], q + rest[1, j]
        w["psi_a"][j], w["psi_b"][j] = c[j] * d - s[j] * q, s[j] * d + c[j] * q
    w["eddy_a"], w["eddy_b"] = w["psi_a"], w["psi_b"]


@kernel
def at_rest(w, c, s, rest):
    """Write the magnets' harmonics (2, lanes) in Wb at angles of cos c, sin s (lanes,)."""
    for j in range(w.psi_a.size):
        rest[0, j], rest[1, j], _, _ = ports.magnets(w, j, c[j], s[j])
        for k in range(w.more_magnets):
            d, q, _, _ = ports.further_magnets(w, k, j, c[j], s[j])
            rest[0, j], rest[1, j] = rest[0, j] + d, rest[1, j] + q


def _flux_as_read(w: Any, j: int, r: Inputs, c: float, s: float, flux_map: SplineEnergy | None) -> tuple[float, float]:
    """Return the flux (Wb) that the first reading's current links in lane j; its lags start from that current."""
    phases = np.array(unread(w, j, *(r.read[0] - w["common"][j])))
    i_a, i_b = stationary(*(float(x) for x in phases))
    own: AnyEnergy = Energy(*(float(w[row][j] / n) for row, n in ENERGY_ROWS))
    i_d, i_q = c * i_a + s * i_b, c * i_b - s * i_a
    if flux_map is not None:
        own = flux_map
    d, q, status = flux_newton(own, i_d, i_q, 0.0, 0.0)
    if status != SOLVED:
        raise BadInput(f"{r.file}: no flux of this motor gives the first reading of {math.hypot(i_a, i_b):.3g} A")
    for name, i in (("a", i_a), ("b", i_b)):
        for lag in ("slow", "filter", "i"):
            w[f"{lag}_{name}"][j] = i
    return float(d), float(q)


@kernel
def unread(w, j, a, b, c):
    """Return the phase currents (A) behind three readings: the port `reading` is solved for them, gains near one."""
    x, y, z = a, b, c
    for _ in range(20):
        p, q, r = ports.reading(w, j, x, y, z)
        x, y, z = x + (a - p), y + (b - q), z + (c - r)
    return x, y, z


def in_threads(task, jobs, workers: int) -> None:
    """Run task(job) for all jobs on so many threads; compiled code releases the interpreter."""
    if workers < 1:
        raise BadInput(f"workers = {workers} is no number of threads; give 1 or more")
    if workers == 1:
        for job in jobs:
            task(job)
        return
    with ThreadPoolExecutor(workers) as pool:
        for _ in pool.map(task, jobs):
            pass
