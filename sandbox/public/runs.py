"""Closed-loop runs: one of one estimator, and the comparison of a saturated with a linear
belief."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, ClassVar

from estimators.registry import AnyEstimator
from model.effect_files import effects_of
from model.names import fitting
from model.parameters import Drive
from model.ratings import cautions
from sandbox.drive.scenario import Scenario
from sandbox.output.columns import Column, columns_of
from sandbox.public.calls import records_call
from sandbox.public.loading import load_scenario, ready, several
from sandbox.public.result import Result

if TYPE_CHECKING:
    from sandbox.drive.design import Design
    from sandbox.drive.recording import Recording
    from sandbox.evaluation.compare import Comparison, Run
    from sandbox.evaluation.score import ErrorDeg, Row
    from sandbox.output.plots import AnyAxes, Figure
    from sandbox.public.sweeps import ToleranceResult

AnyMotor = str | Path | Drive
AnyScenario = str | Path | Scenario
Effects = Mapping[str, float] | str | Path | None
ROW_UNITS = {
    "load": "of rated current",
    "speed_rpm": "rpm",
    "true_speed_rpm": "rpm",
    "mean_deg": "deg",
    "rms_deg": "deg",
    "p95_deg": "deg",
    "max_deg": "deg",
    "transient_max_deg": "deg",
    "predicted_mean_deg": "deg",
    "t_start": "s",
    "t_end": "s",
    "copper_w": "W",
    "iron_w": "W",
    "loss_share": "of copper loss at rated current",
    "torque_nm": "N m",
    "torque_ripple": "of rated torque",
    "sound_db": "dB",
    "tone_db": "dB",
    "link_a": "A",
    "injected_v": "V",
}
ROW_NAMES = (
    "estimator",
    "belief",
    "closed_loop",
    "load",
    "speed_rpm",
    "true_speed_rpm",
    "mean_deg",
    "rms_deg",
    "p95_deg",
    "max_deg",
    "transient_max_deg",
    "predicted_mean_deg",
    "lost_lock",
    "reference_held",
    "t_start",
    "t_end",
    "copper_w",
    "iron_w",
    "loss_share",
    "torque_nm",
    "torque_ripple",
    "sound_db",
    "tone_db",
    "link_a",
    "injected_v",
)

COSTS = ROW_NAMES[-9:]  # of `InjectionCost`


def row_columns(rows: Iterable[Row]) -> dict[str, Column]:
    """Return evaluated segments as columns, the position error's statistics beside the rest."""
    flat = []
    for row in rows:
        error = {f"{key}_deg": value for key, value in asdict(row.error_deg).items()}
        both = asdict(row) | error | (asdict(row.cost) if row.cost else dict.fromkeys(COSTS))
        flat.append({name: both[name] for name in ROW_NAMES})
    return columns_of(flat, ROW_UNITS)


