"""The analogue current filter behind the flux ripple (`sandbox/switched/AVERAGING.md`, "A filter in the replay").

What the ripple of a period leaves (`memory`) becomes a current with the inverse inductance on its way from one sample
to the next, and joins the filter's own state in the stationary frame.
"""

from __future__ import annotations

from model.compiled import inlined, kernel
from sandbox.replay.curvature import saturating
from sandbox.replay.lanes import (
    BENT_AA,
    BENT_AB,
    BENT_BB,
    C_0,
    CURVED_A,
    CURVED_B,
    EARLY_A,
    EARLY_B,
    FILTER_A,
    FILTER_B,
    FILTER_KEEP,
    FILTER_SLOPE,
    FILTER_TIME,
    FLAG_A,
    FLAG_B,
    GAMMA_6,
    GAMMA_DD,
    GAMMA_DQ,
    GAMMA_QQ,
    I_A,
    I_B,
    I_D,
    I_Q,
    LANES,
    LINK,
    MAGNET,
    MOVED_A,
    MOVED_B,
    NOW_A,
    NOW_B,
    PSI_D6,
    PSI_Q6,
    RESISTANCE,
    S_0,
    SKIN_R,
    SLOPE_A,
    SLOPE_B,
    SLOW_A,
    SLOW_B,
    SWING_D,
    SWING_Q,
    U_A,
    U_B,
    X_D,
    X_Q,
)
from sandbox.replay.machine import phase_drop, sixth


@inlined
def turned_current(w, j, a, b):
    """Return the current (A, stationary) of a small flux (V s) at the sample."""
    c, s = w[C_0 * LANES + j], w[S_0 * LANES + j]
    d, q = c * a + s * b, c * b - s * a
    x = w[GAMMA_DD * LANES + j] * d + w[GAMMA_DQ * LANES + j] * q
    y = w[GAMMA_DQ * LANES + j] * d + w[GAMMA_QQ * LANES + j] * q
    return c * x - s * y, s * x + c * y


@kernel
def open_filter_ripple(w, turned):
    """Turn the early part into a current (A) of this period's start; the rest waits for the sample at its end.

    Beside it waits the ripple's own resistive drop, R tau Gamma of the ripple in the filter less its mean.  Salience
    that turns (turned: electrical angle of a period) bends the inductance's way between the samples.
    """
    bend = 2.0 * turned * turned
    for j in range(LANES):
        tau, keep = w[FILTER_TIME * LANES + j], w[FILTER_KEEP * LANES + j]
        a, b, x, y = w[NOW_A * LANES + j], w[NOW_B * LANES + j], w[EARLY_A * LANES + j], w[EARLY_B * LANES + j]
        w[FLAG_A * LANES + j], w[FLAG_B * LANES + j] = (
            keep * w[FLAG_A * LANES + j] + a,
            keep * w[FLAG_B * LANES + j] + b,
        )
        r = (w[RESISTANCE * LANES + j] + w[SKIN_R * LANES + j]) * tau
        m_a, m_b = a - (1.0 - keep) * w[MOVED_A * LANES + j], b - (1.0 - keep) * w[MOVED_B * LANES + j]
        i_a, i_b = turned_current(w, j, m_a, m_b)
        w[NOW_A * LANES + j], w[NOW_B * LANES + j] = a - x + r * i_a, b - y + r * i_b
        p, q = bend * w[CURVED_A * LANES + j], bend * w[CURVED_B * LANES + j]
        same = 0.5 * (w[GAMMA_DD * LANES + j] + w[GAMMA_QQ * LANES + j])
        i_a, i_b = turned_current(w, j, x + p, y + q)
        w[EARLY_A * LANES + j], w[EARLY_B * LANES + j] = i_a - same * p, i_b - same * q


@kernel
def close_filter_ripple(w):
    """Add the last period's ripple to the filter at a sample: inductance and saturation are those of now."""
    for j in range(LANES):
        c, s, v = w[C_0 * LANES + j], w[S_0 * LANES + j], w[LINK * LANES + j]
        i_a, i_b = turned_current(w, j, w[NOW_A * LANES + j], w[NOW_B * LANES + j])
        aa, ab, bb = w[BENT_AA * LANES + j], w[BENT_AB * LANES + j], w[BENT_BB * LANES + j]
        half = 0.5 * v * v
        m_dd = half * (c * c * aa + 2.0 * c * s * ab + s * s * bb)
        m_qq = half * (s * s * aa - 2.0 * c * s * ab + c * c * bb)
        m_dq = 2.0 * half * (c * s * (bb - aa) + (c * c - s * s) * ab)
        i_d, i_q = saturating(w, j, w[X_D * LANES + j] - w[MAGNET * LANES + j], w[X_Q * LANES + j], m_dd, m_dq, m_qq)
        w[FILTER_A * LANES + j] += w[EARLY_A * LANES + j] + i_a + c * i_d - s * i_q
        w[FILTER_B * LANES + j] += w[EARLY_B * LANES + j] + i_b + s * i_d + c * i_q


@inlined
def _swinging(w, j, c, s, x_d, x_q, i_d, i_q):
    """Return by how much (A/rad) the current turns at constant flux with harmonics of the inductance."""
    c_6, s_6 = sixth(c, s)
    g = 6.0 * w[GAMMA_6 * LANES + j]
    d_0 = x_d - w[MAGNET * LANES + j] - w[PSI_D6 * LANES + j] * c_6
    q_0 = x_q - w[PSI_Q6 * LANES + j] * s_6
    return g * (c_6 * q_0 - s_6 * d_0) - i_q, g * (c_6 * d_0 + s_6 * q_0) + i_d


@kernel
def start_slope(w, omega, h, harmonics):
    """Write what the current's slope at a step's start adds to the filter (A): its input is a cubic over the step."""
    if harmonics:
        for j in range(LANES):
            _slope(w, j, omega, h, True)
    else:
        for j in range(LANES):
            _slope(w, j, omega, h, False)


@inlined
def _slope(w, j, omega, h, harmonics):
    c, s = w[C_0 * LANES + j], w[S_0 * LANES + j]
    i_a, i_b, r = w[I_A * LANES + j], w[I_B * LANES + j], w[SKIN_R * LANES + j]
    v_a, v_b = phase_drop(w, j, i_a, i_b)
    p_a = w[U_A * LANES + j] - v_a - r * (i_a - w[SLOW_A * LANES + j])
    p_b = w[U_B * LANES + j] - v_b - r * (i_b - w[SLOW_B * LANES + j])
    x_d, x_q, i_d, i_q = w[X_D * LANES + j], w[X_Q * LANES + j], w[I_D * LANES + j], w[I_Q * LANES + j]
    d, q = c * p_a + s * p_b + omega * x_q, c * p_b - s * p_a - omega * x_d
    t_d, t_q = -i_q, i_d
    if harmonics:
        d, q = d - omega * w[SWING_D * LANES + j], q - omega * w[SWING_Q * LANES + j]
        t_d, t_q = _swinging(w, j, c, s, x_d, x_q, i_d, i_q)
    y_d = w[GAMMA_DD * LANES + j] * d + w[GAMMA_DQ * LANES + j] * q + omega * t_d
    y_q = w[GAMMA_DQ * LANES + j] * d + w[GAMMA_QQ * LANES + j] * q + omega * t_q
    f = h * w[FILTER_SLOPE * LANES + j]
    w[SLOPE_A * LANES + j], w[SLOPE_B * LANES + j] = f * (c * y_d - s * y_q), f * (s * y_d + c * y_q)
