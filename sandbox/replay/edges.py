"""Dead time and device drop for LANES parameter sets at once: six edges a period, each with the current it meets.

How late an edge acts follows from its leg's current then (`sandbox/switched/AVERAGING.md`, 5), between edges the
devices drop (6); what late edges lose also reaches the lags of current filter and iron loss, and the iron-loss
current itself belongs to the current at the edge.
"""

from __future__ import annotations

import math

from model.compiled import inlined, kernel
from sandbox.plant import turn
from sandbox.replay.lanes import (
    C_0,
    CLAG_A,
    CLAG_B,
    CORE_A,
    CORE_B,
    CORE_G,
    CORE_INV,
    DEAD,
    DELAY,
    GAMMA_DD,
    GAMMA_DQ,
    GAMMA_QQ,
    I_A,
    I_B,
    I_D,
    I_Q,
    LANES,
    LATE,
    LATE_0,
    LATE_1,
    LATE_2,
    LATE_3,
    LATE_4,
    LATE_5,
    LINK_A,
    PAIRS,
    PSI_A,
    PSI_B,
    PULSE_TORQUE,
    RESISTANCE,
    S_0,
    SOFT,
    SPILL_A,
    SPILL_B,
    SWING_D,
    SWING_Q,
    THRESHOLD,
    U_A,
    U_B,
    X_D,
    X_Q,
    fading,
)

ROOT = math.sqrt(3.0)


@inlined
def current_at(w, j, t, omega, f_a, f_b):
    """Return the magnetising current (A, stationary) t and f volt-seconds later, linear in the rotor frame."""
    r = w[RESISTANCE * LANES + j]
    a = w[PSI_A * LANES + j] + f_a - t * r * w[I_A * LANES + j]
    b = w[PSI_B * LANES + j] + f_b - t * r * w[I_B * LANES + j]
    c, s = turn(w[C_0 * LANES + j], w[S_0 * LANES + j], -omega * t)
    turned = omega * t
    x = c * a + s * b - w[X_D * LANES + j] - turned * w[SWING_D * LANES + j]
    y = c * b - s * a - w[X_Q * LANES + j] - turned * w[SWING_Q * LANES + j]
    i_d = w[I_D * LANES + j] + w[GAMMA_DD * LANES + j] * x + w[GAMMA_DQ * LANES + j] * y
    i_q = w[I_Q * LANES + j] + w[GAMMA_DQ * LANES + j] * x + w[GAMMA_QQ * LANES + j] * y
    return c * i_d - s * i_q, s * i_d + c * i_q


@inlined
def edge(w, j, omega, e, side, lost_a, lost_b, core_a, core_b):
    """Return how late an edge acts (s), its instant and the current then.

    e: instant, unit flux (alpha, beta) and unit vector of its leg; side: +1 rises, -1 falls; lost: volt-seconds;
    core: iron-loss current (A).
    """
    t, v = e[0] + w[DELAY * LANES + j], w[LINK_A * LANES + j]
    i_a, i_b = current_at(w, j, t, omega, v * e[1] + lost_a, v * e[2] + lost_b)
    i_a, i_b = i_a + core_a, i_b + core_b
    sign = min(max((e[3] * i_a + e[4] * i_b) * w[SOFT * LANES + j], -1.0), 1.0)
    dead = w[DEAD * LANES + j]
    return 0.5 * (abs(dead) + side * dead * sign), t, i_a, i_b


@inlined
def lost(v, t, e, side, late, sum_a, sum_b):
    """Add the volt-seconds that a late edge has lost until t (s)."""
    size = side * (2.0 / 3.0) * v * min(late, t - e[0])
    return sum_a - size * e[3], sum_b - size * e[4]


@inlined
def core_after(w, j, iron, x, y, on_a, on_b, time):
    """Return the iron-loss current (A) after a time (s) under pulses of unit vector (on_a, on_b), from (x, y)."""
    if not iron:
        return x, y
    g, v, decay = w[CORE_G * LANES + j], w[LINK_A * LANES + j], fading(-time * w[CORE_INV * LANES + j])
    r = w[RESISTANCE * LANES + j]
    to_a, to_b = g * (v * on_a - r * w[I_A * LANES + j]), g * (v * on_b - r * w[I_B * LANES + j])
    return to_a + (x - to_a) * decay, to_b + (y - to_b) * decay


