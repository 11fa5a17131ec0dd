"""Many runs: sweeps over grids and random designs, and how well a belief has to be known."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, ClassVar

from estimators.registry import AnyEstimator
from model.effect_files import effects_of
from model.errors import BadInput
from sandbox.drive.scenario import Scenario
from sandbox.output.columns import Column, columns_of, unit_of
from sandbox.output.tables import many, print_prose, print_table
from sandbox.public.calls import records_call
from sandbox.public.loading import several
from sandbox.public.result import Result

if TYPE_CHECKING:
    import pyarrow

    from sandbox.engine.processes import Cluster
    from sandbox.evaluation.pages.compare_page import Known
    from sandbox.evaluation.sweep.plan import Sweep
    from sandbox.evaluation.sweep.summary import Group
    from sandbox.evaluation.sweep.tolerances import ToleranceRow
    from sandbox.output.plots import AnyAxes, Figure

UNITS = {
    "tolerance": "1",
    "median_deg": "deg",
    "p95_deg": "deg",
    "gain_left": "1",
    "gain_left_p95": "1",
}


@dataclass(frozen=True, repr=False)
class SweepResult(Result):
    """A finished sweep: a folder with its runs, and what its groups say."""

    command: ClassVar[str] = "sweep"
    plan: Sweep
    folder: Path
    cpu_seconds: float  # of all runs, whenever they were made
    kernel_seconds: float  # of the compiled loops alone

    @property
    def groups(self) -> list[Group]:
        """Each combination of the grid: below which error 50, 95 and 99 % of its runs stay
        (degrees)."""
        from sandbox.evaluation.sweep.summary import groups_of

        return groups_of(self.plan, self.to_table())

    def summary(self) -> str:
        """Return what was run, and what it cost."""
        each = 1e3 * self.cpu_seconds / max(1, self.plan.runs)
        return f"{self.plan.name}, {many(self.plan.runs, 'run')}, {each:.3g} ms of CPU each"

    def as_json(self) -> dict[str, Any]:
        """Return what `sweep.json` holds beyond its header and the names of files."""
        from sandbox.evaluation.sweep.summary import as_json

        cost = {"cpu_seconds": self.cpu_seconds, "kernel_seconds": self.kernel_seconds}
        return as_json(self.plan, self.to_table()) | cost

    def to_table(self) -> pyarrow.Table:
        """Return all runs as one pyarrow table, one row a run, units in the metadata of its
        columns."""
        from sandbox.evaluation.sweep.store import read_table

        return read_table(self.folder)

    def columns(self) -> dict[str, Column]:
        """Return the same as columns."""
        table = self.to_table()
        return {f.name: Column(table[f.name].to_pylist(), unit_of(f)) for f in table.schema}

    def traces(self) -> Any:
        """Return the traces as an xarray Dataset (run, sample), read when used; BadInput where none
        were asked for."""
        from sandbox.evaluation.sweep.store import open_traces

        return open_traces(self.folder)

    def plot(self, path: str | Path | None = None, *, ax: AnyAxes = None) -> Figure:
        """Return the share of drives below an error, a curve a group; a path (.png, .svg, .pdf) is
        written as well.

        ax: axes of your own to draw in; see `Result.plot`.
        """
        from sandbox.evaluation.sweep.curves import yield_figure
        from sandbox.evaluation.sweep.summary import errors_of

        table, groups = self.to_table(), self.groups
        errors, cell = errors_of(table), table["run"].to_numpy() % len(groups)
        curves = {g.name: errors[cell == k] for k, g in enumerate(groups)}
        return yield_figure(curves, self.plan.name, path, ax=ax)

    def report(self) -> None:
        """Print the errors of each group, and why runs have no result."""
        from sandbox.evaluation.sweep.summary import lines

        print_table(f"{self.plan.name}: largest mean position error of a run", *lines(self.groups))
        for why in self.as_json()["sentences"][:3]:
            print_prose(f"{many(why['runs'], 'run')} without a result: {why['sentence']}")
        print_prose(self.summary())

    def save(self, folder: str | Path | None = None, **asked: bool) -> Path:
        """Write sweep.json and .png (csv: all runs as CSV, too) into the sweep's folder, or
        another; return it."""
        return super().save(self.folder if folder is None else folder, **asked)

    def _kinds_in(self, folder: Path) -> tuple[str, ...]:
        """Return the figure; the table for another folder than that of the runs."""
        return ("figure",) if folder.resolve() == self.folder.resolve() else self.kinds

    def _write_more(self, out: Path) -> dict[str, Any]:
        """Write nothing; say where the runs are."""
        return {} if (out / "sweep.parquet").is_file() else {"table": "runs"}


@dataclass(frozen=True, repr=False)
class ToleranceResult(Result):
    """Position error of both beliefs when their parameters are off, and how much of the gain is
    left."""

    command: ClassVar[str] = "tolerances"
    motor: str
    scenario: str
    rows: tuple[ToleranceRow, ...]

    def summary(self) -> str:
        """Return how much is left at the largest tolerance."""
        worst = max(row.tolerance for row in self.rows)
        said = [
            f"{r.estimator} {100 * r.gain_left:.0f} %"
            for r in self.rows
            if r.tolerance == worst and r.gain_left is not None
        ]
        return (
            f"{self.motor}, {self.scenario}, gain left at ±{100 * worst:g} %: "
            f"{', '.join(said) or 'none'}"
        )

    def as_json(self) -> dict[str, Any]:
        """Return what `tolerances.json` holds beyond its header and the names of files."""
        from sandbox.evaluation.sweep.tolerances import OFF, as_json

        return {
            "motor": self.motor,
            "scenario": self.scenario,
            "off": list(OFF),
            "rows": as_json(self.rows),
        }

    def columns(self) -> dict[str, Column]:
        """Return one row for each estimator, belief and tolerance."""
        return columns_of([dataclasses.asdict(row) for row in self.rows], UNITS)

    def plot(self, path: str | Path | None = None, *, ax: AnyAxes = None) -> Figure:
        """Return position error over tolerance, a panel an estimator; a path (.png, .svg, .pdf) is
        written as well.

        ax: axes of your own to draw in, one for each estimator; see `Result.plot`.
        """
        from sandbox.evaluation.sweep.curves import tolerance_figure

        return tolerance_figure(self.rows, f"{self.motor}, {self.scenario}", path, ax=ax)

    def report(self) -> None:
        """Print what is left of the gain at each tolerance."""
        from sandbox.evaluation.sweep.tolerances import lines

        title = (
            f"{self.motor}, {self.scenario}: position error when the belief is known to ± so much"
        )
        print_table(title, *lines(self.rows))

    def for_page(self) -> Known:
        """Return table and drawing as the page of a comparison shows them."""
        from sandbox.evaluation.pages.compare_page import Known
        from sandbox.evaluation.sweep.tolerances import lines
        from sandbox.output.plots import page, svg_text
        from sandbox.output.vector import PHONE

        names = {row.estimator for row in self.rows}
        figure, panels = page((PHONE, 2.6 * len(names)), len(names), 1, sharey=True)
        self.plot(ax=panels)
        return Known(*lines(self.rows), svg_text(figure, f"tolerances{self.motor}{self.scenario}"))


@records_call
def sweep(
    plan: str | Path | Mapping[str, Any],
    folder: str | Path,
    *,
    jobs: int | None = None,
    cluster: Cluster | None = None,
    yes: bool = False,
    again: bool = False,
    progress: Callable[[int, int], None] | None = None,
) -> SweepResult:
    """Make the runs of a sweep, a grid and a random design, or what is left of them after an
    interruption.

    Parameters
    ----------
    plan : str, Path or mapping
        A TOML file (sandbox/evaluation/sweep/README.md), or its tables as a mapping.
    folder : str or Path
        Where finished blocks of runs are kept; a call that finds some goes on where they end.
    jobs : int, optional
        Processes; all cores by default. Results do not depend on it, to the bit.
    cluster : str or dask.distributed.Client, optional
        A scheduler's address, such as "tcp://10.0.0.1:8786", or a client: its workers do the runs.
    yes : bool
        Confirms more than 200 000 runs, or more than 2 GB of traces.
    again : bool
        Whether to forget what an earlier call has finished.
    progress : callable, optional
        Is told how many of how many runs are done.

    Returns
    -------
    SweepResult
        `.to_table()`: one row a run; `.groups`: errors (electrical degrees) that 50, 95 and 99 %
        stay below.

    Raises
    ------
    BadInput
        For what cannot be swept, before anything runs. A run that cannot be made is a row with its
        sentence.

    Examples
    --------
    >>> import tempfile
    >>> from sandbox import sweep
    >>> tables = {
    ...     "run": {"estimator": "qnull", "seed": 1},
    ...     "scenario": {"start_up": False},
    ...     "segment": [{"duration": 0.2, "load": 1.0, "settle": 0.15}],
    ...     "grid": {"belief": ["linear", "saturated"]},
    ...     "random": {"points": 4, "draw": {"true_factor": {"magnet_flux": {"normal": [1.0, 0.02]}}}},
    ... }
    >>> with tempfile.TemporaryDirectory() as place:
    ...     done = sweep(tables, place, jobs=1)
    ...     print(done.to_table().num_rows, [round(group.median_deg) for group in done.groups])
    8 [6, 0]
    """  # noqa: E501
    from sandbox.engine.processes import Workers
    from sandbox.evaluation.sweep.plan import read_sweep, sweep_of
    from sandbox.evaluation.sweep.sweep import run_sweep

    if isinstance(plan, (str, Path)):
        found = read_sweep(plan)
    elif isinstance(plan, Mapping):
        found = sweep_of(plan)
    else:
        raise BadInput(
            f"plan = {plan!r:.60} is neither a TOML file nor its tables; give one of them"
        )
    done = run_sweep(
        found,
        Path(folder),
        Workers.asked(jobs, cluster),
        afresh=again,
        yes=yes,
        progress=progress,
    )
    cpu, kernel = (
        sum(b[name] for b in done.blocks.values()) for name in ("cpu_seconds", "kernel_seconds")
    )
    return SweepResult(found, Path(folder), cpu, kernel)


@records_call
def tolerances(
    motor: str | Path = "ipm_exchanged",
    scenario: str | Path | Scenario = "staircase",
    estimators: Iterable[AnyEstimator] | AnyEstimator = ("qnull", "inversion", "ekf"),
    *,
    percent: Iterable[float] = (5.0, 10.0, 20.0),
    draws: int = 64,
    effects: Mapping[str, float] | str | Path | None = None,
    seed: int = 0,
    jobs: int | None = None,
    cluster: Cluster | None = None,
    progress: Callable[[int, int], None] | None = None,
) -> ToleranceResult:
    """Run estimators whose belief is off, and return how much of the saturated belief's gain is
    left.

    Parameters
    ----------
    motor : str or Path
        A name or a TOML file; the plant and the design are the motor's own.
    scenario : str, Path or Scenario
        See `load_scenario`.
    estimators : iterable of str or Path
        Names or Python files.
    percent : iterable of float
        The belief's magnet flux, inductances and saturation coefficients are drawn, each evenly,
        within ± so much.
    draws : int
        How often these parameters are drawn at each tolerance.
    effects : mapping or str, optional
        As in `simulate`.
    seed : int
        Seed of the draws and of the sensors' noise.
    jobs : int, optional
        Processes; all cores by default.
    cluster : str or dask.distributed.Client, optional
        As in `sweep`.
    progress : callable, optional
        Is told how many of how many runs are done.

    Returns
    -------
    ToleranceResult
        `.rows`: position error (electrical degrees) and the share of the gain that is left.

    Raises
    ------
    BadInput
        For a name, value or file that cannot be used, and a motor with a flux map.

    Examples
    --------
    >>> from sandbox import Scenario, Segment, tolerances
    >>> short = Scenario("short", (Segment(0.2, load=1.0, settle=0.15),), start_up=False)
    >>> found = tolerances("ipm_exchanged", short, ["qnull"], percent=[10], draws=4, jobs=1)
    >>> {(r.belief, r.tolerance): round(r.median_deg) for r in found.rows if r.tolerance == 0.0}  # degrees
    {('linear', 0.0): 6, ('saturated', 0.0): 0}
    """  # noqa: E501
    from sandbox.engine.processes import Workers
    from sandbox.evaluation.sweep.plan import tables_of
    from sandbox.evaluation.sweep.tolerances import Question
    from sandbox.evaluation.sweep.tolerances import tolerances as run_all

    if type(draws) is not int or draws < 1:
        raise BadInput(f"draws = {draws!r:.40} is out of range; give a whole number of at least 1")
    names = [_name(e, "estimator") for e in several(estimators)]
    scene = tables_of(scenario) if isinstance(scenario, Scenario) else _name(scenario, "scenario")
    asked = Question(_name(motor, "motor"), scene, names, effects_of(effects) or {}, draws, seed)
    levels = [0.01 * p for p in percent]
    rows = run_all(asked, levels, workers=Workers.asked(jobs, cluster), progress=progress)
    title = scenario.name if isinstance(scenario, Scenario) else Path(scenario).stem
    return ToleranceResult(Path(motor).stem, title, rows)


def _name(given: object, kind: str) -> str:
    """Return a name or path as text; BadInput for an object, which other processes cannot be told
    of."""
    if not isinstance(given, (str, Path)):
        raise BadInput(
            f"{kind} = {given!r:.60} is no name or file; other processes are told names "
            "and files only"
        )
    return str(given)
