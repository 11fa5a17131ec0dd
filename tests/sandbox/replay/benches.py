"""Recordings of the switched bench without noise, for the replay's tests."""

import dataclasses

import numpy as np

from model.drive_files import load_drive
from model.effects import library
from model.parameters import Motor
from sandbox.recordings.campaign import Campaign, CampaignRecording
from sandbox.switched.advance import replay as switched
from sandbox.switched.bench_numbers import bench, quiet

DRIVE = load_drive("ipm")
DRIVE = dataclasses.replace(
    DRIVE, converter=dataclasses.replace(DRIVE.converter, encoder_counts=1 << 16)
)
NOISE = 0.02  # A rms of one reading of the round motor's drive
# a motor of equal inductances that does not saturate
ROUND = dataclasses.replace(
    DRIVE,
    motor=dataclasses.replace(
        DRIVE.motor,
        inductance_q=DRIVE.motor.inductance_d,
        **{n: 0.0 for n in Motor.__dataclass_fields__ if n.startswith("alpha_")},
    ),
    converter=dataclasses.replace(DRIVE.converter, current_noise=NOISE, current_resolution=0.0),
)
CASES = (("locked", 0.0), ("driven", 20.0), ("driven", 100.0), ("free", 0.0))
MOTION = 0.03  # standard deviations: what may be left of a free rotor's innovations without noise


def record(effects, rotor, speed=0.0, n=700, load_torque=True, finer=1.0, drive=DRIVE):
    """Return a recording of the switched bench without noise: voltage, injection, a step of load
    for a free rotor."""
    b, period, pairs = (
        quiet(bench(drive.motor, drive.converter, effects)),
        drive.converter.sampling_period,
        6,
    )
    b = b._replace(step=b.step / finer)
    k = np.arange(n)
    theta, middle = (0.3 + pairs * speed * period * (k + x) for x in (0.0, 0.5))
    size = 12.0 + 0.1 * pairs * speed if rotor == "driven" else 12.0 * np.sin(2 * np.pi * k / 600)
    u = size * np.exp(1j * (middle + 1.6)) + 30.0 * np.where(k % 8 < 4, 1, -1) * np.exp(1j * middle)
    load, more = np.zeros(n), {"theta": theta, "speed": speed}
    if rotor == "free":
        u, load = (10.0 + 5.0 * np.sin(k / 50.0)).astype(complex), np.where(k > 300, 0.2, 0.0)
        more = {"theta": 0.3, "load_torque": load}
    r = switched(b, rotor, u.real, u.imag, 400.0, **more)
    columns = {
        "t": k * period,
        "u_alpha": u.real,
        "u_beta": u.imag,
        "theta": r["theta"],
        "u_dc": np.full(n, 400.0),
    }
    columns |= {name: r[name] for name in ("i_a", "i_b", "i_c")} | (
        {"load_torque": load} if load_torque else {}
    )
    return CampaignRecording(f"{rotor}_{speed:g}.parquet", rotor, "d", columns)


def campaign(effects, cases=CASES, **more):
    """Return a campaign of the switched bench."""
    return Campaign(
        "bench", DRIVE, tuple(record(effects, *c, **more) for c in cases), {}, {}, False
    )


def typical(name):
    """Return an effect at its typical size, without the jitter that no prediction shows."""
    return {
        k: v
        for k, v in library.typical(name, DRIVE.motor, DRIVE.converter).items()
        if not k.endswith("jitter")
    }
