"""Encoder not aligned with the magnet, or read late."""

from __future__ import annotations

import math
from collections.abc import Mapping

from model.compiled import inlined
from model.effects.card import At, Effect, Ordinary, Parameter
from model.effects.said import angle, quantity
from model.parameters import Converter, Motor


@inlined
def turned(offset):
    """Return what all readings are off (rad, electrical)."""
    return offset


@inlined
def old(latency):
    """Return by how much readings are older than their rows (s)."""
    return latency


def do(v: Mapping[str, float], motor: Motor, converter: Converter) -> str:
    """Return what to do about it, at completed values."""
    offset, late = v["encoder_offset.offset"], v["encoder_offset.latency"]
    way = "subtract {} from" if offset > 0.0 else "add {} to"
    angles = f"{angle(offset)} (electrical; {angle(offset / motor.pole_pairs)} mechanical)"
    steps = [f"{way.format(angles)} the encoder's reading, or align it again"] if offset else []
    if late:
        sign = "add" if late > 0.0 else "subtract"
        steps.append(
            f"{sign} the speed times {quantity(abs(late), 's')} to the angle that is read: it is "
            f"{'older' if late > 0.0 else 'newer'} than its row by that"
        )
    return "; ".join(steps)


CARD = Effect(
    name="encoder_offset",
    summary="encoder not aligned with the magnet, or read late",
    subsystem="sensor",
    equation="theta_read = theta + offset - latency omega",
    formulas=(r"\theta_\text{read} = \theta + \theta_0 - t_l\,\omega",),
    source="geometry; a reading that is older than its row, to the first order in its age",
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
        Parameter(
            "latency",
            "s",
            0.0,
            -1e-2,
            1e-2,
            0.08,
            "PWM period",
            title="age of the encoder's readings",
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
    at=(At("offset", turned, ("offset",)), At("latency", old, ("latency",))),
    do=do,
)
