"""The main job on the paper's motors: figures and table that the README shows.

Run: python experiments/main_job.py
    (about 20 s; writes experiments/results/main_job*.{svg,json,md})
"""

from __future__ import annotations

import datetime
from pathlib import Path

from experiments import screens
from model.drive_files import load_drive
from sandbox.drive.scenario import load_scenario
from sandbox.evaluation.compare import compare
from sandbox.evaluation.pages.compare_figure import comparison_figure
from sandbox.evaluation.pages.compare_tables import comparison_markdown
from sandbox.output.files import write_json
from sandbox.public.printed import print_comparison

RESULTS = Path(__file__).parent / "results"


def main() -> None:
    """Compare beliefs on the staircase for every motor that is valid over its range."""
    RESULTS.mkdir(exist_ok=True)
    for name in ("ipm_exchanged", "ipm", "spm_exchanged"):
        result = compare(load_drive(name), load_scenario("staircase"))
        print_comparison(result)
        screens.write(comparison_figure(result), RESULTS / f"main_job_{name}")
        write_json(RESULTS, f"main_job_{name}", result.as_json())
        title = f"# {name}, staircase ({datetime.date.today()}, seed 0)\n\n"
        note = "Mean position error in electrical degrees (95th percentile of its size).\n\n"
        (RESULTS / f"main_job_{name}.md").write_text(
            title + note + comparison_markdown(result) + "\n"
        )


if __name__ == "__main__":
    main()