@dataclass(frozen=True, repr=False)
class SimulationResult(Result):
    """One run: its samples, the error of each evaluated segment, the loops it was controlled by."""

    command: ClassVar[str] = "simulate"
    kinds: ClassVar[tuple[str, ...]] = ("page", "figure", "table", "trace")
    coordinates: ClassVar[tuple[str, ...]] = ("t",)
    comparison: Comparison  # of this run alone
    design: Design
    effects: Mapping[str, float]

    @property
    def run(self) -> Run:
        """The run itself: estimator, belief, closed_loop, cpu_seconds."""
        return self.comparison.runs[0]

    @property
    def recording(self) -> Recording:
        """Every recorded sample; each channel is an attribute, shape (n,)."""
        return self.run.recording

    @property
    def rows(self) -> tuple[Row, ...]:
        """One row for each evaluated segment: load, speed, position error in electrical degrees."""
        return self.run.rows

    @property
    def lost_lock(self) -> bool:
        """Whether the estimate slipped or stayed away in any evaluated segment."""
        return any(row.lost_lock for row in self.rows)

    @property
    def error_deg(self) -> ErrorDeg:
        """Mean, rms, 95th percentile and maximum of the position error over all evaluated segments,
        degrees."""
        from sandbox.evaluation.score import error_of, settled_part

        return error_of(settled_part(self.recording, self.rows), self.lost_lock)

    def summary(self) -> str:
        """Return who ran where, and the error."""
        run, error = self.run, self.error_deg
        said = (
            "lost lock"
            if error.mean is None
            else f"mean error {error.mean:+.2f} deg, rms {error.rms:.2f} deg"
        )
        where = f"{self.comparison.drive.name}, {self.comparison.scenario.name}"
        return f"{run.estimator} {run.belief}, {where}, {self.recording.t.size} samples, {said}"

    def as_json(self) -> dict[str, Any]:
        """Return what `simulate.json` holds beyond its header and the names of files."""
        run, made = self.run, self.comparison.properties
        return {
            "motor": self.comparison.drive.name,
            "scenario": self.comparison.scenario.name,
            "estimator": run.estimator,
            "belief": run.belief,
            "closed_loop": run.closed_loop,
            "seed": made["seed"],
            "plant": made["plant"],
            "effects": dict(self.effects),
            "cautions": list(cautions(self.comparison.drive)),
            "simulated_seconds": float(self.recording.t[-1]),
            "cpu_seconds": run.cpu_seconds,
            "lost_lock": self.lost_lock,
            "error_deg": asdict(self.error_deg),
            "rows": [asdict(r) for r in self.rows],
            "loops": {name: asdict(loop) for name, loop in self.design.loops.items()},
        }

    def columns(self) -> dict[str, Column]:
        """Return every signal, one row a recorded sample, and the position error."""
        from sandbox.drive.recording import UNITS

        signals = {name: Column(self.recording[name], unit) for name, unit in UNITS.items()}
        return signals | {"error": Column(self.recording.error, "rad")}

    def plot(self, path: str | Path | None = None, *, ax: AnyAxes = None) -> Figure:
        """Return position error, currents, speed and load over time; a path (.png, .svg, .pdf) is
        written as well.

        ax: four axes of your own to draw in, one for each; see `Result.plot`.
        """
        from sandbox.public.figures import run_figure

        drive, scenario = self.comparison.drive.name, self.comparison.scenario.name
        return run_figure(
            self.run,
            f"{drive}, {scenario}: {self.run.estimator}, {self.run.belief} belief",
            path,
            ax=ax,
        )

    def report(self) -> None:
        """Print the error of each evaluated segment, and the loops."""
        from sandbox.public.printed import print_run, print_simulated

        print_run(self.comparison, self.design)
        print_simulated([self.run])

    def to_rerun(self, path: str | Path) -> Path:
        """Write the run as a trace (`.rrd`); return its path."""
        return _trace(self.comparison, path)

    def to_html(self, path: str | Path) -> Path:
        """Write the run as one page with its figures inside (`.html`): errors, currents, fluxes,
        spectra; return it."""
        from sandbox.evaluation.pages.compare_page import write_run

        write_run(Path(path), self.comparison)
        return Path(path)


@dataclass(frozen=True, repr=False)
class ComparisonResult(Result):
    """The same runs by every estimator with both beliefs, the estimate in control and the
    encoder."""

    command: ClassVar[str] = "compare"
    kinds: ClassVar[tuple[str, ...]] = ("page", "figure", "table", "trace")
    comparison: Comparison
    tolerances: ToleranceResult | None = None  # stands on the page, where it was run

    @property
    def runs(self) -> tuple[Run, ...]:
        """Every run: estimator, belief, closed_loop, recording, rows, cpu_seconds."""
        return self.comparison.runs

    @property
    def rows(self) -> tuple[Row, ...]:
        """Every evaluated segment of every run: load, speed, position error in electrical
        degrees."""
        return self.comparison.rows

    def summary(self) -> str:
        """Return what was compared, and the worst means of both beliefs."""
        names = ", ".join(dict.fromkeys(run.estimator for run in self.runs))
        said = ", ".join(
            f"{belief} {_worst(self.rows, belief)}" for belief in ("linear", "saturated")
        )
        return (
            f"{self.comparison.drive.name}, {self.comparison.scenario.name}, {names}; worst "
            f"mean error: {said}"
        )

    def as_json(self) -> dict[str, Any]:
        """Return what `compare.json` holds beyond its header and the names of files."""
        return self.comparison.as_json()

    def columns(self) -> dict[str, Column]:
        """Return one row for each evaluated segment of each run."""
        return row_columns(self.rows)

    def plot(self, path: str | Path | None = None, *, ax: AnyAxes = None) -> Figure:
        """Return position error against load, a column an estimator; a path (.png, .svg, .pdf) is
        written as well.

        ax: axes of your own to draw in, a row with the estimate in control and one with the
        encoder; see `Result.plot`.
        """
        from sandbox.evaluation.pages.compare_figure import comparison_figure

        return comparison_figure(self.comparison, path, ax=ax)

    def plot_cost(self, path: str | Path | None = None, *, ax: AnyAxes = None) -> Figure:
        """Return position error beside loss and sound that the injection adds; a path is written as
        well.

        ax: three axes of your own to draw in; see `Result.plot`.
        """
        from sandbox.evaluation.choice import standings
        from sandbox.evaluation.pages.cost_figure import cost_figure

        c = self.comparison
        title = f"{c.drive.name}, {c.scenario.name}: what the injection costs"
        return cost_figure(standings(self.rows), title, path, limits=c.limits, ax=ax)

    def report(self) -> None:
        """Print the position errors of both beliefs beside theory."""
        from sandbox.public.printed import print_comparison, print_simulated

        print_comparison(self.comparison)
        print_simulated(self.runs)

    def to_rerun(self, path: str | Path) -> Path:
        """Write all runs as one trace (`.rrd`); return its path."""
        return _trace(self.comparison, path)

    def to_html(self, path: str | Path) -> Path:
        """Write one page with its figures inside (`.html`), which estimator to take answered first;
        return its path."""
        from sandbox.evaluation.pages.compare_page import write_comparison

        known = None if self.tolerances is None else self.tolerances.for_page()
        write_comparison(Path(path), self.comparison, known)
        return Path(path)


