"""How well does the motor have to be known?  Gain of the saturated belief with parameters off by up
to 5, 10, 20 %.

python -m experiments.needed_accuracy [--jobs N | --dask ADDRESS] [--draws N]
    writes experiments/results/tolerances/
"""

from __future__ import annotations

import argparse
import datetime
import json
from pathlib import Path

from experiments import screens
from experiments.on_cluster import on_dask
from sandbox import tolerances
from sandbox.evaluation.sweep.tolerances import lines
from sandbox.output.files import plain, version

RESULTS = Path(__file__).parent / "results" / "tolerances"
MOTORS = ("ipm_exchanged", "ipm", "spm_exchanged")


def main() -> None:
    """Run, draw, write the page."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--jobs", type=int, default=1, help="processes (1)")
    on_dask(parser)
    parser.add_argument(
        "--draws", type=int, default=64, help="of the belief's parameters at each tolerance (64)"
    )
    parser.add_argument("--motors", nargs="+", default=MOTORS, help=f"({' '.join(MOTORS)})")
    options = parser.parse_args()
    RESULTS.mkdir(parents=True, exist_ok=True)
    page = [
        "# How well does the motor have to be known?",
        "",
        "The saturated belief is only as good as the numbers in it. This page draws magnet flux, "
        "L_d, L_q and the five alphas of the *belief*, each evenly and on its own, within ± the "
        "tolerance. The plant and the gains stay those of the motor. Each line stands for "
        f"{options.draws} draws. The scenario is the staircase at standstill up to ±180 % load, "
        "and the estimate controls the drive.",
        "",
        "- **linear °, saturated °**: the position error of the linear and of the saturated "
        "belief (the root mean square of the mean errors of all loads, electrical degrees), of "
        "which half of the draws stay below; *95 % of draws* is for the saturated belief.",
        "- **gain left %**: how much of the way from the exact linear belief's error to the exact "
        "saturated belief's error is left: 100 where nothing is lost, 0 where the saturated "
        "belief is no better than a linear one that is exactly right, below 0 where it is worse. "
        "*95 % of draws* have at least so much left.",
        "- **lost**: draws with which the drive lost lock.",
        "",
        f"Made by `python -m experiments.needed_accuracy`, {datetime.date.today()}, {version()}.",
    ]
    for motor in options.motors:
        found = tolerances(
            motor, "staircase", draws=options.draws, jobs=options.jobs, cluster=options.dask
        )
        screens.write(found.plot(), RESULTS / motor)
        (RESULTS / f"{motor}.json").write_text(
            json.dumps(plain(found.as_json()), indent=1) + "\n", encoding="utf-8"
        )
        heads, cells = lines(found.rows)
        page += [
            "",
            f"## {motor}",
            "",
            f"| {' | '.join(heads)} |",
            "|---|" + "--:|" * (len(heads) - 1),
        ]
        page += [f"| {' | '.join(row)} |" for row in cells]
        page += ["", f"![{motor}]({motor}.svg)"]
        print("\n".join(page[-len(cells) - 6 :]), flush=True)
    (RESULTS / "README.md").write_text("\n".join(page) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
