"""The closed loop around the switched bench: estimator, control and recording are those of `sandbox.drive.loop`."""

from __future__ import annotations

import math
from typing import Any

import numba
import numpy as np
from numba import types
from numba.extending import overload

from estimators.contract import BELIEF, ESTIMATE, OVERSAMPLED, SAMPLE, STATE, TUNING, Belief, Oversampled
from model.compiled import compiled_as, kernel, kernel_as
from model.frames import rotate
from sandbox.drive.control import CONTROL, SIZE, speed_from
from sandbox.drive.loop import (
    CURSOR,
    DONE,
    ENCODER,
    MEMORY,
    NOT_FINITE,
    OUTSIDE_DOMAIN,
    RIG,
    RNG,
    TABLE,
    U_ALPHA,
    U_BETA,
    VECTOR,
    command,
    imposed_on,
    interpolate,
    keep,
    read_link,
    record,
    sample_of,
)
from sandbox.validation.switched.advance import measure
from sandbox.validation.switched.bench_numbers import Bench
from sandbox.validation.switched.inverter import I_ALPHA, I_BETA, PSI_ALPHA, PSI_BETA, SPEED, THETA, advance
from sandbox.validation.switched.phase_machine import least_stiffness
from sandbox.validation.switched.readings import gather, shift_pulses

OFF = Bench._field_defaults.values()  # no map, no lists
PLAIN = Bench._make([*(len(Bench._fields) - len(OFF)) * (0.0,), *OFF])
BENCH = numba.typeof(PLAIN)
ALONE = types.none  # no readings inside the period


def run_signature(belief: Any, inside: Any, of_bench: Any = BENCH) -> Any:
    """Return the loop's signature for the numba types of a belief, of the readings inside a period and of a bench."""
    sample = SAMPLE if inside == ALONE else OVERSAMPLED
    step = types.FunctionType(ESTIMATE(STATE, sample, belief, TUNING))
    return types.UniTuple(types.int64, 2)(
        step, STATE, VECTOR, of_bench, types.float64, inside, types.float64, RIG, CONTROL, belief, TUNING, TABLE,
        VECTOR, VECTOR, RNG, TABLE,
    )  # fmt: skip


@kernel
def encoder_slope(b, theta, speed):
    """Return the slope (rad/s, electrical) of an encoder's angle with its errors, without counts."""
    slope = b.eccentricity / b.pole_pairs * math.cos(theta / b.pole_pairs + b.eccentricity_phase)
    if b.resolver != 0.0:
        slope += 2.0 * b.resolver * math.cos(2.0 * theta / b.pole_pairs + b.resolver_phase)
    return b.pole_pairs * speed * (1.0 + slope)


def ask(step, state, sample, inside, belief, tuning):
    """Return the estimate of a sample, or of it and the readings inside the period where there are any."""
    if inside is None:
        return step(state, sample, belief, tuning)
    i_alpha, i_beta, u_alpha, u_beta, carrier = sample
    return step(state, Oversampled(i_alpha, i_beta, u_alpha, u_beta, carrier, inside), belief, tuning)


@overload(ask)
def _ask(step, state, sample, inside, belief, tuning):
    """Choose the branch by type: only one of them fits the step."""
    if isinstance(inside, types.NoneType):
        return lambda step, state, sample, inside, belief, tuning: step(state, sample, belief, tuning)

    def oversampled(step, state, sample, inside, belief, tuning):
        """Hand the readings inside over with the sample."""
        i_alpha, i_beta, u_alpha, u_beta, carrier = sample
        return step(state, Oversampled(i_alpha, i_beta, u_alpha, u_beta, carrier, inside), belief, tuning)

    return oversampled


@kernel
def progress(k, x, b, mode, acting, read, torque, imposed, inside, shift, rng):
    """Advance the bench over [t_k, t_k+1), its pulses shifted and the current read inside where that is asked for."""
    if inside is not None:
        shift_pulses(x, k, shift)
    advance(x, b, mode, acting[0], acting[1], read, torque, imposed)
    if inside is not None:
        gather(x, b, acting, read, rng, inside)


@kernel_as(run_signature(BELIEF, ALONE))
def run_compiled(
    step, state, x, b, u_dc, inside, shift, rig, control, belief, tuning, profile, waveform, primitive, rng, table
):
    """Run the loop; fill `table` (rows, channels); return (status, sample at which it stopped).

    u_dc: V, nominal; inside: None, or room for the readings inside a period (n, 4), pulses then shifted by `shift` (s).
    """
    controller = np.zeros(SIZE)
    memory = np.zeros(MEMORY)
    held = np.zeros(4)
    for k in range(rig.samples):
        t = k * rig.sampling_period
        wanted, cursor = interpolate(profile, t - rig.start_time, int(memory[CURSOR]))
        memory[CURSOR] = cursor
        read = u_dc * read_link(rig, rng)
        imposed = imposed_on(k, b.pole_pairs * x[SPEED], rig, profile, memory) / b.pole_pairs
        acting = (memory[U_ALPHA], memory[U_BETA])
        measure(x, b, rig.rotor, acting[0], acting[1], read, wanted[1], imposed, rng, held)
        reading = (held[0], held[1], held[2])
        motion = (x[THETA], b.pole_pairs * x[SPEED])
        slope = encoder_slope(b, x[THETA], x[SPEED])
        measured = (held[3], speed_from(memory, ENCODER, held[3], slope, b.encoder_step, rig.sampling_period))
        true = rotate(x[I_ALPHA], x[I_BETA], -x[THETA])
        sample = sample_of(k, reading, memory, primitive)
        estimate = ask(step, state, sample, inside, belief, tuning)
        u_alpha, u_beta, i_q = command(k, measured, sample, estimate, wanted, rig, control, controller, waveform)
        if k % rig.stride == 0:
            record(table[k // rig.stride], t, motion, measured, reading, true, acting, estimate, wanted, i_q, read)
        progress(k, x, b, rig.rotor, acting, read, wanted[1], imposed, inside, shift, rng)
        keep(memory, (u_alpha, u_beta))
        if not math.isfinite(x[PSI_ALPHA] + x[PSI_BETA] + x[SPEED] + x[THETA] + u_alpha + u_beta):
            return NOT_FINITE, k
        if not least_stiffness(b, complex(x[PSI_ALPHA], x[PSI_BETA]), x[THETA]) > 0.0:
            return OUTSIDE_DOMAIN, k
    return DONE, rig.samples


run_python = run_compiled.py_func  # the same loop, interpreted, around an estimator of any kind


def run_for(belief: Belief, inside: Any) -> Any:
    """Return the compiled loop for a belief's kind of energy, with readings inside or None.

    Whichever bench it is called with: for one with a map or lists it is compiled when called.
    """
    kinds = numba.typeof(belief), numba.typeof(inside)

    def run(step: Any, state: Any, x: Any, b: Bench, *rest: Any) -> Any:
        """Run the loop as `run_compiled`."""
        of_bench = numba.typeof(b)
        plain = (*kinds, of_bench) == (BELIEF, ALONE, BENCH)
        return (run_compiled if plain else compiled_as(run_signature(*kinds, of_bench), run_python))(
            step, state, x, b, *rest
        )

    return run
