"""By how much the plant's error falls when its steps double, effect by effect; what neutral effects
do beside others.

The recordings of `plant_against_bench` (the switched bench, every effect at typical size, locked,
driven, free) are replayed with 1 to 32 steps a period.  Error: rms difference of the sampled
currents from 256 steps, over rated current. The order is that between 8 and 32 steps; where an
error is below RESOLVED there is none to tell.  Edges cut a period into segments, so a step is at
most so long; that is why few steps are much better than their order says.  At low voltage the edges
of three legs lie within a microsecond or so: 32 steps do not cut the segments in which a voltage
acts at all, and the order that is told is near 0, the error small (Brusa locked: 0.1 ppm up to 32
steps, 0.04 with 64).

Run: python -m experiments.plant_order
    (a minute; writes experiments/results/plant/order.{md,json})
"""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping
from datetime import date
from typing import Any

import numpy as np

from experiments.plant_against_bench import CASES, SETTLED, recorded
from experiments.plant_cases import OUT, cases, of_quartic
from model.drive_files import load_drive
from model.effects import library
from model.parameters import Drive
from sandbox.recordings.campaign import Campaign
from sandbox.replay.replay import Prepared, prepare, replay, with_steps

MOTORS = ("ipm", "ipm_exchanged", "brusa_hsm1")
STEPS, BEST = (1, 8, 32), 256
# of rated current at 32 steps: below, rounding and the corners of sign(i) are in it
RESOLVED = 1e-9


def currents(prepared: Prepared, effects: Mapping[str, float]) -> list[Any]:
    """Return what each recording's three sensors read (A), samples that settle apart."""
    return [i[SETTLED:, :, 0] for i in replay(prepared, [effects]).currents]


def errors(
    drive: Drive, prepared: Prepared, effects: Mapping[str, float]
) -> dict[int, list[float]]:
    """Return for each number of steps the error (over rated current) in each recording."""
    best = currents(with_steps(prepared, BEST), effects)
    out = {}
    for n in STEPS:
        apart = [
            a - b for a, b in zip(currents(with_steps(prepared, n), effects), best, strict=True)
        ]
        rms = [float(np.sqrt(np.mean(np.sum(x**2, axis=1) * 2.0 / 3.0))) for x in apart]
        out[n] = [x / drive.motor.rated_current for x in rms]
    return out


def order(found: Mapping[int, list[float]], k: int) -> float | None:
    """Return the order of convergence in recording k between the last two numbers of steps."""
    few, many = STEPS[-2:]
    if found[many][k] < RESOLVED:
        return None
    return float(np.log(found[few][k] / found[many][k]) / np.log(many / few))


def moved_by_neutral(drive: Drive, prepared: Prepared) -> dict[str, float]:
    """Return the effects whose neutral values move a bit of any recording's readings, and by how
    much at most (of rated current): a plain set beside one with the effect at typical size, so that
    the plant does for both what the effect needs, against the plain set alone."""
    plain, found = currents(prepared, {}), {}
    for name in library.effect_names():
        on = library.typical(name, drive.motor, drive.converter)
        together = [i[SETTLED:, :, 0] for i in replay(prepared, [{}, on]).currents]
        found[name] = max(float(np.abs(a - b).max()) for a, b in zip(together, plain, strict=True))
    return {name: x / drive.motor.rated_current for name, x in found.items() if x > 0.0}


def rows(drive: Drive) -> Iterator[tuple[str, dict[int, list[float]]]]:
    """Yield title and errors of every effect at typical size, of none, and of pairs."""
    for title, effects in cases(drive):
        if not title.endswith(" x 2") and not of_quartic(drive, title):
            recordings = recorded(drive, effects)
            campaign = Campaign("bench", drive, tuple(r for r, _ in recordings), {}, {}, False)
            yield title, errors(drive, prepare(campaign, effects, steps=1), effects)


def table(
    results: Mapping[str, Mapping[str, Mapping[int, list[float]]]],
    moved: Mapping[str, Mapping[str, float]],
) -> str:
    """Return the results as Markdown."""
    names = [f"{rotor} {speed:g}" if rotor == "driven" else rotor for rotor, speed in CASES]
    lines = [
        "# Order of convergence of the plant",
        "",
        f"Written by `python -m experiments.plant_order` on {date.today().isoformat()}. Error with "
        f"1 and with {STEPS[-1]} steps a period (rms of the sampled currents over rated current, "
        f"ppm; against {BEST} steps), and the order of convergence between {STEPS[-2]} and "
        f"{STEPS[-1]} steps (a dash: nothing left to tell). An order near 0: edges lie so close "
        "together that these steps do not cut what lies between them. Neutral effects: a plain "
        "set beside one with the effect on, for both of which the plant then does what the effect "
        "needs, against the plain set alone; the same to the bit but for those named.",
    ]
    for motor, by_title in results.items():
        left = (
            ", ".join(f"{name} ({x:.1g} of rated current)" for name, x in moved[motor].items())
            or "none"
        )
        lines += [
            "",
            f"## {motor}",
            "",
            f"Moved by an effect that is on in the lane beside: {left}.",
            "",
        ]
        lines += [f"| effects | {' | '.join(names)} |", "|---|" + "---|" * len(names)]
        for title, found in by_title.items():
            cells = []
            for k in range(len(names)):
                p = order(found, k)
                first, last = (1e6 * found[n][k] for n in (STEPS[0], STEPS[-1]))
                cells.append(f"{first:.2g}, {last:.1g}: {'-' if p is None else format(p, '.1f')}")
            lines.append(f"| {title} | {' | '.join(cells)} |")
    return "\n".join(lines) + "\n"


def main() -> None:
    """Run everything, write the table."""
    results: dict[str, dict[str, dict[int, list[float]]]] = {}
    moved: dict[str, dict[str, float]] = {}
    for motor in MOTORS:
        drive = load_drive(motor)
        campaign = Campaign("bench", drive, tuple(r for r, _ in recorded(drive, {})), {}, {}, False)
        moved[motor] = moved_by_neutral(drive, prepare(campaign, steps=1))
        results[motor] = {}
        for title, found in rows(drive):
            results[motor][title] = found
            print(motor, title, found, flush=True)
    OUT.mkdir(parents=True, exist_ok=True)
    (OUT / "order.md").write_text(table(results, moved), encoding="utf-8")
    content = {"date": date.today().isoformat(), "moved": moved, "results": results}
    (OUT / "order.json").write_text(json.dumps(content, indent=1) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
