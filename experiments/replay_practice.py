"""Does the plant explain recordings of a bench it shares nothing with, and how fast is it?

Replays practice campaign p01 (no effect, nothing fitted): residual over the noise floor by recording, kept in
results/replay_practice.json; times of a plant step per parameter set and of all sensitivities, on one and on two
threads, are printed.

Run: python experiments/replay_practice.py FOLDER   (FOLDER: recordings, e.g. $SENSORLESS_RECORDINGS; about 30 s)
"""

from __future__ import annotations

import datetime
import os
import sys
import time
from pathlib import Path

import numpy as np

from model.effects import library
from sandbox.output.files import write_json
from sandbox.recordings.campaign import read_campaign
from sandbox.replay.replay import Prepared, halving_error, in_threads, plan, prepare, replay, residuals, run_block
from sandbox.replay.sensitivity import all_parameters, sensitivities

RESULTS = Path(__file__).parent / "results"
SIDE = 16  # sets side by side


def step_time(prepared: Prepared, effects: dict[str, float], workers: int = 1, sets: int = 64) -> float:
    """Return the best of five times (ns) of one plant step of one parameter set, readings included."""
    blocks = [plan(prepared, [effects] * SIDE)[0] for _ in range(sets // SIDE)]
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


def main(folder: Path) -> None:
    """Keep residuals, print times."""
    prepared = prepare(read_campaign(folder / "practice" / "p01"))
    drive, error = prepared.campaign.drive, halving_error(prepared)
    print(f"{prepared.steps} plant step a sampling period; halving it moves readings by {max(error):.1e} noise floors")
    rows = []
    for r in residuals(prepared, replay(prepared, [{}])):
        motion = None if r.motion is None else float(np.sqrt(np.mean(r.motion**2)))
        rows.append({"file": r.file, "rotor": r.rotor, "current": float(r.rms()[0]), "motion": motion})
        told = "" if motion is None else f"motion {motion:.3f}"
        print(f"{r.file:28s} {r.rotor:7s} current {r.rms()[0]:.3f} {told}")
    content = {"date": str(datetime.date.today()), "campaign": "p01", "unit": "noise floors (rms)", "recordings": rows}
    write_json(RESULTS, "replay_practice", content)
    every: dict[str, float] = {}
    for name in library.effect_names():
        if name != "cross_saturation":
            every |= library.typical(name, drive.motor, drive.converter)
    for title, effects in (("no effect", {}), ("dead_time", {"dead_time.time": 2e-6}), ("all effects", every)):
        one, two = (step_time(prepared, effects, workers) for workers in (1, 2))
        print(f"{title:12s} {one:6.1f} ns a step and set on one core, {two:6.1f} on two ({one / two:.2f} x)")
    for workers in (1, 2):
        sensitivities(prepared, workers=workers)
        start = time.perf_counter()
        sensitivities(prepared, workers=workers)
        took = time.perf_counter() - start
        size = f"{prepared.samples} samples, {len(all_parameters())} parameters"
        print(f"sensitivities ({size}): {took:.2f} s on {workers}")


if __name__ == "__main__":
    main(Path(sys.argv[1] if len(sys.argv) > 1 else os.environ.get("SENSORLESS_RECORDINGS", "../shared/recordings")))
