"""What a leg of the inverter loses, by its current: sign through zero, device drop, a measured
table, one bad device.

The sign's shape: `linear`, clip(i/w); `hard`, sign(i); `tanh`, tanh(i/w), which has the linear
one's slope at zero and reaches 96 % at 2 w.  w is the half-width in A.  It serves dead time (at the
edge) and device drop alike.

A table of the leg's voltage error (V, what is lost) against its current (A) stands in place of dead
time and device drop: straight between its points, odd, constant beyond the last; it acts all the
time as a mean
voltage does.

A device of one direction that loses more: one_sided * max(i, 0) in every leg.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from model.compiled import inlined, kernel
from model.errors import BadInput

LINEAR, HARD, TANH = 0.0, 1.0, 2.0
SHAPES = {"linear": LINEAR, "hard": HARD, "tanh": TANH}
POINT = [("current", np.float64), ("volts", np.float64)]


def leg_table(current: ArrayLike, volts: ArrayLike) -> Any:
    """Return a table of a leg's voltage error for a bench; current: (n,) A, from 0 up; volts: (n,)
    V, 0 first.

    BadInput for other shapes, values that are not finite, currents that do not rise.
    """
    i, v = (
        np.atleast_1d(np.asarray(current, dtype=float)),
        np.atleast_1d(np.asarray(volts, dtype=float)),
    )
    if i.ndim != 1 or i.shape != v.shape or len(i) < 2:
        raise BadInput(
            f"inverter table has {i.shape} currents and {v.shape} voltages; give as many "
            "of each, two at least"
        )
    if not (np.isfinite(i).all() and np.isfinite(v).all() and (np.diff(i) > 0.0).all()):
        raise BadInput(
            "inverter table has currents that do not rise, or values that are not "
            "finite; sort it and clean it"
        )
    if i[0] != 0.0 or v[0] != 0.0:
        raise BadInput(
            f"inverter table begins with {v[0]:g} V at {i[0]:g} A; it is odd: begin it "
            "with 0 V at 0 A"
        )
    table = np.empty(len(i), POINT)
    table["current"], table["volts"] = i, v
    return table


@inlined
def clip(x):
    """Return x between -1 and 1."""
    return min(max(x, -1.0), 1.0)


@kernel
def soft_sign(b, current):
    """Return the sign of a leg's current as it goes through zero."""
    x = current / b.soft_current
    return clip(x) if b.sign_shape == LINEAR else other_sign(b.sign_shape, x)


@kernel
def edge_sign(b, hold):
    """Return the sign of the current (A) that keeps a leg where it is as an edge is commanded: by
    dead time's own zone, if it has one."""
    if b.zone_width == 0.0 and b.zone_tanh == 0.0 and b.zone_center == 0.0:
        return soft_sign(b, hold)
    x = hold / (b.zone_width if b.zone_width > 0.0 else b.soft_current) - b.zone_center
    return clip(x) + b.zone_tanh * (math.tanh(x) - clip(x))


@inlined
def soft_signs(b, i_a, i_b, i_c):
    """Return the three legs' signs: one question about the shape instead of three."""
    a, b_, c = i_a / b.soft_current, i_b / b.soft_current, i_c / b.soft_current
    if b.sign_shape == LINEAR:
        return clip(a), clip(b_), clip(c)
    return other_sign(b.sign_shape, a), other_sign(b.sign_shape, b_), other_sign(b.sign_shape, c)


@inlined
def device_signs(b, i_a, i_b, i_c):
    """Return what the three legs' devices drop at their currents (A), in thresholds."""
    if b.threshold_knee == 0.0:
        return soft_signs(b, i_a, i_b, i_c)
    return rounded(b, i_a), rounded(b, i_b), rounded(b, i_c)


@kernel
def rounded(b, current):
    """Return the same of one leg whose devices have a knee."""
    return math.copysign(1.0 - math.exp(-abs(current) / b.threshold_knee), current)


@kernel
def other_sign(shape, x):
    """Return the sign of x, hard or as a hyperbolic tangent."""
    if shape == TANH:
        return math.tanh(x)
    return 1.0 if x > 0.0 else (-1.0 if x < 0.0 else 0.0)


@inlined
def given(table):
    """Tell whether there is a table."""
    return table is not None


@inlined
def reached(p, q, at):
    """Return the share of the way from p to q at which `at` is met; 1 where it is not."""
    return (at - p) / (q - p) if (p - at) * (q - at) < 0.0 else 1.0


@inlined
def table_corner(table, p, q):
    """Return the share of the way from current p to q (A) at which the first point of a table is
    met; 1: none."""
    share = 1.0
    if table is None:
        return share
    for k in range(table.shape[0]):
        share = min(share, reached(p, q, -table[k].current), reached(p, q, table[k].current))
    return share


@inlined
def table_volts(table, current):
    """Return what a leg loses (V) at a current (A) by its measured table."""
    if table is None:
        return 0.0
    size, low, high = abs(current), 0, table.shape[0] - 1
    if size >= table[high].current:
        return math.copysign(1.0, current) * table[high].volts
    while high - low > 1:
        middle = (low + high) // 2
        if table[middle].current <= size:
            low = middle
        else:
            high = middle
    share = (size - table[low].current) / (table[high].current - table[low].current)
    return math.copysign(1.0, current) * (
        table[low].volts + share * (table[high].volts - table[low].volts)
    )


@inlined
def unlisted_drop(b, current):
    """Return what a leg loses (V) by its table and by its one-sided device."""
    return b.one_sided * max(current, 0.0) + table_volts(b.leg_table, current)
