"""The closed loop, one sample at a time: measure, estimate, control, record, advance the plant.

`run_compiled` keeps all of it in one kernel and calls a compiled estimator through a function pointer;
`run_python` is the same source interpreted: compiled pieces around an estimator written in Python.  The command
computed at t_k acts over [t_{k+1}, t_{k+2}): the usual period of delay.  The estimator is handed a Sample, nothing
else.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numba
import numpy as np
from numba import types

from estimators.contract import BELIEF, ESTIMATE, SAMPLE, STATE, TUNING, Belief, Sample
from model.compiled import compiled_as, kernel, kernel_as
from model.effects.current_gain import read
from model.energy import min_eigenvalue
from model.frames import phases, rotate, stationary
from sandbox.control import CONTROL, SIZE, average, current_control, reorient, speed_control, speed_from
from sandbox.effects import BARE, EFFECTS
from sandbox.full import advance as advance_full
from sandbox.full import stiffness
from sandbox.inverter import deliver
from sandbox.oldplant import OMEGA, PHI_D, PHI_Q, PLANT, THETA, Plant, advance, stator_currents
from sandbox.recording import CHANNELS
from sandbox.sensors import encoder, sampled

DONE, OUTSIDE_DOMAIN, NOT_FINITE = 0, 1, 2
TIME, LOAD, LOAD_TORQUE, I_Q_REF, OMEGA_REF, I_D_REF = range(6)  # columns of a profile's breakpoints
# the loop's own memory: voltage now acting, and before; link voltage as read over its nominal value
CURSOR, U_ALPHA, U_BETA, LAST_ALPHA, LAST_BETA, LINK, ENCODER = range(7)
MEMORY = 9  # the encoder's speed has three places
N_CHANNELS = len(CHANNELS)
CLOSED, OPEN = 1, 0
LOCKED, DRIVEN, FREE = 0, 1, 2


class Rig(NamedTuple):
    """Sensors, converter and the way the run is done."""

    samples: int
    stride: int  # every stride-th sample is recorded
    plant_steps: int  # a sampling period
    closed: int  # CLOSED: the estimate controls; OPEN: the encoder does
    speed_controlled: int
    rotor: int
    sampling_period: float  # s
    noise: float  # A rms a phase
    resolution: float  # A per count, 0 none
    start_time: float  # s, of starting up, before the profile begins
    link: float  # V, nominal
    link_noise: float  # V rms, of its reading, by which duties are formed


RIG = numba.typeof(Rig(*6 * (0,), *6 * (0.0,)))
RNG = numba.typeof(np.random.default_rng(0))
VECTOR = types.Array(types.float64, 1, "C")
TABLE = types.Array(types.float64, 2, "C")


@kernel
def interpolate(profile, t, cursor):
    """Return the row of breakpoints at time t and the cursor; the cursor only moves forward."""
    last = profile.shape[0] - 1
    while cursor < last - 1 and t >= profile[cursor + 1, TIME]:
        cursor += 1
    span = profile[cursor + 1, TIME] - profile[cursor, TIME]
    s = min(max((t - profile[cursor, TIME]) / span, 0.0), 1.0) if span > 0.0 else 1.0
    a, b = profile[cursor], profile[cursor + 1]
    load = a[LOAD] + s * (b[LOAD] - a[LOAD])
    torque = a[LOAD_TORQUE] + s * (b[LOAD_TORQUE] - a[LOAD_TORQUE])
    i_q = a[I_Q_REF] + s * (b[I_Q_REF] - a[I_Q_REF])
    omega = a[OMEGA_REF] + s * (b[OMEGA_REF] - a[OMEGA_REF])
    i_d = a[I_D_REF] + s * (b[I_D_REF] - a[I_D_REF])
    return (load, torque, i_q, omega, i_d), cursor


@kernel
def read_current(value, rig, rng):
    """Return a phase current as its sensor reads it: noise, then quantisation."""
    value += rig.noise * rng.standard_normal()
    return rig.resolution * math.floor(value / rig.resolution + 0.5) if rig.resolution > 0.0 else value


@kernel
def read_link(rig, rng):
    """Return the link voltage as the controller reads it, over its nominal value."""
    return 1.0 + rig.link_noise / rig.link * rng.standard_normal() if rig.link_noise > 0.0 else 1.0


@kernel
def read_phases(i_alpha, i_beta, sensors, rig, rng):
    """Return the three phase currents (A) as their sensors read them."""
    a, b, c = phases(i_alpha, i_beta)
    a = read_current(read(a, sensors.gain_a, sensors.offset_a), rig, rng)
    b = read_current(read(b, sensors.gain_b, sensors.offset_b), rig, rng)
    c = read_current(read(c, sensors.gain_c, -sensors.offset_a - sensors.offset_b), rig, rng)
    return a, b, c


@kernel
def sample_of(k, reading, memory, primitive):
    """Return what the estimator is given at t_k."""
    m_alpha, m_beta = stationary(reading[0], reading[1], reading[2])
    carrier = primitive[k % primitive.size]
    return Sample(m_alpha, m_beta, memory[LAST_ALPHA], memory[LAST_BETA], carrier)


@kernel
def formed(memory):
    """Return the voltage (V) that the duties of the acting command make of the nominal link."""
    return memory[U_ALPHA] / memory[LINK], memory[U_BETA] / memory[LINK]


@kernel
def measure(x, plant, effects, rig, memory, rng):
    """Return at t_k the three phase currents read, the true i_d, i_q, angle and speed as the encoder gives them."""
    sensors = effects.sensors
    if effects.path == BARE:
        i_alpha, i_beta, i_d, i_q = stator_currents(x, plant)
    else:
        i_alpha, i_beta, i_d, i_q = sampled(x, plant, effects.machine, effects.inverter, sensors, *formed(memory), rng)
    reading = read_phases(i_alpha, i_beta, sensors, rig, rng)
    angle, slope = encoder(sensors, plant.pole_pairs, x[THETA], x[OMEGA])
    omega = speed_from(memory, ENCODER, angle, slope, sensors.encoder_step, rig.sampling_period)
    return reading, (i_d, i_q), (angle, omega)


@kernel
def command(k, measured, sample, estimate, wanted, rig, control, controller, waveform):
    """Return the voltage (alpha, beta) for the next interval and the q current reference.

    measured: angle and speed from the encoder, by which an open loop controls.
    """
    h = control.sampling_period
    _, _, i_q_ref, omega_ref, i_d_ref = wanted
    starting = estimate.tracking == 0.0
    angle, omega = estimate.theta, estimate.omega
    if rig.closed == OPEN and not starting:
        angle, omega = measured
    reorient(controller, angle, h * omega)
    i_d, i_q = average(controller, *rotate(sample.i_alpha, sample.i_beta, -angle), control.period)
    if starting:
        i_d_ref, i_q_ref = estimate.bias, 0.0
    elif rig.speed_controlled:
        i_q_ref = speed_control(controller, control, omega_ref, omega, 0.0)
    u_d, u_q = current_control(controller, control, i_d, i_q, i_d_ref, i_q_ref, omega_ref)
    u_alpha, u_beta = rotate(u_d, u_q, angle + 1.5 * h * omega)  # centre of the interval it acts in
    pulse = control.amplitude * estimate.injection * waveform[(k + 1) % waveform.size]
    p_alpha, p_beta = rotate(pulse, 0.0, estimate.axis + 1.5 * h * estimate.omega)
    return u_alpha + p_alpha, u_beta + p_beta, i_q_ref


@kernel
def record(row, t, motion, measured, reading, true, acting, estimate, wanted, i_q_ref, u_dc):
    """Write one row in the order of CHANNELS; `acting` is the voltage of the interval that starts at t."""
    row[0] = t
    row[1], row[2], row[3] = reading
    row[4], row[5] = acting
    row[6], row[7], row[8], row[9] = motion[0], estimate.theta, motion[1], estimate.omega
    row[10], row[11] = true
    row[12], row[13] = estimate.ripple_d, estimate.ripple_q
    row[14], row[15] = wanted[0], wanted[1]
    row[16], row[17], row[18], row[19] = wanted[3], i_q_ref, estimate.tracking, measured[0]
    row[20] = u_dc


@kernel
def imposed_on(k, omega, rig, profile, memory):
    """Return the acceleration (rad/s^2, electrical) that takes a driven rotor to its speed at t_{k+1}."""
    if rig.rotor != DRIVEN:
        return 0.0
    t = (k + 1) * rig.sampling_period - rig.start_time
    later, _ = interpolate(profile, t, int(memory[CURSOR]))
    return (later[3] - omega) / rig.sampling_period


@kernel
def keep(memory, next_u):
    """Remember the voltage that acted as the last one and the command as the one that acts next."""
    memory[LAST_ALPHA], memory[LAST_BETA] = memory[U_ALPHA], memory[U_BETA]
    memory[U_ALPHA], memory[U_BETA] = next_u


@kernel
def progress(k, x, plant, effects, rig, wanted, profile, memory, next_u):
    """Advance the plant over [t_k, t_{k+1}) under the acting voltage; return DONE or what went wrong."""
    imposed = imposed_on(k, x[OMEGA], rig, profile, memory)
    v_alpha, v_beta = formed(memory)
    if effects.path == BARE:
        advance(x, plant, v_alpha, v_beta, wanted[1], imposed, rig.plant_steps)
    else:
        machine, shaft, inverter = effects.machine, effects.shaft, effects.inverter
        u_alpha, u_beta = deliver(x, plant, machine, inverter, v_alpha, v_beta)
        advance_full(
            x, plant, machine, shaft, inverter.filter_time, u_alpha, u_beta, wanted[1], imposed, rig.plant_steps
        )
    keep(memory, next_u)
    if not math.isfinite(x[PHI_D] + x[PHI_Q] + x[OMEGA] + x[THETA] + next_u[0] + next_u[1]):
        return NOT_FINITE
    c, s = (math.cos(x[THETA]), math.sin(x[THETA])) if effects.path != BARE else (1.0, 0.0)
    dd, dq, qq = stiffness(plant, effects.machine, c, s, x[PHI_D], x[PHI_Q])
    return DONE if min_eigenvalue(dd, dq, qq) > 0.0 else OUTSIDE_DOMAIN


def run_signature(plant: Any, belief: Any) -> Any:
    """Return the loop's signature for the numba types of a plant and of a belief."""
    step = types.FunctionType(ESTIMATE(STATE, SAMPLE, belief, TUNING))
    return types.UniTuple(types.int64, 2)(
        step, STATE, VECTOR, plant, EFFECTS, RIG, CONTROL, belief, TUNING, TABLE, VECTOR, VECTOR, RNG, TABLE
    )


