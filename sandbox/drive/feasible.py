"""What a run must satisfy before it starts: a sentence now instead of nonsense later."""

from __future__ import annotations

import math
import traceback
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from estimators.contract import RANDOM, ROTATING, Belief, Estimate, Estimator, Tuning
from estimators.startup import polarity_rise
from model.drive_files import motor_names
from model.energy import Energy, boundary_on_ray, flux_from_current, hessian
from model.errors import BadInput, OwnCodeError, PhysicsError, brief, raised
from model.parameters import OVERLOAD, Drive
from model.rating_pairs import injection, link
from sandbox.drive.design import KNOWN_START, Design, check_saliency
from sandbox.drive.scenario import Scenario, scenario_names
from sandbox.plant.gates.modulation import attainable
from sandbox.recordings.injection import samples_per_period

MOST_STEPS = 4_000_000_000  # of the plant in one run: three minutes and more
LEAST_TURN = 4  # samples of a rotating injection's turn
# the two ripples of the polarity test must differ by this many standard deviations
OWN_START = "start_up = false in the scenario"
POLARITY_SIGMA = 6.0


def check_call(
    estimator: Estimator, belief: str, seed: int, stride: int, plant_step: float
) -> None:
    """Raise BadInput for arguments of `simulate` that cannot be meant."""
    if not isinstance(estimator, Estimator):
        raise BadInput(
            f"estimator {estimator!r:.40} is no Estimator; see estimators.registry.load_estimator"
        )
    if estimator.compiled and not hasattr(estimator.step, "signatures"):
        raise BadInput(
            f"estimator '{estimator.name}' says compiled, but its step is plain Python; give "
            "compiled=False, or compile it with model.compiled.kernel_as(estimators.contract.STEP)"
        )
    if belief not in ("saturated", "linear"):
        raise BadInput(f"belief '{belief}' is neither 'saturated' nor 'linear'")
    if not isinstance(seed, int) or seed < 0:
        raise BadInput(f"seed {seed!r:.40} is no whole number of at least 0")
    if not isinstance(stride, int) or stride < 1:
        raise BadInput(
            f"stride {stride!r:.40} is out of range; record every stride-th sample, at least 1"
        )
    if not 1e-9 <= plant_step <= 1e-2:
        raise BadInput(f"plant_step {plant_step} s is out of range; give a value in [1e-9, 0.01] s")


def check_length(samples: int, steps: int, period: float) -> None:
    """Raise BadInput for a run of more plant steps than anybody waits for (steps: in a sampling
    period, s)."""
    if samples * steps > MOST_STEPS:
        raise BadInput(
            f"{samples} samples of {steps} plant steps of {period / steps:.3g} s are more than "
            f"{MOST_STEPS:.0e} steps; shorten the run, or check resistance and inductances (L/R "
            "sets the step), speed and effects"
        )


def check_injection(estimator: Estimator, drive: Drive) -> None:
    """Raise BadInput where a drive's injection is not what an estimator lives on."""
    wave = drive.injection.waveform
    n = samples_per_period(drive.injection, drive.converter)
    if estimator.injection == ROTATING and (wave != "square" or n < LEAST_TURN):
        raise BadInput(
            f"estimator '{estimator.name}' turns a square wave from sample to sample, in at least "
            f"{LEAST_TURN} samples a turn; '{drive.name}' injects a {wave} wave of "
            f"{n} samples: inject a square wave of at most "
            f"{1.0 / (LEAST_TURN * drive.converter.sampling_period):g} Hz"
        )
    if estimator.injection == RANDOM and (wave != "square" or n % 4):
        raise BadInput(
            f"estimator '{estimator.name}' makes cycles of N and N/2 samples of a square wave, N a "
            f"multiple of four; '{drive.name}' injects a {wave} wave of {n} samples: "
            "inject a square wave of "
            f"{1.0 / (4 * max(1, round(n / 4)) * drive.converter.sampling_period):g} Hz"
        )


