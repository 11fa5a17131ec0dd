"""How late a leg's edge acts behind a dead time: ideal switches and diodes, a capacitance across
each switch.

Both switches of a leg are off for the dead time T behind a commanded edge.  Written for both edges
alike: `hold` is the leg's current in the direction that keeps the leg where it is (out of a leg
that rises, into one that falls), y the way that its voltage has gone, 0 to 1 of the link's V, C the
capacitance across each switch:

    hold > 0: the diode keeps y = 0;  hold < 0: dy/dt = -hold/(2 C V) up to 1, where the other diode
    keeps it dhold/dt = before + (after - before) y;  y = 1 from T on

`before`, `after`: slopes of the current (A/s) with the leg where it is, and where it goes.  The
edge is late by the integral of 1 - y over T: all that its volt-seconds know.  With slopes of 0 this
is the curve in print: T where hold > 0; T - T^2 |hold|/(4 C V), then C V/|hold| where the leg
arrives in time (`static_sign`).  Without capacitance y is 0, 1, or, where the current stays at
zero, what keeps it there: a straight line from T to 0 (`ideal`).

Source: Zhang, Xu, Dead-time compensation of inverters considering snubber and parasitic
capacitance, IEEE Trans. Power Electron. 29 (2014) 3179; zero-current clamping: Choi, Sul, IEEE
Trans. Power Electron. 11 (1996) 221.
Checked: against an event-exact circuit of six switches and diodes
(tests/sandbox/plant/test_commutation.py).
"""

from __future__ import annotations

import math
from enum import IntEnum

from model.compiled import inlined, kernel


class Leg(IntEnum):
    """Where a leg's voltage is in the dead time: as before, between the rails, at the other one."""

    KEPT = 0
    FLOATING = 1
    GONE = 2


# (slope times charge)/hold^2 up to which `quick` is right: what it leaves out is below 0.1 of the
# square
SMALL = 0.05
# rad of the leg's swing in a dead time, beyond which its mean is that of no capacitance, to T/60 at
# most
SWINGS = 30.0
MOST_PHASES = 64  # of clamping and swinging: two or three a swing, and the first ones


@inlined
def quick(time, charge, hold, inverse, before, after):
    """Return how late (s) an edge acts whose leg is kept, or arrives, all of the dead time; charge:
    2 C V (A s), inverse: 1/|hold|.

    Arriving: C V/|hold| (1 + ((before + (after - before)/4) 2 C V/(3 hold^2))), the slopes to first
    order.  Where that is not right, near no current, it stays between 0 and the time all the same:
    what is added to make it right would be lost in a number without bounds.
    """
    bent = (0.75 * before + 0.25 * after) * charge * (1.0 / 3.0) * (inverse * inverse)
    return time if hold > 0.0 else min(max(0.5 * charge * inverse * (1.0 + bent), 0.0), time)


@inlined
def crossing(time, charge, hold, before, after):
    """Return whether `quick` may be wrong at constant slopes (A/s).

    The current may come to zero in the dead time, bend on the way, or the leg may not arrive.
    """
    size, steepest = abs(hold), max(abs(before), abs(after))
    slow = (steepest * charge > SMALL * size * size) | (charge > 0.9 * time * size)
    return (size < steepest * time) | ((hold <= 0.0) & slow)


@kernel
def lateness(time, capacitance, link, hold, before, after):
    """Return how late (s) an edge acts, exactly for constant slopes (A/s); capacitance in F, link
    in V, time > 0."""
    charge, steep = 2.0 * capacitance * link, after - before
    if charge <= 0.0 or steep * time * time > SWINGS * SWINGS * charge:
        return ideal(time, hold, before, after)
    if steep <= 0.0:  # no voltage, no change
        return 0.5 * time * (1.0 + static_sign(hold, charge / time))
    return time - gone_over(time, charge, hold, before, steep)


@inlined
def ideal(time, hold, before, after):
    """Return the same (s) without capacitance: straight between the currents that just come to zero
    in the time."""
    low, high = -max(after, 0.0) * time, max(-before, 0.0) * time
    width = high - low
    return (
        time * min(max((hold - low) / width, 0.0), 1.0)
        if width > 0.0
        else (time if hold > 0.0 else 0.0)
    )


@kernel
def gone_over(time, charge, hold, before, steep):
    """Return the integral of y (s) over the dead time, phase by phase: kept, floating, gone,
    floating, ...

    Floating, y swings about the place at which the current would stay as it is, with rate
    sqrt(steep/charge).
    """
    kept = hold > 0.0 or (hold == 0.0 and before >= 0.0)
    left, y, area, phase = time, 0.0, 0.0, (Leg.KEPT if kept else Leg.FLOATING)
    middle, rate = -before / steep, math.sqrt(steep / charge)
    for _ in range(MOST_PHASES):
        if phase == Leg.FLOATING:
            p, s = y - middle, -hold / (charge * rate)
            turn, y_to = next_clamp(p, s, middle)
            on = min(turn, rate * left)
            sine, versed = math.sin(on), 2.0 * math.sin(0.5 * on) ** 2
            area += (middle * on + p * sine + s * versed) / rate
            left -= on / rate
            hold = charge * rate * (p * sine - s * (1.0 - versed))
            y, phase = y_to, (Leg.KEPT if y_to == 0.0 else Leg.GONE)
        else:
            slope = before if phase == Leg.KEPT else before + steep
            leaves = hold * slope < 0.0
            on = min(-hold / slope, left) if leaves else left
            area += y * on
            left -= on
            hold, phase = 0.0, Leg.FLOATING
        if left <= 0.0:
            return area
    return area + min(max(middle, 0.0), 1.0) * left


@kernel
def next_clamp(p, s, middle):
    """Return the angle at which y = middle + p cos + s sin first comes to 1 or, falling, to 0, and
    which; inf: never.

    y begins between both; where it begins at 0 or 1, it goes inwards.
    """
    size, begun = math.hypot(p, s), math.atan2(s, p)
    up, down = math.inf, math.inf
    if size > 1.0 - middle > -size:
        up = (begun - math.acos((1.0 - middle) / size)) % math.tau
    if size > middle > -size:
        down = (begun + math.acos(-middle / size)) % math.tau
    return (up, 1.0) if up < down else (down, 0.0)


@inlined
def clip(x):
    """Return x between -1 and 1."""
    return min(max(x, -1.0), 1.0)


@kernel
def static_sign(current, corner):
    """Return what `lateness` is for a constant current, as a sign: 2 late/T - 1.  corner (A): 2 C
    V/T, at which the leg just arrives."""
    if current >= 0.0 or corner <= 0.0:
        return 1.0 if current >= 0.0 else -1.0
    return 1.0 + current / corner if current > -corner else -corner / current - 1.0
