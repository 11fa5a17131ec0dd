"""The edges of one PWM period in order of time: centred pulses, as commanded.

Time runs from the start of the pattern, which is later than the sample t_k by the pattern's delay.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from model.compiled import inlined, kernel

EDGES = 6
LEG_X, LEG_Y = (1.0, -0.5, -0.5), (0.0, 0.8660254037844386, -0.8660254037844386)


class Edges(NamedTuple):
    """Six edges: instant (s), unit vector of the leg, side (1 rises, -1 falls), whether one is switched (1 or 0), the
    leg, and the place of the same leg's edge before it (-1: none)."""

    time: Any
    x: Any
    y: Any
    side: Any
    real: Any
    leg: Any
    mate: Any


def blank_edges() -> Edges:
    """Return room for one period."""
    return Edges(*(np.zeros(EDGES) for _ in range(5)), np.zeros(EDGES, np.int64), np.zeros(EDGES, np.int64))


@inlined
def duties(u_alpha, u_beta, u_dc):
    """Return the duties of three legs for a voltage (V): common part centred, limited to what a leg can do."""
    side = 0.8660254037844386 * u_beta
    b, c = -0.5 * u_alpha + side, -0.5 * u_alpha - side
    middle = 0.5 * (max(u_alpha, b, c) + min(u_alpha, b, c))
    scale = 1.0 / u_dc
    d_a, d_b, d_c = 0.5 + scale * (u_alpha - middle), 0.5 + scale * (b - middle), 0.5 + scale * (c - middle)
    return min(max(d_a, 0.0), 1.0), min(max(d_b, 0.0), 1.0), min(max(d_c, 0.0), 1.0)


@inlined
def put(e, n, time, leg, side, real):
    """Sort an edge into the first n; return n + 1."""
    k = n
    while k > 0 and e.time[k - 1] > time:
        e.time[k], e.leg[k], e.side[k], e.real[k] = e.time[k - 1], e.leg[k - 1], e.side[k - 1], e.real[k - 1]
        k -= 1
    e.time[k], e.leg[k], e.side[k], e.real[k] = time, leg, side, real
    return n + 1


@inlined
def pulse(e, n, leg, duty, before, period, shift):
    """Sort in a leg's pulse; a leg that is always on or always off does not switch."""
    room = 0.5 * (1.0 - duty) * period
    late = min(max(shift, -room), room)
    on = 0.0 if duty <= 0.0 else 1.0
    n = put(e, n, room + late, leg, 1.0, 0.0 if duty >= 1.0 and before >= 1.0 else on)
    return put(e, n, period - room + late, leg, -1.0, 0.0 if duty >= 1.0 else on)


@kernel
def write_edges(e, duty, before, shift, period):
    """Write the edges of a period; duty, before: three legs' duties of this period and the last one, shift: s."""
    n = pulse(e, 0, 0, duty[0], before[0], period, shift[0])
    n = pulse(e, n, 1, duty[1], before[1], period, shift[1])
    pulse(e, n, 2, duty[2], before[2], period, shift[2])
    for g in range(EDGES):
        leg = e.leg[g]
        e.x[g] = 1.0 if leg == 0 else -0.5
        e.y[g] = 0.0 if leg == 0 else (0.8660254037844386 if leg == 1 else -0.8660254037844386)
        e.mate[g] = -1
        if e.side[g] < 0.0:
            for m in range(g):
                if e.leg[m] == leg:
                    e.mate[g] = m
