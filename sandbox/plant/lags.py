"""Lags of the plant, each in a loop of its own that runs only where it is on: iron loss, sensors' filter, skin effect.

They are exact exponential steps, their input a parabola through the segment's start, middle and end.  The iron-loss
current i_c, tau di_c/dt = g dpsi/dt - i_c, is g/tau times the flux less the flux behind a lag of tau: its input is
then continuous, whatever the voltage does.
"""

from __future__ import annotations

from model.compiled import inlined, kernel
from model.lanes import lag_moments, lag_weights
from sandbox.plant.electrical import finished, halfway


@kernel
def remember(w, span):
    """Keep the current at the start of the segment that ends (span, s), and the bend that late edges gave its flux.

    Lags close over them once the end is known: their input is a parabola with the right mean, and a late edge makes
    the flux's mean differ from that of its ends by `bend`, where Simpson's rule would see two thirds of it.
    """
    half = 0.5 * span
    for j in range(w.psi_a.size):
        w.last_a[j], w.last_b[j] = w.i_a[j], w.i_b[j]
        w.bend_a[j] = 0.5 * (w.mid_a[j] - w.psi_a[j] + half * w.drop_a[j] - 0.5 * w.volt_a[j])
        w.bend_b[j] = 0.5 * (w.mid_b[j] - w.psi_b[j] + half * w.drop_b[j] - 0.5 * w.volt_b[j])


@kernel
def close_iron(w, span):
    """Move the flux behind the iron's lag on by a segment (s) and write the iron-loss current at its end.

    The flux in the middle is less than predicted by what the drop grew on the way, S/4 (mean less start).  With the end
    the middle's current is known, too: of a parabola with this start, mean and end.
    """
    quarter = 0.25 * span
    for j in range(w.psi_a.size):
        a, b = finished(w, j, span)
        decay, w_0, w_m, w_1 = lag_weights(span * w.core_rate[j])
        m_a = w.mid_a[j] + w.bend_a[j] - quarter * (w.fall_a[j] - w.drop_a[j])
        m_b = w.mid_b[j] + w.bend_b[j] - quarter * (w.fall_b[j] - w.drop_b[j])
        y_a = decay * w.eddy_a[j] + w_0 * w.psi_a[j] + w_m * m_a + w_1 * a
        y_b = decay * w.eddy_b[j] + w_0 * w.psi_b[j] + w_m * m_b + w_1 * b
        w.eddy_a[j], w.eddy_b[j] = y_a, y_b
        g = w.core_g[j] * w.core_rate[j]
        c_a, c_b = g * (a - y_a), g * (b - y_b)
        w.j_a[j] += 0.5 * w.core_a[j] - 0.25 * (w.begun_a[j] + c_a)
        w.j_b[j] += 0.5 * w.core_b[j] - 0.25 * (w.begun_b[j] + c_b)
        w.core_a[j], w.core_b[j] = c_a, c_b


@kernel
def iron_in_middle(w, span, u_a, u_b, x, y):
    """Write the mean iron-loss current of the segment, g/S times what the flux behind the lag moves by; the flux goes
    straight on through its middle."""
    inverse = 1.0 / span
    for j in range(w.psi_a.size):
        a, b = halfway(w, j, span, inverse, u_a, u_b, x, y)
        decay, zeroth, first, second = lag_moments(span * w.core_rate[j])
        p, q, g = w.psi_a[j], w.psi_b[j], w.core_g[j] * inverse
        w.core_less[j] = w.core_g[j] * second
        w.begun_a[j], w.begun_b[j] = w.core_a[j], w.core_b[j]
        w.core_a[j] = g * ((decay - 1.0) * w.eddy_a[j] + zeroth * p + 2.0 * first * (a - p))
        w.core_b[j] = g * ((decay - 1.0) * w.eddy_b[j] + zeroth * q + 2.0 * first * (b - q))


@kernel
def iron_bends(w, turned):
    """Take from the mean iron-loss current what the drop's growth over the segment, known by now, bends the flux, and
    from the drop what `electrical.settled` gave it for turning with the rotor (by `turned`, rad), which it does not."""
    square, across = turned * turned * (1.0 / 24.0), turned * (1.0 / 6.0)
    for j in range(w.psi_a.size):
        r, e_a, e_b = w.resistance[j], w.core_a[j] - w.begun_a[j], w.core_b[j] - w.begun_b[j]
        w.fall_a[j] -= r * (square * w.core_a[j] - across * e_b)
        w.fall_b[j] -= r * (square * w.core_b[j] + across * e_a)
        a, b = w.core_less[j] * (w.fall_a[j] - w.drop_a[j]), w.core_less[j] * (w.fall_b[j] - w.drop_b[j])
        w.core_a[j], w.core_b[j] = w.core_a[j] - a, w.core_b[j] - b
        w.j_a[j], w.j_b[j] = w.j_a[j] - a, w.j_b[j] - b
        w.fall_a[j], w.fall_b[j] = w.fall_a[j] - r * a, w.fall_b[j] - r * b


