"""Stator resistance other than nominal (temperature, leads, contacts)."""

from __future__ import annotations

from collections.abc import Mapping

from model.effects.card import Effect, Ordinary, Parameter
from model.effects.said import COPPER, percent, quantity, stated, warmer
from model.parameters import Converter, Motor


def do(v: Mapping[str, float], motor: Motor, converter: Converter) -> str:
    """Return what to do about it, at completed values."""
    found = v["stator_resistance.resistance"]
    change = found / motor.resistance - 1.0
    kelvin = warmer(change * COPPER)
    causes = [f"winding {kelvin}"] if kelvin else []
    if change > 0.0:
        causes.append(f"{quantity(found - motor.resistance, 'ohm')} of cable and contacts")
    elif not kelvin:
        causes.append(
            "more than a cold winding explains: is the stated value between two terminals?"
        )
    return f"R {percent(change)}: {', or '.join(causes)}; set {stated('resistance', found, 'ohm')}"


CARD = Effect(
    name="stator_resistance",
    summary="stator resistance other than nominal (temperature, leads, contacts)",
    subsystem="machine",
    equation="voltage drop R i in both axes; replaces the nominal value",
    formulas=(r"u_d = R\,i_d + \dots, \qquad u_q = R\,i_q + \dots",),
    source=(
        "Ohm's law; copper 0.39 %/K (IEC 60034-1: resistance proportional to 235 + "
        "temperature in degrees C)"
    ),
    parameters=(
        Parameter(
            "resistance",
            "ohm",
            None,
            0.0,
            1e3,
            1.2,
            "neutral",
            "resistance",
            ordinary=Ordinary("resistance", 0.02, of_motor=True),
            title="stator resistance",
        ),
    ),
    axis="along the current",
    order="0 (fundamental), and the injection band at second order",
    region="grows with current, not with speed; all regions",
    confused_with=("device_drop", "current_gain", "skin_effect"),
    separated_by=(
        "locked-rotor staircase: voltage against current, intercept (device drop) and slope (R) "
        "apart; steps against slow ramps for skin effect"
    ),
    do=do,
)
