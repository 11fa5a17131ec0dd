"""Encoder not aligned with the magnet."""

from __future__ import annotations

import math
from collections.abc import Mapping

from model.compiled import inlined
from model.effects.card import At, Effect, Ordinary, Parameter
from model.effects.said import angle
from model.parameters import Converter, Motor


@inlined
def turned(offset):
    """Return what all readings are off (rad, electrical)."""
    return offset


def do(v: Mapping[str, float], motor: Motor, converter: Converter) -> str:
    """Return what to do about it, at completed values."""
    offset = v["encoder_offset.offset"]
    way = "subtract {} from" if offset > 0.0 else "add {} to"
    angles = f"{angle(offset)} (electrical; {angle(offset / motor.pole_pairs)} mechanical)"
    return f"{way.format(angles)} the encoder's reading, or align it again"


CARD = Effect(
    name="encoder_offset",
    summary="encoder not aligned with the magnet",
    subsystem="sensor",
    equation="theta_read = theta + offset",
    formulas=(r"\theta_\text{read} = \theta + \theta_0",),
    source="geometry",
    parameters=(
        Parameter(
            "offset",
            "rad",
            0.0,
            -math.tau,
            math.tau,
            0.05,
            ordinary=Ordinary("encoder_offset", 0.003),
            title="offset of the encoder",
        ),
    ),
    axis="d from q and q from d",
    order="0",
    region="all; back-EMF on d at zero current",
    confused_with=("current_sampling", "pwm_delay", "cross_saturation"),
    separated_by=(
        "driven rotor at zero current: back-EMF on d proportional to speed in both directions; a "
        "delay's share is odd in speed, an offset's even"
    ),
    at=(At("offset", turned, ("offset",)),),
    do=do,
)
