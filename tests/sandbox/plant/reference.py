"""The plant once more, readable: phase legs, edges and samples as events, SciPy's integrator
between them.

Same physics as `sandbox.plant.period` and none of its code; space vectors are complex numbers
alpha + j beta.

    i = exp(j theta) dH/dz + i_c,  i_c = e/R_c + I_x e/sqrt(|e| e_n) + I_h q/r
    z = exp(-j theta) psi - m,  m = phi_m + sum psi_d cos x + j psi_q sin x
    dpsi/dt = u - R i - R_1 (i - x) - phases(i),  tau_x dx/dt = i - x,  tau_f df/dt = i - f
    tau_c de/dt = dpsi/dt - e
    dq/dt = dpsi/dt, less q (q . dpsi/dt)/r^2 while |q| = r and q . dpsi/dt > 0
    torque = 3/2 p [Im(psi* (i - i_c)) + (i - i_c) . dm/dtheta - dH/dtheta]
    x = n theta + phase of every order
    H += sum gamma/2 Re(z^2 exp(-j x)) + back/2 Re(z^2 exp(j x)) + pulse/2 |z|^2 cos x +
        cos x (alpha_30 d^3 + alpha_12 d q^2) + sin x (alpha_21 d^2 q + alpha_03 q^3)

A winding with layers drops R_1 times Dowell's formula in place of R_1 (i - x): a ladder of
inductances and resistances for each of its functions, from their continued fractions (`ladder`).

A commanded edge is taken at its instant; what the leg does then stands in `reference_legs`.  What
is sampled is f, or i where there is no filter, handed to the sensors.  Slow (about 10 ms a period):
for tests, and to be read.
"""

from __future__ import annotations

import cmath
import heapq
import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from scipy.integrate import solve_ivp
from scipy.optimize import root

from model.effects.card import flux_scale
from model.effects.friction_torque import CORNERS, TORQUES, reference
from model.effects.leg_voltage import VOLTS, corners
from model.inverter_table import Points
from model.parameters import Motor
from model.spline import SplineEnergy
from tests.sandbox.plant.reference_legs import LEVEL, A, Commutating, Late, Legs

Array = NDArray[np.float64]
# places in the state
PSI, SLOPE, SLOW, FILTER, THETA, OMEGA, LOAD_OMEGA, TWIST = 0, 2, 4, 6, 8, 9, 10, 11
BENT, AHEAD = 12, 13
FULL = 1.0 - 1e-9  # of a play's radius: there it slides, and is drawn to the radius from both sides
LADDERS = LEVEL + 3
CELLS = 5  # of each ladder: as close as Pade's approximant with so many poles


