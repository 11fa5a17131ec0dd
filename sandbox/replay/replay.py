"""Replay: a recorded campaign drives the averaged plant, many parameter sets side by side.

In: commanded voltages, the link voltage as read, and the rotor's motion behind the encoder (`smoothing`).
Out: what the three current sensors would read at each sample and, for a free rotor, the innovations of the encoder's
reading: predicted torque through the shaft's equations against the measured angle, one sample ahead.  All 26 effects
act (`sandbox.replay.machine`, `legs`).  With the angle prescribed nothing feeds back, so predictions stay
stable however wrong a set is, and each set costs the same.

    prepared = prepare(read_campaign(folder))
    prediction = replay(prepared, [{}, {"dead_time.time": 2e-6}])
    residual = residuals(prepared, prediction)

Checked: against the switched bench effect by effect, and on recordings of a foreign bench with known effects (noise
floor); tests/sandbox/test_replay.py.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from model.energy import SOLVED, Energy, flux_newton
from model.errors import BadInput
from model.frames import stationary
from sandbox.campaign import Campaign
from sandbox.replay import lanes
from sandbox.replay.inputs import Inputs, inputs_of, noise_floor
from sandbox.replay.kernel import COSINE, READ, SINE, run
from sandbox.replay.sets import compile_sets, complete, features_of

Array = NDArray[np.float64]
Set = Mapping[str, float]
STEPS = (1, 2, 4, 8)
ENERGY_ROWS = (
    (lanes.GAMMA_D, 1), (lanes.GAMMA_Q, 1), (lanes.A3, 3), (lanes.B2, 1), (lanes.A4, 4), (lanes.C2, 1), (lanes.B4, 4)
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
        return sum(len(r.table) for r in self.recordings)


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
    first = tuple(inputs_of(campaign, r, dict(base or {}), wanted[0]) for r in chosen)
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
    recordings = tuple(
        r.with_steps(prepared.campaign.drive.converter.sampling_period, steps) for r in prepared.recordings
    )
    return Prepared(prepared.campaign, recordings, steps, prepared.floor, prepared.base)


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
    width = len(blocks) * lanes.LANES
    shapes = [(len(r.table), width) for r in prepared.recordings]
    currents = [np.empty((n, 3, width)) for n, width in shapes]
    free = [r.rotor == "free" for r in prepared.recordings]
    moved = [np.empty(shape if f else (1, lanes.LANES)) for f, shape in zip(free, shapes, strict=True)]

    def task(job: tuple[int, int]) -> None:
        """Fill in what one block of sets predicts for one recording."""
        r, b = job
        run_block(prepared, prepared.recordings[r], blocks[b], currents[r], moved[r], b * lanes.LANES)

    in_threads(task, [(r, b) for r in range(len(prepared.recordings)) for b in range(len(blocks))], workers)
    order = np.empty(len(sets), dtype=int)
    for b, block in enumerate(blocks):
        order[list(block.members)] = b * lanes.LANES + np.arange(len(block.members))
    pick = slice(0, len(sets)) if np.array_equal(order, np.arange(len(sets))) else order
    rows = np.concatenate([b.rows[:, : len(b.members)] for b in blocks], axis=1)
    rows = rows[:, np.argsort(np.concatenate([b.members for b in blocks]))]
    return Prediction(
        tuple(c[:, :, pick] for c in currents),
        tuple(m[:, pick] if f else None for f, m in zip(free, moved, strict=True)),
        tuple(r.encoder(rows) if r.rotor == "driven" else None for r in prepared.recordings),
    )


def residuals(prepared: Prepared, prediction: Prediction) -> list[Residual]:
    """Return each recording's residuals (read less predicted) over their noise floors."""
    out = []
    for r, current, motion, angle in zip(
        prepared.recordings, prediction.currents, prediction.motion, prediction.angle, strict=True
    ):
        turned = None if angle is None else (r.table[:, READ, None] - angle) / r.angle_floor
        out.append(Residual(r.file, r.rotor, (r.read[:, :, None] - current) / prepared.floor, motion, turned))
    return out


