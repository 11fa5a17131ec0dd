"""The paper's test in software: a locked rotor, bias staircases, a pulsating voltage on top; makes a campaign.

Open-loop voltages on the averaged-voltage plant of `sandbox.oldplant`; the inverter's voltage error (dead time, device
drop) acts with the sign of the phase currents at the start of each substep.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from model.compiled import kernel
from model.energy import flux_from_current
from model.frames import phases
from model.parameters import Drive
from model.ripple import voltage_error
from sandbox.campaign import Campaign, CampaignRecording
from sandbox.injection import carrier
from sandbox.oldplant import Plant, advance, stator_currents

Array = NDArray[np.float64]
SUBSTEPS = 16
TESTS = (("locked_d", "d", "d"), ("locked_q_inject_d", "d", "q"), ("locked_q_inject_q", "q", "q"))


@dataclass(frozen=True)
class Bench:
    """What stands between the motor and the recording; neutral values by default."""

    theta: float = 0.0  # rad, lock angle
    angle_error: float = 0.0  # rad, true angle less the encoder's
    threshold: float = 0.0  # V lost by each leg against its current
    width: float = 1e-3  # A within which the sign of the current goes through zero
    noise: float = 0.0  # A rms each sensor
    resolution: float = 0.0  # A per count
    seed: int = 0


@kernel
def _run(x, p, u, threshold, width, substeps, out):
    """Advance through commands u (n, 2) in the stator frame; fill out (n, 2) with alpha-beta currents."""
    for k in range(u.shape[0]):
        out[k, 0], out[k, 1], _, _ = stator_currents(x, p)
        if threshold == 0.0:
            advance(x, p, u[k, 0], u[k, 1], 0.0, 0.0, substeps)
        else:
            for _ in range(substeps):
                a, b, _, _ = stator_currents(x, p)
                e_a, e_b = voltage_error(a, b, 0.0, threshold, width)
                advance(x, p, u[k, 0] - e_a, u[k, 1] - e_b, 0.0, 0.0, 1)


def staircase(
    drive: Drive, file: str, axis: str, currents: Array, dwell: int, bench: Bench | None = None
) -> CampaignRecording:
    """Return a recording that holds bias currents (n, 2) A, each for `dwell` injection periods; starts at the first."""
    bench = bench or Bench()
    motor, h, shape = drive.motor, drive.converter.sampling_period, carrier(drive.injection, drive.converter).waveform
    u = np.repeat(motor.resistance * np.asarray(currents, dtype=float), dwell * len(shape), axis=0)
    if axis != "none":
        u[:, "dq".index(axis)] += drive.injection.amplitude * np.tile(shape, dwell * len(currents))
    c, s = math.cos(bench.theta), math.sin(bench.theta)
    command = np.column_stack([c * u[:, 0] - s * u[:, 1], s * u[:, 0] + c * u[:, 1]])
    plant = Plant(motor.energy, motor.magnet_flux, motor.resistance, float(motor.pole_pairs), 0.0, 0.0, h / SUBSTEPS)
    x = np.zeros(4)
    x[0], x[1] = flux_from_current(motor.energy, *np.asarray(currents, dtype=float)[0])
    x[3] = bench.theta + bench.angle_error
    out = np.empty((len(u), 2))
    _run(x, plant, command, bench.threshold, bench.width, SUBSTEPS, out)
    rng = np.random.default_rng(bench.seed)
    abc = np.stack(phases.py_func(out[:, 0], out[:, 1])) + bench.noise * rng.normal(size=(3, len(u)))
    if bench.resolution:
        abc = bench.resolution * np.round(abc / bench.resolution)
    columns = dict(zip(("i_a", "i_b", "i_c"), abc, strict=True))
    columns |= {"t": np.arange(len(u)) * h, "u_alpha": command[:, 0], "u_beta": command[:, 1]}
    columns |= {"theta": np.full(len(u), bench.theta), "u_dc": np.full(len(u), drive.converter.dc_bus_voltage)}
    return CampaignRecording(file, "locked", axis, columns)


def paper_levels(drive: Drive) -> Array:
    """Return the paper's bias currents (A) and zero: +-2 A by 0.3 A up to 2 A rated, else +-8 A by 0.5 A."""
    top, step = (2.0, 0.3) if drive.motor.rated_current < 2.0 else (8.0, 0.5)
    return np.unique(np.round(np.append(np.arange(-top, top + 1e-9, step), 0.0), 9))


def paper_campaign(
    drive: Drive, levels: Sequence[float] | Array | None = None, dwell: int = 150, bench: Bench | None = None
) -> Campaign:
    """Return the three staircases of the paper's test on a drive: bias on d and q, injection on d and q."""
    i = paper_levels(drive) if levels is None else np.asarray(levels, dtype=float)
    zero = np.zeros_like(i)
    bench = bench or Bench()
    recordings = []
    for k, (name, axis, bias) in enumerate(TESTS):
        both = np.column_stack([i, zero] if bias == "d" else [zero, i])
        own = Bench(**{**bench.__dict__, "seed": bench.seed + k})
        recordings.append(staircase(drive, f"{name}.parquet", axis, both, dwell, own))
    return Campaign(f"{drive.name}_locked", drive, tuple(recordings), {}, {}, False)
