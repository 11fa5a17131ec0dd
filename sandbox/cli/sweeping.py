"""The command `sweep`, and `compare --tolerances`: arguments, progress, files."""

from __future__ import annotations

import argparse
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Any

from model.errors import BadInput
from sandbox.cli.arguments import checked_folder, folder_of, number
from sandbox.output.tables import many, print_prose, print_table, rate_bar

if TYPE_CHECKING:
    from sandbox.public.sweeps import ToleranceResult

MOST_PERCENT = 50.0  # of a belief's parameters


def on_dask(command: Any) -> None:
    """Add the option that hands a command's work to a cluster."""
    text = "address of a dask scheduler, tcp://...: its workers do the work (extra `dask`)"
    command.add_argument("--dask", metavar="ADDRESS", help=text)


def add_sweep(add: Callable[..., Any]) -> Any:
    """Add the command to the command line by its own `add`; return its parser."""
    c = add("sweep", run_sweep, "many runs: grids and random draws; goes on after a stop (see sandbox/sweep/README.md)")
    text = "the plan: what is the same in all runs, what is combined, what is drawn"
    c.add_argument("sweep", type=Path, metavar="SWEEP.toml", help=text)
    on_dask(c)
    c.add_argument("--yes", action="store_true", help="run it, however many runs it has")
    c.add_argument("--again", action="store_true", help="forget what an earlier call has finished in the folder")
    c.set_defaults(kept=kept)
    return c


def run_sweep(options: argparse.Namespace) -> None:
    """Run a sweep, or what is left of it; write its runs, sweep.json and sweep.png."""
    import sandbox
    from sandbox.sweep.summary import lines

    folder = checked_folder(options)
    with rate_bar("sweep", options.quiet) as progress:
        result = sandbox.sweep(
            options.sweep, folder, jobs=options.jobs, cluster=options.dask, yes=options.yes, again=options.again,
            progress=progress,
        )  # fmt: skip
    result.save(csv=options.csv)
    if not options.quiet:
        print_table(f"{result.plan.name}: largest mean position error of a run", *lines(result.groups))
        for why in result.as_json()["sentences"][:3]:
            print_prose(f"{many(why['runs'], 'run')} without a result: {why['sentence']}")
        print_prose(f"{result.summary()}; results in {folder}")


def kept(options: argparse.Namespace) -> str:
    """Return what an interrupted sweep has kept, and how it goes on."""
    from sandbox.sweep.store import counts

    done, total = counts(folder_of(options))
    if not done:
        return "no run is kept yet; nothing half-written"
    without = " without --again" if options.again else ""
    return f"{done} of {total} runs are kept; the same command{without} goes on"


def add_tolerances(command: Any, positive: Callable[[str], int]) -> None:
    """Add the options of `compare` that ask how well the model has to be known; positive: how counts are read."""
    text = "also run with the belief's parameters off by up to so many percent (5,10,20 if no numbers are given)"
    command.add_argument("--tolerances", nargs="?", const="5,10,20", metavar="PERCENT,...", help=text)
    command.add_argument("--draws", type=positive, help="draws of these parameters at each tolerance (64)")
    on_dask(command)


def check_tolerances(options: argparse.Namespace) -> None:
    """Raise BadInput, before anything runs, for tolerances that cannot be drawn."""
    if options.tolerances is None:
        if options.draws is not None:
            raise BadInput(f"--draws {options.draws} belongs to --tolerances, which is not given; add it")
        return
    percents(options.tolerances)
    if options.estimator_library:
        raise BadInput("--tolerances runs in processes that are told names and Python files; leave the library away")


def run_tolerances(options: argparse.Namespace, folder: Path, estimators: list[str]) -> ToleranceResult:
    """Draw belief parameters; write tolerances.json, .png and .parquet; return what was found."""
    import sandbox
    from sandbox.sweep.tolerances import DRAWS, lines

    with rate_bar("tolerances", options.quiet) as progress:
        result = sandbox.tolerances(
            options.motor, options.scenario, estimators, percent=percents(options.tolerances),
            draws=options.draws or DRAWS, effects=options.effects, seed=options.seed, jobs=options.jobs,
            cluster=options.dask, progress=progress,
        )  # fmt: skip
    result.save(folder, csv=options.csv)
    if not options.quiet:
        title = f"{result.motor}, {result.scenario}: position error when the belief is known to ± so much"
        print_table(title, *lines(result.rows))
        print_prose(f"results in {folder}")
    return result


def percents(text: str) -> list[float]:
    """Return numbers separated by commas; BadInput for anything else."""
    try:
        found = [number(part.strip()) for part in text.split(",") if part.strip()]
    except argparse.ArgumentTypeError:
        found = []
    if not found or not all(0.0 <= x <= MOST_PERCENT for x in found):
        raise BadInput(f"--tolerances {text[:40]} are no percentages from 0 to {MOST_PERCENT:g}; write them as 5,10,20")
    return found
