"""One run: a drive, a scenario, an estimator with its belief; from checks to recording."""

from __future__ import annotations

import dataclasses
import math
import time
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from estimators.contract import NONE, PWM, Belief, Estimator
from estimators.startup import start_periods
from model.effects.library import true_motor
from model.energy import AnyEnergy, flux_from_current, torque
from model.errors import BadInput, Diverged, unknown
from model.parameters import Drive, Rotor
from sandbox.drive import loop
from sandbox.drive.closed import closed_bench, longest_step, looked_into, rotor_flux
from sandbox.drive.design import Design, belief_of, design
from sandbox.drive.feasible import (
    check_call,
    check_feasible,
    check_injection,
    check_length,
    first_state,
    step_of,
)
from sandbox.drive.inside import Inside, inside_of
from sandbox.drive.recording import ROW, Recording
from sandbox.drive.scenario import Scenario
from sandbox.plant import sets
from sandbox.plant.gates.modulation import modulation_of
from sandbox.plant.sets import features_of
from sandbox.recordings.injection import Carrier, carrier

MOST_SAMPLES = 10_000_000  # recorded: 1.6 GB, a quarter of an hour at 10 kHz
EXACT, SWITCHED = PLANTS = ("exact", "switched")
OLD_NAME = "averaged"  # of the first
LONGEST = 1e-2  # s


@dataclass(frozen=True)
class Simulation:
    """A finished run; values: all that the plant had, effects that are off included."""

    recording: Recording
    design: Design
    start_time: float  # s of starting up, before the scenario begins
    cpu_seconds: float
    values: Mapping[str, float]


def torque_at_load(drive: Drive, load: float) -> float:
    """Return the motor's torque (N m) at i_d = 0, i_q = load x rated current."""
    motor = drive.motor
    d, q = flux_from_current(motor.energy, 0.0, load * motor.rated_current)
    return float(torque.py_func(motor.energy, d, q, motor.magnet_flux, motor.pole_pairs))


def profile_of(drive: Drive, scenario: Scenario) -> NDArray[np.void]:
    """Return the breakpoints (of `loop.BREAKPOINT`) of load, speed and references, in order of
    time."""
    rows: list[tuple[float, ...]] = []
    t = load = speed = i_d = 0.0  # starting up happens at rest without load
    for s in scenario.segments:
        rows.append((t, *_wanted(drive, scenario, load, speed, i_d, s.blocked)))
        if s.ramp or (s.load, s.speed, s.current_d) != (load, speed, i_d):
            for part in np.linspace(0.0, 1.0, 9)[1:]:  # torque is not linear in load
                x, y = load + part * (s.load - load), speed + part * (s.speed - speed)
                z = i_d + part * (s.current_d - i_d)
                rows.append((t + part * s.ramp, *_wanted(drive, scenario, x, y, z, s.blocked)))
        t, load, speed, i_d = t + s.duration, s.load, s.speed, s.current_d
        rows.append((t, *_wanted(drive, scenario, load, speed, i_d, s.blocked)))
    return np.array(rows, loop.BREAKPOINT)


def _wanted(
    drive: Drive, scenario: Scenario, load: float, speed: float, i_d: float, blocked: bool
) -> loop.Wanted:
    """Return what is wanted at a breakpoint; load, i_d: of rated current, speed: of rated speed."""
    motor = drive.motor
    torque = 0.0 if scenario.rotor != "free" else torque_at_load(drive, load)
    i_q = load * motor.rated_current if scenario.reference == "current" else 0.0
    return loop.Wanted(
        load, torque, i_q, speed * motor.rated_omega, i_d * motor.rated_current, float(blocked)
    )


class How(NamedTuple):
    """How a run is made, whatever is simulated.

    closed_loop: whether the estimate (or the encoder) controls; stride: record every stride-th
    sample; plant_step: s, an upper bound (the plant chooses its own below); truth: another magnetic
    model for the plant than the one the estimator's belief comes from.
    """

    closed_loop: bool = True
    seed: int = 0
    stride: int = 1
    plant_step: float = LONGEST
    truth: AnyEnergy | None = None


@dataclass(frozen=True)
class Setup:
    """What runs have in common that differ only in the plant's values, the belief's and the
    noise."""

    drive: Drive
    scenario: Scenario
    estimator: Estimator
    plant: str
    design: Design
    believed: Belief
    carrier: Carrier
    samples: int
    start_time: float  # s of starting up

    @cached_property
    def profile(self) -> NDArray[np.void]:
        """The breakpoints of load and speed, see `profile_of`; asked for once the run is known to
        be feasible."""
        return profile_of(self.drive, self.scenario)


