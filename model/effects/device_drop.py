"""Forward drop of the switches and diodes."""

from __future__ import annotations

from model.compiled import inlined
from model.effects.card import At, Effect, Parameter


@inlined
def primitive(x):
    """Return the integral of the soft sign from 0 to x (current over soft width)."""
    size = abs(x)
    return 0.5 * x * x if size < 1.0 else size - 0.5


@inlined
def mean_sign(x, y):
    """Return the mean of the soft sign while the current goes linearly from x to y (currents over soft width)."""
    step = y - x
    flat = abs(step) < 1e-6
    return min(max(0.5 * (x + y), -1.0), 1.0) if flat else (primitive(y) - primitive(x)) / (1.0 if flat else step)


@inlined
def mean_of_tanh(x, y):
    """Return the mean of tanh while its argument goes linearly from x to y, within 0.017.

    tanh as three soft signs, whose means have no logarithm: widths and shares are the minimax fit for x >= 0
    (tests/sandbox/plant/test_soft_sign.py fits them again).
    """
    narrow = 0.277034 * mean_sign(1.609714 * x, 1.609714 * y)
    middle = 0.441430 * mean_sign(0.797139 * x, 0.797139 * y)
    return narrow + middle + 0.281536 * mean_sign(0.418666 * x, 0.418666 * y)


@inlined
def lost(threshold, before, after, shape):
    """Return what a leg loses on average (V), its current over the soft width going from before to after.

    shape: of the soft sign, from 0 (linear) to 1 (tanh).
    """
    linear = mean_sign(before, after)
    if shape == 0.0:
        return threshold * linear
    return threshold * (linear + shape * (mean_of_tanh(before, after) - linear))


CARD = Effect(
    name="device_drop",
    summary="forward drop of the switches and diodes",
    subsystem="inverter",
    equation="leg voltage -= threshold sign(i) + r i, sign linear within +-1.5 % of rated current",
    source=(
        "Choi, Sul, Inverter output voltage synthesis using novel dead time compensation, IEEE Trans. "
        "Power Electron. 11 (1996) 221; mean of the soft sign between edges: AVERAGING 6"
    ),
    parameters=(
        Parameter("threshold", "V", 0.0, 0.0, 50.0, 1.0),
        Parameter("on_resistance", "ohm", 0.0, 0.0, 1e2, 0.02, "resistance"),
    ),
    axis="against the current",
    order="1 and 6k",
    region="steps at zero crossings, then constant",
    confused_with=("dead_time", "stator_resistance"),
    separated_by=(
        "zero crossings at two DC-link voltages or PWM frequencies: dead time scales with them, the threshold does not"
    ),
    at=(At("leg", lost, ("threshold",)),),
    rows=lambda v, motor: {"resistance": v["device_drop.on_resistance"]},
)
