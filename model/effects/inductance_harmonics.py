"""Harmonics of the inductances, the sixth and any others, with the torque that energy demands.

What they make of the flux grows with the current; where teeth saturate, with its square, too
(alpha_jk).
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from functools import lru_cache

import numpy as np

from model.array_types import Array
from model.compiled import inlined
from model.effects.card import At, Effect, EffectPart, Limit, Parameter, of_electrical_order
from model.effects.said import number
from model.frames import multiple, sixth
from model.lanes import sine_cosine
from model.parameters import OVERLOAD, Converter, Motor
from model.softening import Softest, Term, of_overload, softest
from model.spline import SplineEnergy
from model.steps import step_for_orders

PARTS = 6  # the sixth order, and others
FURTHER = tuple(f"inductance_harmonics.{k}" for k in range(2, PARTS + 1))
SIXTH = "inductance_harmonics.gamma_6"
SIZES = ("gamma", "back", "pulse", "alpha_30", "alpha_12", "alpha_21", "alpha_03")
NUMBERS = (*SIZES, "order", "phase")
AROUND = np.arange(8) * (math.tau / 8)  # rad: angles of the current


@inlined
def further(gamma_6, c, s, d, q):
    """Return the harmonic part of i_d, i_q (A) and of dH/dtheta (J/rad) at cos, sin of the angle
    and fluxes (Wb)."""
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
    """Return the same of any whole order: an ellipse that turns with it (gamma) or against it
    (back), one that breathes (pulse), and what saturation adds (alpha_jk)."""
    c_n, s_n = multiple(c, s, order)
    sine, cosine = sine_cosine(phase)
    x, y = c_n * cosine - s_n * sine, s_n * cosine + c_n * sine
    both, apart, d_2, q_2 = gamma + back, gamma - back, d * d, q * q
    i_d = x * ((both + pulse) * d + 3.0 * alpha_30 * d_2 + alpha_12 * q_2) + y * q * (
        apart + 2.0 * alpha_21 * d
    )
    i_q = x * q * (pulse - both + 2.0 * alpha_12 * d) + y * (
        apart * d + alpha_21 * d_2 + 3.0 * alpha_03 * q_2
    )
    even = (
        0.5 * (both + pulse) * d_2
        + 0.5 * (pulse - both) * q_2
        + d * (alpha_30 * d_2 + alpha_12 * q_2)
    )
    odd = q * (apart * d + alpha_21 * d_2 + alpha_03 * q_2)
    return i_d, i_q, order * (x * odd - y * even)


def limits(v: Mapping[str, float], motor: Motor, converter: Converter) -> Iterator[Limit]:
    """Yield how large the harmonics may be beside 1/L, at the flux of rated current: a coarse
    bound, as recordings need not go wherever H stops being convex."""
    parts = _there(v)
    if parts:
        found = _at_rated(parts, motor.inductance_d, motor.inductance_q, motor.rated_current)
        yield _limit(v, found, "H is not convex within the flux of rated current")


def inside(v: Mapping[str, float], motor: Motor, converter: Converter) -> Iterator[Limit]:
    """Yield how large the harmonics of a simulated drive may be: H of the motor, with all that
    effects change in it, and of the harmonics stays convex at every angle, up to the largest
    current that a scenario may ask for."""
    parts = _there(v)
    if parts:
        from model.effects.library import scaled, true_motor  # which loads this card

        own = true_motor(motor, v, keep_map=True)
        more = [0.0, 0.0, 0.0]
        if isinstance(own.energy, SplineEnergy):  # what scales of its inductances add to a flux map
            scale = {field: v[name] for name, field in scaled().items()}
            more[0] = (1.0 / scale["inductance_d"] - 1.0) / own.inductance_d
            more[2] = (1.0 / scale["inductance_q"] - 1.0) / own.inductance_q
        what = f"H is not convex at every angle and all currents up to {OVERLOAD:.0%} of rated"
        yield _limit(v, _at_overload(parts, own, tuple(more)), what)


def softened(v: Mapping[str, float], motor: Motor) -> float:
    """Return by how much the harmonics lower the second derivatives of H at most, as a share of
    those that the motor's inductances make: over a turn, without current and at rated current."""
    parts = _there(v)
    return (
        _at_rated(parts, motor.inductance_d, motor.inductance_q, motor.rated_current).share
        if parts
        else 0.0
    )