@inlined
def bent(w, j):
    """Return the current (A) that stands in a segment's middle for a lag: see `remember`."""
    x, y = w.bend_a[j], w.bend_b[j]
    return w.j_a[j] + w.stiff_aa[j] * x + w.stiff_ab[j] * y, w.j_b[j] + w.stiff_ab[j] * x + w.stiff_bb[j] * y


@kernel
def close_filter(w, span):
    """Move the sensors' filter on by a segment that ends with the current as it is now."""
    for j in range(w.psi_a.size):
        decay, w_0, w_m, w_1 = lag_weights(span * w.filter_rate[j])
        m_a, m_b = bent(w, j)
        w.filter_a[j] = decay * w.filter_a[j] + w_0 * w.last_a[j] + w_m * m_a + w_1 * w.i_a[j]
        w.filter_b[j] = decay * w.filter_b[j] + w_0 * w.last_b[j] + w_m * m_b + w_1 * w.i_b[j]


@kernel
def close_skin(w, span):
    """Move the slow part of the current on by a segment, and add the skin effect's drop at its end."""
    for j in range(w.psi_a.size):
        decay, w_0, w_m, w_1 = lag_weights(span * w.skin_rate[j])
        m_a, m_b = bent(w, j)
        x_a = decay * w.slow_a[j] + w_0 * w.last_a[j] + w_m * m_a + w_1 * w.i_a[j]
        x_b = decay * w.slow_b[j] + w_0 * w.last_b[j] + w_m * m_b + w_1 * w.i_b[j]
        w.slow_a[j], w.slow_b[j] = x_a, x_b
        w.drop_a[j] += w.skin_r[j] * (w.i_a[j] - x_a)
        w.drop_b[j] += w.skin_r[j] * (w.i_b[j] - x_b)


@kernel
def swelling(w):
    """Write by how much the mean current exceeds that in the middle (A): the parabola through start and middle is the
    line through them plus 12 times this times s (s - 1/2), s the share of the segment."""
    for j in range(w.psi_a.size):
        inverse = 1.0 / max(w.resistance[j], 1e-9)
        w.swell_a[j] = (w.fall_a[j] - w.resistance[j] * w.j_a[j]) * inverse
        w.swell_b[j] = (w.fall_b[j] - w.resistance[j] * w.j_b[j]) * inverse


@kernel
def skin_in_middle(w, span):
    """Add the skin effect's mean drop: R_1 tau/S times what its lag moves by, the current a parabola.

    The way to the middle was taken as if this drop grew with the current alone (e: the rest).
    """
    for j in range(w.psi_a.size):
        x = span * w.skin_rate[j]
        decay, zeroth, first, second = lag_moments(x)
        i_a, i_b, square = w.i_a[j], w.i_b[j], 12.0 * (second - 0.5 * first)
        moved_a = (decay - 1.0) * w.slow_a[j] + zeroth * i_a + 2.0 * first * (w.j_a[j] - i_a) + square * w.swell_a[j]
        moved_b = (decay - 1.0) * w.slow_b[j] + zeroth * i_b + 2.0 * first * (w.j_b[j] - i_b) + square * w.swell_b[j]
        r = w.skin_r[j] / x
        v_a, v_b = r * moved_a, r * moved_b
        d_a = 0.25 * span * (w.skin_r[j] * (w.j_a[j] - w.slow_a[j]) - v_a)
        d_b = 0.25 * span * (w.skin_r[j] * (w.j_b[j] - w.slow_b[j]) - v_b)
        e_a = w.stiff_aa[j] * d_a + w.stiff_ab[j] * d_b
        e_b = w.stiff_ab[j] * d_a + w.stiff_bb[j] * d_b
        w.j_a[j], w.j_b[j] = w.j_a[j] + e_a, w.j_b[j] + e_b
        w.fall_a[j] += v_a + w.resistance[j] * (4.0 / 3.0) * e_a
        w.fall_b[j] += v_b + w.resistance[j] * (4.0 / 3.0) * e_b
