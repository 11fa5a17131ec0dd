"""What dead time's edges leave in the lags of current filter and iron loss: lost volt-seconds, where they are.

Late patterns are in the lags already (`filtered`, `legs`); an edge later or earlier than its pattern is a step of flux.
"""

from __future__ import annotations

from model.compiled import inlined, kernel
from sandbox.replay.lanes import (
    CLAG_A,
    CLAG_B,
    CORE_INV,
    CORE_TIME,
    DEAD,
    EARLY_A,
    EARLY_B,
    EDGE_0,
    EDGE_1,
    EDGE_2,
    EDGE_3,
    EDGE_4,
    EDGE_5,
    FILTER_KEEP,
    FILTER_TIME,
    LANES,
    LATE,
    LATE_0,
    LATE_1,
    LATE_2,
    LATE_3,
    LATE_4,
    LATE_5,
    LINK_A,
    NOW_A,
    NOW_B,
    fading,
)


@inlined
def kick(w, j, late, e, side, inverse, even, period, x, y):
    """Add what one edge, later or earlier than its pattern by half the dead time, leaves in a lag (V s)."""
    t = e[0] + w[LATE * LANES + j]
    size = side * (2.0 / 3.0) * w[LINK_A * LANES + j] * (late - 0.5 * abs(w[DEAD * LANES + j]))
    size *= fading(min(t - period, 0.0) * inverse) - even
    return x + size * e[3], y + size * e[4]


@inlined
def kicks(w, j, tau, inverse, e_0, e_1, e_2, e_3, e_4, e_5, period):
    """Return what the edges leave in a lag beyond the late pattern (V s): lost volt-seconds, where they are."""
    even = tau / period * (1.0 - fading(-period * inverse))
    x, y = kick(w, j, w[LATE_0 * LANES + j], e_0, 1.0, inverse, even, period, 0.0, 0.0)
    x, y = kick(w, j, w[LATE_1 * LANES + j], e_1, 1.0, inverse, even, period, x, y)
    x, y = kick(w, j, w[LATE_2 * LANES + j], e_2, 1.0, inverse, even, period, x, y)
    x, y = kick(w, j, w[LATE_3 * LANES + j], e_3, -1.0, inverse, even, period, x, y)
    x, y = kick(w, j, w[LATE_4 * LANES + j], e_4, -1.0, inverse, even, period, x, y)
    return kick(w, j, w[LATE_5 * LANES + j], e_5, -1.0, inverse, even, period, x, y)


@inlined
def filter_kick(w, j, x, late, e, side, period, total):
    """Add the same of the filter, and weighted by how long ago it was (in periods); x: what it knows of the edge."""
    tau, keep = w[FILTER_TIME * LANES + j], w[FILTER_KEEP * LANES + j]
    ago, even = max(period - e[0] - w[LATE * LANES + j], 0.0), tau / period * (1.0 - keep)
    size = side * (2.0 / 3.0) * w[LINK_A * LANES + j] * (late - 0.5 * abs(w[DEAD * LANES + j]))
    now, early = size * (x - even), size * ((ago + tau) * x + tau * (keep - 2.0 * even)) / period
    return total[0] + now * e[3], total[1] + now * e[4], total[2] + early * e[3], total[3] + early * e[4]


@kernel
def kick_filter(w, e_0, e_1, e_2, e_3, e_4, e_5, period):
    """Add dead time's edges to the current filter's ripple."""
    for j in range(LANES):
        z = (w[NOW_A * LANES + j], w[NOW_B * LANES + j], w[EARLY_A * LANES + j], w[EARLY_B * LANES + j])
        z = filter_kick(w, j, w[EDGE_0 * LANES + j], w[LATE_0 * LANES + j], e_0, 1.0, period, z)
        z = filter_kick(w, j, w[EDGE_1 * LANES + j], w[LATE_1 * LANES + j], e_1, 1.0, period, z)
        z = filter_kick(w, j, w[EDGE_2 * LANES + j], w[LATE_2 * LANES + j], e_2, 1.0, period, z)
        z = filter_kick(w, j, w[EDGE_3 * LANES + j], w[LATE_3 * LANES + j], e_3, -1.0, period, z)
        z = filter_kick(w, j, w[EDGE_4 * LANES + j], w[LATE_4 * LANES + j], e_4, -1.0, period, z)
        z = filter_kick(w, j, w[EDGE_5 * LANES + j], w[LATE_5 * LANES + j], e_5, -1.0, period, z)
        w[NOW_A * LANES + j], w[NOW_B * LANES + j], w[EARLY_A * LANES + j], w[EARLY_B * LANES + j] = z


@kernel
def kick_core(w, e_0, e_1, e_2, e_3, e_4, e_5, period):
    """Add dead time's edges to the iron-loss current's ripple."""
    for j in range(LANES):
        tau, inverse = w[CORE_TIME * LANES + j], w[CORE_INV * LANES + j]
        x, y = kicks(w, j, tau, inverse, e_0, e_1, e_2, e_3, e_4, e_5, period)
        w[CLAG_A * LANES + j], w[CLAG_B * LANES + j] = w[CLAG_A * LANES + j] + x, w[CLAG_B * LANES + j] + y
