"""One run of a sweep: from the numbers of its case to its row; what runs have in common is made
ready once a process.

A case that cannot be run is a row, too: its status and its sentence say why.
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Mapping
from functools import lru_cache
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from estimators.contract import Belief
from estimators.registry import load_estimator
from model.drive_files import load_drive
from model.effects.library import parameters, replaced, scaled, true_motor
from model.errors import BadInput, OwnCodeError, PhysicsError, sentence
from model.parameters import Drive
from model.spline import SplineEnergy
from sandbox.drive.design import Design, belief_of
from sandbox.drive.feasible import check_call
from sandbox.drive.recording import CHANNELS, Recording
from sandbox.drive.scenario import Scenario, load_scenario
from sandbox.drive.simulate import EXACT, LONGEST, Setup, Simulation, run_once, set_up
from sandbox.evaluation.injection_cost import injection_cost
from sandbox.evaluation.score import ErrorDeg, is_lost, speed_held, statistics
from sandbox.evaluation.sweep.keys import MAGNETICS, Value, keys
from sandbox.evaluation.sweep.plan import OWN, Sweep, again, scene_of
from sandbox.plant.sets import complete

OK, REFUSED, FAILED, ERROR, CRASHED = "ok", "refused", "failed", "error", "crashed"
EACH_TIME = (
    "true_factor",
    "believed_factor",
    "effects",
    "seed",
    "closed_loop",
    "injection_cost",
)  # need no other design
EFFECTS = {field: name for name, field in (*replaced().items(), *scaled().items())}
Case = Mapping[str, Value]


class Windows(NamedTuple):
    """Samples of a scored stretch: where it begins, where it counts as settled, where it ends."""

    start: int
    settled: int
    end: int


class Ready(NamedTuple):
    """A setup, and where its scored stretches lie."""

    setup: Setup
    belief: str
    windows: tuple[Windows, ...]


class Row(NamedTuple):
    """What is kept of a run beside its case; degrees electrical, None where lock was lost or
    nothing was run."""

    status: str = OK
    sentence: str | None = None
    mean_deg: float | None = None
    rms_deg: float | None = None
    p95_deg: float | None = None
    max_deg: float | None = None
    worst_mean_deg: float | None = None
    rms_mean_deg: float | None = None
    lost_lock: bool | None = None
    speed_held: bool | None = None
    loss_w: float | None = None
    torque_ripple: float | None = None
    sound_db: float | None = None
    tone_db: float | None = None


class Run(NamedTuple):
    """A finished run: its row, its traces (channels, kept samples; None where none are asked for),
    kernel seconds."""

    row: Row
    traces: NDArray[np.float64] | None = None
    kernel_seconds: float = 0.0


def run_case(sweep: Sweep, case: Case) -> Run:
    """Run one case; whatever goes wrong is its row."""
    try:
        return _run(sweep, case)
    except OwnCodeError as error:
        return Run(Row(ERROR, str(error)))
    except BadInput as error:
        return Run(Row(REFUSED, str(error)))
    except PhysicsError as error:
        return Run(Row(FAILED, str(error)))
    except Exception as error:  # an estimator or an effect of the user's own may raise anything
        return Run(Row(ERROR, sentence(f"{type(error).__name__}: {error}")))


def _run(sweep: Sweep, case: Case) -> Run:
    ready = made_ready(
        sweep.text, tuple((k, v) for k, v in case.items() if k.partition(".")[0] not in EACH_TIME)
    )
    setup = _with_belief(ready, case)
    effects = effects_of(setup.drive, case)
    done = run_once(setup, effects, closed_loop=bool(case["closed_loop"]), seed=int(case["seed"]))
    row = row_of(ready, done)
    if case.get("injection_cost") and not row.lost_lock:
        row = _with_costs(row, ready, done.recording, effects)
    return Run(row, _traces(sweep, done.recording), done.cpu_seconds)


@lru_cache(maxsize=64)
def made_ready(text: str, base: tuple[tuple[str, Value], ...]) -> Ready:
    """Return what the runs of a sweep with these values of a case have in common."""
    case = dict(base)
    drive = drive_of(case)
    scenario = scenario_of(case, text)
    plant, belief, estimator = (
        case.get("plant", EXACT),
        str(case["belief"]),
        load_estimator(str(case["estimator"])),
    )
    check_call(estimator, belief, 0, 1, LONGEST)
    setup = set_up(drive, scenario, estimator, belief, str(plant))
    setup = dataclasses.replace(setup, design=_with_bandwidths(setup.design, case))
    return Ready(setup, belief, windows_of(setup))


def drive_of(case: Case) -> Drive:
    """Return a case's drive: the motor's file, with the values that the case sets."""
    drive = _loaded(str(case["motor"]))
    motor, converter, injection = (
        family(case, f"{name}_value") for name in ("motor", "drive", "injection")
    )
    if "sampling_period" in converter and drive.converter.pwm_frequency is not None:
        converter["pwm_frequency"] = 1.0 / converter["sampling_period"]
    if isinstance(drive.motor.energy, SplineEnergy):
        _refuse_of_map("motor_value", motor)
    return dataclasses.replace(
        drive,
        motor=dataclasses.replace(drive.motor, **motor),
        converter=dataclasses.replace(drive.converter, **converter),
        injection=dataclasses.replace(drive.injection, **injection),
    )


@lru_cache(maxsize=16)
def _loaded(motor: str) -> Drive:
    return load_drive(motor)


def scenario_of(case: Case, text: str) -> Scenario:
    """Return a case's scenario, cut and scaled as the case says."""
    scenario: Scenario = (
        scene_of(again(text)) if case["scenario"] == OWN else load_scenario(str(case["scenario"]))
    )
    if "duration" in case:
        scenario = scenario.cut(float(case["duration"]))
    factors = family(case, "scenario_factor")
    if not factors:
        return scenario
    scaled = [
        dataclasses.replace(
            s, **{name: factor * getattr(s, name) for name, factor in factors.items()}
        )
        for s in scenario.segments
    ]
    return dataclasses.replace(scenario, segments=tuple(scaled))


