"""The closed loop, one sample at a time: measure, estimate, control, record, advance the plant.

`run_compiled` keeps all of it in one kernel and calls a compiled estimator through a function
pointer; `run_python` is the same source interpreted: compiled pieces around an estimator written in
Python.  The command computed at t_k acts over [t_{k+1}, t_{k+2}): the usual period of delay, so the
plant can go on to the pattern's end before the sample it gave on its way is looked at.  The
estimator is handed a Sample, nothing else; one that reads the current inside the period an
Oversampled.
"""

from __future__ import annotations

import math
from enum import IntEnum
from typing import Any, NamedTuple

import numba
import numpy as np
from numba import types

from estimators.contract import (
    BELIEF,
    ESTIMATE,
    OVERSAMPLED,
    SAMPLE,
    STATE,
    TUNING,
    Belief,
    Sample,
    is_usual,
)
from model.compiled import compiled_as, kernel, kernel_as
from model.energy import min_eigenvalue
from model.frames import rotate, stationary
from model.parameters import Rotor
from sandbox.drive.control import (
    CONTROL,
    SIZE,
    average,
    current_control,
    reorient,
    rest,
    speed_control,
    speed_from,
)
from sandbox.drive.inside import ask, shift_pulses
from sandbox.drive.recording import ROW
from sandbox.drive.sensing import encoder, gather, instant, looked_at, read_link, read_phases
from sandbox.plant.batch import numba_type, room_type
from sandbox.plant.edges import write_edges
from sandbox.plant.gates.blocked import block
from sandbox.plant.gates.modulation import PLAIN, Modulation, given, is_plain, modulated
from sandbox.plant.period import AppliedTorque, RotorTrajectory, Timing, travel


class Status(IntEnum):
    """How a run ended."""

    DONE, OUTSIDE_DOMAIN, NOT_FINITE = range(3)


class Places(NamedTuple):
    """Places of the loop's own memory."""

    CURSOR: int = 0
    U_ALPHA: int = 1  # voltage now acting
    U_BETA: int = 2
    LAST_ALPHA: int = 3  # and before
    LAST_BETA: int = 4
    LINK: int = 5  # as read, over its nominal value
    ENCODER: int = 6  # three places of its speed
    INSTANT: int = 9  # s, the last sample less t_k
    SPAN: int = 10  # s, the plant's last segment


Memory = Places()  # no enum: before 0.68 numba takes none as an index
MEMORY = Memory.SPAN + 1


class Rig(NamedTuple):
    """Sensors, converter and the way the run is done."""

    samples: int
    stride: int  # every stride-th sample is recorded
    closed: int  # 1: the estimate controls; 0: the encoder does
    speed_controlled: int
    rotor: int  # of `Rotor`
    sampling_period: float  # s
    noise: float  # A rms a phase
    resolution: float  # A per count, 0 none
    start_time: float  # s, of starting up, before the profile begins
    link: float  # V, nominal
    link_noise: float  # V rms, of its reading, by which duties are formed
    encoder_step: float  # rad, electrical, of one count; 0: no counts
    modulation: Modulation = PLAIN


RIG = numba.typeof(Rig(*5 * (0,), *7 * (0.0,)))
RNG = numba.typeof(np.random.default_rng(0))
VECTOR = types.Array(types.float64, 1, "C")
ALONE = types.none  # no readings inside the period
ROWS = types.Array(numba.from_dtype(ROW), 1, "C")
TIMING, ROOM = numba.typeof(Timing(*5 * (0.0,))), numba.from_dtype(room_type(1))


class LoopPlant(NamedTuple):
    """The plant of a run: its batch of one lane, flux map (None: the quartic), timing, features,
    room."""

    w: Any
    flux_map: Any
    timing: Timing
    features: int
    room: Any


class Wanted(NamedTuple):
    """What the scenario asks for at an instant."""

    load: float  # of rated current
    torque: float  # N m, of the load
    i_q: float  # A
    omega: float  # rad/s, electrical
    i_d: float  # A
    blocked: float  # 1: gates are blocked


# a profile's breakpoints, between them straight lines: s from the scenario's begin, then what is
# wanted
BREAKPOINT = np.dtype([("time", np.float64), *((name, np.float64) for name in Wanted._fields)])
PROFILE = types.Array(numba.from_dtype(BREAKPOINT), 1, "C")


