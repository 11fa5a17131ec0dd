"""What injection costs: every estimator with both beliefs on three motors, error beside loss and
sound.

Run: python -m experiments.injection_costs
    (about a minute; writes experiments/results/injection_costs*)
The plant has core loss of its effect's usual size (iron_loss, 20 times the rated reactance), so
that iron counts.
"""

from __future__ import annotations

import datetime
import textwrap
from pathlib import Path

from experiments import screens
from model.drive_files import load_drive
from model.effects.library import typical
from sandbox.drive.scenario import Scenario, Segment
from sandbox.evaluation.choice import Standing, standings
from sandbox.evaluation.compare import compare
from sandbox.evaluation.pages.cost_figure import READING, cost_figure, cost_table
from sandbox.evaluation.protocol_names import ESTIMATORS
from sandbox.output.files import write_json

RESULTS = Path(__file__).parent / "results"
MOTORS = ("ipm", "ipm_exchanged", "spm_exchanged")
SCENE = Scenario(
    "costs",
    (
        Segment(0.4),
        Segment(0.8, 1.0, ramp=0.2, settle=0.5),
        Segment(0.8, 1.0, 0.1, ramp=0.3, settle=0.5),
    ),
    "driven",
)


def main() -> None:
    """Run all estimators; print and write tables, figures and numbers."""
    parts, numbers = [f"# What injection costs\n\n{datetime.date.today()}, seed 0. {setting()}"], {}
    for name in MOTORS:
        drive = load_drive(name)
        result = compare(
            drive, SCENE, ESTIMATORS, effects=typical("iron_loss", drive.motor, drive.converter)
        )
        found = standings(result.rows)
        screens.write(cost_figure(found, name), RESULTS / f"injection_costs_{name}")
        numbers[name] = result.as_json()["rows"]
        parts.append(
            f"## {name}\n\n![Error, loss and sound of each "
            f"estimator](injection_costs_{name}.svg)\n\n{markdown(found)}"
        )
        print(parts[-1])
    write_json(RESULTS, "injection_costs", {"motors": numbers})
    (RESULTS / "injection_costs.md").write_text("\n\n".join(parts) + "\n", encoding="utf-8")


def setting() -> str:
    """Return what was run and how to read it."""
    return textwrap.fill(
        "A driven rotor at standstill without load, at standstill with rated load, at 10 % speed "
        f"with rated load, the estimate in control. {READING} `sensorless compare --effects "
        "iron_loss.core_resistance=...` makes such a table of your motor, and `--quiet-below`, "
        "`--loss-below` are limits of what it recommends.",
        120,
        initial_indent=" " * 20,
    ).strip()


def markdown(found: tuple[Standing, ...]) -> str:
    """Return the table of costs as markdown."""
    heads, lines = cost_table(found)
    rule = "|---|" + "--:|" * (len(heads) - 1)
    return "\n".join(
        [f"| {' | '.join(heads)} |", rule, *(f"| {' | '.join(line)} |" for line in lines)]
    )


if __name__ == "__main__":
    main()
