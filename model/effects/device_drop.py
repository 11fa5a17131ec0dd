"""Forward drop of the switches and diodes.

At small currents it is less than their threshold: at a sharp one it goes through zero as the sign
of a current does everywhere, linearly; with a knee it is V_t (1 - exp(-|i|/i_k)).
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from model.array_types import Array
from model.compiled import inlined
from model.effects.card import At, Effect, Legs, LegSlope, Parameter
from model.effects.said import quantity
from model.lanes import fading
from model.parameters import Converter, Motor


@inlined
def primitive(x):
    """Return the integral of the soft sign from 0 to x (current over soft width)."""
    size = abs(x)
    inside = min(size, 1.0)
    return inside * (size - 0.5 * inside)


@inlined
def mean_sign(x, y, steep=1.0):
    """Return the mean of the soft sign of `steep` times the current while that goes linearly from x
    to y (over soft width).  Of several such means at one x and y, the division is done once."""
    step = y - x
    flat = abs(step) < 1e-6
    inverse = 1.0 / (1.0 if flat else step)
    middle = min(max(0.5 * steep * (x + y), -1.0), 1.0)
    return (
        middle if flat else (primitive(steep * y) - primitive(steep * x)) * inverse * (1.0 / steep)
    )


@inlined
def mean_of_tanh(x, y):
    """Return the mean of tanh while its argument goes linearly from x to y, within 0.017.

    tanh as three soft signs, whose means have no logarithm: widths and shares are the minimax fit
    for x >= 0 (tests/sandbox/plant/test_commutation_soft_sign.py fits them again).
    """
    narrow, middle = 0.277034 * mean_sign(x, y, 1.609714), 0.441430 * mean_sign(x, y, 0.797139)
    return narrow + middle + 0.281536 * mean_sign(x, y, 0.418666)


@inlined
def lost(threshold, knee, before, after, shape):
    """Return what a leg loses on average (V) at a sharp threshold, its current over the soft width
    going from before to after.

    shape: of the soft sign, from 0 (linear) to 1 (tanh).
    """
    threshold = 0.0 if knee > 0.0 else threshold
    linear = mean_sign(before, after)
    if shape == 0.0:
        return threshold * linear
    return threshold * (linear + shape * (mean_of_tanh(before, after) - linear))


@inlined
def at_knee(x):
    """Return the volts at a current over the knee, in thresholds, and their integral from 0 on."""
    size = abs(x)
    lacks = fading(-size)
    return (1.0 - lacks if x >= 0.0 else lacks - 1.0), size - (1.0 - lacks)


@inlined
def lost_at_knee(threshold, knee, before, after):
    """Return what a leg loses on average (V) with a knee, its current (A) going straight from
    before to after."""
    per = 1.0 / (knee if knee > 0.0 else 1.0)
    x, y = before * per, after * per
    step = y - x
    flat = abs(step) < 1e-5  # a mean of the ends is off by 1/12 of its square
    (here, first), (there, last) = at_knee(x), at_knee(y)
    mean = 0.5 * (here + there) if flat else (last - first) / (1.0 if flat else step)
    return threshold * mean if knee > 0.0 else 0.0


@inlined
def slope(on_resistance):
    """Return the resistance (ohm) of the devices that conduct."""
    return on_resistance


def leg_loss(v: Mapping[str, float], current: Array) -> Array:
    """Return what a leg loses by it (V, any shape) at constant currents (A), by completed
    values."""
    i, knee = np.asarray(current, dtype=float), v["device_drop.knee_current"]
    share = -np.expm1(-np.abs(i) / knee) * np.sign(i) if knee else sign(v, i)
    return np.asarray(v["device_drop.threshold"] * share + v["device_drop.on_resistance"] * i)


def sign(v: Mapping[str, float], current: Array) -> Array:
    """Return the sign of currents (A, any shape) as it goes through zero, sharp where values say
    nothing of its zone."""
    width, shape = v.get("bench.soft_current", 0.0), v.get("bench.soft_shape", 0.0)
    if not width:
        return np.sign(current)
    x = np.asarray(current, dtype=float) / width
    return (1.0 - shape) * np.clip(x, -1.0, 1.0) + shape * np.tanh(x)


def leg_slope(v: Mapping[str, float], motor: Motor, legs: Legs) -> LegSlope:
    """Return what a leg loses by the threshold around zero current, by completed values; the
    on-resistance is one of the winding's circuit (`slope`)."""
    within = v["device_drop.knee_current"] or legs.zone
    return LegSlope(v["device_drop.threshold"] * (1.0 / within), within)


def do(v: Mapping[str, float], motor: Motor, converter: Converter) -> str:
    """Return what to do about it, at completed values."""
    threshold, ohm = v["device_drop.threshold"], v["device_drop.on_resistance"]
    own = [f"{quantity(threshold, 'V')} with the sign of each phase current"] if threshold else []
    own += [f"{quantity(ohm, 'ohm')} times it (or put that into the resistance)"] if ohm else []
    knee = v["device_drop.knee_current"] if threshold else 0.0
    soft = f", less of it below {quantity(2.0 * knee, 'A')}" if knee else ""
    return f"add to the commanded phase voltages {' and '.join(own)}{soft}: what the devices drop"


CARD = Effect(
    name="device_drop",
    summary="forward drop of the switches and diodes",
    subsystem="inverter",
    equation=(
        "leg voltage -= threshold sign(i) + r i, sign linear within +-1.5 % of rated current, or "
        "with a knee (1 - exp(-|i|/knee)) sign(i)"
    ),
    formulas=(
        r"u_\text{leg} \;\text{-=}\; V_t\,\operatorname{sign}(i) + r\,i, \qquad "
        r"\operatorname{sign}(i) \to \bigl(1 - e^{-|i|/i_k}\bigr)\operatorname{sign}(i)",
    ),
    source=(
        "Choi, Sul, Inverter output voltage synthesis using novel dead time compensation, IEEE "
        "Trans. Power Electron. 11 (1996) 221"
    ),
    parameters=(
        Parameter("threshold", "V", 0.0, 0.0, 50.0, 1.0, title="threshold voltage of the devices"),
        Parameter(
            "on_resistance",
            "ohm",
            0.0,
            0.0,
            1e2,
            0.02,
            "resistance",
            title="on-resistance of the devices",
        ),
        Parameter(
            "knee_current",
            "A",
            0.0,
            0.0,
            1e5,
            0.0,
            "rated current",
            fit="log",
            spread=1.0,
            change=0.05,
            title="current of the devices' knee",
        ),
    ),
    axis="against the current",
    order="1 and 6k",
    region="steps at zero crossings, then constant",
    confused_with=("dead_time", "stator_resistance"),
    separated_by=(
        "zero crossings at two DC-link voltages or PWM frequencies: dead time scales "
        "with them, the threshold does not"
    ),
    at=(
        At("leg", lost, ("threshold", "knee_current")),
        At("leg_curve", lost_at_knee, ("threshold", "knee_current"), switches=("knee_current",)),
        At("resistance", slope, ("on_resistance",)),
    ),
    switches=("threshold", "on_resistance"),
    do=do,
    leg_slope=leg_slope,
)
