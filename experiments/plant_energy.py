"""The plant's energy balance, effect by effect: what goes in is lost, handed to the shaft, or
stored.

    3/2 int u i dt = copper + skin + core + legs + friction + shaft + change of what is stored

Twenty periods of the plant, every effect at typical size that has to do with energy, the rotor
locked, driven, free. The electrical power is that of the legs' terminals, so what devices drop is
lost behind them.  Shaft: the air gap's work on a driven rotor, the load's of a free one.  Stored:
3/2 (H + eddy branch + skin branch), kinetic energy, twist of the shaft, potential of the cogging.
What is left, over the largest of these terms, with 1, 16 and 64 steps a period.  `plant_meter` adds
the terms up; so that it can look into them, kernels run without a compiler.

Run: python -m experiments.plant_energy
    (4 minutes; writes experiments/results/plant/energy.{md,json})
or for one row: python -m experiments.plant_energy MOTOR TITLE   (prints it)
"""

from __future__ import annotations

import json
import math
import os
import subprocess
import sys
from collections.abc import Iterator, Mapping
from datetime import date
from typing import Any

import numba
import numpy as np

from experiments.plant_cases import OUT, cases, of_quartic
from experiments.plant_meter import Fields, Meter, pair
from model.drive_files import load_drive
from model.parameters import Drive
from model.spline import SplineEnergy
from sandbox.plant import additions as add
from sandbox.plant import period as plant
from sandbox.plant import sets
from sandbox.plant.batch import blank_room
from sandbox.plant.edges import duties, write_edges
from sandbox.plant.fixed import fix
from sandbox.plant.sets import batch_of, complete, features_of, timing_of

MOTORS = ("ipm", "ipm_exchanged", "brusa_hsm1")
# rad/s electrical, at the beginning
CASES = (("locked", 0.0), ("driven", 120.0), ("driven", 600.0), ("free", 300.0))
STEPS, PERIODS = (1, 16, 64), 20
RESOLVED = 1e-9  # of the largest term: below, no order is told
OUTSIDE = ("pwm_delay", "current_", "encoder_")  # what only sensors see, or the samples' instants


def balance(
    drive: Drive, effects: Mapping[str, float], rotor: str, speed: float, steps: int
) -> dict[str, float]:
    """Return all terms (J) of PERIODS periods with so many steps a period; speed: rad/s
    electrical."""
    motor, converter = drive.motor, drive.converter
    v, h, rated = (
        complete(motor, converter, effects),
        converter.sampling_period,
        motor.rated_current,
    )
    # with LINK segments are taken by their parts
    features = features_of(motor, v) | add.MOVED | add.MOTION | add.LINK
    # no compiler here that would see a record's fields
    sets.fix = lambda w, nominal, period: fix(Fields(w), nominal, period)
    w: Any = Fields(batch_of(motor, converter, [v], 1))
    room: Any = Fields(blank_room(1))
    if rotor != "free":
        features &= ~add.TWIST
        w.inertia_inv[:] = w.motor_inv[:] = w.load_inv[:] = w.load_share[:] = 0.0
    flux_map = motor.energy if isinstance(motor.energy, SplineEnergy) else None
    w.angle[0], w.speed[0], w.off_c[0], w.off_s[0] = 0.3, speed, 1.0, 0.0
    load = 0.1 * motor.rated_torque if rotor == "free" else 0.0
    meter = Meter(w, v, drive, rotor, load)
    e = complex(math.cos(0.3), math.sin(0.3))
    i = rated * complex(-0.1, 0.5) * e
    psi = meter.flux(i, motor.magnet_flux * e)
    for name, x in (("psi", psi), ("eddy", psi), ("slow", i)):
        getattr(w, f"{name}_alpha")[0], getattr(w, f"{name}_beta")[0] = pair(x)
    timing, looks, seen, span = timing_of(w, h, steps), np.empty(0), np.empty((0, 2)), 0.0
    kept = plant.at_start, plant.in_middle, plant.lose, plant.moved
    stored: list[float] = []

    def at_start(*given: Any) -> None:
        """Begin a segment, then look."""
        kept[0](*given)
        meter.at_start()
        stored.append(meter.stored()) if not stored else None

    def in_middle(*given: Any) -> None:
        """Go to a segment's middle, then look."""
        kept[1](*given)
        meter.in_middle(given[7], complex(given[9], given[10]), complex(given[11], given[12]))

    def lose(batch: Any, acts: Any, t: float, length: float, x: float, y: float) -> None:
        """Note an edge that still waits."""
        meter.waiting.append((complex(x, y), min(max(acts[0] - t, 0.0), length)))
        kept[2](batch, acts, t, length, x, y)

    def moved(batch: Any, bits: int, trajectory: Any, t: float, length: float) -> Any:
        """Move the rotor, then look."""
        before = (*meter.speeds(), w.slip[0])
        trajectory = kept[3](batch, bits, trajectory, t, length)
        meter.moved(length, before)
        return trajectory

    plant.at_start, plant.in_middle, plant.lose, plant.moved = at_start, in_middle, lose, moved
    applied = plant.STILL._replace(load=load, load_after=load)
    try:
        for k in range(PERIODS):
            u = (
                motor.resistance * i / e
                + 1j * speed * psi / e
                + drive.injection.amplitude * (1 if k % 8 < 4 else -1)
            )
            u *= complex(
                math.cos(0.3 + speed * h * (k + 0.5)), math.sin(0.3 + speed * h * (k + 0.5))
            )
            room.before[:] = room.duty
            room.duty[:] = duties(u.real, u.imag, converter.dc_bus_voltage)
            write_edges(room, h)
            theta, omega = motor.pole_pairs * meter.turn(), motor.pole_pairs * meter.speeds()[0]
            surge = w.surge[0] if rotor == "free" else 0.0
            trajectory = plant.RotorTrajectory(
                math.cos(theta), math.sin(theta), 0.0, 0.0, omega, surge, 0.0, omega, applied
            )
            span = plant.travel(
                w, flux_map, timing, features, room, trajectory, k * h, span, looks, seen
            )
        theta = motor.pole_pairs * meter.turn()
        plant.at_start(
            w, flux_map, features, math.cos(theta), math.sin(theta), 0.0, trajectory, span
        )
    finally:
        plant.at_start, plant.in_middle, plant.lose, plant.moved = kept
    return meter.total | {"stored": meter.stored() - stored[0]}


