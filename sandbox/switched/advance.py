"""The switched bench used: start, measure as the sensors read, replay a recording's commands.

    state = start(b, theta=0.3)
    rng = numpy.random.default_rng(0)
    for each sampling instant t_k:
        reading = measure(state, b, FREE, u_alpha, u_beta, u_dc, load_torque, 0.0, rng)
        advance(state, b, FREE, u_alpha, u_beta, u_dc, load_torque, 0.0)

u_alpha, u_beta is the command acting from t_k on: sensors that sample late already see it.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from model.compiled import kernel
from model.errors import BadInput, PhysicsError, unknown
from model.parameters import Rotor
from sandbox.switched.bench_numbers import SwitchedBench
from sandbox.switched.bench_state import SIZE, Slot
from sandbox.switched.inverter import advance, early_slot, travel
from sandbox.switched.layers import CIRCUITS
from sandbox.switched.phase_machine import current_and_torque, magnet, phase_currents, sliding
from sandbox.switched.readers import remembered

Vector = NDArray[np.float64]
MODES = {rotor.name.lower(): int(rotor) for rotor in Rotor}
NEWTON_STEPS = 50
PREDICTED = np.dtype(
    [(name, np.float64) for name in ("i_a", "i_b", "i_c", "theta", "position", "speed", "torque")],
    align=True,
)


class Reading(NamedTuple):
    """What the sensors read at t_k."""

    i_a: float  # A
    i_b: float
    i_c: float
    theta: float  # rad, electrical, of the encoder


def flux_for(b: SwitchedBench, i: complex, theta: float) -> complex:
    """Return the flux vector (Wb) whose magnetising current is i (A): Newton's method with a
    difference Jacobian; PhysicsError where none has it."""
    m = magnet(b, complex(math.cos(theta), math.sin(theta)))[0]
    psi, h = (
        m,
        1e-6
        * max(abs(b.magnet_flux), abs(i) / (b.flux_map.stiffness if b.flux_map else b.g_0), 1e-6),
    )
    for _ in range(NEWTON_STEPS):
        at = current_and_torque(b, psi, theta)[0]
        miss = i - at
        if abs(miss) <= 1e-12 * max(abs(i), b.soft_current):
            return complex(psi)
        x = (current_and_torque(b, psi + h, theta)[0] - at) / h
        y = (current_and_torque(b, psi + 1j * h, theta)[0] - at) / h
        det = x.real * y.imag - x.imag * y.real
        psi += (
            complex(
                miss.real * y.imag - miss.imag * y.real, x.real * miss.imag - x.imag * miss.real
            )
            / det
        )
    raise PhysicsError(
        f"no flux gives a current of {abs(i):.4g} A; the motor's saturation model ends before it"
    )


def start(
    b: SwitchedBench,
    theta: float = 0.0,
    speed: float = 0.0,
    i_alpha: float = 0.0,
    i_beta: float = 0.0,
) -> Vector:
    """Return a state at rest electrically: theta (rad, electrical), speed (rad/s, mechanical),
    terminal current (A)."""
    # scratch behind it: for looking ahead, and for steps that are taken again
    state = np.zeros(3 * SIZE)
    psi = flux_for(b, complex(i_alpha, i_beta), theta)
    state[Slot.PSI_ALPHA], state[Slot.PSI_BETA] = psi.real, psi.imag
    state[Slot.HELD_ALPHA], state[Slot.HELD_BETA] = psi.real, psi.imag
    state[Slot.CORE_ALPHA : Slot.CORE_ALPHA + 2] = 0.0
    for first in (
        Slot.SKIN_ALPHA,
        Slot.FILTER_ALPHA,
        Slot.I_ALPHA,
        *(early_slot(channel) for channel in range(3)),
        *(Slot.MODES + 2 * k for k in range(CIRCUITS)),
    ):
        state[first], state[first + 1] = i_alpha, i_beta
    state[Slot.CORES], state[Slot.CORES + 1], state[Slot.CORES + 2] = phase_currents(
        complex(i_alpha, i_beta)
    )
    state[Slot.THETA], state[Slot.SPEED], state[Slot.LOAD_SPEED] = theta, speed, speed
    if b.bristle_stiffness and speed:  # it has turned so for long
        state[Slot.BENT] = math.copysign(sliding(b, speed) / b.bristle_stiffness, speed)
    state[Slot.OFFSET] = b.sampling_delay
    return state


def rotor_flux(b: SwitchedBench, state: Vector) -> tuple[float, float]:
    """Return phi_d, phi_q (Wb), the flux in the rotor frame less the constant magnet flux."""
    seen = complex(state[Slot.PSI_ALPHA], state[Slot.PSI_BETA]) * complex(
        math.cos(state[Slot.THETA]), -math.sin(state[Slot.THETA])
    )
    return seen.real - b.magnet_flux, seen.imag


@kernel
def misread(b, theta):
    """Return what the encoder errs by (rad, electrical) beside its offset: eccentricity, further
    orders of a turn, a resolver's error.

    A resolver's error of second order is resolver sin(2 theta_mech + phase) in mechanical rad, as
    of one pole pair.
    """
    turn, off = theta / b.pole_pairs, 0.0
    if b.eccentricity != 0.0:
        off += b.eccentricity * math.sin(turn + b.eccentricity_phase)
    if b.resolver != 0.0:
        off += b.pole_pairs * b.resolver * math.sin(2.0 * turn + b.resolver_phase)
    for k in range(len(b.wobble)):
        off += b.wobble[k] * math.sin(b.wobble_order[k] * turn + b.wobble_phase[k])
    return off


@kernel
def misread_slope(b, theta):
    """Return its slope by the electrical angle (rad/rad)."""
    turn = theta / b.pole_pairs
    slope = b.eccentricity / b.pole_pairs * math.cos(turn + b.eccentricity_phase)
    if b.resolver != 0.0:
        slope += 2.0 * b.resolver * math.cos(2.0 * turn + b.resolver_phase)
    for k in range(len(b.wobble)):
        order = b.wobble_order[k]
        slope += order * b.wobble[k] / b.pole_pairs * math.cos(order * turn + b.wobble_phase[k])
    return slope


@kernel
def encoder(b, theta):
    """Return the electrical angle as the encoder reads it: offset, what it errs by, nearest
    count."""
    read = theta + b.encoder_offset + misread(b, theta)
    return round(read / b.encoder_step) * b.encoder_step if b.encoder_step > 0.0 else read


@kernel
def sensor(b, current, gain, offset, rng):
    """Return one sensor's reading (A): curvature, gain, linearity, offset, noise, counts."""
    if b.curvature != 0.0:
        current *= 1.0 - b.curvature * current * current
    read = gain * current
    size = abs(read)
    read += read * size * (b.bend_2 + size * (b.bend_3 + size * b.bend_4)) + offset
    if b.noise > 0.0:
        read += b.noise * rng.standard_normal()
    return round(read / b.resolution) * b.resolution if b.resolution > 0.0 else read


