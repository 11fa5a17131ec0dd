"""What an exported drive costs in C: microseconds a PWM period on one core, and what that means for
a test rig.

python -m experiments.drive_in_c     writes results/drive_in_c.{json,md}
"""

from __future__ import annotations

import datetime
import json
import subprocess
import tempfile
from collections.abc import Mapping
from pathlib import Path
from string import Template

from estimators.c.build import compiler
from experiments.drawing import RESULTS
from model.drive_files import load_drive
from sandbox.public.exports.drive import export_drive

MOTOR, ROUNDS, PERIODS = "ipm_exchanged", 5, 20_000
EFFECTS: dict[str, dict[str, float]] = {
    "bare": {},
    "dead time": {"dead_time.time": 2e-6},
    "dead time, device drop": {"dead_time.time": 2e-6, "device_drop.threshold": 1.0},
    "ten effects": {
        "dead_time.time": 2e-6,
        "device_drop.threshold": 1.0,
        "iron_loss.core_resistance": 2000.0,
        "flux_harmonics.psi_d6": 5e-4,
        "inductance_harmonics.gamma_6": 0.1,
        "cogging_torque.amplitude": 0.02,
        "coulomb_friction.torque": 0.02,
        "dc_link_ripple.amplitude": 4.0,
        "current_filter.time_constant": 1.5e-5,
        "skin_effect.resistance": 1.0,
    },
}
KINDS = [("double", 1, True), ("float", 1, False), ("double, 10 parts", 10, True)]
TIMER = Template("""\
#include "sensorless_drive.h"
#include <math.h>
#include <stdio.h>
#include <time.h>
int main(void) {
    static sensorless_drive drive;
    sensorless_drive_input in = {{0.5, 0.5, 0.5}, 0, 0, 0, 0, {0}};
    sensorless_drive_output out = {0};
    struct timespec from, to;
    const sensorless_drive_parameters *is = &sensorless_drive_parameters_of_$cname;
    int wrong = sensorless_drive_init(&drive, is, SENSORLESS_FREE, (drive_real)0.4, 0, 0);
    clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &from);
    for (int k = 0; k < $periods; k++) {
        const drive_real angle = (drive_real)(0.02 * (k % 314)), size = (drive_real)(is->drive_dc_bus_voltage * 0.05);
        sensorless_drive_duties(size * cosf(angle), size * sinf(angle), is->drive_dc_bus_voltage, in.duty);
        for (int part = 0; part < $parts; part++) wrong |= sensorless_drive_part(&drive, &in, &out, part, $parts);
    }
    clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &to);
    printf("%.9g\\n", ((double)(to.tv_sec - from.tv_sec) + 1e-9 * (double)(to.tv_nsec - from.tv_nsec)) / $periods);
    return wrong;
}
""")  # noqa: E501


def costs(effects: Mapping[str, float]) -> dict[str, float]:
    """Return microseconds a period, the least of several rounds, of each kind."""
    with tempfile.TemporaryDirectory() as name:
        folder = export_drive(MOTOR, effects, fmu=False).save(Path(name) / "c")
        return {kind: cost(folder, parts, double) for kind, parts, double in KINDS}


def cost(folder: Path, parts: int, double: bool) -> float:
    """Return the same of an exported drive, in so many parts."""
    (folder / "timer.c").write_text(TIMER.substitute(cname=MOTOR, periods=PERIODS, parts=parts))
    wide = ["-DSENSORLESS_FLOAT64"] if double else []
    call = [
        str(compiler()),
        "-std=gnu99",
        "-O2",
        *wide,
        "-o",
        "timer",
        "timer.c",
        "sensorless_drive.c",
        "-lm",
    ]
    subprocess.run(call, cwd=folder, check=True)
    runs = [
        subprocess.run(["./timer"], cwd=folder, capture_output=True, text=True, check=True)
        for _ in range(ROUNDS)
    ]
    return 1e6 * min(float(run.stdout) for run in runs)


def main() -> None:
    """Measure, and write the table."""
    rows = {name: costs(effects) for name, effects in EFFECTS.items()}
    made = {
        "date": datetime.date.today().isoformat(),
        "motor": MOTOR,
        "period_us": 1e6 * load_drive(MOTOR).converter.sampling_period,
        "microseconds_per_period": rows,
    }
    (RESULTS / "drive_in_c.json").write_text(json.dumps(made, indent=1) + "\n", encoding="utf-8")
    (RESULTS / "drive_in_c.md").write_text(page(made), encoding="utf-8")


def page(made: dict) -> str:
    """Return the page of a measurement."""
    rows, kinds = made["microseconds_per_period"], list(made["microseconds_per_period"]["bare"])
    lines = [f"| {name} | {' | '.join(f'{rows[name][k]:.2f}' for k in kinds)} |" for name in rows]
    head = [f"| effects | {' | '.join(kinds)} |", f"|---|{len(kinds) * '--:|'}"]
    worst = max(row["double, 10 parts"] for row in rows.values()) / 10.0
    return (
        "# An exported drive in C: microseconds a PWM period\n\n`python -m "
        f"experiments.drive_in_c`, {made['date']}, one core beside other programs, least of "
        f"{ROUNDS} rounds of {PERIODS} periods of {made['period_us']:g} µs; `{made['motor']}`, "
        "rotor free, a turning voltage of 5 % of the link.\n\n"
        + "\n".join([*head, *lines])
        + "\n\n"
        f"A step of hardware in the loop takes one part: {worst:.2f} µs at the most here "
        "(its mean; a real-time system "
        "needs room for the worst). A tenth of a period of 100 µs leaves 10 µs for it.\n"
    )


if __name__ == "__main__":
    main()