@kernel
def interpolate(profile, t, cursor):
    """Return what is wanted at time t and the cursor; the cursor only moves forward."""
    last = profile.size - 1
    while cursor < last - 1 and t >= profile[cursor + 1].time:
        cursor += 1
    a, b = profile[cursor], profile[cursor + 1]
    span = b.time - a.time
    s = min(max((t - a.time) / span, 0.0), 1.0) if span > 0.0 else 1.0
    load = a.load + s * (b.load - a.load)
    torque = a.torque + s * (b.torque - a.torque)
    i_q = a.i_q + s * (b.i_q - a.i_q)
    omega = a.omega + s * (b.omega - a.omega)
    i_d = a.i_d + s * (b.i_d - a.i_d)
    return Wanted(load, torque, i_q, omega, i_d, a.blocked), cursor


@kernel
def sample_of(k, reading, memory, primitive):
    """Return what the estimator is given at t_k."""
    i_a, i_b, i_c = reading
    m_alpha, m_beta = stationary(i_a, i_b, i_c)
    carrier = primitive[k % primitive.size]
    return Sample(m_alpha, m_beta, memory[Memory.LAST_ALPHA], memory[Memory.LAST_BETA], carrier)


@kernel
def rotor(w):
    """Return angle (rad) and speed (rad/s) of the rotor, electrical, at the pattern's start."""
    swing = w.pairs[0] * w.load_share[0]
    return w.angle[0] + swing * w.twist[0], w.speed[0] + swing * w.slip[0]


@kernel
def at_pattern(w):
    """Return the rotor's speed (rad/s, electrical) at the pattern's start, and how much later than
    t_k that is (s)."""
    return rotor(w)[1], w.delay[0]


@kernel
def at_sample(w, rig, applied):
    """Return angle and speed at t_k, before the pattern's start: the rotor turned as its last
    acceleration made it."""
    theta, omega = rotor(w)
    gained = w.delay[0] * (applied.imposed if rig.rotor == Rotor.DRIVEN else 2.0 * w.surge[0])
    return theta - w.delay[0] * (omega - 0.5 * gained), omega - gained


@kernel
def at_start(w, theta):
    """Return the terminal current i_d, i_q (A) at the pattern's start, of a rotor at theta
    (rad)."""
    return rotate(w.first_alpha[0], w.first_beta[0], -theta)


@kernel
def shift(room, k, inside):
    """Shift the pulses of period k."""
    shift_pulses(room.shift, k, inside.shift)


@kernel
def command(k, measured, sample, estimate, wanted, rig, control, controller, waveform, blocked):
    """Return the voltage (alpha, beta) for the next interval and the q current reference.

    measured: angle and speed from the encoder, by which an open loop controls; blocked: whether
    gates are, the voltage is then what the magnets induce at the speed known: no current will flow
    when they switch again.
    """
    h = control.sampling_period
    i_q_ref, i_d_ref = wanted.i_q, wanted.i_d
    starting = estimate.tracking == 0.0
    angle, omega = estimate.theta, estimate.omega
    if not rig.closed and not starting:
        angle, omega = measured
    reorient(controller, angle, h * omega)
    i_d, i_q = average(controller, *rotate(sample.i_alpha, sample.i_beta, -angle), control.period)
    if starting:
        i_d_ref, i_q_ref = estimate.bias, 0.0
    elif rig.speed_controlled:
        i_q_ref = speed_control(controller, control, wanted.omega, omega, 0.0)
    injected = control.amplitude * estimate.injection
    if blocked:
        rest(controller)
        i_q_ref, u_d, u_q = 0.0, 0.0, omega * control.magnet_flux
    else:
        u_d, u_q = current_control(
            controller, control, i_d, i_q, i_d_ref, i_q_ref, wanted.omega, injected
        )
    u_alpha, u_beta = rotate(u_d, u_q, angle + 1.5 * h * omega)  # centre of the interval it acts in
    pulse = injected * waveform[(k + 1) % waveform.size]
    p_alpha, p_beta = rotate(pulse, 0.0, estimate.axis + 1.5 * h * estimate.omega)
    return u_alpha + p_alpha, u_beta + p_beta, i_q_ref


