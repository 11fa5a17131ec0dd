"""Campaigns of two more plants, on which `experiments.ordinary_size` measures how large the
replay's own error is.

FOLDER/events: the readable reference (phase legs, edges and samples as events, SciPy's integrator
between).  It has no step, its lags are integrated with the fluxes, and the encoder cuts counts off
in place of rounding. FOLDER/fine: the same commands and encoder on the plant of the replay itself,
eight steps a period. Voltages are commanded in open loop; the rotor is locked or driven.

Run: python -m experiments.reference_campaigns FOLDER
    (ten seconds a campaign; truths are written beside)
"""

from __future__ import annotations

import argparse
from collections.abc import Mapping
from dataclasses import replace
from itertools import product
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from model.drive_files import load_drive
from model.effects import library
from model.parameters import Drive
from sandbox.output.toml import toml_text
from sandbox.plant.sets import complete
from sandbox.recordings.campaign import Campaign, CampaignRecording
from sandbox.recordings.writing import write_campaign
from sandbox.replay.replay import prepare, replay
from tests.sandbox.plant.reference import A, Reference

Array = NDArray[np.float64]

SAMPLES, SEED, FINE, COUNTS = 900, 1, 8, 1 << 14
EFFECTS = (
    "dead_time",
    "device_drop",
    "pwm_delay",
    "current_filter",
    "skin_effect",
    "iron_loss",
    "saturation",
    "flux_harmonics",
)
# stated of every drive; the plants have none of them
UNCERTAINTY = {"resistance": 0.01, "magnet_flux": 0.01, "inductance_d": 0.01, "inductance_q": 0.01}
BACKGROUND = {
    "current_gain": 0.0015,
    "current_offset": 0.005,
    "encoder_offset": 0.002,
    "dead_time": 4e-8,
}


class Run(NamedTuple):
    """One recording: mechanical speed (rad/s), size of the voltage's swing (V)."""

    file: str
    speed: float
    size: float


RUNS = (
    Run("locked_slow.parquet", 0.0, 25.0),
    Run("locked_fast.parquet", 0.0, 15.0),
    Run("driven_slow.parquet", 12.0, 20.0),
    Run("driven_fast.parquet", 60.0, 25.0),
)


def drive() -> Drive:
    """Return the drive: the paper's salient motor, a fine encoder."""
    own = load_drive("ipm_exchanged")
    return replace(
        own, converter=replace(own.converter, encoder_counts=COUNTS, current_noise=0.004)
    )


def commanded(d: Drive, run: Run) -> CampaignRecording:
    """Return the commands and the encoder of a recording, currents still missing."""
    c, pairs, k = d.converter, d.motor.pole_pairs, np.arange(SAMPLES)
    omega, period, link = pairs * run.speed, c.sampling_period, c.dc_bus_voltage
    swing = np.sin(2.0 * np.pi * k / 700.0 + run.size) + 0.6 * np.sin(2.0 * np.pi * k / 270.0)
    u = (run.size * swing * np.exp(1j * k / 160.0) + 1j * omega * d.motor.magnet_flux).astype(
        complex
    )
    u += d.injection.amplitude * np.where(k % 8 < 4, 1.0, -1.0)
    u *= np.exp(1j * (0.3 + omega * period * (k + 0.5)))
    count = 2.0 * np.pi * pairs / COUNTS
    columns = {"t": k * period, "u_alpha": u.real, "u_beta": u.imag, "u_dc": np.full(SAMPLES, link)}
    # cut off, half a count late in the mean
    columns["theta"] = count * np.floor((0.3 + omega * period * k) / count)
    columns |= dict.fromkeys(("i_a", "i_b", "i_c"), np.zeros(SAMPLES))
    return CampaignRecording(run.file, "driven" if run.speed else "locked", "d", columns)


def events(d: Drive, run: Run, r: CampaignRecording, values: Mapping[str, float]) -> Array:
    """Return the readings (n, 3) in A of the reference under the commands of a recording."""
    c, omega, u = d.converter, d.motor.pole_pairs * run.speed, r.u_alpha + 1j * r.u_beta
    legs = np.stack([(u * A ** (-m)).real for m in range(3)], axis=1)
    duty = 0.5 + (legs - 0.5 * (legs.max(1) + legs.min(1))[:, None]) / c.dc_bus_voltage
    v, trajectory = complete(d.motor, c, values), lambda t: (0.3 + omega * t, omega)
    plant = Reference(d.motor, v, c.sampling_period, c.dc_bus_voltage, trajectory=trajectory)
    return plant.run(duty, plant.start(0.3))[0]


def fine(d: Drive, run: Run, r: CampaignRecording, values: Mapping[str, float]) -> Array:
    """Return the same of the replay's own plant with FINE steps a period."""
    own = prepare(Campaign(run.file, d, (r,), {}, {}, False), values, steps=FINE)
    return replay(own, [values]).currents[0][:, :, 0]


def read(d: Drive, readings: Array, rng: np.random.Generator) -> dict[str, Array]:
    """Return readings as a drive logs them: with noise, in steps of its converter."""
    c = d.converter
    noisy = readings + c.current_noise * rng.standard_normal(readings.shape)
    noisy = (
        c.current_resolution * np.round(noisy / c.current_resolution)
        if c.current_resolution
        else noisy
    )
    return {f"i_{x}": noisy[:, m] for m, x in enumerate("abc")}


def main(folder: str) -> None:
    """Record a campaign without effects and one with each of EFFECTS at its typical size, on both
    plants."""
    d = drive()
    for turn, (plant, effect) in enumerate(product((fine, events), ("none", *EFFECTS))):
        place = Path(folder) / plant.__name__
        if (place / f"{effect}.truth.toml").is_file():  # of a call that was interrupted
            continue
        values = library.typical(effect, d.motor, d.converter) if effect in EFFECTS else {}
        rng, runs = np.random.default_rng([SEED, turn]), []
        for run in RUNS:
            r = commanded(d, run)
            runs.append(replace(r, columns={**r.columns, **read(d, plant(d, run, r, values), rng)}))
        own = Campaign(effect, d, tuple(runs), UNCERTAINTY, BACKGROUND, False)
        print(write_campaign(place / effect, own), flush=True)
        named = (
            [(f"[{effect}]", {k.partition(".")[2]: x for k, x in values.items()})] if values else []
        )
        text = toml_text([("", {"effects": [effect] if values else []}), *named])
        (place / f"{effect}.truth.toml").write_text(text, encoding="utf-8")


if __name__ == "__main__":
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("folder", help="where both plants' campaigns go")
    main(parser.parse_args().folder)