def family(case: Case, name: str) -> dict[str, Any]:
    """Return the values of one family of keys by their own names."""
    head = f"{name}."
    return {key[len(head) :]: value for key, value in case.items() if key.startswith(head)}


def effects_of(drive: Drive, case: Case) -> dict[str, float]:
    """Return what a case's plant has and the model lacks, by the effects' names; BadInput for a
    value given twice."""
    found: dict[str, float] = {
        name: float(value) for name, value in family(case, "effects").items()
    }
    for field, factor in family(case, "true_factor").items():
        name = EFFECTS[field]
        if name in found:
            raise BadInput(
                f"true_factor.{field} and effects.{name} set the same value; give one of them"
            )
        own = 1.0 if name.startswith("inductance.") else float(getattr(drive.motor, field))
        found[name] = factor * own
        _check_factor(field, factor, name, own)
    return found


def _check_factor(field: str, factor: float, name: str, own: float) -> None:
    """Raise BadInput, in the words of the sweep's file, for a factor that takes an effect's value
    out of its bounds."""
    p, key = parameters()[name], keys()[f"motor_value.{field}"]
    low, high = (
        (p.low, p.high)
        if name.startswith("inductance.")
        else (max(p.low, key.low), min(p.high, key.high))
    )
    if not low <= factor * own <= high:
        least, most = sorted((low / own, high / own))
        raise BadInput(
            f"true_factor.{field} = {factor:g} is out of range; give a number in "
            f"[{least:.4g}, {most:.4g}]"
        )


def _with_belief(ready: Ready, case: Case) -> Setup:
    """Return the setup with the belief that a case states."""
    factors = family(case, "believed_factor")
    if not factors:
        return ready.setup
    drive = ready.setup.drive
    if isinstance(drive.motor.energy, SplineEnergy):
        _refuse_of_map("believed_factor", factors)
    changed = {name: factor * getattr(drive.motor, name) for name, factor in factors.items()}
    try:
        motor = dataclasses.replace(drive.motor, **changed)
    except BadInput as error:
        raise BadInput(f"believed_factor: {error}") from None
    believed: Belief = belief_of(dataclasses.replace(drive, motor=motor), ready.belief)
    return dataclasses.replace(ready.setup, believed=believed)