def left(terms: Mapping[str, float]) -> float:
    """Return what is left of the balance over its largest term."""
    return (2.0 * terms["in"] - sum(terms.values())) / max(map(abs, terms.values()))


def looked_at(drive: Drive) -> Iterator[tuple[str, dict[str, float]]]:
    """Yield title and parameters of the rows: what has to do with energy, at typical size."""
    for title, effects in cases(drive):
        names = title.split(" x ")[0].split(" + ")
        if title.endswith(" x 2") or any(name.startswith(OUTSIDE) for name in names):
            continue
        if not of_quartic(drive, title):
            yield title, effects


def row(drive: Drive, effects: Mapping[str, float]) -> list[dict[str, Any]]:
    """Return of each case what is left at every number of steps, and the terms (J) with most
    steps."""
    out = []
    for rotor, speed in CASES:
        found = [balance(drive, effects, rotor, speed, n) for n in STEPS]
        out.append({"left": [left(x) for x in found], "terms": found[-1]})
    return out


def cell(found: Mapping[str, Any]) -> str:
    """Return what is left with fewest and most steps (ppm), and the order between the last two
    numbers of steps."""
    few, many = (abs(x) for x in found["left"][-2:])
    order = (
        "-"
        if many < RESOLVED or few < many
        else f"{math.log(few / many) / math.log(STEPS[-1] / STEPS[-2]):.1f}"
    )
    return f"{1e6 * abs(found['left'][0]):.2g}, {1e6 * many:.1g}: {order}"


def table(results: Mapping[str, Mapping[str, list[dict[str, Any]]]]) -> str:
    """Return the results as Markdown."""
    names = [f"{rotor} {speed:g}" if speed else rotor for rotor, speed in CASES]
    lines = [
        "# Energy balance of the plant",
        "",
        f"Written by `python -m experiments.plant_energy` on {date.today().isoformat()}. Energy in "
        f"less losses, work and change of what is stored over {PERIODS} periods, with {STEPS[0]} "
        f"and {STEPS[-1]} steps a period (ppm of the largest of these terms), and the order of "
        f"convergence between {STEPS[-2]} and {STEPS[-1]} steps (a dash: nothing left to tell). "
        "Numbers beside a rotor: rad/s electrical, of a free one at the beginning.",
    ]
    for motor, rows in results.items():
        lines += [
            "",
            f"## {motor}",
            "",
            f"| effects | {' | '.join(names)} |",
            "|---|" + "---|" * len(names),
        ]
        lines += [f"| {title} | {' | '.join(map(cell, found))} |" for title, found in rows.items()]
        terms = next(iter(rows.values()))[0]["terms"]
        lines += [
            "",
            "Largest share that a term has of the largest one, over all rows and cases:",
            "",
        ]
        shares = {
            name: max(share(c["terms"], name) for f in rows.values() for c in f) for name in terms
        }
        lines += [", ".join(f"{name} {x:.2g}" for name, x in shares.items()) + "."]
    return "\n".join(lines) + "\n"


def share(terms: Mapping[str, float], name: str) -> float:
    """Return a term over the largest."""
    return abs(terms[name]) / max(map(abs, terms.values()))


def main(motor: str = "", title: str = "") -> None:
    """Run one row and print it, or everything and write the table."""
    if not numba.config.DISABLE_JIT:  # type: ignore[attr-defined]
        again = [
            sys.executable,
            "-m",
            "experiments.plant_energy",
            *([motor, title] if motor else []),
        ]
        raise SystemExit(
            subprocess.run(
                again, env={**os.environ, "NUMBA_DISABLE_JIT": "1"}, check=False
            ).returncode
        )
    if motor:
        drive = load_drive(motor)
        print(json.dumps(row(drive, dict(cases(drive))[title])))
        return
    results: dict[str, dict[str, list[dict[str, Any]]]] = {}
    for name in MOTORS:
        results[name] = {}
        drive = load_drive(name)
        for what, effects in looked_at(drive):
            results[name][what] = row(drive, effects)
            print(name, what, *map(cell, results[name][what]), sep=" | ", flush=True)
    OUT.mkdir(parents=True, exist_ok=True)
    (OUT / "energy.md").write_text(table(results), encoding="utf-8")
    content = {"date": date.today().isoformat(), "results": results}
    (OUT / "energy.json").write_text(json.dumps(content, indent=1) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main(*sys.argv[1:])
