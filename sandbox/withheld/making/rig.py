"""A simple field-oriented controller around the switched bench, on the encoder's angle: what
records a withheld cycle.

It knows readings and the believed motor only.  A command computed from the sample at t_k acts from
t_k+1 on. Current control is proportional-integral in the measured rotor frame (injection averaged
out over its period), speed control likewise on the encoder's difference over two milliseconds.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.random import Generator
from numpy.typing import NDArray

from model.array_types import Array
from model.compiled import kernel
from model.errors import PhysicsError
from model.parameters import Drive, Motor, Rotor
from sandbox.switched.advance import MODES, measure, start
from sandbox.switched.bench_numbers import SwitchedBench
from sandbox.switched.bench_state import Slot
from sandbox.switched.inverter import advance
from sandbox.withheld.making.cycles import FIRST, KIND, SECOND, SPEED, VOLTAGE, Cycle

WINDOW = 0.002  # s over which the encoder's difference gives speed
ROOM = 64  # samples a window may have
SPEED_LAG = 2.5e-3  # s
RECORDED = np.dtype(
    [(name, np.float64) for name in ("u_alpha", "u_beta", "i_a", "i_b", "i_c", "theta")], align=True
)
REFERENCE_LAG = 4e-3  # s, of the current asked for
RAMP = 0.5  # of what rated torque could do
CURRENT_LIMIT = 1.8  # times rated current, for speed control
AXES = {"none": 0.0, "d": 1.0, "q": 2.0}


class Tuning(NamedTuple):
    """Gains of the controller (SI), the injection as samples a period, amplitude in V and axis (0
    none, 1 d, 2 q)."""

    period: float
    pole_pairs: float
    gain_d: float  # V/A
    gain_q: float
    integral: float  # V/(A s)
    speed_gain: float  # A s/rad electrical
    speed_integral: float
    ramp: float  # rad/s^2 electrical, of the speed asked for
    current_limit: float
    voltage_limit: float
    magnet_flux: float
    inductance_d: float
    inductance_q: float
    window: int
    injection_samples: int
    injection: float
    axis: float


def tuned(drive: Drive, believed: Motor, axis: str, rng: Generator) -> Tuning:
    """Return a controller for a recording, its bandwidths drawn; slower where injection runs beside
    it."""
    period = drive.converter.sampling_period
    bandwidth = math.tau * (rng.uniform(60.0, 110.0) if axis == "none" else rng.uniform(12.0, 22.0))
    rate = math.tau * rng.uniform(3.0, 6.0)
    to_current = (
        believed.inertia / believed.pole_pairs / (1.5 * believed.pole_pairs * believed.magnet_flux)
    )
    return Tuning(
        period,
        float(believed.pole_pairs),
        bandwidth * believed.inductance_d,
        bandwidth * believed.inductance_q,
        bandwidth * believed.resistance,
        1.6 * rate * to_current,
        rate * rate * to_current,
        RAMP * believed.rated_torque * believed.pole_pairs / believed.inertia,
        CURRENT_LIMIT * believed.rated_current,
        0.92 * drive.converter.voltage_limit,
        believed.magnet_flux,
        believed.inductance_d,
        believed.inductance_q,
        min(round(WINDOW / period), ROOM - 1),
        round(1.0 / (drive.injection.frequency * period)),
        drive.injection.amplitude,
        AXES[axis],
    )


@kernel
def limited(x, y, bound):
    """Return a vector shortened to a length, and the share kept."""
    size = math.hypot(x, y)
    if size <= bound:
        return x, y, 1.0
    return x * bound / size, y * bound / size, bound / size


@kernel
def averaged(ring, k, samples, i_d, i_q):
    """Return the mean current over the last period of injection; ring: (2, ROOM)."""
    ring[0, k % samples], ring[1, k % samples] = i_d, i_q
    n = min(k + 1, samples)
    return np.sum(ring[0, :n]) / n, np.sum(ring[1, :n]) / n


@kernel
def run_cycle(x, b, rotor, g, u_dc, plan, angle, speed, load, rng, out):
    """Run a cycle; out: (n,) of RECORDED; return the samples done (fewer where the state is no
    longer finite).

    u_dc: (n,) V as read; plan: (n, 4); angle, speed: imposed motion (rad electrical, rad/s
    mechanical); load: (n,) torque that really acts, N m.
    """
    n = len(plan)
    currents, angles = np.zeros((2, ROOM)), np.zeros(ROOM)
    u_alpha = u_beta = sum_d = sum_q = omega = sum_speed = want_d = want_q = wanted = 0.0
    samples = g.injection_samples if g.axis > 0.0 else 1
    for k in range(n):
        acceleration = 0.0
        if rotor == Rotor.DRIVEN:
            x[Slot.THETA], x[Slot.SPEED] = angle[k], speed[k]
            acceleration = (speed[min(k + 1, n - 1)] - speed[k]) / g.period
        held, row = (
            measure(x, b, rotor, u_alpha, u_beta, u_dc[k], load[k], acceleration, rng),
            out[k],
        )
        i_a, i_b, i_c, theta = held.i_a, held.i_b, held.i_c, held.theta
        row.u_alpha, row.u_beta, row.i_a, row.i_b, row.i_c, row.theta = (
            u_alpha,
            u_beta,
            i_a,
            i_b,
            i_c,
            theta,
        )
        i_alpha, i_beta = (2.0 * i_a - i_b - i_c) / 3.0, (i_b - i_c) / math.sqrt(3.0)
        c, s = math.cos(theta), math.sin(theta)
        i_d, i_q = averaged(
            currents, k, samples, c * i_alpha + s * i_beta, c * i_beta - s * i_alpha
        )
        back = min(k, g.window)
        if back > 0:
            difference = (theta - angles[(k - back) % ROOM]) / (back * g.period)
            omega += (difference - omega) * g.period / SPEED_LAG
        angles[k % ROOM] = theta
        kind, first, second = plan[k, KIND], plan[k, FIRST], plan[k, SECOND]
        u_d, u_q = first, second
        if kind != VOLTAGE:
            ask_d, ask_q = first, second
            if kind == SPEED:
                wanted += min(max(first - wanted, -g.ramp * g.period), g.ramp * g.period)
                miss = wanted - omega
                want = g.speed_gain * miss + sum_speed
                ask_d, ask_q = 0.0, min(max(want, -g.current_limit), g.current_limit)
                if want == ask_q:
                    sum_speed += g.speed_integral * miss * g.period
            want_d += (ask_d - want_d) * g.period / REFERENCE_LAG
            want_q += (ask_q - want_q) * g.period / REFERENCE_LAG
            e_d, e_q = want_d - i_d, want_q - i_q
            u_d = g.gain_d * e_d + sum_d - omega * g.inductance_q * i_q
            u_q = g.gain_q * e_q + sum_q + omega * (g.inductance_d * i_d + g.magnet_flux)
            u_d, u_q, kept = limited(u_d, u_q, g.voltage_limit)
            if kept == 1.0:
                sum_d, sum_q = (
                    sum_d + g.integral * e_d * g.period,
                    sum_q + g.integral * e_q * g.period,
                )
        if g.axis > 0.0:
            wave = g.injection if (k + 1) % samples < samples // 2 else -g.injection
            u_d, u_q = (
                u_d + (wave if g.axis == 1.0 else 0.0),
                u_q + (wave if g.axis == 2.0 else 0.0),
            )
        advance(x, b, rotor, u_alpha, u_beta, u_dc[k], load[k], acceleration)
        if not math.isfinite(x[Slot.PSI_ALPHA] + x[Slot.PSI_BETA] + x[Slot.THETA]):
            return k
        ahead = theta + 1.5 * omega * g.period
        c, s = math.cos(ahead), math.sin(ahead)
        u_alpha, u_beta, _ = limited(c * u_d - s * u_q, s * u_d + c * u_q, g.voltage_limit)
    return n


def record(
    b: SwitchedBench,
    cycle: Cycle,
    tuning: Tuning,
    theta: float,
    load: Array,
    u_dc: Array,
    seed: int,
) -> NDArray[np.void]:
    """Return a recorded cycle (n,) of RECORDED; theta: true angle at the start, rad.

    load: (n,) N m that really acts; u_dc: (n,) V as read.  PhysicsError where the bench's equations
    blow up.
    """
    n = len(cycle.plan)
    angle = theta + tuning.period * np.concatenate(
        [[0.0], np.cumsum(0.5 * (cycle.speed[1:] + cycle.speed[:-1]))]
    )
    speed = cycle.speed / tuning.pole_pairs
    state = start(b, theta, float(speed[0]))
    out = np.empty(n, RECORDED)
    rng = np.random.default_rng(seed)
    done = run_cycle(
        state, b, MODES[cycle.rotor], tuning, u_dc, cycle.plan, angle, speed, load, rng, out
    )
    if done < n:
        raise PhysicsError(
            f"{cycle.file}: the switched bench is not finite after {done} of {n} samples"
        )
    return out
