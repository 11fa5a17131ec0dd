"""Real drives from elsewhere (data sets `laas_bldc`, `moteus_ld`) as campaigns, as far as their content allows.

Neither can be replayed electrically; each says in plain sentences what it can and cannot show, and which residual is
left.  What is assumed because a file lacks it stands in the motor's provenance.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from model.datasets import fetch
from model.drives import laas, moteus
from model.errors import unknown
from model.frames import phases
from model.parameters import Converter, Drive, Injection, Motor
from sandbox.campaign import Campaign, CampaignRecording, Finding

PERIOD = 1e-3  # s, of the LAAS log
RUNS = ("acceleration", "rolling_data", "rolling_data1", "rolling_data2")
ASSUMED_LINK, ASSUMED_INDUCTANCE = 24.0, 1e-3  # V, H: on no file; nothing below depends on them


@dataclass(frozen=True)
class RealDrive:
    """A real drive: its campaign (None where the file holds no time series), residuals left, what shows and what not.

    `residuals` names the subsystems of the diagnosis that the data can speak of; without "current" there is no replay.
    """

    name: str
    campaign: Campaign | None
    residuals: tuple[str, ...]
    can: tuple[str, ...]
    cannot: tuple[str, ...]


def real_drives(data_set: str) -> list[RealDrive]:
    """Return the drives of a data set, `laas_bldc` or `moteus_ld`, fetched if need be; BadInput for another name."""
    if data_set == "laas_bldc":
        return [laas_drive(fetch(data_set))]
    if data_set == "moteus_ld":
        return [moteus_drive(path) for path in sorted(fetch(data_set).glob("ld_*.json"))]
    raise unknown("data set of a drive", data_set, ("laas_bldc", "moteus_ld"))


def laas_drive(folder: Path) -> RealDrive:
    """Return the LAAS motor: i_q, u_q and angle at 1 kHz, enough for the residual of motion, not for a replay."""
    friction = laas.friction(laas.read(folder / "acceleration.txt"))
    runs = {name: laas.read(folder / f"{name}.txt") for name in RUNS}
    constant, inertia = friction.torque_constant.value, friction.inertia.value
    flux = constant / (1.5 * laas.POLE_PAIRS)
    resistance = _resistance(runs["acceleration"])
    current = max(float(np.max(np.abs(r.current))) for r in runs.values())
    speed = max(float(np.max(np.abs(r.speed))) for r in runs.values())
    motor = Motor(
        "laas_bldc", laas.POLE_PAIRS, resistance, flux, ASSUMED_INDUCTANCE, ASSUMED_INDUCTANCE, inertia,
        current, constant * current, speed * 30.0 / math.pi, viscous_friction=friction.viscous.value,
    )  # fmt: skip
    converter = Converter(PERIOD, ASSUMED_LINK, 0.0, 0.0)
    provenance = {
        "resistance, magnet_flux": "fitted to u_q = R i_q + flux x speed of acceleration.txt",
        "inertia, "
        "viscous_friction": "fitted to the current's sine in acceleration.txt; Coulomb friction is not in [motor]",
        "inductance_d, inductance_q, dc_bus_voltage": "assumed; on no file",
        "rated values": "largest on file",
    }
    recordings = tuple(_laas_recording(name, run) for name, run in runs.items())
    motion = residual_of_motion(friction)
    rolling = [float(np.mean(runs[n].current)) for n in RUNS[1:]]
    can = (
        f"Motion: inertia, friction and torque constant explain {100.0 * (1.0 - motion):.1f} % of the current's energy "
        "in the ramps they were fitted to (low-passed at 25 Hz, above 30 rad/s).",
        f"Held out: they predict {friction.steady[0]:.3f} A at 50.7 rad/s; three rolling runs took "
        f"{', '.join(f'{x:.3f}' for x in rolling)} A.",
        "Cogging, by order of the angle, from the slow scan (quasi_static_scan.txt, see experiments/real_cogging.py).",
    )
    cannot = (
        "Phase currents, i_d, u_d and the link voltage are not on file (i_d = u_d = 0 stand in): no replay of "
        "currents, so "
        "nothing about dead time, device drop, saturation or current sensors.",
        "The log keeps one sample in 1 ms, with gaps, and is interpolated; the rotor turns up to "
        f"{laas.POLE_PAIRS * speed * PERIOD:.1f} rad electrical between two rows, so the voltage inside is lost.",
        "The encoder's zero is not aligned with the magnet: nothing about encoder offset.",
        "The torque constant is the back-EMF's, not measured as torque: scales of inertia and friction hang on it.",
    )
    notes = tuple(
        Finding(r.file, "t", None, f"{r.file}: interpolated to 1 ms; i_d, u_d and u_dc are assumed, not recorded")
        for r in recordings
    )
    campaign = Campaign(
        "laas_bldc", Drive(motor, converter, Injection(100.0, 1.0), provenance), recordings, {}, {}, True, notes
    )
    return RealDrive("laas_bldc", campaign, ("motion",), can, cannot)


def residual_of_motion(friction: laas.Friction) -> float:
    """Return the share of the current's energy that inertia and friction leave unexplained where they were fitted.

    Only speeds above 30 rad/s count, as in the fit: below, cogging and the low-pass hide the friction's shape.
    """
    fast = np.abs(friction.speed) > 30.0
    predicted = friction.inertial + friction.current_at(friction.speed)
    rest = (friction.current - predicted)[fast]
    offset = float(np.mean(rest))  # the sensor's
    return float(np.sum((rest - offset) ** 2) / np.sum((friction.current[fast] - offset) ** 2))


def _resistance(run: laas.Run) -> float:
    """Return the resistance (ohm) of u_q = R i_q + flux x speed + offset."""
    design = np.c_[run.current, run.speed, np.ones(len(run.time))]
    return float(np.linalg.lstsq(design, run.voltage, rcond=None)[0][0])


def _laas_recording(name: str, run: laas.Run) -> CampaignRecording:
    """Return a run on an even grid of 1 ms, its q quantities turned into the stator frame with i_d = u_d = 0."""
    t = np.arange(0.0, run.time[-1] - run.time[0], PERIOD)
    position, i_q, u_q = (np.interp(t + run.time[0], run.time, x) for x in (run.position, run.current, run.voltage))
    theta = laas.POLE_PAIRS * position
    i = phases.py_func(-np.sin(theta) * i_q, np.cos(theta) * i_q)
    columns = dict(zip(("i_a", "i_b", "i_c"), (np.asarray(x) for x in i), strict=True))
    columns |= {"t": t, "theta": theta, "u_alpha": -np.sin(theta) * u_q, "u_beta": np.cos(theta) * u_q}
    columns |= {"u_dc": np.full(len(t), ASSUMED_LINK), "load_torque": np.zeros(len(t))}
    return CampaignRecording(f"{name}.parquet", "free", "none", columns)


def moteus_drive(path: Path) -> RealDrive:
    """Return one motor of the moteus files: steady points only, so no campaign; the inverter's voltage remains."""
    sweep = moteus.read(path)
    drop = moteus.inverter_drop(moteus.intercepts(sweep))
    points = sum(len(y) for y in sweep.y)
    v, better = drop.voltage, 1.0 - (drop.held_out_with / drop.held_out_without) ** 2
    decided = f"{100.0 * better:.0f} % less squared error held out"
    if v.high - v.low > 2.0 * v.value or better <= 0.0:
        decided = "too noisy to say that there is one"
    can = (
        f"Inverter: a voltage along the current of {v.value:.3g} V (95 %: {v.low:.2g} to {v.high:.2g}) in v_q at "
        f"{points} steady points ({decided}).",
        f"Machine: flux against d-current, {len(sweep.i_d)} levels (own fit {sweep.own_flux:.4g} Wb).",
    )
    cannot = (
        "The file holds v_q - R i_q against speed and i_d, no time series: no campaign, no replay.",
        "i_q and v_d are not on file: an error of R, and device drop against dead time, cannot be told.",
        "Link voltage and PWM frequency are not on file: a dead time follows from the voltage only by assuming them.",
        "Nothing about motion, the current sensors or the encoder.",
    )
    return RealDrive(f"moteus_{sweep.name}", None, ("inverter voltage",), can, cannot)
