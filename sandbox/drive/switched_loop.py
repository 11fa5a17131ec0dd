"""The closed loop around the switched bench: estimator, control and recording are those of
`sandbox.drive.loop`."""

from __future__ import annotations

import math
from typing import Any

import numba
import numpy as np
from numba import types

from estimators.contract import (
    BELIEF,
    COMMANDED_ALPHA,
    COMMANDED_BETA,
    ESTIMATE,
    OVERSAMPLED,
    READ_ALPHA,
    READ_BETA,
    SAMPLE,
    STATE,
    TUNING,
    Belief,
)
from model.compiled import compiled_as, kernel, kernel_as
from model.frames import rotate, stationary
from sandbox.drive.control import CONTROL, SIZE, speed_from
from sandbox.drive.inside import ask, commanded, shift_pulses
from sandbox.drive.loop import (
    ALONE,
    MEMORY,
    PROFILE,
    RIG,
    RNG,
    ROWS,
    VECTOR,
    Memory,
    Status,
    applied_in,
    command,
    interpolate,
    keep,
    record,
    sample_of,
)
from sandbox.drive.sensing import read_link
from sandbox.switched.advance import measure, misread_slope, sensor
from sandbox.switched.bench_numbers import SwitchedBench
from sandbox.switched.bench_state import Slot
from sandbox.switched.gates.blocked import coast
from sandbox.switched.inverter import advance, leg_duties
from sandbox.switched.phase_machine import least_stiffness, phase_currents, vector

OFF = SwitchedBench._field_defaults.values()  # no map, no lists
PLAIN = SwitchedBench._make([*(len(SwitchedBench._fields) - len(OFF)) * (0.0,), *OFF])
BENCH = numba.typeof(PLAIN)


def run_signature(belief: Any, inside: Any, of_bench: Any = BENCH) -> Any:
    """Return the loop's signature for the numba types of a belief, of the readings inside a period
    and of a bench."""
    sample = SAMPLE if inside == ALONE else OVERSAMPLED
    step = types.FunctionType(ESTIMATE(STATE, sample, belief, TUNING))
    return types.UniTuple(types.int64, 2)(
        step,
        STATE,
        VECTOR,
        of_bench,
        types.float64,
        inside,
        RIG,
        CONTROL,
        belief,
        TUNING,
        PROFILE,
        VECTOR,
        VECTOR,
        RNG,
        ROWS,
    )


@kernel
def encoder_slope(b, theta, speed):
    """Return the slope (rad/s, electrical) of an encoder's angle with its errors, without
    counts."""
    return b.pole_pairs * speed * (1.0 + misread_slope(b, theta))


@kernel
def gather(state, b, acting, u_dc, rng, inside):
    """Write the readings of the period just advanced over: currents as the sensors read them, V s
    as commanded.

    acting: the command (V); u_dc: the link as read, by which duties were formed.  A late sampler
    reads late here as well; jitter does not act on these readings.
    """
    legs, readings = leg_duties(b, acting[0], acting[1], u_dc), inside.readings
    n = readings.shape[0]
    for j in range(n):
        slot = Slot.READINGS + 1 + 2 * j
        i_a, i_b, i_c = phase_currents(complex(state[slot], state[slot + 1]))
        readings[j, READ_ALPHA], readings[j, READ_BETA] = stationary(
            sensor(b, i_a, b.gain_a, b.common_offset + b.offset_a, rng),
            sensor(b, i_b, b.gain_b, b.common_offset + b.offset_b, rng),
            sensor(b, i_c, b.gain_c, b.common_offset - b.offset_a - b.offset_b, rng),
        )
        readings[j, COMMANDED_ALPHA], readings[j, COMMANDED_BETA] = commanded(
            (j + 0.5) * b.period / n, b.period, legs, state[Slot.SHIFT :], u_dc
        )


@kernel
def known(b, acting, u_dc):
    """Return the voltage (V) that the drive knows to act: its command, or what its modulator makes
    of it."""
    if b.pattern == 0 and b.beyond == 0 and b.drive_least_pulse == 0.0:
        return acting
    d_a, d_b, d_c = leg_duties(b, acting[0], acting[1], u_dc)
    u = u_dc * vector(d_a, d_b, d_c)
    return u.real, u.imag


