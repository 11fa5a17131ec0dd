"""What the flux ripple's curvature costs a period's mean current (`sandbox/switched/AVERAGING.md`, 0)."""

from __future__ import annotations

from model.compiled import inlined, kernel
from model.pulses import on_area, on_time
from sandbox.replay.lanes import (
    A3,
    A4,
    B2,
    B4,
    C2,
    C_0,
    I_A,
    I_B,
    LANES,
    LATE,
    LINK,
    MAGNET,
    PSI_A,
    PSI_B,
    RESISTANCE,
    S_0,
    U_A,
    U_B,
    incremental,
)

ROOT_3 = 1.7320508075688772


@inlined
def saturating(w, j, d, q, m_dd, m_dq, m_qq):
    """Return the third derivatives of energy at fluxes d, q times half a product of fluxes (A); m_dq: twice that."""
    ddd, ddq = 2.0 * w[A3 * LANES + j] + 6.0 * w[A4 * LANES + j] * d, 4.0 * w[C2 * LANES + j] * q
    dqq, qqq = 2.0 * (w[B2 * LANES + j] + 2.0 * w[C2 * LANES + j] * d), 6.0 * w[B4 * LANES + j] * q
    return ddd * m_dd + ddq * m_dq + dqq * m_qq, ddq * m_dd + dqq * m_dq + qqq * m_qq


@inlined
def bent(w, j, first_a, first_b, square_aa, square_ab, square_bb, omega):
    """Take from lane j's voltage R times the mean current that the ripple adds; arguments as `bend`."""
    c, s, v, r = w[C_0 * LANES + j], w[S_0 * LANES + j], w[LINK * LANES + j], w[RESISTANCE * LANES + j]
    a, b = w[PSI_A * LANES + j], w[PSI_B * LANES + j]
    x_d, x_q = c * a + s * b, c * b - s * a
    d, q = x_d - w[MAGNET * LANES + j], x_q
    dd, dq, qq = incremental(w, j, d, q)
    w_d, w_q = v * (c * first_a + s * first_b), v * (c * first_b - s * first_a)
    g_d, g_q = dd * w_d + dq * w_q, dq * w_d + qq * w_q
    i_d, i_q = r * (dd * g_d + dq * g_q), r * (dq * g_d + qq * g_q)  # the ripple's own resistive drop
    i_d += omega * ((dd - qq) * w_q - 2.0 * dq * w_d)  # salience turning under it
    i_q += omega * ((dd - qq) * w_d + 2.0 * dq * w_q)
    p_a = w[U_A * LANES + j] - r * w[I_A * LANES + j]
    p_b = w[U_B * LANES + j] - r * w[I_B * LANES + j]
    p_d, p_q = c * p_a + s * p_b + omega * x_q, c * p_b - s * p_a - omega * x_d
    half = 0.5 * v * v
    m_dd = p_d * w_d + half * (c * c * square_aa + 2.0 * c * s * square_ab + s * s * square_bb)
    m_qq = p_q * w_q + half * (s * s * square_aa - 2.0 * c * s * square_ab + c * c * square_bb)
    m_dq = p_d * w_q + p_q * w_d + 2.0 * half * (c * s * (square_bb - square_aa) + (c * c - s * s) * square_ab)
    s_d, s_q = saturating(w, j, d, q, m_dd, m_dq, m_qq)  # saturation changing under it, and over its width
    i_d, i_q = i_d + s_d, i_q + s_q
    w[U_A * LANES + j] -= r * (c * i_d - s * i_q)
    w[U_B * LANES + j] -= r * (s * i_d + c * i_q)


@kernel
def bend(w, first_a, first_b, square_aa, square_ab, square_bb, omega):
    """Take from the period's voltage what the flux ripple's curvature costs: R times the mean current it adds.

    first (s^2), square (s^2): the ripple's first moment about the period's middle and its mean square, of unit link
    voltage, from the duties (`inputs.ripple_moments`).
    """
    for j in range(LANES):
        bent(w, j, first_a, first_b, square_aa, square_ab, square_bb, omega)


@inlined
def shift(d_a, d_b, d_c, late, period):
    """Return a late pattern's flux beside the centred one's at the period's ends (s), and that one's integral until
    then (s^2), vectors of unit link voltage; pulses of the last period are taken to be like this one's."""
    x, y = on_time(d_a, period, late) - d_a * late, on_time(d_b, period, late) - d_b * late
    z, half = on_time(d_c, period, late) - d_c * late, 0.5 * late * late
    a, b = (2.0 * x - y - z) * (1.0 / 3.0), (y - z) * (1.0 / ROOT_3)
    x, y = on_area(d_a, period, late) - d_a * half, on_area(d_b, period, late) - d_b * half
    z = on_area(d_c, period, late) - d_c * half
    return a, b, (2.0 * x - y - z) * (1.0 / 3.0), (y - z) * (1.0 / ROOT_3)


@kernel
def bend_late(w, d_a, d_b, d_c, first_a, first_b, square_aa, square_ab, square_bb, omega, period):
    """Do the same for a late pattern: its ripple's moments differ by what stands beside the centred one's."""
    for j in range(LANES):
        a, b, x, y = shift(d_a, d_b, d_c, w[LATE * LANES + j], period)
        bent(w, j, first_a + x, first_b + y, square_aa + a * a, square_ab + a * b, square_bb + b * b, omega)
