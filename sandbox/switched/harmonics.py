"""Parts of the machine that repeat with the angle, in any orders: sums beside the sixth of the
effect library.

theta is the electrical, Theta the mechanical angle; everything in the rotor frame.

- Flux: h(theta) = sum [psi_d cos(n theta + phase) + j psi_q sin(n theta + phase)] (1 + k |z_0|^2),
  where z_0 = psi e^{-j theta} - phi_m is the flux that currents cause, harmonics not taken off.
  The energy is H(z) of z = z_0 - h, so the amplitude grows with the current that goes with z_0;
  current and torque derive from that energy: with g = 2 dH/dz* (the current of a machine at z) and
  G = sum k [psi_d cos + j psi_q sin],

      i = g - 2 Re(g* G) z_0,   torque = 3/2 p [Re(g* s) - dH/dtheta at constant z e^{j theta}],
      s = j phi_m + h' + j h - 2 phi_m Im(z_0) G   (h' at constant z_0)

  Growth with the square keeps H smooth at zero flux; k = growth / (flux of rated current)^2.
- Inductance: H += sum [gamma/2 Re(z^2 e^{-j x}) + back/2 Re(z^2 e^{j x}) + pulse/2 |z|^2 cos x],
  x = n theta + phase. gamma is an inductance ellipse that turns by n/2 against the rotor (the
  effect library's gamma_6 has n = 6), back one that turns the other way, pulse one that breathes.
  What saturation adds, of third degree: cos x Re(c_3 z^3 + c_1 z |z|^2) + sin x Im(s_3 z^3 + s_1
  z |z|^2), with 4 c_3 = alpha_30 - alpha_12, 4 c_1 = 3 alpha_30 + alpha_12, 4
  s_3 = alpha_21 - alpha_03, 4 s_1 = alpha_21 + 3 alpha_03.
- Cogging: torque sum A sin(n Theta + phase), potential sum A/n cos(n Theta + phase).
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np

from model.compiled import inlined, kernel
from model.errors import BadInput
from model.parameters import Motor

MOST_TURNS = 1e4  # order


class FluxHarmonic(NamedTuple):
    """One order of the magnet's flux: amplitudes in Wb, phase in rad, their growth at the flux of
    rated current."""

    order: float
    psi_d: float = 0.0
    psi_q: float = 0.0
    phase: float = 0.0
    growth: float = 0.0


class InductanceHarmonic(NamedTuple):
    """One order of the inverse inductance, electrical: phase in rad; parts that turn with it,
    breathe and turn against it, in 1/H; what saturation adds, in A/Wb^2."""

    order: float
    gamma: float = 0.0
    pulse: float = 0.0
    phase: float = 0.0
    back: float = 0.0
    alpha_30: float = 0.0
    alpha_12: float = 0.0
    alpha_21: float = 0.0
    alpha_03: float = 0.0


class CoggingHarmonic(NamedTuple):
    """One order of the cogging torque, mechanical: amplitude in N m, phase in rad."""

    order: float
    amplitude: float = 0.0
    phase: float = 0.0


class Harmonics(NamedTuple):
    """The lists as kernels read them: records of the three kinds above, growth in 1/Wb^2."""

    flux: Any
    inductance: Any
    cogging: Any


def _records(kind: Any, rows: Sequence[Any]) -> Any:
    return np.array(
        [tuple(row) for row in rows], dtype=[(name, np.float64) for name in kind._fields]
    )


def harmonics(
    motor: Motor,
    flux: Sequence[FluxHarmonic] = (),
    inductance: Sequence[InductanceHarmonic] = (),
    cogging: Sequence[CoggingHarmonic] = (),
) -> Harmonics:
    """Return the lists for a bench (`bench(...)._replace(harmonics=...)`); the effect library's are
    beside them.

    BadInput for a value that is not finite, an order of cogging below 1, and amplitudes that no
    motor of this kind can have: flux harmonics together (grown) not below the magnet's flux or,
    without a magnet, the flux
    of rated current; inductance harmonics together (`largest_swing`) not below the least inverse
    inductance.
    """
    for kind in (*flux, *inductance, *cogging):
        _check_finite(kind)
    for one in cogging:
        if one.order < 1.0:
            raise BadInput(
                f"cogging harmonic of order {one.order:g} has no potential; give an order from 1 on"
            )
    rated = math.sqrt(motor.inductance_d * motor.inductance_q) * motor.rated_current
    grown = sum(max(abs(f.psi_d), abs(f.psi_q)) * max(1.0, abs(1.0 + f.growth)) for f in flux)
    swing = sum(largest_swing(g, motor) for g in inductance)
    check_below("flux harmonics together", grown, max(motor.magnet_flux, rated), "Wb")
    least = min(1.0 / motor.inductance_d, 1.0 / motor.inductance_q)
    check_below(
        "inductance harmonics together", swing, least, "1/H, where the energy is not convex"
    )
    scaled = [f._replace(growth=f.growth / rated**2) for f in flux]
    return Harmonics(
        _records(FluxHarmonic, scaled),
        _records(InductanceHarmonic, inductance),
        _records(CoggingHarmonic, cogging),
    )


def largest_swing(one: InductanceHarmonic, motor: Motor) -> float:
    """Return the largest size (1/H) of what a harmonic adds to the energy's second derivatives,
    over all angles, without current and at the flux L i of rated current, on a grid of its
    directions (within 0.2 %).

    Along a direction (c, s) the second derivative is c^2 H_dd + 2 c s H_dq + s^2 H_qq, the parts
    with the cosine and the sine of x apart; the root of their squares is reached at some angle.
    """
    around = np.arange(0.0, math.tau, math.tau / 144)
    d = np.append(0.0, motor.inductance_d * motor.rated_current * np.cos(around))[:, None]
    q = np.append(0.0, motor.inductance_q * motor.rated_current * np.sin(around))[:, None]
    c, s = np.cos(around), np.sin(around)
    cosine = (one.gamma + one.back) * (c * c - s * s) + one.pulse
    cosine = (
        cosine + 6.0 * one.alpha_30 * d * c * c + one.alpha_12 * (4.0 * q * c * s + 2.0 * d * s * s)
    )
    sine = 2.0 * (one.gamma - one.back) * c * s
    sine = (
        sine + one.alpha_21 * (2.0 * q * c * c + 4.0 * d * c * s) + 6.0 * one.alpha_03 * q * s * s
    )
    return float(np.hypot(cosine, sine).max())


def _check_finite(one: Any) -> None:
    for name, value in zip(one._fields, one, strict=True):
        if not math.isfinite(value) or (name == "order" and abs(value) > MOST_TURNS):
            raise BadInput(
                f"{type(one).__name__}: {name} = {value} is out of range; give a finite "
                "one, orders to 1e4"
            )


def check_below(what: str, size: float, bound: float, unit: str) -> None:
    """Raise BadInput where a size that is on is not below a bound."""
    if size > 0.0 and not size < bound:
        raise BadInput(f"{what}: {size:g} is out of range; they must stay below {bound:g} {unit}")


@kernel
def flux_sum(rows, theta):
    """Return the flux harmonics without growth (Wb) and their slope by theta; the same of what
    grows (1/Wb)."""
    h = slope = grown = grown_slope = complex(0.0, 0.0)
    for k in range(rows.shape[0]):
        one = rows[k]
        x = one.order * theta + one.phase
        cos, sin = math.cos(x), math.sin(x)
        value = complex(one.psi_d * cos, one.psi_q * sin)
        turn = complex(-one.order * one.psi_d * sin, one.order * one.psi_q * cos)
        h += value
        slope += turn
        grown += one.growth * value
        grown_slope += one.growth * turn
    return h, slope, grown, grown_slope


@kernel
def inductance_sum(rows, theta):
    """Return the sums of gamma e^{j x} + back e^{-j x}, of their slopes by j theta, of pulse cos x
    and of n pulse sin x (1/H), x = n theta + phase."""
    swing = turning = complex(0.0, 0.0)
    pulse = pulse_slope = 0.0
    for k in range(rows.shape[0]):
        one = rows[k]
        x = one.order * theta + one.phase
        cos, sin = math.cos(x), math.sin(x)
        swing += complex((one.gamma + one.back) * cos, (one.gamma - one.back) * sin)
        turning += one.order * complex((one.gamma - one.back) * cos, (one.gamma + one.back) * sin)
        pulse += one.pulse * cos
        pulse_slope += one.order * one.pulse * sin
    return swing, turning, pulse, pulse_slope


@inlined
def with_flux(h, magnet_flux, psi, theta, e_1, m, slope):
    """Return the magnet's flux m and its slope (Wb, stationary) with the harmonics, z_0 (Wb) and G
    (1/Wb)."""
    if h is None:
        return m, slope, complex(0.0, 0.0), complex(0.0, 0.0)
    more, turn, grown, grown_turn = flux_sum(h.flux, theta)
    z_0 = psi * e_1.conjugate() - magnet_flux
    r_2 = z_0.real * z_0.real + z_0.imag * z_0.imag
    more, turn = more + r_2 * grown, turn + r_2 * grown_turn
    turn += complex(-more.imag, more.real) - 2.0 * magnet_flux * z_0.imag * grown
    return m + e_1 * more, slope + e_1 * turn, z_0, grown


@inlined
def chained(h, i, z_0, grown, e_1):
    """Return the current (A, stationary) of a machine at z with what growing amplitudes add to
    it, -2 Re(g* G) z_0."""
    if h is None:
        return i
    seen = i * e_1.conjugate()
    return i - 2.0 * (seen.real * grown.real + seen.imag * grown.imag) * (e_1 * z_0)


@kernel
def chained_stiffness(a, c, z_0, grown, along):
    """Return a, c of d(g - 2 along z_0)/dz_0, along = Re(g* G), where dz = dz_0 - 2 G Re(z_0*
    dz_0), dg = a dz + c dz*.

    The images of 1 and j give a (their mean stretch) and c (their difference): image(1) = a + c,
    image(j) = j (a - c).
    """
    one = 1.0 - 2.0 * z_0.real * grown
    two = complex(0.0, 1.0) - 2.0 * z_0.imag * grown
    first, second = a * one + c * one.conjugate(), a * two + c * two.conjugate()
    first -= 2.0 * (first.real * grown.real + first.imag * grown.imag) * z_0 + 2.0 * along
    second -= 2.0 * (
        second.real * grown.real + second.imag * grown.imag
    ) * z_0 + 2.0 * along * complex(0.0, 1.0)
    second *= complex(0.0, -1.0)
    return 0.5 * (first + second).real, 0.5 * (first - second)


@inlined
def with_swing(h, z, theta, i, turning):
    """Return a current (A) and dH/dtheta (J, `machine.gradient`) with those of the inductance
    harmonics, at flux z."""
    if h is None:
        return i, turning
    swing, swing_turn, pulse, pulse_turn = inductance_sum(h.inductance, theta)
    turning += (z * z * (swing + 0.5 * swing_turn).conjugate()).imag
    i += swing * z.conjugate() + pulse * z
    more, more_turn = growing(h.inductance, z, theta)
    return i + more, turning + more_turn - 0.5 * pulse_turn * abs(z) ** 2


@kernel
def swing_energy(h, z, theta):
    """Return the inductance harmonics' part of H (J up to the factor 3/2)."""
    if h is None:
        return 0.0
    swing, _, pulse, _ = inductance_sum(h.inductance, theta)
    h_2 = 0.5 * ((z * z * swing.conjugate()).real + pulse * abs(z) ** 2)
    c_3, c_1, s_3, s_1 = saturated(h.inductance, theta, False)
    return (
        h_2
        + (z * z * (c_3 * z + c_1 * z.conjugate())).real
        + (z * z * (s_3 * z + s_1 * z.conjugate())).imag
    )