def _trace(comparison: Comparison, path: str | Path) -> Path:
    """Write the runs of a comparison as a trace; return its path."""
    from sandbox.evaluation.pages.compare_sheets import sheets
    from sandbox.evaluation.pages.compare_trace import write_trace

    write_trace(Path(path), comparison, sheets(comparison))
    return Path(path)


def _worst(rows: Iterable[Row], belief: str) -> str:
    """Return the largest mean error with a belief in words, and whether lock was lost."""
    means = [row.error_deg.mean for row in rows if row.belief == belief]
    kept = [abs(mean) for mean in means if mean is not None]
    lost = len(means) - len(kept)
    if not kept:
        return "lost"
    return f"{max(kept):.2f} deg" + (f" (lost in {lost} of {len(means)})" if lost else "")


@records_call
def simulate(
    motor: AnyMotor = "ipm_exchanged",
    scenario: AnyScenario = "staircase",
    estimator: AnyEstimator = "qnull",
    *,
    belief: str = "saturated",
    closed_loop: bool = True,
    duration: float | None = None,
    effects: Effects = None,
    plant: str = "exact",
    seed: int = 0,
    record: str | Path | None = None,
) -> SimulationResult:
    """Run one estimator through a scenario on a motor.

    Parameters
    ----------
    motor : str, Path or Drive
        See `load_motor`.
    scenario : str, Path or Scenario
        See `load_scenario`.
    estimator : str, Path or Estimator
        See `load_estimator`.
    belief : {'saturated', 'linear'}
        Which model of the motor the estimator believes.
    closed_loop : bool
        Whether the estimate controls; otherwise the encoder does, and the estimator only watches.
    duration : float, optional
        s of the scenario to run; all of it by default.  Beyond ten million samples every second,
        third ... one is kept (an hour takes 3.8 GB), unless they are recorded as a campaign.
    effects : mapping, str or Path, optional
        What the plant has and the model lacks, such as ``{"dead_time.time": 2e-6}`` (SI units, see
        `list_effects`), or a file of effects as `diagnose` writes it (``effects.toml``).
    plant : {'exact', 'switched'}
        The plant, or the second simulator that checks it; both run every estimator.
    seed : int
        Seed of the sensors' noise.
    record : str or Path, optional
        A new folder; the run is written there as a campaign, as a bench would have recorded it.

    Returns
    -------
    SimulationResult
        `.error_deg` and `.rows` (electrical degrees), `.recording` (s, A, V, rad, rad/s),
        `.design.loops`.

    Raises
    ------
    BadInput
        For a name, value or file that cannot be used.
    PhysicsError
        Where the motor or the drive cannot do what the scenario asks.

    Examples
    --------
    >>> from sandbox import Scenario, Segment, simulate
    >>> loaded = Scenario("loaded", (Segment(0.2), Segment(0.3, load=1.0, ramp=0.05, settle=0.2)))
    >>> run = simulate("ipm_exchanged", loaded, "qnull", belief="linear")
    >>> round(run.rows[1].error_deg.mean)  # electrical degrees: the motor's cross-saturation angle at rated load
    -6
    """  # noqa: E501
    scene, added = load_scenario(scenario), effects_of(effects)
    scene = scene if duration is None else scene.cut(duration)
    if record is not None:
        check_new_folder(Path(record))
    drive, (own,) = ready(motor, [estimator], added, scene)
    from sandbox.evaluation.compare import single, stride_of  # compiles

    if record is not None:
        from sandbox.drive.record import bench_of

        drive = bench_of(drive, own, scene)
    stride = stride_of(drive, scene) if record is None else 1
    result, gains = single(
        drive,
        scene,
        own,
        belief,
        closed_loop=closed_loop,
        seed=seed,
        effects=added,
        plant=plant,
        stride=stride,
    )
    if record is not None:
        from estimators.contract import NONE, PWM, RANDOM
        from sandbox.drive.record import campaign_of
        from sandbox.recordings.writing import map_read, write_campaign

        name = fitting(Path(record).name, "campaign")
        pulsates = own.injection not in (NONE, PWM, RANDOM)
        campaign = campaign_of(drive, scene, result.runs[0].recording, name, pulsates)
        write_campaign(record, campaign, map_read(drive.motor))
    return SimulationResult(result, gains, added)