def _limit(v: Mapping[str, float], found: Softest, what: str) -> Limit:
    """Return a limit of the parameter that softens H most, by its name as the user gave it."""
    size = abs(v[found.name])
    together = (
        sum(v[f"{part}.{n}"] != 0.0 for part in FURTHER for n in SIZES) + (v[SIXTH] != 0.0) > 1
    )
    unit = "A/Wb^2" if ".alpha_" in found.name else "1/H"
    remedy = (
        "lower it and the other harmonics of the inductances in proportion"
        if together
        else "lower it"
    )
    return Limit(
        found.name, size, size / found.share, f"{unit} in size, beyond which {what}; {remedy}"
    )


def _there(v: Mapping[str, float]) -> tuple[tuple[str, float, float, float], ...]:
    """Return name, size, order and phase of every term that is there."""
    first = [(SIXTH, v[SIXTH], 6.0, 0.0)]
    more = [
        (f"{p}.{n}", v[f"{p}.{n}"], v[f"{p}.order"], v[f"{p}.phase"])
        for p in FURTHER
        for n in SIZES
    ]
    return tuple(x for x in (*first, *more) if x[1])


def _terms(parts: Sequence[tuple[str, float, float, float]], d: Array, q: Array) -> list[Term]:
    """Return what terms add to the second derivatives of H at fluxes (Wb)."""
    none, one = np.zeros(len(d)), np.ones(len(d))
    cosine_sine = {  # dd, dq, qq for each
        "gamma": ((one, none, -one), (none, one, none)),
        "back": ((one, none, -one), (none, -one, none)),
        "pulse": ((one, none, one), (none, none, none)),
        "alpha_30": ((6.0 * d, none, none), (none, none, none)),
        "alpha_12": ((none, 2.0 * q, 2.0 * d), (none, none, none)),
        "alpha_21": ((none, none, none), (2.0 * q, 2.0 * d, none)),
        "alpha_03": ((none, none, none), (none, none, 6.0 * q)),
    }
    terms = []
    for name, size, order, phase in parts:
        cosine, sine = (
            np.array(x) for x in cosine_sine["gamma" if name == SIXTH else name.rpartition(".")[2]]
        )
        z = size * (cosine - 1j * sine) * np.exp(1j * phase)
        terms.append(Term(name, int(abs(order)), z if order > 0.0 else z.conj()))
    return terms


@lru_cache(maxsize=1000)  # a diagnosis asks for the same sizes again and again
def _at_rated(
    parts: Sequence[tuple[str, float, float, float]], l_d: float, l_q: float, rated_current: float
) -> Softest:
    """Return where the harmonics soften an energy of inductances alone (H) most, up to rated
    current."""
    d = np.append(0.0, rated_current * l_d * np.cos(AROUND))
    q = np.append(0.0, rated_current * l_q * np.sin(AROUND))
    one = np.ones(len(d))
    return softest(_terms(parts, d, q), np.array([one / l_d, 0.0 * one, one / l_q]))


@lru_cache(maxsize=100)
def _at_overload(
    parts: Sequence[tuple[str, float, float, float]], motor: Motor, more: tuple[float, ...]
) -> Softest:
    """Return where the harmonics soften the motor's own energy most, up to OVERLOAD of rated
    current; more: 1/H on its second derivatives."""
    fluxes, stiffness = of_overload(motor)
    return softest(_terms(parts, *fluxes), stiffness + np.array(more)[:, None])


def longest(v: Mapping[str, float], motor: Motor, omega: float) -> float:
    """Return the longest step (s) that resolves the highest order."""
    there = [part for part in FURTHER if any(v[f"{part}.{n}"] for n in SIZES)]
    return step_for_orders([v[f"{part}.order"] for part in there], omega)


def do(v: Mapping[str, float], motor: Motor, converter: Converter) -> str:
    """Return what to do about it, at completed values."""
    sixth = (
        [f"order 6, {number(100.0 * abs(v[SIXTH]) * motor.inductance_d)} % of 1/L_d"]
        if v[SIXTH]
        else []
    )
    more = [
        f"order {v[f'{part}.order']:g}" for part in FURTHER if any(v[f"{part}.{n}"] for n in SIZES)
    ]
    return (
        "give the estimator inductances that turn with the rotor "
        f"({', '.join([*sixth, *more])}; effects.toml has "
        "them), or expect its error to swing with the angle: they come with teeth and winding"
    )


