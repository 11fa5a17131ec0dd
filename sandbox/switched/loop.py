"""The closed loop around the switched bench: estimator, control and recording are those of `sandbox.loop`."""

from __future__ import annotations

import math

import numba
import numpy as np
from numba import types

from estimators.contract import BELIEF, STATE, STEP, TUNING
from model.compiled import kernel, kernel_as
from model.frames import rotate
from sandbox.control import CONTROL, SIZE, speed_from
from sandbox.loop import (
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
from sandbox.switched.effects import NO_MAP, Bench
from sandbox.switched.inverter import I_ALPHA, I_BETA, PSI_ALPHA, PSI_BETA, SPEED, THETA, advance
from sandbox.switched.machine import least_stiffness
from sandbox.switched.simulate import measure

BENCH = numba.typeof(Bench._make([*(len(Bench._fields) - 1) * (0.0,), NO_MAP]))
RUN = types.UniTuple(types.int64, 2)(
    types.FunctionType(STEP), STATE, VECTOR, BENCH, types.float64, RIG, CONTROL, BELIEF, TUNING, TABLE, VECTOR, VECTOR,
    RNG, TABLE,
)  # fmt: skip


@kernel
def encoder_slope(b, theta, speed):
    """Return the slope (rad/s, electrical) of an eccentric encoder's angle without counts."""
    slope = b.eccentricity / b.pole_pairs * math.cos(theta / b.pole_pairs + b.eccentricity_phase)
    return b.pole_pairs * speed * (1.0 + slope)


@kernel_as(RUN)
def run_compiled(step, state, x, b, u_dc, rig, control, belief, tuning, profile, waveform, primitive, rng, table):
    """Run the loop; fill `table` (rows, channels); return (status, sample at which it stopped); u_dc: V, nominal."""
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
        estimate = step(state, sample, belief, tuning)
        u_alpha, u_beta, i_q = command(k, measured, sample, estimate, wanted, rig, control, controller, waveform)
        if k % rig.stride == 0:
            record(table[k // rig.stride], t, motion, measured, reading, true, acting, estimate, wanted, i_q, read)
        advance(x, b, rig.rotor, acting[0], acting[1], read, wanted[1], imposed)
        keep(memory, (u_alpha, u_beta))
        if not math.isfinite(x[PSI_ALPHA] + x[PSI_BETA] + x[SPEED] + x[THETA] + u_alpha + u_beta):
            return NOT_FINITE, k
        if not least_stiffness(b, complex(x[PSI_ALPHA], x[PSI_BETA]), x[THETA]) > 0.0:
            return OUTSIDE_DOMAIN, k
    return DONE, rig.samples


run_python = run_compiled.py_func  # the same loop, interpreted, around an estimator of any kind
