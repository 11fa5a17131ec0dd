"""Harmonics of the inductances, the sixth and any others, with the torque that energy demands.

What they make of the flux grows with the current; where teeth saturate, with its square, too (alpha_jk).
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from functools import lru_cache

import numpy as np

from model.compiled import inlined
from model.effects.card import EITHER_PHASE, INF, At, Effect, Limit, Parameter, Part
from model.frames import multiple, sixth
from model.lanes import sine_cosine
from model.parameters import Converter, Motor
from model.steps import step_for_orders

PARTS = 6  # the sixth order, and others
FURTHER = tuple(f"inductance_harmonics.{k}" for k in range(2, PARTS + 1))
SIZES = ("gamma", "back", "pulse", "alpha_30", "alpha_12", "alpha_21", "alpha_03")
NUMBERS = (*SIZES, "order", "phase")
TURN = np.arange(720) * (math.tau / 720)  # rad: angles of the rotor at which H is looked at
AROUND = np.arange(8) * (math.tau / 8)  # rad: angles of the current


@inlined
def further(gamma_6, c, s, d, q):
    """Return the harmonic part of i_d, i_q (A) and of dH/dtheta (J/rad) at cos, sin of the angle and fluxes (Wb)."""
    c_6, s_6 = sixth(c, s)
    i_d, i_q = current(gamma_6, c_6, s_6, d, q)
    return i_d, i_q, slope(gamma_6, c_6, s_6, d, q)


@inlined
def current(gamma_6, cos_6, sin_6, d, q):
    """Return the harmonic part of i_d, i_q (A) at fluxes d, q (Wb)."""
    return gamma_6 * (cos_6 * d + sin_6 * q), gamma_6 * (sin_6 * d - cos_6 * q)


@inlined
def slope(gamma_6, cos_6, sin_6, d, q):
    """Return dH/dtheta at constant fluxes, J/rad."""
    return 3.0 * gamma_6 * (2.0 * cos_6 * d * q - sin_6 * (d * d - q * q))


@inlined
def of_order(gamma, back, pulse, alpha_30, alpha_12, alpha_21, alpha_03, order, phase, c, s, d, q):
    """Return the same of any whole order: an ellipse that turns with it (gamma) or against it (back), one that breathes
    (pulse), and what saturation adds (alpha_jk)."""
    c_n, s_n = multiple(c, s, order)
    sine, cosine = sine_cosine(phase)
    x, y = c_n * cosine - s_n * sine, s_n * cosine + c_n * sine
    both, apart, d_2, q_2 = gamma + back, gamma - back, d * d, q * q
    i_d = x * ((both + pulse) * d + 3.0 * alpha_30 * d_2 + alpha_12 * q_2) + y * q * (apart + 2.0 * alpha_21 * d)
    i_q = x * q * (pulse - both + 2.0 * alpha_12 * d) + y * (apart * d + alpha_21 * d_2 + 3.0 * alpha_03 * q_2)
    even = 0.5 * (both + pulse) * d_2 + 0.5 * (pulse - both) * q_2 + d * (alpha_30 * d_2 + alpha_12 * q_2)
    odd = q * (apart * d + alpha_21 * d_2 + alpha_03 * q_2)
    return i_d, i_q, order * (x * odd - y * even)


def limits(v: Mapping[str, float], motor: Motor, converter: Converter) -> Iterator[Limit]:
    """Yield how large the harmonics may be: within the flux of rated current H stays convex."""
    least = min(1.0 / motor.inductance_d, 1.0 / motor.inductance_q)
    what = "1/H in all orders together, where H is not convex"
    yield Limit("inductance_harmonics.gamma_6", softened(v, motor) * least, least, what)


def softened(v: Mapping[str, float], motor: Motor) -> float:
    """Return by how much the harmonics lower the second derivatives of H at most, as a share of those that the motor's
    inductances make: in scaled fluxes d/sqrt(L_d), q/sqrt(L_q), over a turn, without current and at rated current."""
    parts = [(v["inductance_harmonics.gamma_6"], *[0.0] * 6, 6.0, 0.0)]
    parts += [tuple(v[f"{part}.{n}"] for n in NUMBERS) for part in FURTHER]
    there = tuple(x for x in parts if any(x[: len(SIZES)]))
    return _softened(there, motor.inductance_d, motor.inductance_q, motor.rated_current) if there else 0.0


@lru_cache(maxsize=1000)  # a diagnosis asks for the same sizes again and again
def _softened(parts: Sequence[tuple[float, ...]], l_d: float, l_q: float, rated_current: float) -> float:
    d = np.append(0.0, rated_current * l_d * np.cos(AROUND))
    q = np.append(0.0, rated_current * l_q * np.sin(AROUND))
    dd, dq, qq = np.zeros((3, len(TURN), len(d)))
    for g, b, p, a_30, a_12, a_21, a_03, order, phase in parts:
        angle = (order * TURN + phase)[:, None]
        x, y = np.cos(angle), np.sin(angle)
        dd = dd + x * (g + b + p + 6.0 * a_30 * d) + y * 2.0 * a_21 * q
        dq = dq + x * 2.0 * a_12 * q + y * (g - b + 2.0 * a_21 * d)
        qq = qq + x * (p - g - b + 2.0 * a_12 * d) + y * 6.0 * a_03 * q
    dd, dq, qq = l_d * dd, math.sqrt(l_d * l_q) * dq, l_q * qq
    return float(-np.min(0.5 * (dd + qq) - np.hypot(0.5 * (dd - qq), dq)))


def longest(v: Mapping[str, float], motor: Motor, omega: float) -> float:
    """Return the longest step (s) that resolves the highest order."""
    there = [part for part in FURTHER if any(v[f"{part}.{n}"] for n in SIZES)]
    return step_for_orders([v[f"{part}.order"] for part in there], omega)


CARD = Effect(
    name="inductance_harmonics",
    summary="harmonics of the inductances, the sixth and any others, with the torque that energy demands",
    subsystem="machine",
    equation=(
        "H += gamma/2 [cos 6 theta (d^2 - q^2) + 2 sin 6 theta d q]; further orders: x = n theta + phase for 6 theta, "
        "+ back/2 [cos x (d^2 - q^2) - 2 sin x d q] + pulse/2 cos x (d^2 + q^2) + cos x (alpha_30 d^3 + alpha_12 d q^2)"
        " + sin x (alpha_21 d^2 q + alpha_03 q^3); current its gradient, torque -3/2 p dH/dtheta"
    ),
    source=(
        "derivation: the terms of second and third degree in the fluxes of an energy H(phi, theta) that is even in "
        "(q, theta); finite elements need those of third degree where teeth saturate (experiments/thor_orders.py)"
    ),
    parameters=(
        Parameter("gamma_6", "1/H", 0.0, -1e4, 1e4, 0.01, "1 / L_d", title="6th harmonic of inverse inductance"),
    ),
    axis="d and q, rotating by 6 theta",
    order="6 and the injection band +-6",
    region="grows with current; at every speed, standstill included",
    confused_with=("flux_harmonics", "cross_saturation", "winding_asymmetry"),
    separated_by="locked rotor at several angles with injection; or slow driven rotor under current",
    at=(At("energy", further, ("gamma_6",)),),
    limits=limits,
    longest=longest,
    repeats=PARTS,
    further=Part(
        parameters=(
            Parameter(
                "gamma",
                "1/H",
                0.0,
                -1e4,
                1e4,
                0.005,
                "1 / L_d",
                first="gamma_6",
                title="harmonic of inverse inductance",
            ),
            Parameter("back", "1/H", 0.0, -1e4, 1e4, 0.005, "1 / L_d", title="backward harmonic of inverse inductance"),
            Parameter(
                "pulse", "1/H", 0.0, -1e4, 1e4, 0.005, "1 / L_d", title="pulsating harmonic of inverse inductance"
            ),
            Parameter(
                "alpha_30",
                "A/Wb^2",
                0.0,
                -1e6,
                1e6,
                0.01,
                "rated current / (L_d rated current)^2",
                title="harmonic of alpha_30",
            ),
            Parameter(
                "alpha_12",
                "A/Wb^2",
                0.0,
                -1e6,
                1e6,
                0.01,
                "rated current / (L_d L_q rated current^2)",
                title="harmonic of alpha_12",
            ),
            Parameter(
                "alpha_21",
                "A/Wb^2",
                0.0,
                -1e6,
                1e6,
                0.01,
                "rated current / (L_d L_q rated current^2)",
                title="harmonic of alpha_21",
            ),
            Parameter(
                "alpha_03",
                "A/Wb^2",
                0.0,
                -1e6,
                1e6,
                0.01,
                "rated current / (L_q rated current)^2",
                title="harmonic of alpha_03",
            ),
            Parameter(
                "order",
                "",
                12.0,
                -60.0,
                60.0,
                12.0,
                fit="fixed",
                scan=(6.0, 60.0, 6.0),
                whole=True,
                title="order of inductance harmonic",
            ),
            Parameter(
                "phase",
                "rad",
                0.0,
                -INF,
                INF,
                0.0,
                fit="fixed",
                change=1.0,
                scan=EITHER_PHASE,
                title="phase of inductance harmonic",
            ),
        ),
        at=(At("energy", of_order, NUMBERS),),
        switches=SIZES,
        first_at={"order": 6.0, "phase": 0.0},
    ),
)