CARD = Effect(
    name="inductance_harmonics",
    summary="harmonics of the inductances, the sixth and any others, with the torque that energy "
    "demands",
    subsystem="machine",
    equation=(
        "H += gamma/2 [cos 6 theta (d^2 - q^2) + 2 sin 6 theta d q]; further orders: x = n theta "
        "+ phase for 6 theta, + back/2 [cos x (d^2 - q^2) - 2 sin x d q] + pulse/2 cos x (d^2 + "
        "q^2) + cos x (alpha_30 d^3 + alpha_12 d q^2) + sin x (alpha_21 d^2 q + alpha_03 q^3); "
        "current its gradient, torque -3/2 p dH/dtheta"
    ),
    formulas=(
        r"H \;\text{+=}\; \tfrac12 \gamma_6 \bigl[\cos\,6\theta\,(\phi_d^2 - \phi_q^2) + 2 "
        r"\sin\,6\theta\,\phi_d\,\phi_q\bigr]",
        r"H \;\text{+=}\; \tfrac12 \gamma \bigl[\cos\,x\,(\phi_d^2 - \phi_q^2) + 2 \sin "
        r"x\,\phi_d\,\phi_q\bigr], \qquad x = n\theta + \varphi",
        r"H \;\text{+=}\; \tfrac12 \gamma_\text{back} \bigl[\cos\,x\,(\phi_d^2 - \phi_q^2) - 2 "
        r"\sin\,x\,\phi_d\,\phi_q\bigr]",
        r"H \;\text{+=}\; \tfrac12 \gamma_\text{pulse} \cos\,x\,(\phi_d^2 + \phi_q^2)",
        r"H \;\text{+=}\; \cos\,x\,(\alpha_{30}\,\phi_d^3 + \alpha_{12}\,\phi_d\,\phi_q^2) + "
        r"\sin\,x\,(\alpha_{21}\,\phi_d^2\,\phi_q + \alpha_{03}\,\phi_q^3)",
        r"i = \frac{\partial H}{\partial \phi}, \qquad T \;\text{+=}\; "
        r"-\tfrac32\,p\,\frac{\partial H}{\partial \theta}",
    ),
    source=(
        "derivation: the terms of second and third degree in the fluxes of an energy H(phi, "
        "theta) that is even in (q, theta); finite elements need those of third degree where "
        "teeth saturate (experiments/thor_orders.py)"
    ),
    parameters=(
        Parameter(
            "gamma_6",
            "1/H",
            0.0,
            -1e4,
            1e4,
            0.01,
            "1 / L_d",
            title="6th harmonic of inverse inductance",
        ),
    ),
    axis="d and q, rotating by 6 theta",
    order="6 and the injection band +-6",
    region="grows with current; at every speed, standstill included",
    confused_with=("flux_harmonics", "cross_saturation", "winding_asymmetry"),
    separated_by="locked rotor at several angles with injection; or slow driven rotor under current",  # noqa: E501
    at=(At("energy", further, ("gamma_6",)),),
    limits=limits,
    inside=inside,
    longest=longest,
    repeats=PARTS,
    further=EffectPart(
        parameters=(
            *(
                Parameter(name, "1/H", 0.0, -1e4, 1e4, 0.005, "1 / L_d", first=first, title=title)
                for name, first, title in (
                    ("gamma", "gamma_6", "harmonic of inverse inductance"),
                    ("back", "", "backward harmonic of inverse inductance"),
                    ("pulse", "", "pulsating harmonic of inverse inductance"),
                )
            ),
            *(
                Parameter(name, "A/Wb^2", 0.0, -1e6, 1e6, 0.01, of, title=f"harmonic of {name}")
                for name, of in (
                    ("alpha_30", "rated current / (L_d rated current)^2"),
                    ("alpha_12", "rated current / (L_d L_q rated current^2)"),
                    ("alpha_21", "rated current / (L_d L_q rated current^2)"),
                    ("alpha_03", "rated current / (L_q rated current)^2"),
                )
            ),
            *of_electrical_order("inductance harmonic"),
        ),
        at=(At("energy", of_order, NUMBERS),),
        switches=SIZES,
        first_at={"order": 6.0, "phase": 0.0},
    ),
    do=do,
)