@dataclass(frozen=True)
class Block:
    """Up to LANES sets that run together: their places, compiled rows (ROWS, LANES), lock angles, common features."""

    members: tuple[int, ...]
    rows: Array
    lock: Array
    features: int


def plan(prepared: Prepared, sets: Sequence[Set]) -> list[Block]:
    """Return the blocks in which sets run: those that need the same effects together, so that none pays for others."""
    drive = prepared.campaign.drive
    complete_sets = [complete(drive.motor, drive.converter, s) for s in sets]
    needs = [features_of(v) for v in complete_sets]
    order = sorted(range(len(sets)), key=lambda k: (needs[k].bit_count(), needs[k]))
    if len(order) <= lanes.LANES:
        order = list(range(len(sets)))
    return [block_of(prepared, order[k : k + lanes.LANES], complete_sets) for k in range(0, len(order), lanes.LANES)]


def block_of(prepared: Prepared, members: Sequence[int], complete_sets: Sequence[Set]) -> Block:
    """Return one block; free lanes repeat its first set."""
    drive = prepared.campaign.drive
    own = [complete_sets[k] for k in members]
    own += [own[0]] * (lanes.LANES - len(own))
    features = 0
    for v in own:
        features |= features_of(v)
    lock = np.array([v["bench.lock_angle"] for v in own])
    return Block(tuple(members), compile_sets(drive.motor, drive.converter, own, prepared.steps), lock, features)


def run_block(prepared: Prepared, r: Inputs, block: Block, out: Array, moved: Array, first: int) -> None:
    """Replay one recording through one block into columns first ... of out (n, 3, ...) and moved (n, ...)."""
    rows = block.rows.copy()
    rows[lanes.LINK] *= r.link
    if r.rotor == "locked":
        rows[lanes.OFFSET] -= block.lock
        rows[lanes.OFF_C], rows[lanes.OFF_S] = np.cos(rows[lanes.OFFSET]), np.sin(rows[lanes.OFFSET])
    _start(rows, r)
    period = prepared.campaign.drive.converter.sampling_period
    free = r.rotor == "free"
    run(rows.ravel(), block.features, r.table, r.edges, r.turns, period, prepared.steps, free, out, moved, first)


def _start(rows: Array, r: Inputs) -> None:
    """Set the states at the first sample: without current, or (`Inputs.loaded`) with the current as read."""
    for j in range(rows.shape[1]):
        p = rows[:, j]
        error = p[lanes.ECC_COS] * r.table[0, SINE] + p[lanes.ECC_SIN] * r.table[0, COSINE]
        theta = math.atan2(r.turns[0, 0, 1], r.turns[0, 0, 0]) - p[lanes.OFFSET] - error
        co, si = math.cos(theta), math.sin(theta)
        d = q = 0.0
        if r.loaded:
            off_a, off_b = p[lanes.OFFSET_A], p[lanes.OFFSET_B]
            phases = (r.read[0] - p[lanes.COMMON] - (off_a, off_b, -off_a - off_b)) / p[lanes.GAIN_A : lanes.GAIN_C + 1]
            i_a, i_b = stationary(*(float(x) for x in phases))
            own = Energy(*(float(p[row] / n) for row, n in ENERGY_ROWS))
            d, q, status = flux_newton(own, co * i_a + si * i_b, co * i_b - si * i_a, 0.0, 0.0)
            if status != SOLVED:
                raise BadInput(
                    f"{r.file}: no flux of this motor gives the first reading of {math.hypot(i_a, i_b):.3g} A"
                )
            p[[lanes.SLOW_A, lanes.FILTER_A]], p[[lanes.SLOW_B, lanes.FILTER_B]] = i_a, i_b
        d += p[lanes.MAGNET] + p[lanes.PSI_D6] * math.cos(6.0 * theta)
        q += p[lanes.PSI_Q6] * math.sin(6.0 * theta)
        p[lanes.PSI_A], p[lanes.PSI_B] = co * d - si * q, si * d + co * q


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