@inlined
def six_edges(w, j, iron, omega, e_0, e_1, e_2, e_3, e_4, e_5):
    """Return instant and current of each edge in order of time, and the volt-seconds lost in all.

    What late pulses of the last period still bring is there before the first edge.
    """
    n_a, n_b = w[SPILL_A * LANES + j], w[SPILL_B * LANES + j]
    v, third = w[LINK_A * LANES + j], 2.0 / 3.0
    slope = -w[CORE_G * LANES + j] * w[CORE_INV * LANES + j]
    x, y = w[CORE_A * LANES + j] + slope * w[CLAG_A * LANES + j], w[CORE_B * LANES + j] + slope * w[CLAG_B * LANES + j]
    if not iron:
        x, y = w[CORE_A * LANES + j], w[CORE_B * LANES + j]
    x, y = core_after(w, j, iron, x, y, 0.0, 0.0, e_0[0] + w[DELAY * LANES + j])
    l_0, t_0, x_0, y_0 = edge(w, j, omega, e_0, 1.0, n_a, n_b, x, y)
    on_a, on_b = third * e_0[3], third * e_0[4]
    a, b = lost(v, e_1[0], e_0, 1.0, l_0, n_a, n_b)
    x, y = core_after(w, j, iron, x, y, on_a, on_b, e_1[0] - e_0[0])
    l_1, t_1, x_1, y_1 = edge(w, j, omega, e_1, 1.0, a, b, x, y)
    on_a, on_b = on_a + third * e_1[3], on_b + third * e_1[4]
    a, b = lost(v, e_2[0], e_0, 1.0, l_0, n_a, n_b)
    a, b = lost(v, e_2[0], e_1, 1.0, l_1, a, b)
    x, y = core_after(w, j, iron, x, y, on_a, on_b, e_2[0] - e_1[0])
    l_2, t_2, x_2, y_2 = edge(w, j, omega, e_2, 1.0, a, b, x, y)
    a, b = lost(v, e_3[0], e_0, 1.0, l_0, n_a, n_b)
    a, b = lost(v, e_3[0], e_1, 1.0, l_1, a, b)
    a, b = lost(v, e_3[0], e_2, 1.0, l_2, a, b)
    x, y = core_after(w, j, iron, x, y, 0.0, 0.0, e_3[0] - e_2[0])
    l_3, t_3, x_3, y_3 = edge(w, j, omega, e_3, -1.0, a, b, x, y)
    on_a, on_b = -third * e_3[3], -third * e_3[4]
    p, q = lost(v, e_4[0], e_3, -1.0, l_3, a, b)
    x, y = core_after(w, j, iron, x, y, on_a, on_b, e_4[0] - e_3[0])
    l_4, t_4, x_4, y_4 = edge(w, j, omega, e_4, -1.0, p, q, x, y)
    on_a, on_b = on_a - third * e_4[3], on_b - third * e_4[4]
    p, q = lost(v, e_5[0], e_3, -1.0, l_3, a, b)
    p, q = lost(v, e_5[0], e_4, -1.0, l_4, p, q)
    x, y = core_after(w, j, iron, x, y, on_a, on_b, e_5[0] - e_4[0])
    l_5, t_5, x_5, y_5 = edge(w, j, omega, e_5, -1.0, p, q, x, y)
    w[LATE_0 * LANES + j], w[LATE_1 * LANES + j], w[LATE_2 * LANES + j] = l_0, l_1, l_2
    w[LATE_3 * LANES + j], w[LATE_4 * LANES + j], w[LATE_5 * LANES + j] = l_3, l_4, l_5
    all_late = 1.0  # s: every edge has acted by then
    a, b = lost(v, all_late, e_0, 1.0, l_0, 0.0, 0.0)
    a, b = lost(v, all_late, e_1, 1.0, l_1, a, b)
    a, b = lost(v, all_late, e_2, 1.0, l_2, a, b)
    a, b = lost(v, all_late, e_3, -1.0, l_3, a, b)
    a, b = lost(v, all_late, e_4, -1.0, l_4, a, b)
    a, b = lost(v, all_late, e_5, -1.0, l_5, a, b)
    return t_0, x_0, y_0, t_1, x_1, y_1, t_2, x_2, y_2, t_3, x_3, y_3, t_4, x_4, y_4, t_5, x_5, y_5, a, b


@inlined
def lost_voltage(w, j, x, y, period):
    """Return the mean voltage (V) of lost volt-seconds with R Gamma of the flux they move by being late (1)."""
    a, b, late = x / period, y / period, w[LATE * LANES + j]
    c, s, r = w[C_0 * LANES + j], w[S_0 * LANES + j], w[RESISTANCE * LANES + j]
    d, q = late * (c * a + s * b), late * (c * b - s * a)
    g_d = w[GAMMA_DD * LANES + j] * d + w[GAMMA_DQ * LANES + j] * q
    g_q = w[GAMMA_DQ * LANES + j] * d + w[GAMMA_QQ * LANES + j] * q
    g_a, g_b = c * g_d - s * g_q, s * g_d + c * g_q
    pull = w[PSI_A * LANES + j] * g_b - w[PSI_B * LANES + j] * g_a
    pull += late * (a * w[I_B * LANES + j] - b * w[I_A * LANES + j])
    w[PULSE_TORQUE * LANES + j] -= 1.5 * w[PAIRS * LANES + j] * pull  # mean current beside the samples' straight line
    return a + r * g_a, b + r * g_b


