"""Winding resistance and inductance against frequency: one eddy branch, or layers of conductors."""

from __future__ import annotations

import cmath
import math
from collections.abc import Iterator, Mapping

from model.compiled import inlined
from model.effects.card import At, Effect, Limit, Parameter
from model.effects.said import quantity
from model.errors import BadInput
from model.parameters import Converter, Motor
from model.steps import LARGEST_DECAY, step_for_winding

LEAST = 0.5  # layers: half a conductor, between whose halves there is no field
HALVINGS = 60  # of the bracket of a step: to rounding


@inlined
def ladder(resistance, time_constant, layers):
    """Return R_1 (ohm) of the drop R_1 (i - x), and the time constant (s) of tau dx/dt = i - x;
    none where there are layers."""
    return (0.0 if layers > 0.0 else resistance), time_constant


@inlined
def dowell(resistance, time_constant, layers):
    """Return the ohm of every even and of every odd branch n that Dowell's formula has in a winding
    of so many layers, of `resistance` (ohm) at rest, and the time constant (s) of the first.

    x coth x = 1 + sum of 2 x^2/(x^2 + n^2 pi^2), x tanh(x/2) = sum of 4 x^2/(x^2 + n^2 pi^2) over
    odd n, x^2 = s pi^2 tau.
    """
    even = 2.0 * resistance if layers > 0.0 else 0.0
    return even, even * (1.0 + 4.0 / 3.0 * max(layers * layers - 1.0, -0.75)), time_constant


def impedance(layers: float, time_constant: float, omega: float) -> complex:
    """Return the impedance of so many layers over their resistance at rest, at omega (rad/s), by
    Dowell's formula; time_constant: of the first branch, s."""
    x = cmath.sqrt(1j * omega * time_constant) * math.pi
    if not x:
        return 1.0 + 0.0j
    return x / cmath.tanh(x) + 2.0 / 3.0 * (layers * layers - 1.0) * x * cmath.tanh(0.5 * x)


def limits(v: Mapping[str, float], motor: Motor, converter: Converter) -> Iterator[Limit]:
    """Yield no limit: layers are none, or at least half a one."""
    layers = v["skin_effect.layers"]
    if 0.0 < layers < LEAST:
        raise BadInput(
            f"skin_effect.layers = {layers:g} is out of range; give at least {LEAST:g}, or 0 for "
            "one branch in place of layers"
        )
    yield from ()


def longest(v: Mapping[str, float], motor: Motor, omega: float) -> float:
    """Return the longest step (s) of a closed loop: what a current meets that changes within it,
    of layers as much as at an angular frequency of one over the step."""
    ohm, layers = v["skin_effect.resistance"], v["skin_effect.layers"]
    if not layers:
        return step_for_winding(motor.resistance + ohm, motor.energy)
    tau, energy = v["skin_effect.time_constant"], motor.energy
    short, long = 0.0, LARGEST_DECAY / (motor.resistance * max(energy.gamma_d, energy.gamma_q))
    for _ in range(HALVINGS):
        step = 0.5 * (short + long)
        more = ohm * (impedance(layers, tau, 1.0 / step).real - 1.0)
        fits = step <= step_for_winding(motor.resistance + more, energy)
        short, long = (step, long) if fits else (short, step)
    return short


def do(v: Mapping[str, float], motor: Motor, converter: Converter) -> str:
    """Return what to do about it, at completed values."""
    ohm, tau = v["skin_effect.resistance"], v["skin_effect.time_constant"]
    if layers := v["skin_effect.layers"]:
        square = layers * layers
        corner = quantity(1.0 / (math.pi**3 * tau), "Hz")
        low, high = ohm * (5.0 * square - 1.0) / 45.0, ohm * (2.0 * square + 1.0) / 3.0
        return (
            f"count {quantity(low, 'ohm')} times x² more into the estimator's resistance at the "
            f"injection's frequency f, x = f/({corner}), where x is below 1; far above that it is "
            f"{quantity(high, 'ohm')} times √x; none for slow currents"
        )
    corner = quantity(1.0 / (math.tau * tau), "Hz")
    return (
        f"count up to {quantity(ohm, 'ohm')} more into the estimator's resistance at the "
        "injection's frequency f, "
        f"x²/(1 + x²) of it with x = f/({corner}), and none for slow currents"
    )


CARD = Effect(
    name="skin_effect",
    summary="winding resistance and inductance against frequency",
    subsystem="machine",
    equation=(
        "drop = R i + R_1 (i - x), tau dx/dt = i - x per stationary axis: R to R + R_1, and L "
        "lower by up to R_1 tau, around 1/tau. With layers m: Dowell's formula for that many "
        "conductors above one another in a slot, R_1 their resistance at rest (part of R), tau = "
        "mu_0 sigma (h/pi)^2 of conductors h high: R_1 (x coth x + 2/3 (m^2 - 1) x tanh(x/2) - 1) "
        "more, x^2 = s pi^2 tau"
    ),
    formulas=(
        r"u_R = R\,i + R_1\,(i - x), \qquad \tau\,\frac{d x}{d t} = i - x",
        r"\text{layers:} \quad u_R = R\,i + R_1\,\Bigl(x \coth x + \tfrac{2}{3}\,(m^2 - 1)\,x "
        r"\tanh \tfrac{x}{2} - 1\Bigr)\,i, \qquad x^2 = s\,\pi^2 \tau",
    ),
    source=(
        "Dowell, Effects of eddy currents in transformer windings, Proc. IEE 113 (1966) 1387; one "
        "branch: first-order ladder for it"
    ),
    parameters=(
        Parameter(
            "resistance",
            "ohm",
            0.0,
            0.0,
            1e3,
            0.3,
            "resistance",
            title="additional resistance of the skin effect",
        ),
        Parameter(
            "time_constant",
            "s",
            2e-4,
            1e-6,
            1.0,
            2e-4,
            fit="log",
            spread=1.0,
            starts=(0.2, 1.0, 5.0),
            title="time constant of the skin effect",
        ),
        Parameter(
            "layers",
            "",
            0.0,
            0.0,
            100.0,
            0.0,
            fit="log",
            spread=0.7,  # from half as many to twice as many
            change=1.0,
            title="number of layers of the skin effect",
        ),
    ),
    axis="along the fast part of the current",
    order="the injection band, and steps",
    region=(
        "the first time constants after a step; nothing at rest; far below 1/tau only R_1 tau^2 "
        "(in R) and R_1 tau (in L) count"
    ),
    confused_with=("iron_loss", "inductance", "stator_resistance"),
    separated_by="locked-rotor voltage steps at full sampling rate against a slow ramp",
    at=(
        At("skin", ladder, ("resistance", "time_constant", "layers"), form=("layers", False)),
        At("layers", dowell, ("resistance", "time_constant", "layers"), form=("layers", True)),
    ),
    switches=("resistance",),
    limits=limits,
    longest=longest,
    do=do,
)