@kernel
def saturated(rows, theta, slope):
    """Return c_3 cos x, c_1 cos x, s_3 sin x and s_1 sin x (A/Wb^2), summed over the orders, or
    (slope) their slopes by the angle: the same a quarter turn on, times the order; see above."""
    c_3 = c_1 = s_3 = s_1 = 0.0
    for k in range(rows.shape[0]):
        one = rows[k]
        x, size = one.order * theta + one.phase, 0.25
        if slope:
            x, size = x + 0.5 * math.pi, 0.25 * one.order
        cos, sin = size * math.cos(x), size * math.sin(x)
        c_3 += (one.alpha_30 - one.alpha_12) * cos
        c_1 += (3.0 * one.alpha_30 + one.alpha_12) * cos
        s_3 += (one.alpha_21 - one.alpha_03) * sin
        s_1 += (one.alpha_21 + 3.0 * one.alpha_03) * sin
    return c_3, c_1, s_3, s_1


@kernel
def growing(rows, z, theta):
    """Return what the terms of third degree add to the current (A) and to dH/dtheta at constant z
    e^{j theta} (J).

    2 d/dz* of Re(c z^3), Re(c z^2 z*), Im(s z^3), Im(s z^2 z*) is 3 c z*^2, c (z^2 + 2 z z*), 3 j s
    z*^2 and j s (2 z z* - z^2), c and s real; z turns by -j z for each radian.
    """
    c_3, c_1, s_3, s_1 = saturated(rows, theta, False)
    c_3_turn, c_1_turn, s_3_turn, s_1_turn = saturated(rows, theta, True)
    back, z_2, r_2 = z.conjugate(), z * z, z.real * z.real + z.imag * z.imag
    j = complex(0.0, 1.0)
    i = 3.0 * (c_3 + j * s_3) * back * back + c_1 * (z_2 + 2.0 * r_2) + j * s_1 * (2.0 * r_2 - z_2)
    turning = (z_2 * (c_3_turn * z + c_1_turn * back)).real + (
        z_2 * (s_3_turn * z + s_1_turn * back)
    ).imag
    return i, turning - (back * i).imag


@kernel
def with_swing_stiffness(h, z, theta, a, c):
    """Return a, c of di = a dz + c dz* (1/H) with those of the inductance harmonics at flux z
    added."""
    if h is None:
        return a, c
    swing, _, pulse, _ = inductance_sum(h.inductance, theta)
    c_3, c_1, s_3, s_1 = saturated(h.inductance, theta, False)
    j = complex(0.0, 1.0)
    c += 6.0 * (c_3 + j * s_3) * z.conjugate() + 2.0 * (c_1 + j * s_1) * z
    return a + pulse + 4.0 * (c_1 * z.real + s_1 * z.imag), c + swing


@inlined
def cogging_sum(h, theta_mech):
    """Return the cogging torque (N m) of the lists and its potential (J) at a mechanical angle."""
    torque = potential = 0.0
    if h is None:
        return torque, potential
    for k in range(h.cogging.shape[0]):
        one = h.cogging[k]
        x = one.order * theta_mech + one.phase
        torque += one.amplitude * math.sin(x)
        potential += one.amplitude / one.order * math.cos(x)
    return torque, potential
