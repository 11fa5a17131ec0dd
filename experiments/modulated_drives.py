"""Which estimators keep lock on drives as they modulate?  The protocol's test `modulation`, one motor.

python -m experiments.modulated_drives   writes experiments/results/modulated_drives.md and .json
"""

from __future__ import annotations

import datetime
import json
from pathlib import Path

from model.drive_files import load_drive
from sandbox.evaluation.protocol import protocol
from sandbox.evaluation.protocol_modulation import BEYOND, PAUSE, SHORT, beyond, cases, highest
from sandbox.output.files import plain, version

RESULTS = Path(__file__).parent / "results"
MOTOR = "ipm_exchanged"


def main() -> None:
    """Run every estimator with both beliefs and write the table."""
    drive = load_drive(MOTOR)
    speed = highest(drive)
    names = [case.name for case, _ in cases(drive)]
    rows = protocol(motors=[MOTOR], tests=["modulation"], jobs=1).rows
    page = [
        "# Estimators on drives as they modulate",
        "",
        f"`{MOTOR}` driven at standstill and at {100 * speed:g} % of rated speed under rated load; the protocol's test "
        "`modulation`. The worse of the two mean errors, electrical degrees; **lost**: lock was lost.",
        "",
        "- `dpwm_...`: discontinuous PWM; *short pulses*: `dpwm_min`, pulses and gaps below "
        f"{1e6 * SHORT * drive.converter.update_period:g} µs are dropped.",
        "- `nearest`, `shortened`, `six_step`: overmodulation, with a link and an injection of "
        + ", ".join(
            f"{link:.0f} and {amplitude:.1f} V" for link, amplitude in (beyond(drive, speed, n) for n in BEYOND)
        )
        + f" instead of {drive.converter.dc_bus_voltage:g} and {drive.injection.amplitude:g} V. With the injection the "
        "first two leave the circle inside the hexagon, without (`active_flux`) they do not; `six_step` needs more "
        "than the hexagon gives on average.",
        "- *less injection*, *little injection*: these amplitudes on the usual link, never beyond the circle.",
        f"- *flying start*: gates blocked for {PAUSE:g} s at that speed, half load before and after; *slower*: the "
        "rotor has lost a fifth of its speed meanwhile.",
        "",
        "What reads the voltage that the magnets induce (`active_flux`, `hybrid`, the Kalman filters) follows the "
        "rotor while gates are blocked. Injection alone has no ripple then: it goes on at its last speed, and ends at "
        "either pole.",
        "",
        f"Made by `python -m experiments.modulated_drives`, {datetime.date.today()}, {version()}.",
        "",
        f"| estimator | {' | '.join(names)} |",
        "|---|" + "--:|" * len(names),
    ]
    for row in rows:
        found = [row.outcome.metrics.get(f"{name}: mean_deg") for name in names]
        cells = ["**lost**" if x is None else f"{x:.2f}" for x in found]
        page.append(f"| `{row.unit.estimator}` {row.unit.belief[:3]}. | {' | '.join(cells)} |")
    (RESULTS / "modulated_drives.md").write_text("\n".join(page) + "\n", encoding="utf-8")
    kept = {"date": str(datetime.date.today()), "version": version(), "tests": [row.as_json() for row in rows]}
    (RESULTS / "modulated_drives.json").write_text(json.dumps(plain(kept), indent=1) + "\n", encoding="utf-8")
    print("\n".join(page[-len(rows) - 2 :]))


if __name__ == "__main__":
    main()