@kernel
def progress(k, x, b, mode, acting, read, torque, imposed, inside, rng, blocked):
    """Advance the bench over [t_k, t_k+1), its pulses shifted and the current read inside where
    that is asked for; return the voltage (V) that the drive knows to act."""
    if blocked:
        u = coast(x, b, mode, torque, imposed)
        return u.real, u.imag
    if inside is not None:
        shift_pulses(x[Slot.SHIFT :], k, inside.shift)
    advance(x, b, mode, acting[0], acting[1], read, torque, imposed)
    if inside is not None:
        gather(x, b, acting, read, rng, inside)
    return known(b, acting, read)


@kernel_as(run_signature(BELIEF, ALONE))
def run_compiled(
    step,
    state,
    x,
    b,
    u_dc,
    inside,
    rig,
    control,
    belief,
    tuning,
    profile,
    waveform,
    primitive,
    rng,
    rows,
):
    """Run the loop; fill `rows` (of ROW); return (status, sample at which it stopped).

    u_dc: V, nominal; inside: None, or what is read inside a period (`Inside`), pulses then shifted.
    """
    controller = np.zeros(SIZE)
    memory = np.zeros(MEMORY)
    for k in range(rig.samples):
        t = k * rig.sampling_period
        wanted, cursor = interpolate(profile, t - rig.start_time, int(memory[Memory.CURSOR]))
        memory[Memory.CURSOR] = cursor
        read = u_dc * read_link(rig, rng)
        imposed = (
            applied_in(k, wanted, b.pole_pairs * x[Slot.SPEED], 0.0, rig, profile, memory).imposed
            / b.pole_pairs
        )
        acting = (memory[Memory.U_ALPHA], memory[Memory.U_BETA])
        held = measure(x, b, rig.rotor, acting[0], acting[1], read, wanted.torque, imposed, rng)
        reading = (held.i_a, held.i_b, held.i_c)
        motion = (x[Slot.THETA], b.pole_pairs * x[Slot.SPEED])
        slope = encoder_slope(b, x[Slot.THETA], x[Slot.SPEED])
        measured = (
            held.theta,
            speed_from(
                memory, Memory.ENCODER, held.theta, slope, b.encoder_step, rig.sampling_period
            ),
        )
        true = rotate(x[Slot.I_ALPHA], x[Slot.I_BETA], -x[Slot.THETA])
        sample = sample_of(k, reading, memory, primitive)
        estimate = ask(step, state, sample, inside, belief, tuning)
        blocked = wanted.blocked > 0.0 and t >= rig.start_time
        u_alpha, u_beta, i_q = command(
            k, measured, sample, estimate, wanted, rig, control, controller, waveform, blocked
        )
        if k % rig.stride == 0:
            record(
                rows[k // rig.stride],
                t,
                motion,
                measured,
                reading,
                true,
                acting,
                estimate,
                wanted,
                i_q,
                read,
            )
        delivered = progress(
            k, x, b, rig.rotor, acting, read, wanted.torque, imposed, inside, rng, blocked
        )
        if blocked and k % rig.stride == 0:
            rows[k // rig.stride].u_alpha, rows[k // rig.stride].u_beta = delivered
        keep(memory, delivered, (u_alpha, u_beta))
        if not math.isfinite(
            x[Slot.PSI_ALPHA] + x[Slot.PSI_BETA] + x[Slot.SPEED] + x[Slot.THETA] + u_alpha + u_beta
        ):
            return Status.NOT_FINITE, k
        if (
            not least_stiffness(b, complex(x[Slot.PSI_ALPHA], x[Slot.PSI_BETA]), x[Slot.THETA])
            > 0.0
        ):
            return Status.OUTSIDE_DOMAIN, k
    return Status.DONE, rig.samples


run_python = run_compiled.py_func  # the same loop, interpreted, around an estimator of any kind


def run_for(belief: Belief, inside: Any) -> Any:
    """Return the compiled loop for a belief's kind of energy, with readings inside or None.

    Whichever bench it is called with: for one with a map or lists it is compiled when called.
    """
    kinds = numba.typeof(belief), numba.typeof(inside)

    def run(step: Any, state: Any, x: Any, b: SwitchedBench, *rest: Any) -> Any:
        """Run the loop as `run_compiled`."""
        of_bench = numba.typeof(b)
        plain = (*kinds, of_bench) == (BELIEF, ALONE, BENCH)
        return (
            run_compiled if plain else compiled_as(run_signature(*kinds, of_bench), run_python)
        )(step, state, x, b, *rest)

    return run