@kernel
def dead_time(w, e_0, e_1, e_2, e_3, e_4, e_5, omega, period, iron):
    """Take from the period's voltage what late edges lose (5)."""
    if iron:
        for j in range(LANES):
            out = six_edges(w, j, True, omega, e_0, e_1, e_2, e_3, e_4, e_5)
            x, y = lost_voltage(w, j, out[18], out[19], period)
            w[U_A * LANES + j], w[U_B * LANES + j] = w[U_A * LANES + j] + x, w[U_B * LANES + j] + y
    else:
        for j in range(LANES):
            out = six_edges(w, j, False, omega, e_0, e_1, e_2, e_3, e_4, e_5)
            x, y = lost_voltage(w, j, out[18], out[19], period)
            w[U_A * LANES + j], w[U_B * LANES + j] = w[U_A * LANES + j] + x, w[U_B * LANES + j] + y


@inlined
def primitive(x):
    """Return the integral of the soft sign from 0 to x."""
    size = abs(x)
    return 0.5 * x * x if size < 1.0 else size - 0.5


@inlined
def mean_sign(x, y):
    """Return the mean soft sign on the way from x to y (`model.effects.device_drop`), without a branch."""
    step = y - x
    flat = abs(step) < 1e-6
    return min(max(0.5 * (x + y), -1.0), 1.0) if flat else (primitive(y) - primitive(x)) / (1.0 if flat else step)


@inlined
def signs(w, j, a, b, x, y, share, sum_a, sum_b):
    """Add to a vector the mean signs of three legs while the current goes from (a, b) to (x, y) for a share of time."""
    k = w[SOFT * LANES + j]
    one = mean_sign(k * a, k * x)
    p, q, o, r = -0.5 * a, 0.5 * ROOT * b, -0.5 * x, 0.5 * ROOT * y
    two, three = mean_sign(k * (p + q), k * (o + r)), mean_sign(k * (p - q), k * (o - r))
    return sum_a + share * (2.0 * one - two - three) * (1.0 / 3.0), sum_b + share * (two - three) * (1.0 / ROOT)


@kernel
def dead_time_and_drop(w, e_0, e_1, e_2, e_3, e_4, e_5, omega, period):
    """Take from the period's voltage what late edges and the devices' thresholds lose (5, 6)."""
    per = 1.0 / period
    for j in range(LANES):
        t_0, x_0, y_0, t_1, x_1, y_1, t_2, x_2, y_2, t_3, x_3, y_3, t_4, x_4, y_4, t_5, x_5, y_5, x, y = six_edges(
            w, j, True, omega, e_0, e_1, e_2, e_3, e_4, e_5
        )
        s_a, s_b = signs(w, j, w[I_A * LANES + j], w[I_B * LANES + j], x_0, y_0, t_0 * per, 0.0, 0.0)
        s_a, s_b = signs(w, j, x_0, y_0, x_1, y_1, (t_1 - t_0) * per, s_a, s_b)
        s_a, s_b = signs(w, j, x_1, y_1, x_2, y_2, (t_2 - t_1) * per, s_a, s_b)
        s_a, s_b = signs(w, j, x_2, y_2, x_3, y_3, (t_3 - t_2) * per, s_a, s_b)
        s_a, s_b = signs(w, j, x_3, y_3, x_4, y_4, (t_4 - t_3) * per, s_a, s_b)
        s_a, s_b = signs(w, j, x_4, y_4, x_5, y_5, (t_5 - t_4) * per, s_a, s_b)
        f_a, f_b = w[U_A * LANES + j] * period + x, w[U_B * LANES + j] * period + y
        a, b = current_at(w, j, period, omega, f_a, f_b)
        a, b = a + w[CORE_A * LANES + j], b + w[CORE_B * LANES + j]
        s_a, s_b = signs(w, j, x_5, y_5, a, b, (period - t_5) * per, s_a, s_b)
        drop = w[THRESHOLD * LANES + j]
        x, y = lost_voltage(w, j, x, y, period)
        w[U_A * LANES + j] = w[U_A * LANES + j] + x - drop * s_a
        w[U_B * LANES + j] = w[U_B * LANES + j] + y - drop * s_b
