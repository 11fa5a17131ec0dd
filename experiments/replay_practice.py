"""Does the plant explain recordings of a bench it shares nothing with, and how fast is it?

Replays every practice campaign three times: as stated; with its true motor and effects put in,
nothing fitted; and with the sizes of its true effects and the ordinary deviations fitted, which the
truth does not hold (offsets, gains, the inverter's own small dead time, the angle of locked
rotors). Residuals over the noise floor by recording are kept in results/replay_practice.json; times
of a plant step per parameter set and of all sensitivities, on one and on two threads, are printed.

Run: python -m experiments.replay_practice FOLDER
    (FOLDER: recordings, e.g. $SENSORLESS_RECORDINGS; five minutes)
"""

from __future__ import annotations

import datetime
import os
import sys
import time
import tomllib
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from model.effects import library
from model.parameters import Motor
from sandbox.gap.evidence.fit import fit
from sandbox.gap.evidence.normal import ParameterPoint
from sandbox.gap.posterior.holdout import weights_of
from sandbox.output.files import write_json
from sandbox.plant.sets import complete
from sandbox.recordings.campaign import Campaign, read_folder
from sandbox.replay.grouping import ROOMS
from sandbox.replay.replay import (
    Prepared,
    halving_error,
    in_threads,
    plan,
    prepare,
    replay,
    residuals,
    run_block,
)
from sandbox.replay.sensitivity import all_parameters, sensitivities

RESULTS = Path(__file__).parent / "results"
SIDE = ROOMS[-1]  # sets side by side: a full block


def step_time(
    prepared: Prepared, effects: dict[str, float], workers: int = 1, count: int = 2
) -> float:
    """Return the best of five times (ns) of one plant step of one parameter set, readings
    included."""
    blocks = [plan(prepared, [effects] * SIDE)[0] for _ in range(count)]
    jobs = [(r, b) for r in prepared.recordings for b in blocks]
    longest = max(r.samples for r in prepared.recordings)
    room = {id(b): (np.empty((longest, 3, SIDE)), np.empty((longest, SIDE))) for b in blocks}
    per_block = [[(r, b) for r, b in jobs if b is block] for block in blocks]

    def task(own) -> None:
        """Replay the recordings of one block of sets."""
        for r, b in own:
            run_block(prepared, r, b, *room[id(b)], 0)

    times = []
    for _ in range(6):
        start = time.perf_counter()
        in_threads(task, per_block, workers)
        times.append(time.perf_counter() - start)
    return min(times) / (prepared.samples * prepared.steps * len(blocks) * SIDE) * 1e9


# what a truth calls the motor's values, and the parameters that replace the stated ones
OF_MOTOR = {
    "R": "stator_resistance.resistance",
    "phim": "magnet_flux.magnet_flux",
    "J": "inertia.inertia",
    "B": "viscous_friction.coefficient",
    **{f"a{n}": f"saturation.alpha_{n}" for n in ("30", "12", "40", "22", "04")},
}


def true_set(truth: Mapping[str, Any], motor: Motor) -> dict[str, float]:
    """Return the parameter set of a truth's motor and effects, beside the stated motor."""
    own = truth["true_motor"]
    values = {public: float(own[key]) for key, public in OF_MOTOR.items()}
    values["coulomb_friction.width"] = 2.0  # rad/s, of all campaigns of the time, not stated
    for axis, stated in (("d", motor.inductance_d), ("q", motor.inductance_q)):
        values[f"inductance.scale_{axis}"] = own[f"L{axis}"] / stated
    for effect in truth["effects"]:
        values |= {f"{effect}.{name}": float(x) for name, x in truth[effect].items()}
    return values


def missed(prepared: Prepared, values: Mapping[str, float]) -> list[dict[str, Any]]:
    """Return rms residuals over the noise floor, a row a recording."""
    rows = []
    for r in residuals(prepared, replay(prepared, [values])):
        motion = None if r.motion is None else float(np.sqrt(np.mean(r.motion**2)))
        rows.append(
            {"file": r.file, "rotor": r.rotor, "current": float(r.rms()[0]), "motion": motion}
        )
    return rows


def fitted_from(
    campaign: Campaign, values: Mapping[str, float], effects: Sequence[str]
) -> ParameterPoint:
    """Return the most probable point near the truth: sizes of the true effects and ordinary
    deviations fitted."""
    drive = campaign.drive
    begun = ParameterPoint(
        prepare(campaign, values), complete(drive.motor, drive.converter, values)
    )
    return fit(begun, tuple(effects), weights_of(len(campaign.recordings))).point


def campaigns(folder: Path) -> list[dict[str, Any]]:
    """Replay every campaign of a folder as stated and with the truth beside it; print one line
    each."""
    out = []
    for path in sorted(folder.glob("*.truth.toml")):
        name = path.name.removesuffix(".truth.toml")
        truth, campaign = (
            tomllib.loads(path.read_text(encoding="utf-8")),
            read_folder(folder / name),
        )
        values = true_set(truth, campaign.drive.motor)
        stated, true = missed(prepare(campaign), {}), missed(prepare(campaign, values), values)
        at = fitted_from(campaign, values, truth["effects"])
        fitted = missed(at.turned(), at.values)
        out.append(
            {
                "campaign": name,
                "effects": truth["effects"],
                "stated": stated,
                "true": true,
                "fitted": fitted,
            }
        )
        text = [
            f"{title} {min(sizes):.2f} to {max(sizes):.2f}"
            for title, rows in (("as stated", stated), ("with the truth", true), ("fitted", fitted))
            for sizes in [[r["current"] for r in rows]]
        ]
        print(
            f"{name} {' + '.join(truth['effects']) or 'no effect':28s} {', '.join(text)}",
            flush=True,
        )
    return out


def main(folder: Path) -> None:
    """Keep residuals, print times."""
    found = campaigns(folder / "practice")
    content = {"date": str(datetime.date.today()), "unit": "noise floors (rms)", "campaigns": found}
    write_json(RESULTS, "replay_practice", content)
    prepared = prepare(read_folder(folder / "practice" / "p01"))
    drive, error = prepared.campaign.drive, halving_error(prepared)
    print(
        f"{prepared.steps} plant step a sampling period; halving it moves readings by "
        f"{max(error):.1e} noise floors"
    )
    every: dict[str, float] = {}
    for name in library.effect_names():
        if name != "cross_saturation":
            every |= library.typical(name, drive.motor, drive.converter)
    for title, effects in (
        ("no effect", {}),
        ("dead_time", {"dead_time.time": 2e-6}),
        ("all effects", every),
    ):
        one, two = (step_time(prepared, effects, workers) for workers in (1, 2))
        print(
            f"{title:12s} {one:6.1f} ns a step and set on one core, {two:6.1f} on two "
            f"({one / two:.2f} x)"
        )
    for workers in (1, 2):
        sensitivities(prepared, workers=workers)
        start = time.perf_counter()
        sensitivities(prepared, workers=workers)
        took = time.perf_counter() - start
        size = f"{prepared.samples} samples, {len(all_parameters())} parameters"
        print(f"sensitivities ({size}): {took:.2f} s on {workers}")


if __name__ == "__main__":
    main(
        Path(
            sys.argv[1]
            if len(sys.argv) > 1
            else os.environ.get("SENSORLESS_RECORDINGS", "../shared/recordings")
        )
    )