def step_of(estimator: Estimator, believed: Belief) -> Callable[..., Estimate]:
    """Return the step that a loop calls: the compiled one for this belief, or a Python one that is
    watched."""
    compiled: Callable[..., Estimate] = estimator.step_for(believed)
    return compiled if estimator.compiled else checked(estimator)


def first_state(estimator: Estimator, believed: Belief, tuning: Tuning, angle: float | None) -> Any:
    """Return an estimator's first state; OwnCodeError, in one sentence, where its `init` raises."""
    try:
        state = estimator.init(believed, tuning, angle)
    except (BadInput, PhysicsError, MemoryError):
        raise
    except (Exception, SystemExit) as error:
        raise own_code_error(estimator, "init", error) from error
    if estimator.compiled and not (
        isinstance(state, np.ndarray)
        and state.dtype == np.float64
        and state.ndim == 1
        and state.flags.c_contiguous
    ):
        raise OwnCodeError(
            f"init of estimator '{estimator.name}' returned {brief(state)}; "
            "a compiled one returns an array (n,) of float64"
        )
    return state


def checked(estimator: Estimator) -> Callable[..., Estimate]:
    """Return a Python estimator's step that says so when it raises or returns something else than
    an Estimate; BadInput, or OwnCodeError."""

    def step(*arguments: object) -> Estimate:
        """Return the estimate, once it is seen to be one; BadInput where it is none."""
        try:
            estimate = estimator.step(*arguments)  # type: ignore[arg-type]
        except (BadInput, PhysicsError, MemoryError):
            raise
        except (Exception, SystemExit) as error:
            raise own_code_error(estimator, "step", error) from error
        if not isinstance(estimate, Estimate):
            raise BadInput(
                f"step of estimator '{estimator.name}' returned "
                f"{type(estimate).__name__}; it must return an Estimate"
            )
        return estimate

    return step


def own_code_error(estimator: Estimator, which: str, error: BaseException) -> OwnCodeError:
    """Return what an estimator's `init` or `step` raised as one sentence: the error, and the line
    of its own file."""
    frames = [
        (frame.f_code.co_filename, line) for frame, line in traceback.walk_tb(error.__traceback__)
    ]
    code = getattr(getattr(estimator, which), "__code__", None)
    own = [place for place in frames if code is not None and place[0] == code.co_filename]
    # the innermost of its own file: what it calls there is its to mend
    file, line = (own or frames)[-1]
    return OwnCodeError(
        f"{which} of estimator '{estimator.name}' raised {raised(error)} ({Path(file).name}, line "
        f"{line}); mend it there"
    )


def check_feasible(drive: Drive, scenario: Scenario, gains: Design, injects: bool = True) -> None:
    """Raise where a scenario cannot be run on a drive: saliency, domain, polarity, current, speed
    or voltage.

    injects: whether the estimator does while it tracks; starting up always does.
    """
    motor, m = drive.motor, drive.motor.energy
    if gains.reads_ripple:
        check_saliency(m)
    able = attainable(drive.converter)
    left = able - drive.injection.amplitude
    if left <= 0.0 and (injects or scenario.start_up):
        raise PhysicsError(
            f"{injection(drive)} exceeds the {able:.4g} V that {link(drive)} gives; lower the "
            "injection or raise dc_bus_voltage"
        )
    if scenario.start_up:
        check_polarity(drive, gains, left, can_carry(drive, scenario), scenario.name)
    room = left if injects else able
    for s in scenario.segments:
        if math.hypot(s.load, s.current_d) > OVERLOAD:
            raise BadInput(
                f"load {100 * math.hypot(s.load, s.current_d):g} % exceeds the current limit of "
                f"{100 * OVERLOAD:g} %; lower it"
            )
        i_d = s.current_d * motor.rated_current
        i_q, omega = s.load * motor.rated_current, s.speed * motor.rated_omega
        if abs(omega) > gains.top_omega:
            raise BadInput(
                f"speed {100 * s.speed:g} % ({abs(s.speed) * motor.rated_speed_rpm:.4g} rpm) is "
                f"beyond {gains.top_omega / motor.rated_omega * motor.rated_speed_rpm:.4g} rpm, up "
                "to which the current loop behind the injection's average holds; lower it, or "
                "inject faster"
            )
        try:
            d, q = (float(v) for v in flux_from_current(m, i_d, i_q))
        except PhysicsError as error:
            raise PhysicsError(
                str(error).replace("use another parameter set", other_set(drive))
            ) from None
        u = math.hypot(
            motor.resistance * i_d - omega * q,
            motor.resistance * i_q + omega * (d + motor.magnet_flux),
        )
        if u > room and not s.blocked:
            own = f" beside {injection(drive)}" if injects else ""
            raise PhysicsError(
                f"load {100 * s.load:g} % at {100 * s.speed:g} % speed needs {u:.4g} V, but "
                f"{link(drive)} leaves {room:.4g} V{own}; lower load"
                f"{', speed or injection' if injects else ' or speed'}, or raise dc_bus_voltage"
            )