@dataclass
class Reference:
    """A motor with completed effects `v` (public names, `bench.*` too) on an inverter of given
    period (s) and link (V).

    trajectory: rotor angle (rad electrical) and speed (rad/s electrical) by time; None: the rotor
    moves by its torque.
    load: N m asked of the load machine, by time; table: a leg's voltage error (V) against its
    current (A), measured.
    """

    motor: Motor
    v: Mapping[str, float]
    period: float
    link: float
    trajectory: Callable[[float], tuple[float, float]] | None = None
    load: Callable[[float], float] = lambda t: 0.0
    table: Points | None = None
    link_sag: float = 0.0  # V that the link sags by
    source: Array | None = None  # its dip (V), and what feeds it times the impedance (V)
    legs: Commutating | None = None  # what moves legs between their switches

    def gradient(self, z: complex) -> complex:
        """Return dH/dd + j dH/dq (A) of the motor's own energy at the flux due to currents (Wb)."""
        d, q, m, v = z.real, z.imag, self.motor, self.v
        if self.flux_map is not None:
            return map_gradient(self.flux_map, d, q)
        a = {n: v[f"saturation.alpha_{n}"] for n in ("30", "12", "40", "22", "04")}
        i_d = d / (v["inductance.scale_d"] * m.inductance_d) + 3.0 * a["30"] * d**2 + a["12"] * q**2
        i_q = (
            q / (v["inductance.scale_q"] * m.inductance_q)
            + 2.0 * a["12"] * d * q
            + 4.0 * a["04"] * q**3
        )
        return complex(
            i_d + 4.0 * a["40"] * d**3 + 2.0 * a["22"] * d * q**2, i_q + 2.0 * a["22"] * d**2 * q
        )

    def machine(self, psi: complex, theta: float) -> tuple[complex, float]:
        """Return the magnetising current (A) and the air-gap torque (N m)."""
        v, e, slope, turning = self.v, cmath.exp(1j * theta), 0j, 0.0
        m = complex(v["magnet_flux.magnet_flux"])
        for n, phase, psi_d, psi_q in self.flux_orders:
            x = n * theta + phase
            m += complex(psi_d * math.cos(x), psi_q * math.sin(x))
            slope += n * complex(-psi_d * math.sin(x), psi_q * math.cos(x))
        z = psi / e - m
        i = self.gradient(z)
        for n, phase, *sizes in self.inductance_orders:
            own, bent = harmonic_energy(z, cmath.exp(1j * (n * theta + phase)), *sizes)
            i, turning = i + own, turning + n * bent
        torque = ((psi / e).conjugate() * i).imag + (i.conjugate() * slope).real - turning
        return i * e, 1.5 * self.motor.pole_pairs * torque

    @cached_property
    def flux_map(self) -> SplineEnergy | None:
        """The motor's flux map, if it has one."""
        return m if isinstance(m := self.motor.energy, SplineEnergy) else None

    @cached_property
    def flux_orders(self) -> list[tuple[float, ...]]:
        """Order, phase (rad), amplitudes on d and q of every harmonic of the flux."""
        v = self.v
        sixth = (6.0, 0.0, v["flux_harmonics.psi_d6"], v["flux_harmonics.psi_q6"])
        return self.present([*self.orders("flux_harmonics", "psi_d", "psi_q"), sixth])

    @cached_property
    def inductance_orders(self) -> list[tuple[float, ...]]:
        """Order, phase (rad) and sizes of every harmonic of the inductances."""
        sizes = ("gamma", "back", "pulse", "alpha_30", "alpha_12", "alpha_21", "alpha_03")
        sixth = (6.0, 0.0, self.v["inductance_harmonics.gamma_6"], *[0.0] * 6)
        return self.present([*self.orders("inductance_harmonics", *sizes), sixth])

    @cached_property
    def teeth(self) -> list[tuple[float, ...]]:
        """Amplitude (N m), order a turn, phase (rad) of every order of cogging."""
        places = ("", "2.", "3.", "4.", "5.", "6.")
        return [
            tuple(self.v[f"cogging_torque.{k}{x}"] for x in ("amplitude", "order_mech", "phase"))
            for k in places
        ]

    @cached_property
    def leg_curve(self) -> list[tuple[float, float]]:
        """Volts, and the current (A) up to which they grow, of every part of a leg's curve that is
        there."""
        volts = [self.v[f"leg_voltage.{n}"] for n in VOLTS]
        ends = (float(c) for c in corners(self.v, self.motor))
        return [(u, c) for u, c in zip(volts, ends, strict=True) if u]

    @cached_property
    def rubbing(self) -> list[tuple[float, float]]:
        """Torque (N m), and the speed (rad/s, mechanical) up to which it grows, of every part of
        friction's curve that is there."""
        torques = [self.v[f"friction_torque.{n}"] for n in TORQUES]
        own = reference(self.v, self.motor)
        return [(t, c * own) for t, c in zip(torques, CORNERS, strict=True) if t]

    def bent(self, i: float) -> float:
        """Return what a sensor reads at a current (A) by its linearity error."""
        x = abs(i) / (self.v["current_linearity.reference"] or self.motor.rated_current)
        terms = enumerate(("second", "third", "fourth"), 1)
        return i + i * sum(self.v[f"current_linearity.{n}"] * x**k for k, n in terms)

    def orders(self, effect: str, *sizes: str) -> list[tuple[float, ...]]:
        """Return order, phase (rad) and sizes of all further harmonics of an effect."""
        return [
            tuple(self.v[f"{effect}.{k}.{n}"] for n in ("order", "phase", *sizes))
            for k in range(2, 7)
        ]

    def present(self, orders: list[tuple[float, ...]]) -> list[tuple[float, ...]]:
        """Return those that have a size."""
        return [one for one in orders if any(one[2:])]

    def phases(self, i: complex) -> complex:
        """Return the vector of what the phases lose one by one (V)."""
        v, lost = self.v, 0j
        for k, own in enumerate(
            (v["winding_asymmetry.delta_a"], v["winding_asymmetry.delta_b"], 0.0)
        ):
            x = (i * A ** (-k)).real
            r = v["device_drop.on_resistance"] + own
            own_volts = v["device_drop.threshold"] * self.device(x) + r * x
            own_volts += sum(u * min(max(x / c, -1.0), 1.0) for u, c in self.leg_curve)
            if self.table:
                amps, volts = np.array(self.table).T
                own_volts += math.copysign(float(np.interp(abs(x), amps, volts)), x)
            lost += (2.0 / 3.0) * A**k * own_volts
        return lost

    def device(self, current: float) -> float:
        """Return what a leg's devices drop at a current (A), in thresholds."""
        if knee := self.v["device_drop.knee_current"]:
            return math.copysign(1.0 - math.exp(-abs(current) / knee), current)
        return self.sign(current)

    def sign(self, current: float) -> float:
        """Return the soft sign of a leg's current (A)."""
        x, shape = current / self.v["bench.soft_current"], self.v["bench.soft_shape"]
        return (1.0 - shape) * min(max(x, -1.0), 1.0) + shape * math.tanh(x)

    def supply(self, t: float) -> float:
        """Return the link's voltage (V)."""
        v, ripple = self.v, 0.0
        if v["dc_link_ripple.amplitude"]:
            angle = math.tau * v["dc_link_ripple.frequency"] * t + v["dc_link_ripple.phase"]
            ripple = v["dc_link_ripple.amplitude"] * math.sin(angle)
        return (1.0 + v["dc_link_error.gain_error"]) * self.link - self.link_sag + ripple

    def voltage(self, t: float, y: Array) -> complex:
        """Return the vector of the legs' voltages (V)."""
        levels = y[LEVEL:LADDERS]
        return (
            (2.0 / 3.0)
            * self.supply(t)
            * sum(complex(level) * A**k for k, level in enumerate(levels))
        )

    def rotor(self, t: float, y: Array) -> tuple[float, float]:
        """Return the rotor's angle (rad electrical) and speed (rad/s electrical)."""
        return (
            self.trajectory(t) if self.trajectory else (y[THETA], self.motor.pole_pairs * y[OMEGA])
        )

    def current(self, t: float, y: Array) -> complex:
        """Return the terminal current (A)."""
        return self.machine(two(y, PSI), self.rotor(t, y)[0])[0] + self.core(y)

    def core(self, y: Array) -> complex:
        """Return the iron-loss current (A)."""
        v, e, flux = self.v, two(y, SLOPE), flux_scale(self.motor)
        rated = self.motor.rated_omega * flux
        # the root begins straight, within 1e-4 of the rated slope
        root = (abs(e) ** 2 + (1e-4 * rated) ** 2) ** 0.25
        i = e / v["iron_loss.core_resistance"]
        i += v["iron_loss.excess_current"] * e / (root * math.sqrt(rated))
        reach = v["iron_loss.hysteresis_reach"] * flux
        return i + v["iron_loss.hysteresis_current"] * two(y, AHEAD) / reach

    def slides(self, q: complex, d_psi: complex) -> complex:
        """Return the slope (V) of the flux ahead of that held, q (Wb)."""
        reach = self.v["iron_loss.hysteresis_reach"] * flux_scale(self.motor)
        pulls = (q.conjugate() * d_psi).real
        return d_psi - q * pulls / reach**2 if abs(q) >= FULL * reach and pulls > 0.0 else d_psi

    def slopes(self, t: float, y: Array, algebra: bool = True) -> Array:
        """Return the state's time derivative; algebra: floating legs without capacitance find their
        levels first."""
        v, out = self.v, np.zeros_like(y)
        if self.legs and algebra:
            y = self.legs.settled(t, y)
            out[LEVEL:LADDERS] = self.legs.moves(t, y)
        magnetising, torque = self.machine(two(y, PSI), self.rotor(t, y)[0])
        i = magnetising + self.core(y)
        fast = i - two(y, SLOW)
        d_psi = self.voltage(t, y) - v["stator_resistance.resistance"] * i - self.phases(i)
        d_psi -= v["skin_effect.resistance"] * (self.layers(i, y, out) if self.layered else fast)
        put(out, PSI, d_psi)
        if math.isfinite(v["iron_loss.core_resistance"]) or v["iron_loss.excess_current"]:
            put(out, SLOPE, (d_psi - two(y, SLOPE)) / v["iron_loss.time_constant"])
        if v["iron_loss.hysteresis_current"]:
            put(out, AHEAD, self.slides(two(y, AHEAD), d_psi))
        put(out, SLOW, fast / v["skin_effect.time_constant"])
        if v["current_filter.time_constant"]:
            put(out, FILTER, (i - two(y, FILTER)) / v["current_filter.time_constant"])
        if not self.trajectory:
            out[THETA] = self.motor.pole_pairs * y[OMEGA]
            out[OMEGA:AHEAD] = self.shaft(t, y, torque)
        return out

    @property
    def layered(self) -> bool:
        """Whether the winding has layers."""
        return self.v["skin_effect.layers"] > 0.0

    @property
    def longest(self) -> float:
        """The longest step (s) at which the integrator does not leave its bounds before it notices:
        the fastest cell has 5000/T (found), DOP853 is stable up to 6."""
        return 1e-3 * math.pi**2 * self.v["skin_effect.time_constant"] if self.layered else math.inf

    def layers(self, i: complex, y: Array, out: Array) -> complex:
        """Return what Dowell's formula has of a current (A) beside 1 (V by 1 ohm), and write the
        slopes of its ladders: x coth x = 1 + y/(3 + y/(5 + ...)), y = x^2 = s T; x tanh(x/2) =
        2 u/(1 + u/(3 + ...)), u = y/4."""
        v = self.v
        whole = math.pi**2 * v["skin_effect.time_constant"]
        more = 4.0 / 3.0 * (v["skin_effect.layers"] ** 2 - 1.0)
        one = ladder(i, y, out, LADDERS, 3, whole)
        return one + more * ladder(i, y, out, LADDERS + 2 * CELLS, 1, 0.25 * whole)

    def shaft(self, t: float, y: Array, torque: float) -> tuple[float, float, float, float]:
        """Return accelerations of motor and load (rad/s^2), the slopes of the twist and of the
        bristles' bend, all mechanical."""
        v, omega, load_omega = self.v, y[OMEGA], y[LOAD_OMEGA]
        dry, bending = self.dry(omega, y[BENT])
        net = torque
        for size, n, phase in self.teeth:
            net += size * math.sin(n * y[THETA] / self.motor.pole_pairs + phase)
        net -= v["viscous_friction.coefficient"] * omega + dry
        net -= sum(t * min(max(omega / w, -1.0), 1.0) for t, w in self.rubbing)
        load = self.load(t) * (1.0 + v["bench.load_torque_gain"]) + v["bench.load_torque_offset"]
        j, j_l, k = (
            v["inertia.inertia"],
            v["shaft_compliance.load_inertia"],
            v["shaft_compliance.stiffness"],
        )
        if not (j_l and math.isfinite(k)):
            return (net - load) / j, (net - load) / j, 0.0, bending
        damping = 2.0 * v["shaft_compliance.damping_ratio"] * math.sqrt(k * (j - j_l) * j_l / j)
        half = 0.5 * v["shaft_compliance.backlash"]
        wound = y[TWIST] - min(max(y[TWIST], -half), half)
        through = k * wound + (damping * (omega - load_omega) if wound or not half else 0.0)
        return (net - through) / (j - j_l), (through - load) / j_l, omega - load_omega, bending

    def dry(self, omega: float, z: float) -> tuple[float, float]:
        """Return the torque (N m) of dry friction at a speed (rad/s) and a bend (rad) of its
        bristles, and the bend's slope (rad/s)."""
        v = self.v
        torque, more, hump, width, bend = (
            v[f"coulomb_friction.{n}"]
            for n in ("torque", "stribeck_torque", "stribeck_speed", "width", "presliding")
        )
        level = torque + more * math.exp(-((omega / hump) ** 2))
        if not bend:
            return level * math.tanh(omega / width), 0.0
        stiff, load = (torque + more) / bend, v["shaft_compliance.load_inertia"]
        damping = 2.0 * v["coulomb_friction.presliding_damping"]
        damping *= math.sqrt(stiff * (v["inertia.inertia"] - load))
        slope = omega - stiff * abs(omega) * z / level if level else omega
        return stiff * z + damping * slope, slope

    def start(self, theta: float = 0.0, current: complex = 0j) -> Array:
        """Return the state at rest at an angle (rad electrical) and a terminal current (A)."""

        def miss(x: Array) -> Array:
            """Return by how much the current misses at a flux."""
            left = self.machine(complex(*x), theta)[0] - current
            return np.array([left.real, left.imag])

        # what is always 0 would make the integrator's norm, a mean, less strict
        size = LADDERS + (4 * CELLS if self.layered else 0)
        y, zero = np.zeros(size), self.v["magnet_flux.magnet_flux"] * cmath.exp(1j * theta)
        put(y, PSI, complex(*root(miss, [zero.real, zero.imag], tol=1e-14).x))
        ladders = (LADDERS, LADDERS + 2 * CELLS) if self.layered else ()
        for first in (SLOW, FILTER, *ladders):
            put(y, first, current)
        y[THETA] = theta
        return y

    def run(self, duty: Array, y: Array) -> tuple[Array, Array]:
        """Return readings (n, 3) in A for t_k and states (n, m) at t_k under duties (n, 3) of
        the periods from t_k on.

        y: the state at the first pattern's start, which is later than t_0 by the delay of the
        pattern.
        """
        n, v, t = len(duty), self.v, self.v["pwm_delay.delay"]
        readings, states = np.tile(self.read(t, y), (n, 1)), np.tile(y, (n, 1))
        real = v["dead_time.time"] > 0.0 and v["dead_time.capacitance"]
        pulses: Legs = Commutating(self) if real else Late(self)
        events: list[tuple[float, str, int, int]] = []
        for k in range(n):
            for when, kind in ((k * self.period + t, "pattern"), (k * self.period, "state")):
                heapq.heappush(events, (when, kind, k, 0))
            for m in range(3):
                late = v["current_sampling.delay"] + m * v["current_sampling.channel_lag"]
                heapq.heappush(events, (k * self.period + late, "sample", k, m))
        while events:
            when, kind, k, leg = heapq.heappop(events)
            if when > t:
                y, t = pulses.go(t, y, when), when
            if kind == "pattern":
                i, d = self.current(t, y), duty[k]
                drawn = sum(d[m] * (i * A ** (-m)).real for m in range(3))
                self.link_sag = self.sags(drawn)
                for edge in pulses.commanded(t, d):
                    heapq.heappush(events, edge)
            elif kind in ("fall", "rise"):
                heapq.heappush(events, pulses.taken(t, y, leg, kind))
            elif kind == "z act":
                pulses.act(y, leg, k)
            elif kind == "state":
                states[k] = y
            else:
                readings[k, leg] = self.read(t, y)[leg]
        return readings, states

    def sags(self, drawn: float) -> float:
        """Return by how much the link sags (V) in the middle of a period that draws a mean current
        (A); of a source with an inductance, whose circuit is integrated over the period."""
        v = self.v
        ohm, sag = v["dc_link_error.impedance"], v["dc_link_error.sag"]
        if not ohm:
            return sag * drawn
        w = math.tau * v["dc_link_error.resonance"]
        if self.source is None:
            self.source = np.array([sag * drawn, ohm * drawn])
        ends = solve_ivp(
            lambda _, x: (w * (ohm * drawn - x[1]), w * (x[0] - sag / ohm * x[1])),
            (0.0, self.period),
            self.source,
            t_eval=(0.5 * self.period, self.period),
            rtol=1e-10,
            atol=1e-12,
        ).y
        self.source = ends[:, 1]
        return float(ends[0, 0])

    def read(self, t: float, y: Array) -> Array:
        """Return what the three sensors read (A)."""
        v = self.v
        i = two(y, FILTER) if v["current_filter.time_constant"] else self.current(t, y)
        off = [v["current_offset.offset_a"], v["current_offset.offset_b"]]
        off.append(-sum(off))
        gain = [v[f"current_gain.gain_{x}"] for x in "abc"]
        phases = [self.bent(gain[k] * (i * A ** (-k)).real) for k in range(3)]
        return np.array([phases[k] + off[k] + v["bench.common_offset"] for k in range(3)])


