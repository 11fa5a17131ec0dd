"""What one period's flux ripple leaves in the analogue current filter: sums over the pulses' edges, LANES sets at once.

Closed forms of `sandbox/switched/AVERAGING.md`, "A filter in the replay"; `filtered` makes currents of them.
"""

from __future__ import annotations

from model.compiled import inlined, kernel
from model.pulses import on_time
from sandbox.replay.curvature import ROOT_3
from sandbox.replay.lanes import (
    BENT_AA,
    BENT_AB,
    BENT_BB,
    CURVED_A,
    CURVED_B,
    EARLY_A,
    EARLY_B,
    EDGE_0,
    EDGE_1,
    EDGE_2,
    EDGE_3,
    EDGE_4,
    EDGE_5,
    FILTER_INV,
    FILTER_KEEP,
    FILTER_TIME,
    LANES,
    LATE,
    LINK_A,
    NOW_A,
    NOW_B,
    PATTERN_A,
    PATTERN_B,
    fading,
)


@inlined
def of_edge(e, side, mean_a, mean_b, v_a, v_b, inverse, late, period, total):
    """Add one edge's sums to a total and return x, what the filter still knows of it at the period's end.

    Sums of its step (unit link voltage) times x, a x, a^2 x and a, its time a (s) before the end, and of its square's
    two parts times x.  v: slope of the ripple before the edge.  An edge beyond the end acts in the next period
    (`carry`): 1 and 0 for x and a, none in the square; the last sum is such edges' steps.
    """
    n_a, n_b, o_a, o_b, m_a, m_b, k_a, k_b, p_aa, p_ab, p_bb, q_aa, q_ab, q_bb, g_a, g_b = total
    l_a, l_b = side * (2.0 / 3.0) * e[3], side * (2.0 / 3.0) * e[4]
    r_a, r_b = e[1] - e[0] * mean_a, e[2] - e[0] * mean_b
    ago = period - e[0] - late
    a, beyond = max(ago, 0.0), (1.0 if ago < 0.0 else 0.0)
    x = fading(-a * inverse)
    f = x - beyond
    p_aa, p_ab, p_bb = p_aa + 2.0 * l_a * r_a * f, p_ab + (l_a * r_b + l_b * r_a) * f, p_bb + 2.0 * l_b * r_b * f
    q_aa, q_bb = q_aa + 2.0 * l_a * (2.0 * v_a + l_a) * f, q_bb + 2.0 * l_b * (2.0 * v_b + l_b) * f
    q_ab += 2.0 * (l_a * v_b + l_b * v_a + l_a * l_b) * f
    n_a, n_b, o_a, o_b = n_a + l_a * x, n_b + l_b * x, o_a + l_a * a * x, o_b + l_b * a * x
    m_a, m_b, k_a, k_b = m_a + l_a * a * a * x, m_b + l_b * a * a * x, k_a + l_a * a, k_b + l_b * a
    g_a, g_b = g_a + l_a * beyond, g_b + l_b * beyond
    return x, (n_a, n_b, o_a, o_b, m_a, m_b, k_a, k_b, p_aa, p_ab, p_bb, q_aa, q_ab, q_bb, g_a, g_b)


@inlined
def left(tau, keep, period, x, a_x, aa_x, a):
    """Return of such sums what the flux ripple leaves in the filter (s): in all, times its age (in periods), times age
    and time till then (in periods squared)."""
    even, per = tau / period * (1.0 - keep), 1.0 / period
    early = tau * (a_x + 2.0 * tau * x - a * (keep - 2.0 * even))
    old = tau * (aa_x + 4.0 * tau * a_x + 6.0 * tau * tau * x)
    old -= a * (tau * keep * (period + 4.0 * tau) - 6.0 * tau * tau * even)
    return tau * x + a * even, per * early, per * (early - per * old)


@inlined
def write(w, j, tau, keep, period, n_a, n_b, o_a, o_b, m_a, m_b, k_a, k_b):
    """Add the ripple of an edge's or a period's sums to what the filter has of this period (V s)."""
    v = w[LINK_A * LANES + j]
    now, early, curved = left(tau, keep, period, n_a, o_a, m_a, k_a)
    w[NOW_A * LANES + j], w[EARLY_A * LANES + j] = w[NOW_A * LANES + j] + v * now, w[EARLY_A * LANES + j] + v * early
    w[CURVED_A * LANES + j] += v * curved
    now, early, curved = left(tau, keep, period, n_b, o_b, m_b, k_b)
    w[NOW_B * LANES + j], w[EARLY_B * LANES + j] = w[NOW_B * LANES + j] + v * now, w[EARLY_B * LANES + j] + v * early
    w[CURVED_B * LANES + j] += v * curved