def can_carry(drive: Drive, scenario: Scenario) -> bool:
    """Tell whether a motor's model holds all currents that a scenario asks for."""
    rated = drive.motor.rated_current
    try:
        for s in scenario.segments:
            flux_from_current(drive.motor.energy, s.current_d * rated, s.load * rated)
    except PhysicsError:
        return False
    return True


def other_set(drive: Drive) -> str:
    """Return which parameter set to use in a motor's place, as far as one is known."""
    name = f"{drive.name}_exchanged"
    if name in motor_names():
        return f"use '{name}', its rows of L_d and L_q exchanged"
    return "use another parameter set"


def check_polarity(
    drive: Drive, gains: Design, room: float, carried: bool = False, asked: str = "staircase"
) -> None:
    """Raise where starting up cannot tell the magnet's ends: bias outside the domain, or ripples
    too alike.

    carried: the scenario could be run without starting up; asked: its name.
    """
    motor, tuning = drive.motor, gains.tuning
    known = KNOWN_START.format(asked) if asked in scenario_names() else OWN_START
    try:
        flux_from_current(motor.energy, np.array([-1.0, 1.0]) * tuning.bias, 0.0)
    except PhysicsError as error:
        if not isinstance(motor.energy, Energy):
            raise PhysicsError(
                f"starting up tests polarity at +-{tuning.bias:g} A on d: {error}; or begin with "
                f"the angle known: {known}"
            ) from None
        ends = [boundary_on_ray(motor.energy, sign * tuning.bias, 0.0)[0] for sign in (-1.0, 1.0)]
        end = min(ends, key=abs)
        remedy = (
            ", or set start_up = false in the scenario, whose own loads it can carry"
            if carried
            else ""
        )
        raise PhysicsError(
            f"starting up tests polarity at +-{tuning.bias:g} A on d, and the energy of "
            f"'{drive.name}' stops being convex at i_d = {end:.4g} A; {other_set(drive)}{remedy}"
        ) from None
    if motor.resistance * tuning.bias > room:
        raise PhysicsError(
            f"starting up holds {tuning.bias:g} A, which needs "
            f"{motor.resistance * tuning.bias:.4g} V of {room:.4g} V "
            "beside the injection; lower the injection or raise dc_bus_voltage"
        )
    rise = abs(float(polarity_rise(motor.energy, tuning.bias)))
    noise = (
        math.sqrt(2.0 * tuning.current_variance / (tuning.average * tuning.power))
        / tuning.amplitude
    )
    if rise < POLARITY_SIGMA * noise:
        saturates = rise > 1e-9 * abs(float(hessian(motor.energy, 0.0, 0.0)[0]))
        raise BadInput(
            f"polarity cannot be found: at +-{tuning.bias:g} A on d the ripples differ by "
            f"{rise:.3g} 1/H, noise is {noise:.3g} 1/H; give the motor its alphas (saturation), "
            f"{'raise the injection, ' if saturates else ''}or begin with the angle known: "
            f"{known}"
        )
