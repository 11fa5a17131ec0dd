"""Harmonics of the inductances, the sixth and any others, with the torque that energy demands."""

from __future__ import annotations

from collections.abc import Iterator, Mapping

from model.compiled import inlined
from model.effects.card import EITHER_PHASE, INF, At, Effect, Limit, Parameter, Part
from model.frames import multiple, sixth
from model.lanes import sine_cosine
from model.parameters import Converter, Motor
from model.steps import step_for_orders

PARTS = 6  # the sixth order, and others
FURTHER = tuple(f"inductance_harmonics.{k}" for k in range(2, PARTS + 1))


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
def of_order(gamma, pulse, order, phase, c, s, d, q):
    """Return the same of any whole order: an ellipse that turns, gamma, and one that breathes, pulse."""
    c_n, s_n = multiple(c, s, order)
    sine, cosine = sine_cosine(phase)
    x, y = c_n * cosine - s_n * sine, s_n * cosine + c_n * sine
    i_d, i_q = current(gamma, x, y, d, q)
    bent = gamma * (2.0 * x * d * q - y * (d * d - q * q)) - pulse * y * (d * d + q * q)
    return i_d + pulse * x * d, i_q + pulse * x * q, 0.5 * order * bent


def limits(v: Mapping[str, float], motor: Motor, converter: Converter) -> Iterator[Limit]:
    """Yield how large the harmonics may be."""
    size = abs(v["inductance_harmonics.gamma_6"])
    size += sum(abs(v[f"{part}.gamma"]) + abs(v[f"{part}.pulse"]) for part in FURTHER)
    least = min(1.0 / motor.inductance_d, 1.0 / motor.inductance_q)
    yield Limit("inductance_harmonics.gamma_6", size, least, "1/H in all orders together, where H is not convex")


def longest(v: Mapping[str, float], motor: Motor, omega: float) -> float:
    """Return the longest step (s) that resolves the highest order."""
    there = [part for part in FURTHER if v[f"{part}.gamma"] or v[f"{part}.pulse"]]
    return step_for_orders([v[f"{part}.order"] for part in there], omega)


CARD = Effect(
    name="inductance_harmonics",
    summary="harmonics of the inductances, the sixth and any others, with the torque that energy demands",
    subsystem="machine",
    equation=(
        "H += gamma/2 [cos 6 theta (d^2 - q^2) + 2 sin 6 theta d q]; further orders: n theta + phase for 6 theta, and "
        "+ pulse/2 cos(n theta + phase) (d^2 + q^2); current its gradient, torque -3/2 p dH/dtheta"
    ),
    source=(
        "derivation: lowest slotting term of an energy H(phi, theta) with three-phase symmetry; angle-"
        "resolved maps of measured motors show it"
    ),
    parameters=(Parameter("gamma_6", "1/H", 0.0, -1e4, 1e4, 0.01, "1 / L_d"),),
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
            Parameter("gamma", "1/H", 0.0, -1e4, 1e4, 0.005, "1 / L_d"),
            Parameter("pulse", "1/H", 0.0, -1e4, 1e4, 0.005, "1 / L_d"),
            Parameter("order", "", 12.0, -60.0, 60.0, 12.0, fit="fixed", scan=(12.0, 60.0, 6.0), whole=True),
            Parameter("phase", "rad", 0.0, -INF, INF, 0.0, fit="fixed", change=1.0, scan=EITHER_PHASE),
        ),
        at=(At("energy", of_order, ("gamma", "pulse", "order", "phase")),),
        switches=("gamma", "pulse"),
    ),
)
