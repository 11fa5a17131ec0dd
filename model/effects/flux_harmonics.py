"""Harmonics of the magnet flux in the rotor frame: the sixth (5th and 7th of the back-EMF), and any
others."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping

from model.compiled import inlined
from model.effects.card import At, Effect, EffectPart, Limit, Parameter, of_electrical_order
from model.effects.said import quantity
from model.frames import multiple, sixth
from model.lanes import sine_cosine
from model.parameters import Converter, Motor
from model.steps import step_for_orders

PARTS = 6  # the sixth order, and others
FURTHER = tuple(f"flux_harmonics.{k}" for k in range(2, PARTS + 1))


@inlined
def harmonic(psi_d6, psi_q6, c, s):
    """Return the harmonic part of the magnet flux (Wb) and its slope (Wb/rad) at cos, sin of the
    angle."""
    c_6, s_6 = sixth(c, s)
    d, q = flux(psi_d6, psi_q6, c_6, s_6)
    t_d, t_q = slope(psi_d6, psi_q6, c_6, s_6)
    return d, q, t_d, t_q


@inlined
def flux(psi_d6, psi_q6, cos_6, sin_6):
    """Return the harmonic part of the magnet flux (Wb) in the rotor frame."""
    return psi_d6 * cos_6, psi_q6 * sin_6


@inlined
def slope(psi_d6, psi_q6, cos_6, sin_6):
    """Return its derivative by the angle, Wb/rad."""
    return -6.0 * psi_d6 * sin_6, 6.0 * psi_q6 * cos_6


@inlined
def of_order(psi_d, psi_q, order, phase, c, s):
    """Return the same of any whole order: psi_d cos(order theta + phase), psi_q sin(order theta +
    phase)."""
    c_n, s_n = multiple(c, s, order)
    sine, cosine = sine_cosine(phase)
    x, y = c_n * cosine - s_n * sine, s_n * cosine + c_n * sine
    return psi_d * x, psi_q * y, -order * psi_d * y, order * psi_q * x


def limits(v: Mapping[str, float], motor: Motor, converter: Converter) -> Iterator[Limit]:
    """Yield how large the harmonics may be."""
    for axis in "dq":
        size = abs(v[f"flux_harmonics.psi_{axis}6"]) + sum(
            abs(v[f"{part}.psi_{axis}"]) for part in FURTHER
        )
        what = "Wb in all orders together, the magnet flux"
        yield Limit(f"flux_harmonics.psi_{axis}6", size, motor.magnet_flux, what)


def longest(v: Mapping[str, float], motor: Motor, omega: float) -> float:
    """Return the longest step (s) that resolves the highest order."""
    there = [part for part in FURTHER if v[f"{part}.psi_d"] or v[f"{part}.psi_q"]]
    return step_for_orders([v[f"{part}.order"] for part in there], omega)


def do(v: Mapping[str, float], motor: Motor, converter: Converter) -> str:
    """Return what to do about it, at completed values."""
    sixth = math.hypot(v["flux_harmonics.psi_d6"], v["flux_harmonics.psi_q6"])
    sizes = [f"{quantity(sixth, 'Wb')} of order 6"] if sixth else []
    for k in range(2, CARD.repeats + 1):
        size = math.hypot(v[f"flux_harmonics.{k}.psi_d"], v[f"flux_harmonics.{k}.psi_q"])
        sizes += (
            [f"{quantity(size, 'Wb')} of order {v[f'flux_harmonics.{k}.order']:g}"] if size else []
        )
    return (
        f"feed the back-EMF's harmonics forward ({', '.join(sizes)} in the rotor's "
        "frame; effects.toml has d, q and "
        "phase), or keep them in the simulator: they come with the magnets' shape"
    )


CARD = Effect(
    name="flux_harmonics",
    summary="harmonics of the magnet flux in the rotor frame: the sixth (5th and 7th of the "
    "back-EMF), and any others",
    subsystem="machine",
    equation=(
        "psi_d = phi_m + psi_d6 cos 6 theta, psi_q = psi_q6 sin 6 theta; further orders: + psi_d "
        "cos(n theta + phase), + psi_q sin(n theta + phase); torque -3/2 p dH/dtheta included"
    ),
    formulas=(
        r"\psi_d = \phi_d + \phi_m + \psi_{d6} \cos\,6\theta + \sum_n \psi_{d,n} "
        r"\cos(n\theta + \varphi_n)",
        r"\psi_q = \phi_q + \psi_{q6} \sin\,6\theta + \sum_n \psi_{q,n} \sin(n\theta + \varphi_n)",
    ),
    source=(
        "Chapman, Sudhoff, Whitcomb, Multiple reference frame analysis of non-sinusoidal "
        "brushless DC "
        "drives, IEEE Trans. Energy Conversion 14 (1999) 440; torque from the energy H(phi, theta)"
    ),
    parameters=(
        Parameter(
            "psi_d6", "Wb", 0.0, -1e2, 1e2, 0.01, "magnet flux", title="6th harmonic of d flux"
        ),
        Parameter(
            "psi_q6", "Wb", 0.0, -1e2, 1e2, 0.006, "magnet flux", title="6th harmonic of q flux"
        ),
    ),
    axis="d and q",
    order="6",
    region="voltage grows with speed; also at zero current",
    confused_with=("inductance_harmonics", "dead_time", "cogging_torque"),
    separated_by="driven rotor at zero current: 5th and 7th of the back-EMF proportional to speed",
    at=(At("magnets", harmonic, ("psi_d6", "psi_q6")),),
    limits=limits,
    longest=longest,
    repeats=PARTS,
    further=EffectPart(
        parameters=(
            Parameter(
                "psi_d",
                "Wb",
                0.0,
                -1e2,
                1e2,
                0.005,
                "magnet flux",
                first="psi_d6",
                title="harmonic of d flux",
            ),
            Parameter(
                "psi_q",
                "Wb",
                0.0,
                -1e2,
                1e2,
                0.003,
                "magnet flux",
                first="psi_q6",
                title="harmonic of q flux",
            ),
            *of_electrical_order("flux harmonic"),
        ),
        at=(At("magnets", of_order, ("psi_d", "psi_q", "order", "phase")),),
        switches=("psi_d", "psi_q"),
        first_at={"order": 6.0, "phase": 0.0},
    ),
    do=do,
)