def _refuse_of_map(name: str, values: Mapping[str, Any]) -> None:
    for field in MAGNETICS:
        if field in values:
            raise BadInput(
                f"{name}.{field} does nothing on a motor with a flux map; leave it away "
                "for this motor"
            )


def _with_bandwidths(design: Design, case: Case) -> Design:
    """Return a design with bandwidths times the case's factors; ratios of gains inside a loop stay
    as designed."""
    f = {"current": 1.0, "tracking": 1.0, "speed": 1.0} | family(case, "bandwidth_factor")
    c, t = design.control, design.tuning
    i, a, s = f["current"], f["tracking"], f["speed"]
    control = c._replace(
        kp_d=i * c.kp_d,
        kp_q=i * c.kp_q,
        ki_d=i * c.ki_d,
        ki_q=i * c.ki_q,
        speed_kp=s * c.speed_kp,
        speed_ki=s * s * c.speed_ki,
    )
    tuning = t._replace(kp=a * t.kp, ki=a * a * t.ki, speed_variance=a**4 * t.speed_variance)
    return dataclasses.replace(design, control=control, tuning=tuning)


def windows_of(setup: Setup) -> tuple[Windows, ...]:
    """Return the scored stretches' samples; they are those that `sandbox.evaluation.score` looks
    at."""
    t, scenario = np.arange(setup.samples) * setup.drive.converter.sampling_period, setup.scenario
    found, start = [], setup.start_time
    for s in scenario.segments:
        times = start, start + scenario.settle_of(s), start + s.duration
        if s.score:
            found.append(Windows(*(int(k) for k in np.searchsorted(t, np.array(times) - 1e-9))))
        start += s.duration
    return tuple(found)


def row_of(ready: Ready, done: Simulation) -> Row:
    """Return the errors over all scored stretches."""
    table, setup = done.recording.table, ready.setup
    lost, held, errors = False, True, []
    for w in ready.windows:
        settled = Recording(table[w.settled : w.end])
        lost = lost or is_lost(Recording(table[w.start : w.end]))
        held = held and (setup.scenario.reference != "speed" or speed_held(settled))
        errors.append(np.degrees(settled.error))
    found: ErrorDeg = statistics(np.concatenate(errors) if len(errors) > 1 else errors[0], lost)
    means = [] if lost else [float(e.mean()) for e in errors if e.size]
    worst = max(means, key=abs, default=None)
    together = math.sqrt(sum(m * m for m in means) / len(means)) if means else None
    return Row(OK, None, found.mean, found.rms, found.p95, found.max, worst, together, lost, held)


def _with_costs(row: Row, ready: Ready, recording: Recording, effects: Mapping[str, float]) -> Row:
    """Return a row with the largest costs of the injection over all scored stretches."""
    setup, table = ready.setup, recording.table
    values = complete(setup.drive.motor, setup.drive.converter, effects)
    true = true_motor(setup.drive.motor, values, keep_map=True)
    parts = [Recording(table[w.settled : w.end]) for w in ready.windows]
    found = [
        injection_cost(setup.drive, part, true, values, setup.estimator.inside) for part in parts
    ]
    costs = [c for c in found if c is not None]
    return row._replace(
        loss_w=max((c.loss_w for c in costs), default=None),
        torque_ripple=max((c.torque_ripple for c in costs), default=None),
        sound_db=max((c.sound_db for c in costs), default=None),
        tone_db=max((c.tone_db for c in costs), default=None),
    )


def _traces(sweep: Sweep, recording: Recording) -> NDArray[np.float64] | None:
    """Return the channels that the sweep keeps, (channels, samples)."""
    if sweep.traces is None:
        return None
    kept = [recording[c] if c in CHANNELS else recording.error for c in sweep.traces.channels]
    return np.array([channel[:: sweep.traces.stride] for channel in kept])
