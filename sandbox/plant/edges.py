"""The edges of one PWM period in order of time: centred pulses, as commanded; or of half a period,
at double update.

Time runs from the start of the pattern, which is later than the sample t_k by the pattern's delay.
"""

from __future__ import annotations

from model.compiled import inlined, kernel

EDGES = 6
LEG_X, LEG_Y = (1.0, -0.5, -0.5), (0.0, 0.8660254037844386, -0.8660254037844386)


@inlined
def duties(u_alpha, u_beta, u_dc):
    """Return the duties of three legs for a voltage (V): common part centred, limited to what a leg
    can do."""
    side = 0.8660254037844386 * u_beta
    b, c = -0.5 * u_alpha + side, -0.5 * u_alpha - side
    middle = 0.5 * (max(u_alpha, b, c) + min(u_alpha, b, c))
    scale = 1.0 / u_dc
    d_a, d_b, d_c = (
        0.5 + scale * (u_alpha - middle),
        0.5 + scale * (b - middle),
        0.5 + scale * (c - middle),
    )
    return min(max(d_a, 0.0), 1.0), min(max(d_b, 0.0), 1.0), min(max(d_c, 0.0), 1.0)


@inlined
def put(room, n, time, leg, side, real):
    """Sort an edge into the first n; return n + 1."""
    k = n
    while k > 0 and room.time[k - 1] > time:
        room.time[k], room.leg[k], room.side[k], room.real[k] = (
            room.time[k - 1],
            room.leg[k - 1],
            room.side[k - 1],
            room.real[k - 1],
        )
        k -= 1
    room.time[k], room.leg[k], room.side[k], room.real[k] = time, leg, side, real
    return n + 1


@inlined
def pulse(room, n, leg, period):
    """Sort in a leg's pulse; a leg that is always on or always off does not switch."""
    duty = room.duty[leg]
    side = 0.5 * (1.0 - duty) * period
    late = min(max(room.shift[leg], -side), side)
    on = 0.0 if duty <= 0.0 else 1.0
    n = put(room, n, side + late, leg, 1.0, 0.0 if duty >= 1.0 and room.before[leg] >= 1.0 else on)
    return put(room, n, period - side + late, leg, -1.0, 0.0 if duty >= 1.0 else on)


@inlined
def half_pulse(room, n, leg, period, half):
    """Sort in a leg's edge of half a PWM period (s): it rises (half 1) or falls (-1); an edge that
    is none is last."""
    duty = room.duty[leg]
    time = (1.0 - duty) * period if half > 0 else duty * period
    if half > 0:
        real = 0.0 if duty <= 0.0 or (duty >= 1.0 and room.before[leg] >= 1.0) else 1.0
    else:
        real = 0.0 if duty >= 1.0 or (duty <= 0.0 and room.before[leg] <= 0.0) else 1.0
    n = put(room, n, time, leg, float(half), real)
    return put(room, n, period, leg, 0.0, 0.0)


@kernel
def write_edges(room, period):
    """Write the edges of a period (s) from its duties, the last period's, and how late pulses are
    moved.

    room.half: 0, or with double update 1 (legs rise, all are on at the end) and -1 (all are on at
    first, they fall).
    """
    n, half = 0, room.half
    for leg in range(3):
        n = pulse(room, n, leg, period) if half == 0 else half_pulse(room, n, leg, period, half)
    for g in range(EDGES):
        leg = room.leg[g]
        room.x[g] = 1.0 if leg == 0 else -0.5
        room.y[g] = 0.0 if leg == 0 else (0.8660254037844386 if leg == 1 else -0.8660254037844386)
        room.mate[g] = -1
        if room.side[g] < 0.0:
            for m in range(g):
                if room.leg[m] == leg:
                    room.mate[g] = m
