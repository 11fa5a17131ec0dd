"""The machine with all its effects, LANES parameter sets at once; angles are prescribed.

Stationary frame throughout: a held voltage is constant there, and only the resistive drop needs integrating.  The
terms are those of `model/effects`, written on rows of `sandbox.replay.lanes`; tests compare them with the switched
bench, effect by effect.
"""

from __future__ import annotations

import math

from model.compiled import inlined, kernel
from sandbox.replay.lanes import (
    C_0,
    C_1,
    C_2,
    CORE_A,
    CORE_B,
    CORE_DECAY,
    CORE_G,
    CORE_NEW,
    CORE_OLD,
    DELTA_A,
    DELTA_B,
    FILTER_A,
    FILTER_B,
    FILTER_DECAY,
    FILTER_MID,
    FILTER_NEW,
    FILTER_OLD,
    GAMMA_6,
    GAMMA_DD,
    GAMMA_DQ,
    GAMMA_QQ,
    I_A,
    I_B,
    I_D,
    I_Q,
    LANES,
    M_A,
    M_B,
    MAGNET,
    PAIRS,
    PSI_A,
    PSI_B,
    PSI_D6,
    PSI_Q6,
    RESISTANCE,
    S_0,
    S_1,
    S_2,
    SKIN_DECAY,
    SKIN_NEW,
    SKIN_OLD,
    SKIN_R,
    SLOPE_A,
    SLOPE_B,
    SLOW_A,
    SLOW_B,
    SWING_D,
    SWING_Q,
    TORQUE,
    U_A,
    U_B,
    X_D,
    X_Q,
    incremental,
    magnetising,
)

ROOT = math.sqrt(3.0)


@inlined
def sixth(c, s):
    """Return cos and sin of six times the angle of cos c and sin s."""
    c_2, s_2 = c * c - s * s, 2.0 * c * s
    c_4, s_4 = c_2 * c_2 - s_2 * s_2, 2.0 * c_2 * s_2
    return c_4 * c_2 - s_4 * s_2, s_4 * c_2 + c_4 * s_2


@inlined
def full_current(w, j, c, s, a, b):
    """Return the magnetising current (A, stationary), harmonics included."""
    c_6, s_6 = sixth(c, s)
    d = c * a + s * b - w[MAGNET * LANES + j] - w[PSI_D6 * LANES + j] * c_6
    q = c * b - s * a - w[PSI_Q6 * LANES + j] * s_6
    i_d, i_q = magnetising(w, j, d, q)
    g = w[GAMMA_6 * LANES + j]
    i_d, i_q = i_d + g * (c_6 * d + s_6 * q), i_q + g * (s_6 * d - c_6 * q)
    return c * i_d - s * i_q, s * i_d + c * i_q


@kernel
def full_sample(w):
    """Set currents, torque and incremental inductance of the sample from the states."""
    for j in range(LANES):
        a, b, c, s = w[PSI_A * LANES + j], w[PSI_B * LANES + j], w[C_0 * LANES + j], w[S_0 * LANES + j]
        c_6, s_6 = sixth(c, s)
        h_d, h_q, g = w[PSI_D6 * LANES + j], w[PSI_Q6 * LANES + j], w[GAMMA_6 * LANES + j]
        x_d, x_q = c * a + s * b, c * b - s * a
        d, q = x_d - w[MAGNET * LANES + j] - h_d * c_6, x_q - h_q * s_6
        i_d, i_q = magnetising(w, j, d, q)
        i_d, i_q = i_d + g * (c_6 * d + s_6 * q), i_q + g * (s_6 * d - c_6 * q)
        dd, dq, qq = incremental(w, j, d, q)
        turning = 3.0 * g * (2.0 * c_6 * d * q - s_6 * (d * d - q * q)) + 6.0 * (h_d * s_6 * i_d - h_q * c_6 * i_q)
        w[TORQUE * LANES + j] = 1.5 * w[PAIRS * LANES + j] * (x_d * i_q - x_q * i_d - turning)
        m_a, m_b = c * i_d - s * i_q, s * i_d + c * i_q
        k_a, k_b = w[CORE_A * LANES + j], w[CORE_B * LANES + j]
        w[M_A * LANES + j], w[M_B * LANES + j] = m_a, m_b
        w[I_A * LANES + j], w[I_B * LANES + j] = m_a + k_a, m_b + k_b
        w[I_D * LANES + j], w[I_Q * LANES + j] = i_d, i_q
        w[X_D * LANES + j], w[X_Q * LANES + j] = x_d, x_q
        w[SWING_D * LANES + j], w[SWING_Q * LANES + j] = -6.0 * h_d * s_6, 6.0 * h_q * c_6
        w[GAMMA_DD * LANES + j], w[GAMMA_DQ * LANES + j] = dd + g * c_6, dq + g * s_6
        w[GAMMA_QQ * LANES + j] = qq - g * c_6


@kernel
def close_lags(w):
    """Give the lags of current their share of the sample's current (`full_step` left it out)."""
    for j in range(LANES):
        i_a, i_b = w[I_A * LANES + j], w[I_B * LANES + j]
        new, own = w[FILTER_NEW * LANES + j], w[SKIN_NEW * LANES + j]
        w[FILTER_A * LANES + j], w[FILTER_B * LANES + j] = (
            w[FILTER_A * LANES + j] + new * i_a,
            w[FILTER_B * LANES + j] + new * i_b,
        )
        w[SLOW_A * LANES + j], w[SLOW_B * LANES + j] = (
            w[SLOW_A * LANES + j] + own * i_a,
            w[SLOW_B * LANES + j] + own * i_b,
        )