def simulate(
    drive: Drive,
    scenario: Scenario,
    estimator: Estimator,
    belief: str = "saturated",
    *,
    effects: Mapping[str, float] | None = None,
    plant: str = EXACT,
    **how: Any,
) -> Simulation:
    """Run a scenario and return its recording.

    belief: `saturated` or `linear`; effects: what the plant has and the model lacks, by public name
    such as {"dead_time.time": 2e-6}, on the exact plant `bench.*`, too; plant: `exact` (event by
    event) or `switched` (the independent bench); how: fields of `How`.  Raises BadInput or
    PhysicsError with one sentence.
    """
    asked = How(**how)
    check_call(estimator, belief, asked.seed, asked.stride, asked.plant_step)
    # before the design, which takes longer
    values = sets.complete(drive.motor, drive.converter, effects)
    return _run(set_up(drive, scenario, estimator, belief, plant), values, asked)


def set_up(
    drive: Drive, scenario: Scenario, estimator: Estimator, belief: str, plant: str = EXACT
) -> Setup:
    """Return a run made ready: gains designed, the belief formed; arguments and errors as
    `simulate`."""
    plant = plant_named(plant)
    check_injection(estimator, drive)
    injects = estimator.injection != NONE
    gains = design(drive, scenario.start_up, estimator.takes_published, injects)
    tuning = gains.tuning
    start_time = (
        start_periods(tuning.settle, tuning.average) * tuning.period * tuning.sampling_period
    )
    return Setup(
        drive,
        scenario,
        estimator,
        plant,
        gains,
        belief_of(drive, belief),
        carrier(drive.injection, drive.converter),
        round((start_time + scenario.duration) / tuning.sampling_period),
        start_time,
    )


def run_once(setup: Setup, effects: Mapping[str, float] | None = None, **how: Any) -> Simulation:
    """Run what was made ready on a plant with effects; arguments and errors as `simulate`."""
    values = sets.complete(setup.drive.motor, setup.drive.converter, effects)
    return _run(setup, values, How(**how))


