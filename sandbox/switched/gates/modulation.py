"""How the bench's drive modulates, by dwell times of space vectors: apart from
`sandbox.plant.gates.modulation`.

A voltage in the sector between two neighbouring active vectors takes the shares t_1, t_2 of the
period from them; the rest is zero vectors, none of the legs on or all.  Corner m of the hexagon
stands at m times 60 degrees: with m even one leg is on, with m odd two are.
"""

from __future__ import annotations

import cmath
import math
from enum import IntEnum

from model.compiled import kernel

SIXTH = math.pi / 3.0
NO_PULSE = 1e-9  # of the period


class ZeroVectors(IntEnum):
    """Where a pattern's zero vectors come from, in the order of MODULATIONS."""

    BOTH, ALL_OFF, ALL_ON, LARGEST_KEPT = range(4)


class Limit(IntEnum):
    """What becomes of a voltage beyond the hexagon, in the order of OVERMODULATIONS behind none."""

    NONE, NEAREST_POINT, SAME_ANGLE, CORNERS = range(4)


@kernel
def on(corner, leg):
    """Return whether a leg (0, 1, 2) is on in a corner: within 90 degrees of the leg's own axis."""
    apart = (corner - 2 * leg) % 6
    return 1.0 if apart in (0, 1, 5) else 0.0


@kernel
def dwell(beyond, u, u_dc):
    """Return the sector and the shares of its two corners for a voltage (V), limited to what a
    period holds."""
    angle = cmath.phase(u) % (2.0 * math.pi)
    sector = min(int(angle // SIXTH), 5)
    size, angle = abs(u) / u_dc, angle - SIXTH * sector
    first, second = (
        math.sqrt(3.0) * size * math.sin(SIXTH - angle),
        math.sqrt(3.0) * size * math.sin(angle),
    )
    if beyond == Limit.CORNERS and size >= 2.0 / math.pi:
        return sector, 1.0 if first > second else 0.0, 0.0 if first > second else 1.0
    over = first + second - 1.0
    if over > 0.0 and beyond == Limit.SAME_ANGLE:
        first, second = first / (1.0 + over), second / (1.0 + over)
    elif over > 0.0:
        first = min(max(first - 0.5 * over, 0.0), 1.0)
        second = 1.0 - first
    return sector, first, second


@kernel
def dwelt(b, u_alpha, u_beta, u_dc):
    """Return the legs' duties for a voltage (V) as the bench's drive modulates."""
    sector, first, second = dwell(b.beyond, complex(u_alpha, u_beta), u_dc)
    rest = 1.0 - first - second
    if b.pattern == ZeroVectors.BOTH:
        high = 0.5 * rest
    elif (
        b.pattern == ZeroVectors.LARGEST_KEPT
    ):  # one leg on nearby: its voltage is the largest, it stays on
        single = first > second if sector % 2 == 0 else second > first
        high = rest if single else 0.0
    else:
        high = rest if b.pattern == ZeroVectors.ALL_ON else 0.0
    a = high + first * on(sector, 0) + second * on(sector + 1, 0)
    b_ = high + first * on(sector, 1) + second * on(sector + 1, 1)
    c = high + first * on(sector, 2) + second * on(sector + 1, 2)
    return whole(a), whole(b_), whole(c)


@kernel
def whole(duty):
    """Return a duty that is 0 or 1 but for rounding as 0 or 1: it would have edges of its own."""
    if duty < NO_PULSE:
        return 0.0
    return 1.0 if duty > 1.0 - NO_PULSE else duty