def check_new_folder(folder: Path, out: Path | None = None) -> None:
    """Raise BadInput, before the run, where a campaign could not be written afterwards."""
    import os

    from model.errors import BadInput

    if (
        not folder.name
        or folder.exists()
        or (out is not None and folder.resolve() == out.resolve())
    ):
        raise BadInput(
            f"--record '{folder}' is no new folder of its own; give one that does not "
            "exist, apart from --out"
        )
    parent = next(p for p in folder.resolve().parents if p.exists())
    if not parent.is_dir() or not os.access(parent, os.W_OK):
        raise BadInput(f"--record '{folder}' cannot be made below '{parent}'; give another place")


@records_call
def compare(
    motor: AnyMotor = "ipm_exchanged",
    scenario: AnyScenario = "staircase",
    estimators: Iterable[AnyEstimator] | AnyEstimator = ("qnull", "inversion", "ekf"),
    *,
    effects: Effects = None,
    quiet_below: float | None = None,
    loss_below: float | None = None,
    seed: int = 0,
    jobs: int | None = None,
    progress: Callable[[float], None] | None = None,
) -> ComparisonResult:
    """Run every estimator with a saturated and a linear belief, controlled by its estimate and by
    the encoder.

    Parameters
    ----------
    motor : str, Path or Drive
        See `load_motor`.
    scenario : str, Path or Scenario
        See `load_scenario`.
    estimators : iterable of str, Path or Estimator
        See `load_estimator`.
    effects : mapping, str or Path, optional
        As in `simulate`; theory does not know effects, so with any of them there is none to compare
        with.
    quiet_below : float, optional
        dB: what is recommended must stay below it in the proxy for the injection's sound, see
        `rows[...].cost`.
    loss_below : float, optional
        W: likewise, of the copper and core loss that the injection adds.
    seed : int
        Seed of the sensors' noise, the same in every run.
    jobs : int, optional
        Threads; all cores by default. Results do not depend on it.
    progress : callable, optional
        Is told the fraction that is done.

    Returns
    -------
    ComparisonResult
        `.rows`: estimator, belief, load, speed (rpm), position error (electrical degrees), the
        theory's mean, and `.cost`: loss (W), torque ripple, sound and more that the injection adds.

    Raises
    ------
    BadInput, PhysicsError
        As `simulate`.

    Examples
    --------
    >>> from sandbox import Scenario, Segment, compare
    >>> loaded = Scenario("loaded", (Segment(0.3, load=1.0, ramp=0.05, settle=0.2),))
    >>> both = compare("ipm_exchanged", loaded, ["qnull"])
    >>> {row.belief: round(abs(row.error_deg.mean)) for row in both.rows if row.closed_loop}  # degrees
    {'linear': 6, 'saturated': 0}
    """  # noqa: E501
    scene, added = load_scenario(scenario), effects_of(effects)
    drive, own = ready(motor, several(estimators), added)
    from sandbox.evaluation.choice import limits_of
    from sandbox.evaluation.compare import compare as run_all  # compiles

    limits = limits_of(quiet_below, loss_below)
    found = run_all(
        drive, scene, own, seed=seed, jobs=jobs, progress=progress, effects=added or None
    )
    return ComparisonResult(replace(found, limits=limits))
