"""The main job: the same runs with an estimator that believes the saturated model and one that
believes the linear."""

from __future__ import annotations

import math
import os
from collections.abc import Callable, Iterable, Mapping
from concurrent.futures import ThreadPoolExecutor
from dataclasses import asdict, dataclass, fields, replace
from itertools import product
from typing import Any

from estimators.contract import Estimator
from estimators.registry import AnyEstimator, load_estimator
from model.effects.library import parameters, true_motor
from model.errors import BadInput
from model.parameters import Drive
from model.ratings import cautions
from sandbox.drive.design import Design
from sandbox.drive.recording import Recording
from sandbox.drive.scenario import Scenario
from sandbox.drive.simulate import EXACT, MOST_SAMPLES, How, Simulation, plant_named, simulate
from sandbox.evaluation.choice import ANY, Limits, best, standings
from sandbox.evaluation.injection_cost import injection_cost
from sandbox.evaluation.lost import why_lost_in, why_missed
from sandbox.evaluation.score import Row, rows_of
from sandbox.output.files import version
from sandbox.plant.sets import BENCH

BELIEFS = ("linear", "saturated")
ESTIMATORS = ("qnull", "inversion", "ekf")
STARTING = 5.0  # s: starting up takes less


@dataclass(frozen=True)
class Run:
    """One estimator with one belief, closed (its estimate controls) or open (the encoder does)."""

    estimator: str
    belief: str
    closed_loop: bool
    recording: Recording
    rows: tuple[Row, ...]
    cpu_seconds: float

    @property
    def name(self) -> str:
        """estimator/closed or open/belief."""
        return f"{self.estimator}/{'closed' if self.closed_loop else 'open'}/{self.belief}"


@dataclass(frozen=True, repr=False)
class Comparison:
    """All runs of one scenario on one drive."""

    drive: Drive
    scenario: Scenario
    runs: tuple[Run, ...]
    properties: dict[str, str | float]
    limits: Limits = ANY

    def __repr__(self) -> str:
        return f"<Comparison: {self.drive.name}, {self.scenario.name}, {len(self.runs)} runs>"

    @property
    def rows(self) -> tuple[Row, ...]:
        """The rows of every run."""
        return tuple(row for run in self.runs for row in run.rows)

    @property
    def effects(self) -> dict[str, str | float]:
        """What the plant has beside the model."""
        return {k: v for k, v in self.properties.items() if k in parameters() or k in BENCH}

    def as_json(self) -> dict[str, object]:
        """Return what `compare.json` holds beyond its header."""
        return {
            "motor": self.drive.name,
            "scenario": self.scenario.name,
            "seed": self.properties["seed"],
            "effects": self.effects,
            "cautions": list(cautions(self.drive)),
            "rows": [asdict(row) for row in self.rows],
            "limits": self.limits._asdict(),
            "chosen": [
                {"estimator": s.estimator, "belief": s.belief}
                for s in best(standings(self.rows), self.limits)
            ],
            "cpu_seconds": sum(run.cpu_seconds for run in self.runs),
        }


def compare(
    drive: Drive,
    scenario: Scenario,
    estimators: Iterable[AnyEstimator] = ESTIMATORS,
    *,
    seed: int = 0,
    jobs: int | None = None,
    progress: Callable[[float], None] | None = None,
    effects: Mapping[str, float] | None = None,
) -> Comparison:
    """Run every estimator (name, file or object) with both beliefs, closed and open, on up to
    `jobs` threads.

    The seed fixes the sensors' noise, the same in every run; very long runs are recorded thinned;
    `progress` is told the fraction done; effects: as `simulate`, with any there is no theory.
    Raises BadInput or PhysicsError.
    """
    loaded = distinct(estimators)
    if not loaded:
        raise BadInput("no estimator to compare; name at least one")
    cases = list(product(loaded, BELIEFS, (True, False)))
    done = 0

    stride = stride_of(drive, scenario, len(cases))

    def one(case: tuple[str, str, bool]) -> Run:
        """Run an estimator (name, belief, closed loop) through the scenario."""
        nonlocal done
        name, belief, closed = case
        how = {"seed": seed, "stride": stride}
        run, _ = _run(
            drive, scenario, loaded[name], belief, closed_loop=closed, effects=effects, **how
        )
        done += 1
        if progress:
            progress(done / len(cases))
        return run

    if progress:
        progress(0.0)
    first = one(cases[0])  # alone: compiles and designs what the others share
    with ThreadPoolExecutor(jobs or os.cpu_count() or 1) as pool:
        runs = (first, *pool.map(one, cases[1:]))
    return Comparison(
        drive, scenario, runs, properties_of(drive, scenario, seed) | dict(effects or {})
    )