def ladder(i: complex, y: Array, out: Array, first: int, least: int, whole: float) -> complex:
    """Return what a current drops across a/b_0 in parallel with b_1 in series with (a/b_2 in
    parallel with ...), a = s whole an inductance, b = least, least + 2, ...: a/(b_0 + a/(b_1 +
    ...)); the state is the currents of the inductances, whose slopes are written."""
    through = [i]
    for k in range(CELLS):
        through.append(through[-1] - two(y, first + 2 * k))
    drop = 0j
    for k in reversed(range(CELLS)):
        odd = least + 4 * k
        drop += (odd + 2) * through[k + 1]
        put(out, first + 2 * k, odd * drop / whole)
    return drop


def harmonic_energy(
    z: complex, u: complex, gamma: float, back: float, pulse: float, *alphas: float
) -> tuple[complex, float]:
    """Return the current (A) and dH/dx (J) that one order of the inductances has at a flux z (Wb);
    u = exp(j x)."""
    d, q, (a_30, a_12, a_21, a_03) = z.real, z.imag, alphas
    i = (gamma * u + back / u) * z.conjugate() + pulse * u.real * z
    i += u.real * complex(3.0 * a_30 * d**2 + a_12 * q**2, 2.0 * a_12 * d * q)
    i += u.imag * complex(2.0 * a_21 * d * q, a_21 * d**2 + 3.0 * a_03 * q**2)
    turning = 0.5 * (
        gamma * (z * z / u).imag - back * (z * z * u).imag - pulse * u.imag * abs(z) ** 2
    )
    turning += u.real * (a_21 * d**2 * q + a_03 * q**3) - u.imag * (a_30 * d**3 + a_12 * d * q**2)
    return i, turning


def two(y: Array, first: int) -> complex:
    """Return two numbers of the state as a vector."""
    return complex(y[first], y[first + 1])


def put(y: Array, first: int, value: complex) -> None:
    """Write a vector to two numbers of the state."""
    y[first], y[first + 1] = value.real, value.imag


def map_gradient(m: SplineEnergy, d: float, q: float) -> complex:
    """Return dH/dd + j dH/dq (A) of a flux map by NumPy's polynomials; inside its box."""
    x, y = (d - m.low_d) * m.per_d, (q - m.low_q) * m.per_q
    i, j = int(x), int(y)
    powers_x, powers_y = (x - i) ** np.arange(5), (y - j) ** np.arange(5)
    slope_x, slope_y = (
        np.arange(5) * np.append(0.0, powers[:4]) for powers in (powers_x, powers_y)
    )
    cell = m.cells[i, j]
    return complex(slope_x @ cell @ powers_y * m.per_d, powers_x @ cell @ slope_y * m.per_q)