@kernel
def sampled(state, b, mode, u_alpha, u_beta, u_dc, load_torque, acceleration, channel):
    """Return the current vector that the sensors hold for t_k as a channel reads it, before gain
    and noise."""
    late = state[Slot.OFFSET] + channel * b.channel_lag
    if late < 0.0:
        first = early_slot(channel)
        return complex(state[first], state[first + 1])
    at = state
    if late > 0.0:
        at = state[SIZE:]
        for k in range(SIZE):
            at[k] = state[k]
        at[Slot.OFFSET] = 0.0
        travel(at, b, mode, u_alpha, u_beta, u_dc, load_torque, acceleration, late)
    if b.filter_time > 0.0:
        return complex(at[Slot.FILTER_ALPHA], at[Slot.FILTER_BETA])
    return complex(at[Slot.I_ALPHA], at[Slot.I_BETA])


@kernel
def measure(state, b, mode, u_alpha, u_beta, u_dc, load_torque, acceleration, rng):
    """Return what the sensors read at t_k; the other arguments as `advance`.

    With jitter, the instant of the next sample is drawn here too, and sensors' cores follow the
    current: call it once a period, before `advance`.
    """
    i_a, i_b, i_c = phase_currents(
        sampled(state, b, mode, u_alpha, u_beta, u_dc, load_torque, acceleration, 0)
    )
    if b.channel_lag > 0.0:
        i_b = phase_currents(
            sampled(state, b, mode, u_alpha, u_beta, u_dc, load_torque, acceleration, 1)
        )[1]
        i_c = phase_currents(
            sampled(state, b, mode, u_alpha, u_beta, u_dc, load_torque, acceleration, 2)
        )[2]
    i_a, i_b, i_c = remembered(state, b, Slot.CORES, (i_a, i_b, i_c))
    i_a = sensor(b, i_a, b.gain_a, b.common_offset + b.offset_a, rng)
    i_b = sensor(b, i_b, b.gain_b, b.common_offset + b.offset_b, rng)
    i_c = sensor(b, i_c, b.gain_c, b.common_offset - b.offset_a - b.offset_b, rng)
    # to the first order in its age, as the plant's
    theta = encoder(b, state[Slot.THETA] - b.encoder_latency * b.pole_pairs * state[Slot.SPEED])
    if b.jitter > 0.0:
        half = 0.45 * b.period
        state[Slot.OFFSET] = min(
            max(b.sampling_delay + b.jitter * rng.standard_normal(), -half), half
        )
    return Reading(i_a, i_b, i_c, theta)