@inlined
def six_edges(w, j, late, mean_a, mean_b, s, e_0, e_1, e_2, e_3, e_4, e_5, period):
    """Write lane j's ripple of this period in the filter and return (less carried edges) the sums that its square asks
    for; s: slopes between the edges."""
    tau, inverse, keep = w[FILTER_TIME * LANES + j], w[FILTER_INV * LANES + j], w[FILTER_KEEP * LANES + j]
    z = (0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
    x_0, z = of_edge(e_0, 1.0, mean_a, mean_b, -mean_a, -mean_b, inverse, late, period, z)
    x_1, z = of_edge(e_1, 1.0, mean_a, mean_b, s[0], s[1], inverse, late, period, z)
    x_2, z = of_edge(e_2, 1.0, mean_a, mean_b, s[2], s[3], inverse, late, period, z)
    x_3, z = of_edge(e_3, -1.0, mean_a, mean_b, -mean_a, -mean_b, inverse, late, period, z)
    x_4, z = of_edge(e_4, -1.0, mean_a, mean_b, s[4], s[5], inverse, late, period, z)
    x_5, z = of_edge(e_5, -1.0, mean_a, mean_b, s[6], s[7], inverse, late, period, z)
    w[EDGE_0 * LANES + j], w[EDGE_1 * LANES + j], w[EDGE_2 * LANES + j] = x_0, x_1, x_2
    w[EDGE_3 * LANES + j], w[EDGE_4 * LANES + j], w[EDGE_5 * LANES + j] = x_3, x_4, x_5
    n_a, n_b, o_a, o_b, m_a, m_b, k_a, k_b, p_aa, p_ab, p_bb, q_aa, q_ab, q_bb, g_a, g_b = z
    w[NOW_A * LANES + j] = w[NOW_B * LANES + j] = w[EARLY_A * LANES + j] = w[EARLY_B * LANES + j] = 0.0
    w[CURVED_A * LANES + j] = w[CURVED_B * LANES + j] = 0.0
    write(w, j, tau, keep, period, n_a, n_b, o_a, o_b, m_a, m_b, k_a, k_b)
    w[BENT_AA * LANES + j], w[BENT_AB * LANES + j] = tau * (p_aa - tau * q_aa), tau * (p_ab - tau * q_ab)
    w[BENT_BB * LANES + j] = tau * (p_bb - tau * q_bb)
    return n_a - g_a, n_b - g_b, o_a, o_b, k_a, k_b


@kernel
def keep_filter_ripple(w, mean_a, mean_b, e_0, e_1, e_2, e_3, e_4, e_5, period):
    """Write what this period's flux ripple leaves in the filter at its end, and its filtered square (by parts).

    One link voltage for all legs: what a rippling link tells them apart by is less than a thousandth.
    """
    s = slopes(mean_a, mean_b, e_0, e_1, e_3, e_4)
    for j in range(LANES):
        six_edges(w, j, 0.0, mean_a, mean_b, s, e_0, e_1, e_2, e_3, e_4, e_5, period)
        tau = w[FILTER_TIME * LANES + j]
        end = 2.0 * tau * tau * (1.0 - w[FILTER_KEEP * LANES + j])
        w[BENT_AA * LANES + j] += end * mean_a * mean_a
        w[BENT_AB * LANES + j] += end * mean_a * mean_b
        w[BENT_BB * LANES + j] += end * mean_b * mean_b


@inlined
def slopes(mean_a, mean_b, e_0, e_1, e_3, e_4):
    """Return the slopes of the ripple after the first and second edge to rise, and to fall."""
    k = 2.0 / 3.0
    a_1, b_1 = k * e_0[3] - mean_a, k * e_0[4] - mean_b
    a_4, b_4 = -mean_a - k * e_3[3], -mean_b - k * e_3[4]
    return a_1, b_1, a_1 + k * e_1[3], b_1 + k * e_1[4], a_4, b_4, a_4 - k * e_4[3], b_4 - k * e_4[4]


@inlined
def high(d_a, d_b, d_c, late, period):
    """Return the vector of the legs that are high at the end of a period whose pattern is late."""
    x = 1.0 if abs(late - 0.5 * period) < 0.5 * d_a * period else 0.0
    y = 1.0 if abs(late - 0.5 * period) < 0.5 * d_b * period else 0.0
    z = 1.0 if abs(late - 0.5 * period) < 0.5 * d_c * period else 0.0
    return (2.0 * x - y - z) * (1.0 / 3.0), (y - z) * (1.0 / ROOT_3)


@kernel
def keep_late_ripple(w, d_a, d_b, d_c, b_a, b_b, b_c, mean_a, mean_b, e_0, e_1, e_2, e_3, e_4, e_5, period):
    """Do the same for a late pattern, without the edges that it carries over: the ripple is what stands beside its own
    mean voltage, after what is carried."""
    s = slopes(mean_a, mean_b, e_0, e_1, e_3, e_4)
    for j in range(LANES):
        tau, keep, late = w[FILTER_TIME * LANES + j], w[FILTER_KEEP * LANES + j], w[LATE * LANES + j]
        n_a, n_b, o_a, o_b, k_a, k_b = six_edges(w, j, late, mean_a, mean_b, s, e_0, e_1, e_2, e_3, e_4, e_5, period)
        per = 1.0 / w[LINK_A * LANES + j]
        u_a, u_b = per * w[PATTERN_A * LANES + j], per * w[PATTERN_B * LANES + j]
        x, y, rest = mean_a - u_a, mean_b - u_b, period - late
        f_a, f_b = u_a * rest - k_a, u_b * rest - k_b  # flux carried less the mean voltage's until the pattern begins
        f_a, f_b, g_a, g_b = f_a - 2.0 * tau * x, f_b - 2.0 * tau * y, rest * n_a - o_a, rest * n_b - o_b
        h_a, h_b = high(d_a, d_b, d_c, late, period)
        i_a, i_b = high(b_a, b_b, b_c, late, period)
        h_a, h_b, i_a, i_b, twice = h_a - u_a, h_b - u_b, i_a - u_a, i_b - u_b, 2.0 * tau
        w[BENT_AA * LANES + j] += twice * (n_a * f_a + g_a * x + tau * (h_a * h_a - keep * i_a * i_a))
        cross = n_a * f_b + n_b * f_a + g_a * y + g_b * x
        w[BENT_AB * LANES + j] += tau * cross + twice * tau * (h_a * h_b - keep * i_a * i_b)
        w[BENT_BB * LANES + j] += twice * (n_b * f_b + g_b * y + tau * (h_b * h_b - keep * i_b * i_b))


@kernel
def latest(w):
    """Return by how much the latest of the lanes' patterns is late (s)."""
    late = 0.0
    for j in range(LANES):
        late = max(late, w[LATE * LANES + j])
    return late


@kernel
def carry_edge(w, d_a, d_b, d_c, e, side, mean_a, mean_b, v_a, v_b, period):
    """Add an edge of the last period that late pulses have carried into this one; before its start it is none.

    d, mean, v: the last period's duties, mean voltage and slope before the edge, of unit link voltage.
    """
    l_a, l_b = side * (2.0 / 3.0) * e[3], side * (2.0 / 3.0) * e[4]
    for j in range(LANES):
        tau, keep, late = w[FILTER_TIME * LANES + j], w[FILTER_KEEP * LANES + j], w[LATE * LANES + j]
        a = min(2.0 * period - e[0] - late, period)
        x = fading(-a * w[FILTER_INV * LANES + j])
        n, o, m, k = x - keep, a * x - period * keep, a * a * x - period * period * keep, a - period
        write(w, j, tau, keep, period, l_a * n, l_b * n, l_a * o, l_b * o, l_a * m, l_b * m, l_a * k, l_b * k)
        per, acts = 1.0 / w[LINK_A * LANES + j], (tau * x if a < period else 0.0)
        u_a, u_b = per * w[PATTERN_A * LANES + j], per * w[PATTERN_B * LANES + j]
        x, y = on_time(d_a, period, period - late), on_time(d_b, period, period - late)
        z = on_time(d_c, period, period - late)
        r_a = e[1] - (2.0 * x - y - z) * (1.0 / 3.0) - u_a * (period - a)
        r_b = e[2] - (y - z) * (1.0 / ROOT_3) - u_b * (period - a)
        s_a, s_b = v_a + mean_a - u_a, v_b + mean_b - u_b
        w[BENT_AA * LANES + j] += acts * 2.0 * l_a * (r_a - tau * (2.0 * s_a + l_a))
        w[BENT_AB * LANES + j] += acts * (l_a * r_b + l_b * r_a - 2.0 * tau * (l_a * s_b + l_b * s_a + l_a * l_b))
        w[BENT_BB * LANES + j] += acts * 2.0 * l_b * (r_b - tau * (2.0 * s_b + l_b))


@kernel
def carry(w, edges, d_a, d_b, d_c, mean_a, mean_b, period):
    """Add what late pulses of the last period leave in the filter; edges, duties and mean voltage are that one's."""
    first = period - latest(w)
    v_a, v_b = -mean_a, -mean_b
    for m in range(6):
        e = edges[m, 0], edges[m, 1], edges[m, 2], edges[m, 3], edges[m, 4]
        side = 1.0 if m < 3 else -1.0
        if e[0] > first:
            carry_edge(w, d_a, d_b, d_c, e, side, mean_a, mean_b, v_a, v_b, period)
        v_a, v_b = v_a + side * (2.0 / 3.0) * e[3], v_b + side * (2.0 / 3.0) * e[4]
