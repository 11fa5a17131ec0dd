"""Real drives from elsewhere (data sets `laas_bldc`, `moteus_ld`) as campaigns, as far as their
content allows.

Neither holds what a replay of currents needs; each says in plain sentences what it can and cannot
show, and which residual is left.  What is assumed because a file lacks it stands in the motor's
provenance.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from experiments.real_drives import laas, moteus
from model.datasets import fetch
from model.errors import unknown
from model.frames import phases
from model.parameters import Converter, Drive, Injection, Motor
from sandbox.recordings.campaign import Campaign, CampaignRecording
from sandbox.recordings.findings import Finding

PERIOD = 1e-3  # s, of the LAAS log
COUNTS = 20_000  # of its encoder
ROLLING = ("rolling_data", "rolling_data1", "rolling_data2")
HIDDEN = (  # from a log without i_d, u_d, phase currents and link voltage
    "dead_time",
    "device_drop",
    "dc_link_error",
    "dc_link_ripple",
    "pwm_delay",
    "inductance",
    "inductance_harmonics",
    "saturation",
    "cross_saturation",
    "skin_effect",
    "winding_asymmetry",
    "current_gain",
    "current_offset",
    "current_filter",
    "current_sampling",
    "encoder_offset",
)
ASSUMED_LINK, ASSUMED_INDUCTANCE = 24.0, 1e-3  # V, H: on no file; nothing below depends on them


@dataclass(frozen=True)
class RealDrive:
    """A real drive: its campaign (None where the file holds no time series), residuals left, what
    shows and what not.

    `residuals` names what the data can speak of; `hidden` the effects that they cannot show: what
    would carry them is not on file but assumed, so they are no candidates
    (`sensorless diagnose --exclude`).
    """

    name: str
    campaign: Campaign | None
    residuals: tuple[str, ...]
    can: tuple[str, ...]
    cannot: tuple[str, ...]
    hidden: tuple[str, ...] = ()


def real_drives(data_set: str) -> list[RealDrive]:
    """Return the drives of a data set, `laas_bldc` or `moteus_ld`, fetched if need be; BadInput for
    another name."""
    if data_set == "laas_bldc":
        return [laas_drive(fetch(data_set))]
    if data_set == "moteus_ld":
        return [moteus_drive(path) for path in sorted(fetch(data_set).glob("ld_*.json"))]
    raise unknown("data set of a drive", data_set, ("laas_bldc", "moteus_ld"))


def laas_drive(folder: Path) -> RealDrive:
    """Return the LAAS motor: i_q, u_q and angle at 1 kHz, enough for the residual of motion, not
    for a replay."""
    friction = laas.friction(laas.read(folder / "acceleration.txt"))
    runs = {name: laas.read(folder / f"{name}.txt") for name in ("acceleration", *ROLLING)}
    constant, inertia = friction.torque_constant.value, friction.inertia.value
    flux = constant / (1.5 * laas.POLE_PAIRS)
    resistance = _resistance(runs["acceleration"])
    current = max(float(np.max(np.abs(r.current))) for r in runs.values())
    speed = max(float(np.max(np.abs(r.speed))) for r in runs.values())
    motor = Motor(
        "laas_bldc",
        laas.POLE_PAIRS,
        resistance,
        flux,
        ASSUMED_INDUCTANCE,
        ASSUMED_INDUCTANCE,
        inertia,
        current,
        constant * current,
        speed * 30.0 / math.pi,
        viscous_friction=friction.viscous.value,
    )
    noise = float(np.median([_noise(runs[name].current) for name in ROLLING]))
    converter = Converter(PERIOD, ASSUMED_LINK, 0.0, noise, encoder_counts=COUNTS)
    provenance = {
        "resistance, magnet_flux": "fitted to u_q = R i_q + flux x speed of acceleration.txt",
        "inertia, viscous_friction": "fitted to acceleration.txt; Coulomb friction is not in [motor]",  # noqa: E501
        "inductance_d, inductance_q, dc_bus_voltage": "assumed; on no file",
        "rated values": "largest on file",
        "current_noise": "fourth differences of the rolling runs' i_q",
    }
    recordings = tuple(_laas_recording(name, runs[name]) for name in ROLLING)
    motion = residual_of_motion(friction)
    rolling = [float(np.mean(runs[n].current)) for n in ROLLING]
    can = (
        "Motion: inertia, friction and torque constant explain "
        f"{100.0 * (1.0 - motion):.1f} % of the current's energy "
        "in the ramps they were fitted to (low-passed at 25 Hz, above 30 rad/s).",
        f"Held out: they predict {friction.steady[0]:.3f} A at 50.7 rad/s; three rolling runs took "
        f"{', '.join(f'{x:.3f}' for x in rolling)} A.",
        (
            "Cogging, by order of the angle, from the slow scan (quasi_static_scan.txt, see "
            "experiments/real_cogging.py)."
        ),
    )
    cannot = (
        "Phase currents, i_d, u_d and the link voltage are not on file (i_d = u_d = 0 stand in): "
        "no replay of currents, so nothing about dead time, device drop, saturation or current "
        "sensors.",
        "The log keeps one sample in 1 ms, with gaps, and is interpolated; in the ramps "
        f"(acceleration.txt) the rotor turns up to {_largest_step(runs['acceleration']):.0f} rad "
        "electrical between two rows, which no replay can follow: the nominal model is fitted to "
        "them, the campaign has the rolling runs only.",
        "The encoder's zero is not aligned with the magnet: nothing about encoder offset.",
        (
            "The torque constant is the back-EMF's, not measured as torque: scales of "
            "inertia and friction hang on it."
        ),
    )
    provenance |= {f"can show, {k}": text for k, text in enumerate(can, 1)}
    provenance |= {f"cannot show, {k}": text for k, text in enumerate(cannot, 1)}
    notes = tuple(
        Finding(
            r.file,
            "t",
            None,
            f"{r.file}: interpolated to 1 ms; i_d, u_d and u_dc are assumed, not recorded",
        )
        for r in recordings
    )
    campaign = Campaign(
        "laas_bldc",
        Drive(motor, converter, Injection(100.0, 1.0), provenance),
        recordings,
        {},
        {},
        True,
        notes,
    )
    return RealDrive("laas_bldc", campaign, ("motion",), can, cannot, HIDDEN)


def residual_of_motion(friction: laas.Friction) -> float:
    """Return the share of the current's energy that inertia and friction leave unexplained where
    they were fitted.

    Only speeds above 30 rad/s count, as in the fit: below, cogging and the low-pass hide the
    friction's shape.
    """
    fast = np.abs(friction.speed) > 30.0
    predicted = friction.inertial + friction.current_at(friction.speed)
    rest = (friction.current - predicted)[fast]
    offset = float(np.mean(rest))  # the sensor's
    return float(np.sum((rest - offset) ** 2) / np.sum((friction.current[fast] - offset) ** 2))


def _noise(x: np.ndarray) -> float:
    """Return the white part (rms) of a slow signal, from its fourth differences (variance 70 times
    the noise's)."""
    return float(np.median(np.abs(np.diff(x, 4))) / 0.6745 / math.sqrt(70.0))


def _largest_step(run: laas.Run) -> float:
    """Return the largest electrical angle (rad) between two rows."""
    return float(laas.POLE_PAIRS * np.max(np.abs(np.diff(run.position))))


def _resistance(run: laas.Run) -> float:
    """Return the resistance (ohm) of u_q = R i_q + flux x speed + offset."""
    design = np.c_[run.current, run.speed, np.ones(len(run.time))]
    return float(np.linalg.lstsq(design, run.voltage, rcond=None)[0][0])


def _laas_recording(name: str, run: laas.Run) -> CampaignRecording:
    """Return a run on an even grid of 1 ms, its q quantities turned into the stator frame with
    i_d = u_d = 0.

    The drive turns its voltage with the rotor inside each ms: what acts from row to row is its
    mean, at the angle halfway, shortened by sin(x)/x of half the angle turned.
    """
    t = np.arange(0.0, run.time[-1] - run.time[0], PERIOD)
    position, i_q, u_q = (
        np.interp(t + run.time[0], run.time, x) for x in (run.position, run.current, run.voltage)
    )
    theta = laas.POLE_PAIRS * position
    i = phases.py_func(-np.sin(theta) * i_q, np.cos(theta) * i_q)
    columns = dict(zip(("i_a", "i_b", "i_c"), (np.asarray(x) for x in i), strict=True))
    half = 0.5 * np.append(np.diff(theta), theta[-1] - theta[-2])
    u_q = u_q * np.sinc(half / math.pi)
    columns |= {
        "t": t,
        "theta": theta,
        "u_alpha": -np.sin(theta + half) * u_q,
        "u_beta": np.cos(theta + half) * u_q,
    }
    columns |= {"u_dc": np.full(len(t), ASSUMED_LINK), "load_torque": np.zeros(len(t))}
    return CampaignRecording(f"{name}.parquet", "free", "none", columns)


def moteus_drive(path: Path) -> RealDrive:
    """Return one motor of the moteus files: steady points only, so no campaign; the inverter's
    voltage remains."""
    sweep = moteus.read(path)
    drop = moteus.inverter_drop(moteus.intercepts(sweep))
    points = sum(len(y) for y in sweep.y)
    v, better = drop.voltage, 1.0 - (drop.held_out_with / drop.held_out_without) ** 2
    decided = f"{100.0 * better:.0f} % less squared error held out"
    if v.high - v.low > 2.0 * v.value or better <= 0.0:
        decided = "too noisy to say that there is one"
    can = (
        f"Inverter: a voltage along the current of {v.value:.3g} V (95 %: {v.low:.2g} to "
        f"{v.high:.2g}) in v_q at {points} steady points ({decided}).",
        (
            f"Machine: flux against d-current, {len(sweep.i_d)} levels (own fit "
            f"{sweep.own_flux:.4g} Wb)."
        ),
    )
    cannot = (
        "The file holds v_q - R i_q against speed and i_d, no time series: no campaign, no replay.",
        (
            "i_q and v_d are not on file: an error of R, and device drop against dead time, "
            "cannot be told."
        ),
        (
            "Link voltage and PWM frequency are not on file: a dead time follows from the "
            "voltage only by assuming them."
        ),
        "Nothing about motion, the current sensors or the encoder.",
    )
    return RealDrive(f"moteus_{sweep.name}", None, ("inverter voltage",), can, cannot)