@kernel
def record(row, t, motion, measured, reading, true, acting, estimate, wanted, i_q_ref, u_dc):
    """Write one row of ROW; `acting` is the voltage of the interval that starts at t."""
    row.t, row.u_dc = t, u_dc
    row.i_a, row.i_b, row.i_c = reading
    row.u_alpha, row.u_beta = acting
    row.theta, row.omega = motion
    row.theta_read, _ = measured
    row.theta_hat, row.omega_hat = estimate.theta, estimate.omega
    row.i_d, row.i_q = true
    row.ripple_d, row.ripple_q, row.tracking = (
        estimate.ripple_d,
        estimate.ripple_q,
        estimate.tracking,
    )
    row.load, row.load_torque = wanted.load, wanted.torque
    row.omega_ref, row.i_q_ref = wanted.omega, i_q_ref


@kernel
def applied_in(k, wanted, omega, delay, rig, profile, memory):
    """Return what moves the rotor over the pattern that starts `delay` (s) after t_k, omega (rad/s)
    its speed then.

    The load of a sample lasts from it to the next; the acceleration takes a driven rotor to its
    speed at t_{k+1}, and in what is left of the pattern after it on towards that at t_{k+2}.
    """
    load, period = wanted.torque, rig.sampling_period
    imposed = imposed_after = 0.0
    if rig.rotor == Rotor.DRIVEN or delay > 0.0:
        then, cursor = interpolate(
            profile, (k + 1) * period - rig.start_time, int(memory[Memory.CURSOR])
        )
        if rig.rotor == Rotor.DRIVEN:
            imposed = imposed_after = (then.omega - omega) / (period - delay)
        if delay > 0.0:
            load = then.torque
            if rig.rotor == Rotor.DRIVEN:
                last, _ = interpolate(profile, (k + 2) * period - rig.start_time, cursor)
                imposed_after = (last.omega - then.omega) / period
    return AppliedTorque(wanted.torque, imposed, period - delay, load, imposed_after)


@kernel
def keep(memory, delivered, next_u):
    """Remember the voltage that acted, as the drive knows it, as the last one and the command as
    the one to act."""
    memory[Memory.LAST_ALPHA], memory[Memory.LAST_BETA] = delivered
    memory[Memory.U_ALPHA], memory[Memory.U_BETA] = next_u


@kernel
def progress(k, bench, rig, applied, memory, looks, seen, rng, blocked):
    """Move the plant on over the pattern that starts at t_k + its delay, and hold the current
    sampled for t_k; return the voltage (V) that the drive knows to act: the command, what its
    modulator made of it, or with blocked gates what it measures at the legs.

    looks, seen: instants (s) looked at and the currents there, see `sensing.looked_at`; the first
    two are set here.
    """
    w, room, period = bench.w, bench.room, rig.sampling_period
    for m in range(3):
        room.before[m] = room.duty[m]
    u_dc = rig.link * memory[Memory.LINK]
    delivered = (memory[Memory.U_ALPHA], memory[Memory.U_BETA])
    legs = modulated(rig.modulation, delivered[0], delivered[1], u_dc)
    if not is_plain(rig.modulation):
        delivered = given(legs, u_dc)
    room.duty[0], room.duty[1], room.duty[2] = legs
    room.blocked = 1 if blocked else 0
    if blocked:
        block(room)
    write_edges(room, period)
    theta, omega = rotor(w)
    surge = 0.5 * applied.imposed if rig.rotor == Rotor.DRIVEN else w.surge[0]
    trajectory = RotorTrajectory(
        math.cos(theta), math.sin(theta), 0.0, 0.0, omega, surge, 0.0, omega, applied
    )
    early = memory[Memory.INSTANT] < 0.0
    after = instant(w, rig, rng)
    looks[0] = -1.0 if early else memory[Memory.INSTANT]
    looks[1] = period + after if after < 0.0 else -1.0
    held = (seen[1, 0], seen[1, 1])
    memory[Memory.SPAN] = travel(
        w,
        bench.flux_map,
        bench.timing,
        bench.features,
        room,
        trajectory,
        k * period,
        memory[Memory.SPAN],
        looks,
        seen,
    )
    memory[Memory.INSTANT] = after
    if bench.timing.first != 0.0 or bench.timing.last != 0.0:
        w.held_alpha[0], w.held_beta[0] = held if early else (seen[0, 0], seen[0, 1])
    if blocked:
        delivered = (room.given[0] / period, room.given[1] / period)
    return delivered


