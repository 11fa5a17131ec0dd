"""Offsets of the current sensors."""

from __future__ import annotations

import math
from collections.abc import Mapping

from model.compiled import inlined
from model.effects.card import At, Effect, Ordinary, Parameter
from model.effects.said import quantity
from model.parameters import Converter, Motor


@inlined
def shifted(offset_a, offset_b, a, b, c):
    """Return three readings (A) with their offsets, whose sum is zero."""
    return a + offset_a, b + offset_b, c - (offset_a + offset_b)


OF_THREE = math.sqrt(2.0 / 3.0)  # of one sensor's offset: its part beside the mean of all three


def do(v: Mapping[str, float], motor: Motor, converter: Converter) -> str:
    """Return what to do about it, at completed values."""
    a, b = v["current_offset.offset_a"], v["current_offset.offset_b"]
    offsets = ", ".join(
        f"{quantity(x, 'A')} from phase {p}" for p, x in zip("abc", (a, b, -a - b), strict=True)
    )
    return (
        f"subtract from the current readings: {offsets}; measure the offsets at rest, with the "
        "legs switching"
    )


CARD = Effect(
    name="current_offset",
    summary="offsets of the current sensors",
    subsystem="sensor",
    equation="reading = i + offset, offset_c = -offset_a - offset_b",
    formulas=(r"i_{k,\text{read}} = i_k + o_k, \qquad o_c = -\,o_a - o_b",),
    source=(
        "Chung, Sul, Analysis and compensation of current measurement error in vector-controlled "
        "AC motor drives, IEEE Trans. Ind. Appl. 34 (1998) 340"
    ),
    parameters=(
        Parameter(
            "offset_a",
            "A",
            0.0,
            -1e4,
            1e4,
            0.01,
            "rated current",
            ordinary=Ordinary("current_offset", 0.001, "rated current", OF_THREE),
            title="offset of current sensor a",
        ),
        Parameter(
            "offset_b",
            "A",
            0.0,
            -1e4,
            1e4,
            -0.007,
            "rated current",
            ordinary=Ordinary("current_offset", 0.001, "rated current", OF_THREE),
            title="offset of current sensor b",
        ),
    ),
    axis="fixed in the stator",
    order="1",
    region="everywhere alike, at zero current, too",
    confused_with=("winding_asymmetry", "dead_time", "encoder_eccentricity"),
    separated_by="no voltage, rotor at rest: the readings' mean",
    at=(At("reading", shifted, ("offset_a", "offset_b")),),
    do=do,
    drifts=True,  # sensors warm up
)