@kernel
def run(state, b, mode, u_alpha, u_beta, u_dc, load_torque, theta, speed, rng, out):
    """Replay commands into rows of PREDICTED.

    A DRIVEN rotor follows theta (rad, electrical) and speed (rad/s, mechanical) at each t_k.
    """
    last = len(u_alpha) - 1
    for k in range(last + 1):
        acceleration = 0.0
        if mode == Rotor.DRIVEN:
            state[Slot.THETA], state[Slot.SPEED] = theta[k], speed[k]
            acceleration = (speed[min(k + 1, last)] - speed[k]) / b.period
        read, row = (
            measure(
                state, b, mode, u_alpha[k], u_beta[k], u_dc[k], load_torque[k], acceleration, rng
            ),
            out[k],
        )
        row.i_a, row.i_b, row.i_c, row.theta = read.i_a, read.i_b, read.i_c, read.theta
        row.position, row.speed = state[Slot.THETA], state[Slot.SPEED]
        _, row.torque = current_and_torque(
            b, complex(state[Slot.PSI_ALPHA], state[Slot.PSI_BETA]), state[Slot.THETA]
        )
        advance(state, b, mode, u_alpha[k], u_beta[k], u_dc[k], load_torque[k], acceleration)


class Motion(NamedTuple):
    """How a rotor begins and what turns it.

    load_torque: N m; theta (rad, electrical; true, not the encoder's) and speed (rad/s,
    mechanical): initial values, of a driven rotor those at every sample; current: initial alpha,
    beta in A.
    """

    load_torque: ArrayLike = 0.0
    theta: ArrayLike = 0.0
    speed: ArrayLike = 0.0
    current: tuple[float, float] = (0.0, 0.0)


def replay(
    b: SwitchedBench,
    rotor: str,
    u_alpha: ArrayLike,
    u_beta: ArrayLike,
    u_dc: ArrayLike,
    *,
    seed: int = 0,
    **motion: Any,
) -> dict[str, Vector]:
    """Return predicted readings i_a, i_b, i_c (A), theta (rad), and the truth: position, speed,
    torque; per sample.

    rotor: 'locked', 'free' or 'driven'; u_alpha, u_beta, u_dc: (n,) V; motion: fields of `Motion`.
    Noise and counts are the bench's own: pass `quiet(b)` for a prediction.  BadInput for an unknown
    rotor or columns of different length.
    """
    m = Motion(**motion)
    if rotor not in MODES:
        raise unknown("rotor", rotor, MODES)
    n = len(np.atleast_1d(u_alpha))
    columns = {"u_alpha": u_alpha, "u_beta": u_beta, "u_dc": u_dc}
    columns |= {"load_torque": m.load_torque, "theta": m.theta, "speed": m.speed}
    spread = {name: _column(name, value, n) for name, value in columns.items()}
    state = start(b, float(spread["theta"][0]), float(spread["speed"][0]), *m.current)
    out = np.empty(n, PREDICTED)
    run(state, b, MODES[rotor], *spread.values(), np.random.default_rng(seed), out)
    return {name: out[name] for name in PREDICTED.names or ()}


def _column(name: str, value: ArrayLike, n: int) -> Vector:
    column = np.asarray(value, dtype=float)
    if column.ndim and column.shape != (n,):
        raise BadInput(
            f"column '{name}' has {column.shape} values, u_alpha has {n}; give one per sample"
        )
    # its own: `run` is compiled once more for each that is read-only
    return np.array(np.broadcast_to(column, (n,)))