@kernel
def judge(w, next_u):
    """Return Status.DONE, or what is wrong with the plant after a period: not finite, or no longer
    convex."""
    if not math.isfinite(
        w.psi_alpha[0] + w.psi_beta[0] + w.speed[0] + w.angle[0] + next_u[0] + next_u[1]
    ):
        return Status.NOT_FINITE
    aa, ab, bb = (
        w.stiff_aa[0] + w.stiffer_aa[0],
        w.stiff_ab[0] + w.stiffer_ab[0],
        w.stiff_bb[0] + w.stiffer_bb[0],
    )
    return Status.DONE if min_eigenvalue(aa, ab, bb) > 0.0 else Status.OUTSIDE_DOMAIN


def run_signature(flux_map: Any, belief: Any, inside: Any = ALONE) -> Any:
    """Return the loop's signature for the numba types of a flux map (none: the quartic), of a
    belief and of what is read inside the period (ALONE: nothing)."""
    step = types.FunctionType(
        ESTIMATE(STATE, SAMPLE if inside == ALONE else OVERSAMPLED, belief, TUNING)
    )
    bench = types.NamedTuple((numba_type(1), flux_map, TIMING, types.int64, ROOM), LoopPlant)
    return types.UniTuple(types.int64, 2)(
        step, STATE, bench, inside, RIG, CONTROL, belief, TUNING, PROFILE, VECTOR, VECTOR, RNG, ROWS
    )


@kernel_as(run_signature(types.none, BELIEF))
def run_compiled(
    step,
    state,
    bench,
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

    inside: None, or what is read inside a period (`Inside`), pulses then shifted.
    """
    controller, memory = np.zeros(SIZE), np.zeros(MEMORY)
    w = bench.w
    looks, seen = looked_at(w, rig.sampling_period, inside)
    memory[Memory.INSTANT] = instant(w, rig, rng)
    for k in range(rig.samples):
        t = k * rig.sampling_period
        wanted, cursor = interpolate(profile, t - rig.start_time, int(memory[Memory.CURSOR]))
        memory[Memory.CURSOR], memory[Memory.LINK] = cursor, read_link(rig, rng)
        speed, delay = at_pattern(w)
        applied = applied_in(k, wanted, speed, delay, rig, profile, memory)
        theta, omega = at_sample(w, rig, applied)
        angle, slope = encoder(w, bench.features, theta, omega, rig.encoder_step)
        measured = (
            angle,
            speed_from(memory, Memory.ENCODER, angle, slope, rig.encoder_step, rig.sampling_period),
        )
        if inside is not None:
            shift(bench.room, k, inside)
        blocked = wanted.blocked > 0.0 and t >= rig.start_time
        delivered = progress(k, bench, rig, applied, memory, looks, seen, rng, blocked)
        reading = read_phases(w, rig, rng)
        sample = sample_of(k, reading, memory, primitive)
        estimate = ask(step, state, sample, inside, belief, tuning)
        acting = delivered if blocked else (memory[Memory.U_ALPHA], memory[Memory.U_BETA])
        u_alpha, u_beta, i_q = command(
            k, measured, sample, estimate, wanted, rig, control, controller, waveform, blocked
        )
        if k % rig.stride == 0:
            true, u_dc = at_start(w, theta), rig.link * memory[Memory.LINK]
            row = rows[k // rig.stride]
            record(
                row, t, (theta, omega), measured, reading, true, acting, estimate, wanted, i_q, u_dc
            )
        if inside is not None:
            gather(w, bench.room, rig, inside, rig.link * memory[Memory.LINK], seen, rng)
        keep(memory, delivered, (u_alpha, u_beta))
        status = judge(w, (u_alpha, u_beta))
        if status != Status.DONE:
            return status, k
    return Status.DONE, rig.samples


run_python = run_compiled.py_func  # the same loop, interpreted, around an estimator of any kind


def run_for(flux_map: Any, belief: Belief, inside: Any) -> Any:
    """Return the compiled loop for these kinds of energy and of readings inside the period:
    `run_compiled`, or another compiled when first asked for."""
    if flux_map is None and inside is None and is_usual(belief):
        return run_compiled
    kinds = numba.typeof(flux_map), numba.typeof(belief), numba.typeof(inside)
    return (
        run_compiled
        if kinds == (types.none, BELIEF, ALONE)
        else compiled_as(run_signature(*kinds), run_python)
    )