def _run(
    drive: Drive,
    scenario: Scenario,
    estimator: Estimator,
    belief: str,
    *,
    closed_loop: bool,
    effects: Mapping[str, float] | None,
    **how: Any,
) -> tuple[Run, Design]:
    """Return a run, judged, and the gains it used; how: what else `simulate` takes."""
    done = simulate(
        drive, scenario, estimator, belief, closed_loop=closed_loop, effects=effects, **how
    )
    rows = judged(drive, scenario, done, estimator, belief, closed_loop, effects)
    found = Run(estimator.name, belief, closed_loop, done.recording, rows, done.cpu_seconds)
    return found, done.design


def judged(
    drive: Drive,
    scenario: Scenario,
    run: Simulation,
    estimator: Estimator,
    belief: str,
    closed: bool,
    effects: Mapping[str, float] | None,
) -> tuple[Row, ...]:
    """Return a row for each scored segment: the error, its theory where the plant has no effects,
    the cost."""
    rows = rows_of(drive, scenario, run.recording, run.start_time, estimator.name, belief, closed)
    true = true_motor(drive.motor, run.values, keep_map=True)
    found = []
    asked = [s.current_d for s in scenario.segments if s.score]
    for row, load_d in zip(rows, asked, strict=True):
        cost = None
        why = why_lost_in(run, row, drive, true, estimator, (scenario.name, load_d))
        if not row.lost_lock:
            part = run.recording.between(row.t_start, row.t_end)
            cost = injection_cost(drive, part, true, run.values, estimator.inside)
        predicted = None if effects else row.predicted_mean_deg
        missed = None if row.reference_held else why_missed(row, drive, true, estimator)
        whole = replace(row, cost=cost, predicted_mean_deg=predicted)
        found.append(replace(whole, why_lost=why, why_missed=missed))
    return tuple(found)


def stride_of(drive: Drive, scenario: Scenario, runs: int = 1) -> int:
    """Return how many samples apart very long runs are recorded, so that all together stay within
    MOST_SAMPLES."""
    return math.ceil(
        (scenario.duration + STARTING) / drive.converter.sampling_period * runs / MOST_SAMPLES
    )


def distinct(estimators: Iterable[AnyEstimator]) -> dict[str, Estimator]:
    """Return estimators by name, each once; BadInput where two of them bear one name."""
    found: dict[str, Estimator] = {}
    for which in estimators:
        own = load_estimator(which)
        if found.setdefault(own.name, own) is not own:
            raise BadInput(f"two estimators are called '{own.name}'; give one of them another name")
    return found


def properties_of(drive: Drive, scenario: Scenario, seed: int) -> dict[str, str | float]:
    """Return how runs were made: version, seed, motor and injection."""
    converter, injection = drive.converter, drive.injection
    made: dict[str, str | float] = {
        "version": version(),
        "seed": seed,
        "scenario": scenario.name,
        "sampling_period_s": converter.sampling_period,
        "dc_bus_voltage_V": converter.dc_bus_voltage,
        "injection": f"{injection.waveform}, {injection.frequency:g} Hz, {injection.amplitude:g} V"
        + (
            ""
            if injection.tracking == "designed"
            else f", tracking loop as {injection.tracking} publishes it"
        ),
        "source": drive.provenance.get("source", "user's file"),
    }
    motor = {f.name: getattr(drive.motor, f.name) for f in fields(drive.motor)}
    return made | {
        f"motor.{k}": v
        for k, v in motor.items()
        if k != "description" and isinstance(v, (str, float, int))
    }


def single(
    drive: Drive,
    scenario: Scenario,
    estimator: AnyEstimator,
    belief: str = "saturated",
    *,
    effects: Mapping[str, float] | None = None,
    plant: str = EXACT,
    **how: Any,
) -> tuple[Comparison, Design]:
    """Return one run as a comparison of one, and the gains it used; arguments as `simulate`."""
    plant, loaded = plant_named(plant), load_estimator(estimator)
    asked = How(**how)
    run, gains = _run(
        drive, scenario, loaded, belief, effects=effects, plant=plant, **asked._asdict()
    )
    made = properties_of(drive, scenario, asked.seed) | {"plant": plant} | dict(effects or {})
    return Comparison(drive, scenario, (run,), made), gains
