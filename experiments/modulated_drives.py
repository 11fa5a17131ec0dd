"""Which estimators keep lock on drives as they modulate?  The protocol's test `modulation`, one
motor.

python -m experiments.modulated_drives [--page]
    writes experiments/results/modulated_drives.{md,json}; --page: nothing is run, the page anew
    from the JSON
"""

from __future__ import annotations

import json
import sys
from collections.abc import Mapping, Sequence
from textwrap import fill
from typing import Any

from experiments.drawing import RESULTS, save
from model.drive_files import load_drive
from sandbox.evaluation.protocol import protocol
from sandbox.evaluation.protocol_modulation import BEYOND, PAUSE, SHORT, beyond, cases, highest
from sandbox.output.files import version
from sandbox.output.provenance import commit

NAME = "modulated_drives"
MOTOR = "ipm_exchanged"
Row = Mapping[str, Any]  # of the JSON's `tests`


def mean(row: Row, name: str) -> float | None:
    """Return the worst mean error (degrees) of a case; None where lock was lost."""
    found: float | None = row["metrics"].get(f"{name}: mean_deg")
    return found


def holders(rows: Sequence[Row], name: str) -> str:
    """Return which estimators keep lock in a case with a saturated belief, in words."""
    kept = [
        row["estimator"]
        for row in rows
        if row["belief"] == "saturated" and mean(row, name) is not None
    ]
    return ", ".join(f"`{estimator}`" for estimator in kept) or "none"


def markdown(result: Mapping[str, Any]) -> str:
    """Return the page of a result."""
    drive, rows = load_drive(MOTOR), result["tests"]
    speed, names = highest(drive), [case.name for case, _ in cases(drive)]
    pairs = ", ".join(
        f"{link:.0f} and {size:.1f} V" for link, size in (beyond(drive, speed, n) for n in BEYOND)
    )
    said = [
        "# Estimators on drives as they modulate",
        f"`{MOTOR}` driven at standstill and at {100 * speed:g} % of rated speed under rated load; "
        "the protocol's test `modulation`. The worse of the two mean errors, electrical degrees; "
        "**lost**: lock was lost.",
        "- `dpwm_...`: discontinuous PWM; *short pulses*: `dpwm_min`, pulses and gaps below "
        f"{1e6 * SHORT * drive.converter.update_period:g} µs are dropped.",
        "- `nearest`, `shortened`, `six_step`: overmodulation, with a link and an injection of "
        f"{pairs} instead of {drive.converter.dc_bus_voltage:g} and {drive.injection.amplitude:g} "
        "V. With the injection the first two leave the circle inside the hexagon, without "
        "(`active_flux`) they do not; `six_step` needs more than the hexagon gives on average.",
        (
            "- *less injection*, *little injection*: these amplitudes on the usual link, "
            "never beyond the circle."
        ),
        f"- *flying start*: gates blocked for {PAUSE:g} s at that speed, half load before and "
        "after; *slower*: the rotor has lost a fifth of its speed meanwhile.",
        "What reads the voltage that the magnets induce (`active_flux`, `hybrid`, the Kalman "
        "filters) follows the rotor while gates are blocked. Injection alone has no ripple then: "
        "it goes on at its last speed, and ends at either pole.",
        f"With a saturated belief these keep lock in `six_step`: {holders(rows, 'six_step')}; and "
        "with its injection on the usual link (*little injection*): "
        f"{holders(rows, 'little injection')}. So much of what is lost is lost by the small "
        "injection, not by the modulation. A leg that does not switch takes edges away that "
        "`pwm_ripple` reads.",
        f"Made by `python -m experiments.{NAME}`, {result['date']}, {result['version']}, commit "
        f"{(result['commit'] or 'unknown')[:8]}.",
    ]
    text = "\n\n".join(
        fill(x, 120, subsequent_indent="  " if x.startswith("- ") else "") for x in said
    )
    half = next(k for k, name in enumerate(names) if name in BEYOND)  # before: within the hexagon
    return "\n\n".join([text, table(rows, names[:half]), table(rows, names[half:])]) + "\n"


def table(rows: Sequence[Row], names: Sequence[str]) -> str:
    """Return the table of some cases, a line for each estimator and belief."""
    lines = [f"| estimator | {' | '.join(names)} |", "|---|" + "--:|" * len(names)]
    for row in rows:
        cells = [
            "**lost**" if x is None else f"{x:.2f}" for x in (mean(row, name) for name in names)
        ]
        lines.append(f"| `{row['estimator']}` {row['belief'][:3]}. | {' | '.join(cells)} |")
    return "\n".join(lines)


def main() -> None:
    """Run every estimator with both beliefs, keep it and write the page."""
    if "--page" not in sys.argv[1:]:
        found = protocol(motors=[MOTOR], tests=["modulation"])
        save(
            NAME,
            {
                "version": version(),
                "commit": commit(),
                "tests": [row.as_json() for row in found.rows],
            },
        )
    result = json.loads((RESULTS / f"{NAME}.json").read_text(encoding="utf-8"))
    text = markdown(result)
    (RESULTS / f"{NAME}.md").write_text(text, encoding="utf-8")
    print(text)


if __name__ == "__main__":
    main()
