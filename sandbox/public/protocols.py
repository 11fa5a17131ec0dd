"""The standard evaluation of estimators, and what the simulator costs."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass, fields, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, ClassVar

from estimators.registry import AnyEstimator, check_known
from model.drive_files import motor_file
from model.errors import unknown
from model.parameters import Drive
from sandbox.output.columns import Column, columns_of
from sandbox.output.tables import many
from sandbox.public.calls import records_call
from sandbox.public.loading import several
from sandbox.public.result import Result

if TYPE_CHECKING:
    from sandbox.engine.processes import Cluster
    from sandbox.evaluation.protocol import Protocol
    from sandbox.output.plots import AnyAxes, Figure

POINT_UNITS = {
    "load": "of rated current",
    "load_d": "of rated current",
    "speed": "of rated speed",
    "mean_deg": "deg",
    "rms_deg": "deg",
    "p95_deg": "deg",
    "max_deg": "deg",
    "predicted_deg": "deg",
}


@dataclass(frozen=True, repr=False)
class ProtocolResult(Result):
    """Every test of every estimator and belief on every motor, with its verdict."""

    command: ClassVar[str] = "protocol"
    kinds: ClassVar[tuple[str, ...]] = ("page", "figure", "table")
    protocol: Protocol

    def summary(self) -> str:
        """Return which tests were run how often (by estimator, belief and motor), and how many met
        their goals."""
        rows = self.protocol.rows
        tests = list(dict.fromkeys(row.unit.test for row in rows))
        judged = [row.outcome.passed for row in rows if row.outcome.passed is not None]
        slow = sum(
            bool(row.outcome.metrics.get("speed_missed")) for row in rows if row.outcome.passed
        )
        named = f"{tests[0]} alone" if len(tests) == 1 else f"{len(tests)} tests"
        said = f", {slow} of these without reaching the speed asked for in time" if slow else ""
        return (
            f"{named}, {many(len(rows), 'result')}, {sum(judged)} of {len(judged)} judged "
            f"met their goals{said}"
        )

    def as_json(self) -> dict[str, Any]:
        """Return what `protocol.json` holds beyond its header and the names of files."""
        return self.protocol.as_json()

    def columns(self) -> dict[str, Column]:
        """Return the tidy table: a row for each evaluated segment, or for a test that has none."""
        from sandbox.evaluation.protocol import tidy
        from sandbox.evaluation.protocol_tests import EvaluatedSegment

        rows = tidy(self.protocol)
        names = [
            "motor",
            "test",
            "estimator",
            "belief",
            "passed",
            *(f.name for f in fields(EvaluatedSegment)),
        ]
        return columns_of([{name: row[name] for name in names} for row in rows], POINT_UNITS)

    def plot(self, path: str | Path | None = None, *, ax: AnyAxes = None) -> Figure:
        """Return the page of verdicts, a panel a motor; a path (.png, .svg, .pdf) is written as
        well.

        ax: axes of your own to draw in, one for each motor; see `Result.plot`.
        """
        from sandbox.evaluation.pages.protocol_cells import reading, tables
        from sandbox.evaluation.pages.protocol_figure import protocol_figure

        return protocol_figure(tables(self.protocol), reading(self.protocol), path, ax=ax)

    def to_html(self, path: str | Path) -> Path:
        """Write one page with its figures inside (`.html`), which estimator to take answered first;
        return its path."""
        from sandbox.evaluation.pages.protocol_page import write_protocol

        write_protocol(Path(path), self.protocol)
        return Path(path)

    def report(self) -> None:
        """Print which estimator to take, and the verdict of each test."""
        from sandbox.evaluation.pages.protocol_cells import show

        show(self.protocol)

    def save(self, folder: str | Path, **asked: bool) -> Path:
        """Write protocol.json, .html, .png, .parquet into a folder, and forget what was kept there
        for resuming."""
        from sandbox.evaluation.protocol import forget

        place = super().save(folder, **asked)
        forget(place)
        return place


@dataclass(frozen=True, repr=False)
class BenchResult(Result):
    """What the simulator costs, measured on this machine, and ratios that hardly depend on it."""

    command: ClassVar[str] = "bench"
    kinds: ClassVar[tuple[str, ...]] = ()
    measured: dict[str, float]
    ratios: dict[str, float]

    def summary(self) -> str:
        """Return the two figures that matter most."""
        from sandbox.evaluation.bench import LOOP, PLANT

        plant, loop = 1e3 * self.measured[PLANT], 1e3 * self.measured[LOOP]
        return (
            f"a second costs {plant:.2g} ms of CPU for the plant, {loop:.2g} ms for the closed loop"
        )

    def as_json(self) -> dict[str, Any]:
        """Return what `bench.json` holds beyond its header."""
        return {"measured": self.measured, "ratios": self.ratios}

    def columns(self) -> dict[str, Column]:
        """Return one row a figure."""
        both = {**self.measured, **self.ratios}
        kinds = ["measured"] * len(self.measured) + ["ratio"] * len(self.ratios)
        return {
            "figure": Column(list(both)),
            "kind": Column(kinds),
            "value": Column(list(both.values())),
        }

    def plot(self, path: str | Path | None = None, *, ax: AnyAxes = None) -> Figure:
        """Return the ratios as bars; a path (.png, .svg, .pdf) is written as well.

        ax: axes of your own to draw in; see `Result.plot`.
        """
        from sandbox.output.plots import drawn, page

        figure, panels = page((7.0, 0.8 + 0.3 * len(self.ratios)), 1, 1, ax)
        panels[0, 0].barh(list(self.ratios), list(self.ratios.values()), color="#2e86de")
        panels[0, 0].set(xscale="log", xlabel="ratio (CPU or error)")
        return drawn(figure, path)

    def report(self) -> None:
        """Print every figure."""
        from sandbox.evaluation.bench import in_words
        from sandbox.output.tables import print_table

        rows = [
            list(in_words(*figure))
            for part in (self.measured, self.ratios)
            for figure in part.items()
        ]
        print_table("what it costs on this machine", ["what", "value"], rows)


@records_call
def protocol(
    estimators: Iterable[AnyEstimator] | AnyEstimator | None = None,
    motors: Iterable[str | Path | Drive] | str | Path | Drive | None = None,
    tests: Iterable[str] | str | None = None,
    *,
    quiet_below: float | None = None,
    loss_below: float | None = None,
    seed: int = 0,
    jobs: int | None = None,
    keep: str | Path | None = None,
    cluster: Cluster | None = None,
    progress: Callable[[float], None] | None = None,
) -> ProtocolResult:
    """Run the standard evaluation: every test of every estimator with both beliefs on every motor.

    Parameters
    ----------
    estimators : iterable of str, Path or Estimator, optional
        See `load_estimator`; every compiled one by default.
    motors : iterable of str, Path or Drive, optional
        See `load_motor`; three by default, and a measured one where its flux map is at hand.
    tests : iterable of str, optional
        Names of tests, see `list_tests`; all by default.
    quiet_below : float, optional
        dB: what is recommended must stay below it in the proxy for the injection's sound (test
        `cost`).
    loss_below : float, optional
        W: likewise, of the copper loss that the injection adds.
    seed : int
        Seed of the sensors' noise.
    jobs : int, optional
        Threads; all cores by default.
    keep : str or Path, optional
        A folder in which finished tests wait for the rest, so that an interrupted call goes on.
    cluster : str or dask.distributed.Client, optional
        A dask scheduler's address, or a client: its workers run the tests, estimators are names or
        files.
    progress : callable, optional
        Is told the fraction that is done.

    Returns
    -------
    ProtocolResult
        `.protocol.rows`: each with its unit, metrics (electrical degrees), and whether its goal was
        met.

    Raises
    ------
    BadInput
        For a name or file that cannot be used, before anything runs.

    Examples
    --------
    >>> from sandbox import protocol
    >>> done = protocol(["qnull"], ["ipm_exchanged"], ["load_step"])
    >>> [row.outcome.passed for row in done.protocol.rows]  # saturated belief, linear belief
    [True, True]
    """
    from sandbox.evaluation.protocol_names import ESTIMATORS, LINES, usual_motors

    names = (
        list(ESTIMATORS) if estimators is None else several(estimators),
        list(usual_motors()) if motors is None else several(motors),
        list(LINES) if tests is None else several(tests),
    )
    check_names(*names)
    from sandbox.evaluation.choice import limits_of

    limits = limits_of(quiet_below, loss_below)
    from sandbox.engine.processes import Workers
    from sandbox.evaluation.protocol import protocol as run_all  # compiles

    found = run_all(
        *names,
        seed=seed,
        workers=Workers.asked(jobs, cluster),
        keep=None if keep is None else Path(keep),
        progress=progress,
    )
    return ProtocolResult(replace(found, limits=limits))


def check_names(
    estimators: Iterable[AnyEstimator], motors: Iterable[str | Path | Drive], tests: Iterable[str]
) -> None:
    """Raise BadInput for an unknown name, or an estimator's file that does not exist."""
    from sandbox.evaluation.protocol_names import LINES

    for test in tests:
        if test not in LINES:
            raise unknown("test", test, LINES)
    for which in estimators:
        check_known(which)
    for motor in motors:
        if not isinstance(motor, Drive):
            motor_file(motor)


@records_call
def bench(anchors: str | Path | None = None, python: str | None = None) -> BenchResult:
    """Measure what a plant step, a closed-loop second and the effects cost on this machine; about a
    minute.

    Parameters
    ----------
    anchors : str or Path, optional
        Folder of the reference programs (C reference, motulator's script), to be measured in the
        same run.
    python : str, optional
        A Python >= 3.12 that has motulator 0.18; by default this one, or one in an environment that
        is made for it.

    Returns
    -------
    BenchResult
        `.measured` (ns, CPU s per simulated s, degrees) and `.ratios`.

    Raises
    ------
    BadInput
        Where a reference program is not at hand.

    Examples
    --------
    >>> from sandbox import bench
    >>> bench().ratios["all_effects_to_none_cpu"]  # doctest: +SKIP
    3.2
    """
    from sandbox.evaluation.bench import bench as measure
    from sandbox.evaluation.peer_python import check_peer

    folder = None if anchors is None else Path(anchors)
    found = measure(folder, "" if folder is None else check_peer(folder, python))
    return BenchResult(found["measured"], found["ratios"])