def _run(setup: Setup, values: Mapping[str, float], how: How) -> Simulation:
    """The same with all values of the plant."""
    drive, scenario, estimator = setup.drive, setup.scenario, setup.estimator
    believed, gains, samples = setup.believed, setup.design, setup.samples
    true = true_motor(drive.motor, values, keep_map=True)
    injects = estimator.injection not in (NONE, PWM)
    check_feasible(dataclasses.replace(drive, motor=true), scenario, gains, injects)
    tuning, h = gains.tuning, gains.tuning.sampling_period
    stride = how.stride
    if samples // stride > MOST_SAMPLES:
        text = f"{samples // stride} recorded samples are more than {MOST_SAMPLES}; shorten the run"
        raise BadInput(f"{text} or raise the stride")
    first_angle = None if scenario.start_up else scenario.start_angle + scenario.start_error
    state = first_state(estimator, believed, tuning, first_angle)
    rows = np.zeros(-(-samples // stride), ROW)
    inside = inside_for(estimator, drive)
    on = _switched if setup.plant == SWITCHED else exact_bench
    compiled = believed if estimator.compiled else None
    run, *bench = on(drive, scenario, values, how.plant_step, how.truth, compiled, inside)
    rig = rig_of(drive, scenario, how.closed_loop, samples, stride, setup.start_time)
    if setup.plant == EXACT:
        check_length(samples, max(1, math.ceil(h / bench[0].timing.longest)), h)
    step = step_of(estimator, believed)
    profile = setup.profile
    begun = time.thread_time()
    status, at = run(
        step,
        state,
        *bench,
        inside,
        rig,
        gains.control,
        believed,
        tuning,
        profile,
        setup.carrier.waveform,
        setup.carrier.primitive,
        np.random.default_rng(how.seed),
        rows,
    )
    spent = time.thread_time() - begun
    if status != loop.Status.DONE:
        raise _failure(status, at * h, _flux(setup.plant, bench), drive)
    return Simulation(Recording.of(rows), gains, setup.start_time, spent, values)


def plant_named(plant: str) -> str:
    """Return the plant's present name; BadInput for one that is none."""
    plant = EXACT if plant == OLD_NAME else plant
    if plant not in PLANTS:
        raise unknown("plant", plant, PLANTS)
    return plant


def inside_for(estimator: Estimator, drive: Drive) -> Inside | None:
    """Return fresh room for what an estimator reads inside the period, None for one that does
    not."""
    return inside_of(drive.converter) if estimator.inside else None


def exact_bench(
    drive: Drive,
    scenario: Scenario,
    values: Mapping[str, float],
    plant_step: float,
    truth: AnyEnergy | None,
    believed: Belief | None,
    inside: Inside | None,
) -> tuple[Any, ...]:
    """Return the loop's kernel (interpreted where there is no compiled belief) and the plant.

    values: completed parameters; inside: what is read inside a period, None for nothing.
    """
    motor = true_motor(drive.motor, values, keep_map=True)
    top = 1.5 * max(abs(s.speed) for s in scenario.segments) * motor.rated_omega
    step = min(plant_step, longest_step(motor, values, features_of(drive.motor, values), top))
    bench = closed_bench(
        drive.motor, drive.converter, values, scenario.rotor, scenario.start_angle, step, truth
    )
    bench = looked_into(bench) if inside else bench
    return loop.run_for(bench.flux_map, believed, inside) if believed else loop.run_python, bench


def _switched(
    drive: Drive,
    scenario: Scenario,
    values: Mapping[str, float],
    plant_step: float,
    truth: AnyEnergy | None,
    believed: Belief | None,
    inside: Inside | None,
) -> tuple[Any, ...]:
    """Return the loop's kernel, the bench's state, the bench and the nominal link voltage; inside
    as `exact_bench`."""
    from sandbox.drive import switched_loop as switched
    from sandbox.switched import advance as bench_of
    from sandbox.switched.bench_numbers import bench
    from sandbox.switched.bench_state import Slot

    if truth is not None:
        raise BadInput(
            "the switched plant takes no other magnetic model; give effects such as "
            "saturation.alpha_30"
        )
    of_bench = sets.complete(drive.motor, drive.converter)
    for name in sets.BENCH:
        if values[name] != of_bench[name]:
            raise BadInput(
                f"the switched plant has no '{name}'; leave it away, or take --plant exact"
            )
    b = bench(
        drive.motor, drive.converter, {k: v for k, v in values.items() if k not in sets.BENCH}
    )
    if any(s.blocked for s in scenario.segments) and (
        inside or b.pwm_delay or b.sampling_delay or b.jitter
    ):
        raise BadInput(
            "the switched plant samples at t_k alone where gates are blocked; leave "
            "pwm_delay, current_sampling and "
            "estimators that read inside the period away, or take --plant exact"
        )
    b = b._replace(step=min(b.step, plant_step))
    x = bench_of.start(b, scenario.start_angle)
    x[Slot.READINGS] = len(inside.readings) if inside else 0
    run = switched.run_for(believed, inside) if believed else switched.run_python
    return run, x, b, drive.converter.dc_bus_voltage


def rig_of(
    drive: Drive, scenario: Scenario, closed: bool, n: int, stride: int, start: float
) -> loop.Rig:
    """Return sensors and converter for n samples, with the time of starting up in s."""
    c = drive.converter
    counts = math.tau * drive.motor.pole_pairs / c.encoder_counts if c.encoder_counts else 0.0
    return loop.Rig(
        n,
        stride,
        int(closed),
        int(scenario.reference == "speed"),
        int(Rotor[scenario.rotor.upper()]),
        c.sampling_period,
        c.current_noise,
        c.current_resolution,
        start,
        c.dc_bus_voltage,
        c.link_noise,
        counts,
        modulation_of(c),
    )


def _flux(plant: str, bench: Any) -> tuple[float, float]:
    """Return phi_d, phi_q (Wb) of either plant's state."""
    if plant == SWITCHED:
        from sandbox.switched.advance import rotor_flux as of_switched

        return of_switched(bench[1], bench[0])
    return rotor_flux(bench[0])


def _failure(status: int, t: float, x: tuple[float, float], drive: Drive) -> Diverged:
    if status == loop.Status.OUTSIDE_DOMAIN:
        return Diverged(
            f"after {t:.4g} s the fluxes ({x[0]:.4g}, {x[1]:.4g}) Wb left the domain in which the "
            f"energy of '{drive.name}', with what effects add, is convex; lower the load or those "
            "effects, or use another parameter set (see `sensorless audit`)"
        )
    return Diverged(
        f"after {t:.4g} s the simulation of '{drive.name}' is no longer finite, in the "
        "plant or in the estimate; check "
        "the motor's values (SI units) and that sampling_period is short against L/R"
    )