@inlined
def phase_drop(w, j, i_a, i_b):
    """Return resistive drop and winding asymmetry (V)."""
    r, x = w[RESISTANCE * LANES + j], w[DELTA_A * LANES + j] * i_a
    y = w[DELTA_B * LANES + j] * (0.5 * ROOT * i_b - 0.5 * i_a)
    return r * i_a + (2.0 * x - y) * (1.0 / 3.0), r * i_b + y * (1.0 / ROOT)


@kernel
def full_step(w, h):
    """Move fluxes, iron-loss current and the current's lags on by a step of h (s).

    Lags may be short: iron's and skin's are exact for an input linear over half steps, the filter's for a parabola,
    or a cubic with `filtered.start_slope`; its share of the coming sample's current is `close_lags`', too.
    """
    half, part = 0.5 * h, h / 6.0
    for j in range(LANES):
        a, b, u_a, u_b = w[PSI_A * LANES + j], w[PSI_B * LANES + j], w[U_A * LANES + j], w[U_B * LANES + j]
        c_1, s_1, c_2, s_2 = w[C_1 * LANES + j], w[S_1 * LANES + j], w[C_2 * LANES + j], w[S_2 * LANES + j]
        g, r_1 = w[CORE_G * LANES + j], w[SKIN_R * LANES + j]
        k_decay, k_old, k_new = w[CORE_DECAY * LANES + j], w[CORE_OLD * LANES + j], w[CORE_NEW * LANES + j]
        x_decay, x_old, x_new = w[SKIN_DECAY * LANES + j], w[SKIN_OLD * LANES + j], w[SKIN_NEW * LANES + j]
        k_a, k_b, x_a, x_b = w[CORE_A * LANES + j], w[CORE_B * LANES + j], w[SLOW_A * LANES + j], w[SLOW_B * LANES + j]
        i_a, i_b = w[I_A * LANES + j], w[I_B * LANES + j]
        v_a, v_b = phase_drop(w, j, i_a, i_b)
        p_a, p_b = u_a - v_a - r_1 * (i_a - x_a), u_b - v_b - r_1 * (i_b - x_b)
        kept_a, kept_b = k_decay * k_a + k_old * g * p_a, k_decay * k_b + k_old * g * p_b
        slow_a, slow_b = x_decay * x_a + x_old * i_a, x_decay * x_b + x_old * i_b
        j_a, j_b = full_current(w, j, c_1, s_1, a + half * p_a, b + half * p_b)
        j_a, j_b = j_a + kept_a + k_new * g * p_a, j_b + kept_b + k_new * g * p_b
        m_a, m_b = 0.5 * j_a, 0.5 * j_b  # the middle's two estimates err by h^2 to either side
        v_a, v_b = phase_drop(w, j, j_a, j_b)
        q_a, q_b = u_a - v_a - r_1 * (j_a - slow_a - x_new * j_a), u_b - v_b - r_1 * (j_b - slow_b - x_new * j_b)
        k_a, k_b = kept_a + k_new * g * q_a, kept_b + k_new * g * q_b  # iron-loss current in the middle
        j_a, j_b = full_current(w, j, c_1, s_1, a + half * q_a, b + half * q_b)
        j_a, j_b = j_a + k_a, j_b + k_b
        m_a, m_b = m_a + 0.5 * j_a, m_b + 0.5 * j_b
        x_a, x_b = slow_a + x_new * j_a, slow_b + x_new * j_b
        v_a, v_b = phase_drop(w, j, j_a, j_b)
        r_a, r_b = u_a - v_a - r_1 * (j_a - x_a), u_b - v_b - r_1 * (j_b - x_b)
        kept_a, kept_b = k_decay * k_a + k_old * g * r_a, k_decay * k_b + k_old * g * r_b
        slow_a, slow_b = x_decay * x_a + x_old * j_a, x_decay * x_b + x_old * j_b
        y_a, y_b = full_current(w, j, c_2, s_2, a + h * r_a, b + h * r_b)
        y_a, y_b = y_a + kept_a + k_new * g * r_a, y_b + kept_b + k_new * g * r_b
        v_a, v_b = phase_drop(w, j, y_a, y_b)
        e_a, e_b = u_a - v_a - r_1 * (y_a - slow_a - x_new * y_a), u_b - v_b - r_1 * (y_b - slow_b - x_new * y_b)
        w[CORE_A * LANES + j], w[CORE_B * LANES + j] = kept_a + k_new * g * e_a, kept_b + k_new * g * e_b
        w[SLOW_A * LANES + j], w[SLOW_B * LANES + j] = slow_a, slow_b  # `close_lags` adds the coming sample's share
        decay, old, mid = w[FILTER_DECAY * LANES + j], w[FILTER_OLD * LANES + j], w[FILTER_MID * LANES + j]
        w[FILTER_A * LANES + j] = decay * w[FILTER_A * LANES + j] + old * i_a + mid * m_a + w[SLOPE_A * LANES + j]
        w[FILTER_B * LANES + j] = decay * w[FILTER_B * LANES + j] + old * i_b + mid * m_b + w[SLOPE_B * LANES + j]
        w[PSI_A * LANES + j] = a + part * (p_a + 2.0 * (q_a + r_a) + e_a)
        w[PSI_B * LANES + j] = b + part * (p_b + 2.0 * (q_b + r_b) + e_b)
