"""Winding resistance and inductance against frequency."""

from __future__ import annotations

import math
from collections.abc import Mapping

from model.compiled import inlined
from model.effects.card import At, Effect, Parameter
from model.effects.said import quantity
from model.parameters import Converter, Motor
from model.steps import step_for_winding


@inlined
def ladder(resistance, time_constant):
    """Return R_1 (ohm) of the drop R_1 (i - x), and the time constant (s) of tau dx/dt = i - x."""
    return resistance, time_constant


def do(v: Mapping[str, float], motor: Motor, converter: Converter) -> str:
    """Return what to do about it, at completed values."""
    ohm, tau = v["skin_effect.resistance"], v["skin_effect.time_constant"]
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
        "lower by up to R_1 tau, around 1/tau"
    ),
    formulas=(r"u_R = R\,i + R_1\,(i - x), \qquad \tau\,\frac{d x}{d t} = i - x",),
    source=(
        "first-order ladder for Dowell, Effects of eddy currents in transformer "
        "windings, Proc. IEE 113 (1966) 1387"
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
    ),
    axis="along the fast part of the current",
    order="the injection band, and steps",
    region=(
        "the first time constants after a step; nothing at rest; far below 1/tau only R_1 tau^2 "
        "(in R) and R_1 tau (in L) count"
    ),
    confused_with=("iron_loss", "inductance", "stator_resistance"),
    separated_by="locked-rotor voltage steps at full sampling rate against a slow ramp",
    at=(At("skin", ladder, ("resistance", "time_constant")),),
    switches=("resistance",),
    longest=lambda v, motor, omega: step_for_winding(
        motor.resistance + v["skin_effect.resistance"], motor.energy
    ),
    do=do,
)
