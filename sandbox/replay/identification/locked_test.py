"""The paper's test in software: a locked rotor, bias staircases, a pulsating voltage on top; makes
a campaign.

Open-loop voltages on the plant (`sandbox.replay`, which is told commands and an angle and says what
sensors read).
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from model.array_types import Array
from model.frames import phases
from model.parameters import Drive
from sandbox.recordings.campaign import Campaign, CampaignRecording
from sandbox.recordings.injection import carrier
from sandbox.replay.replay import prepare, replay

STEPS = 2  # the least that resolves the current's way to 1e-6 of it (tests)
TESTS = (("locked_d", "d", "d"), ("locked_q_inject_d", "d", "q"), ("locked_q_inject_q", "q", "q"))


@dataclass(frozen=True)
class LockedBench:
    """What stands between the motor and the recording; neutral values by default."""

    theta: float = 0.0  # rad, lock angle
    angle_error: float = 0.0  # rad, true angle less the encoder's
    threshold: float = 0.0  # V lost by each leg against its current
    width: float = 1e-3  # A within which the sign of the current goes through zero
    noise: float = 0.0  # A rms each sensor
    resolution: float = 0.0  # A per count
    seed: int = 0


def staircase(
    drive: Drive,
    file: str,
    axis: str,
    currents: Array,
    dwell: int,
    bench: LockedBench | None = None,
) -> CampaignRecording:
    """Return a recording that holds bias currents (n, 2) A, each for `dwell` injection periods;
    starts at the first."""
    bench = bench or LockedBench()
    motor, h, shape = (
        drive.motor,
        drive.converter.sampling_period,
        carrier(drive.injection, drive.converter).waveform,
    )
    u = np.repeat(motor.resistance * np.asarray(currents, dtype=float), dwell * len(shape), axis=0)
    if axis != "none":
        u[:, "dq".index(axis)] += drive.injection.amplitude * np.tile(shape, dwell * len(currents))
    c, s = math.cos(bench.theta), math.sin(bench.theta)
    command = np.column_stack([c * u[:, 0] - s * u[:, 1], s * u[:, 0] + c * u[:, 1]])
    first = phases.py_func(
        *(c * currents[0][0] - s * currents[0][1], s * currents[0][0] + c * currents[0][1])
    )
    columns: dict[str, Array] = {
        "t": h * np.arange(len(u), dtype=float),
        "u_alpha": command[:, 0],
        "u_beta": command[:, 1],
    }
    columns |= {
        "theta": np.full(len(u), bench.theta),
        "u_dc": np.full(len(u), drive.converter.dc_bus_voltage),
    }
    # where it starts from
    columns |= {f"i_{x}": np.full(len(u), float(i)) for x, i in zip("abc", first, strict=True)}
    asked = CampaignRecording(file, "locked", axis, columns)
    values = {
        "encoder_offset.offset": -bench.angle_error,
        "device_drop.threshold": bench.threshold,
        "bench.soft_current": bench.width,
    }
    sensing = replace(
        drive,
        converter=replace(drive.converter, current_noise=max(drive.converter.current_noise, 1e-6)),
    )
    prepared = prepare(Campaign("staircase", sensing, (asked,), {}, {}, False), values, steps=STEPS)
    read = replay(prepared, [values]).currents[0][:, :, 0].T
    rng = np.random.default_rng(bench.seed)
    abc = read + bench.noise * rng.normal(size=(3, len(u)))
    if bench.resolution:
        abc = bench.resolution * np.round(abc / bench.resolution)
    return replace(asked, columns={**columns, **dict(zip(("i_a", "i_b", "i_c"), abc, strict=True))})


def paper_levels(drive: Drive) -> Array:
    """Return the paper's bias currents (A) and zero: +-2 A by 0.3 A up to 2 A rated, else +-8 A by
    0.5 A."""
    top, step = (2.0, 0.3) if drive.motor.rated_current < 2.0 else (8.0, 0.5)
    return np.unique(np.round(np.append(np.arange(-top, top + 1e-9, step), 0.0), 9))


def paper_campaign(
    drive: Drive,
    levels: Sequence[float] | Array | None = None,
    dwell: int = 150,
    bench: LockedBench | None = None,
) -> Campaign:
    """Return the three staircases of the paper's test on a drive: bias on d and q, injection on d
    and q."""
    i = paper_levels(drive) if levels is None else np.asarray(levels, dtype=float)
    zero = np.zeros_like(i)
    bench = bench or LockedBench()
    recordings = []
    for k, (name, axis, bias) in enumerate(TESTS):
        both = np.column_stack([i, zero] if bias == "d" else [zero, i])
        own = LockedBench(**{**bench.__dict__, "seed": bench.seed + k})
        recordings.append(staircase(drive, f"{name}.parquet", axis, both, dwell, own))
    return Campaign(f"{drive.name}_locked", drive, tuple(recordings), {}, {}, False)
