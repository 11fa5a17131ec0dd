"""The sample campaign that comes with the package (`sensorless diagnose --example`), made anew.

Four recordings of the switched bench, which shares no code with the simulator that the diagnosis
fits: the paper's interior-magnet motor with a hot winding (R +15 %) behind an inverter with 2 us of
dead time; the nominal model knows of neither.  Readings have the noise and the counts that
campaign.toml states.

Run: python -m experiments.example_campaign   (writes sandbox/recordings/example; a few seconds)
"""

from __future__ import annotations

import dataclasses
import math
import shutil
from pathlib import Path

import numpy as np

from model.drive_files import load_drive
from sandbox.drive.record import UNCERTAINTY, background_of
from sandbox.recordings.campaign import EXAMPLE, Campaign, CampaignRecording
from sandbox.recordings.writing import write_campaign
from sandbox.switched.advance import replay
from sandbox.switched.bench_numbers import bench, quiet

HOT, DEAD_TIME = 1.15, 2e-6
SAMPLES = 1200
CASES = (  # name, rotor, speed (rad/s mechanical), swing of the voltage (V)
    ("locked_slow", "locked", 0.0, 25.0),
    ("locked_fast", "locked", 0.0, 15.0),
    ("driven_slow", "driven", 10.0, 20.0),
    ("driven_fast", "driven", 60.0, 25.0),
)


def drive():
    """Return the drive with an encoder of 16384 counts and noise of 0.3 % of rated current."""
    own = load_drive("ipm_exchanged")
    converter = dataclasses.replace(own.converter, encoder_counts=1 << 14, current_noise=0.004)
    said = own.provenance | {"current_noise": "assumed: 0.33 % of rated current"}
    return dataclasses.replace(own, converter=converter, provenance=said)


def recording(own, case, effects, rng) -> CampaignRecording:
    """Return one recording: a swinging, turning voltage with injection along d, read with counts
    and noise."""
    name, rotor, speed, size = case
    c, pairs = own.converter, own.motor.pole_pairs
    period, k = c.sampling_period, np.arange(SAMPLES)
    middle = 0.3 + pairs * speed * period * (k + 0.5)
    swing = np.sin(math.tau * k / 700 + size) + 0.6 * np.sin(math.tau * k / 270)
    back = 1j * pairs * speed * own.motor.magnet_flux
    u = (size * swing * np.exp(1j * k / 160) + back) * np.exp(1j * middle)
    u += own.injection.amplitude * np.where(k % 8 < 4, 1, -1) * np.exp(1j * middle)
    u = np.round(u.real, 2) + 1j * np.round(u.imag, 2)  # as a drive logs them; smaller on disk
    motion = (
        {"theta": 0.3 + pairs * speed * period * k, "speed": speed}
        if rotor == "driven"
        else {"theta": 0.3}
    )
    r = replay(
        quiet(bench(own.motor, c, effects)),
        rotor,
        u.real,
        u.imag,
        c.dc_bus_voltage,
        **{"speed": 0.0, **motion},
    )
    count = math.tau * pairs / c.encoder_counts
    columns = {
        "t": k * period,
        "u_alpha": u.real,
        "u_beta": u.imag,
        "u_dc": np.full(SAMPLES, c.dc_bus_voltage),
    }
    columns["theta"] = count * np.floor(r["theta"] / count + 0.5)
    for phase in ("i_a", "i_b", "i_c"):
        read = r[phase] + c.current_noise * rng.standard_normal(SAMPLES)
        columns[phase] = c.current_resolution * np.round(read / c.current_resolution)
    return CampaignRecording(f"{name}.parquet", rotor, "d", columns)


def campaign() -> Campaign:
    """Return the sample campaign."""
    own, rng = drive(), np.random.default_rng(20261122)
    effects = {
        "dead_time.time": DEAD_TIME,
        "stator_resistance.resistance": HOT * own.motor.resistance,
    }
    recordings = tuple(recording(own, case, effects, rng) for case in CASES)
    return Campaign("example", own, recordings, UNCERTAINTY, background_of(own), False)


def main() -> None:
    """Write the campaign in place of the one there."""
    shutil.rmtree(EXAMPLE, ignore_errors=True)
    folder = write_campaign(EXAMPLE, campaign())
    size = sum(p.stat().st_size for p in Path(folder).iterdir())
    print(f"{len(CASES)} recordings, {size / 1e3:.0f} kB")


if __name__ == "__main__":
    main()