@kernel_as(run_signature(PLANT, BELIEF))
def run_compiled(
    step, state, x, plant, effects, rig, control, belief, tuning, profile, waveform, primitive, rng, table
):
    """Run the loop; fill `table` (rows, channels); return (status, sample at which it stopped)."""
    controller = np.zeros(SIZE)
    memory = np.zeros(MEMORY)
    for k in range(rig.samples):
        t = k * rig.sampling_period
        wanted, cursor = interpolate(profile, t - rig.start_time, int(memory[CURSOR]))
        memory[CURSOR], memory[LINK] = cursor, read_link(rig, rng)
        reading, true, measured = measure(x, plant, effects, rig, memory, rng)
        sample = sample_of(k, reading, memory, primitive)
        estimate = step(state, sample, belief, tuning)
        acting = (memory[U_ALPHA], memory[U_BETA])
        u_alpha, u_beta, i_q = command(k, measured, sample, estimate, wanted, rig, control, controller, waveform)
        if k % rig.stride == 0:
            motion = (x[THETA], x[OMEGA])
            u_dc = rig.link * memory[LINK]
            record(table[k // rig.stride], t, motion, measured, reading, true, acting, estimate, wanted, i_q, u_dc)
        status = progress(k, x, plant, effects, rig, wanted, profile, memory, (u_alpha, u_beta))
        if status != DONE:
            return status, k
    return DONE, rig.samples


run_python = run_compiled.py_func  # the same loop, interpreted, around an estimator of any kind


def run_for(plant: Plant, belief: Belief) -> Any:
    """Return the compiled loop for these kinds of energy: `run_compiled`, or another compiled when first asked for."""
    kinds = numba.typeof(plant), numba.typeof(belief)
    return run_compiled if kinds == (PLANT, BELIEF) else compiled_as(run_signature(*kinds), run_python)
