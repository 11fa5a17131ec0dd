"""First-order lags in the plant: of the sensors, of eddy currents, and of the skin effect.

They are exact exponential steps, their input a parabola through the segment's start, middle and end, and a kink.  The
iron-loss current i_c, tau di_c/dt = g dpsi/dt - i_c, is g/tau times the flux less the flux behind a lag of tau: its
input is then continuous, whatever the voltage does.

The kink: an edge that acts the share rho of a segment S late takes v (x, y) from the voltage until then.  The flux goes
along v S (x, y) (s rho - min(s, rho)), s the share of the segment, beside the straight line between its ends.  To this
a lag of rate k answers exactly, with x = k S and E = exp(-x), by

    -v S (x, y) (rho + (1 - rho) E - exp(-x (1 - rho)))/x

(`kink`).  The mean of the same is -v S (x, y) rho (1 - rho)/2, twice `bend`.  The parabolas and lines below have the
right mean, so they hold the kink's mean already: what they answer to it is taken off again.
"""

from __future__ import annotations

from model.compiled import inlined, kernel
from model.lanes import SERIES_BELOW, fading, lag_moments, lag_weights, short_lag_moments
from sandbox.plant.batch import CORE, FILTER, SKIN
from sandbox.plant.electrical import finished, halfway


@kernel
def face(w, c, s):
    """Write the inverse inductance (1/H) with the rotor turned on by an angle of cos c, sin s since it was written."""
    c_2, s_2 = c * c - s * s, 2.0 * c * s
    for j in range(w.psi_a.size):
        mean, half = 0.5 * (w.stiff_aa[j] + w.stiff_bb[j]), 0.5 * (w.stiff_aa[j] - w.stiff_bb[j])
        across = half * c_2 - w.stiff_ab[j] * s_2
        w.faced_aa[j], w.faced_bb[j] = mean + across, mean - across
        w.faced_ab[j] = half * s_2 + w.stiff_ab[j] * c_2


@inlined
def weigh(w, lag, rates, span):
    """Write the moments of a lag over a segment of length span (s) and clear its kinks; rates: (lanes,) 1/s."""
    fastest = 0.0
    for j in range(w.psi_a.size):
        fastest = max(fastest, rates[j])
        w.kink_a[lag, j] = w.kink_b[lag, j] = 0.0
    if span * fastest <= SERIES_BELOW:  # the same numbers sooner
        for j in range(w.psi_a.size):
            w.zeroth[lag, j], w.first[lag, j], w.second[lag, j] = short_lag_moments(span * rates[j])
    else:
        for j in range(w.psi_a.size):
            w.zeroth[lag, j], w.first[lag, j], w.second[lag, j] = lag_moments(span * rates[j])


@inlined
def answer(late, steps, gone):
    """Return what a lag answers to the kink of an edge over what that changes (see above); late: share of the segment;
    steps: the segment over the time constant; gone: one minus the decay."""
    told = (late + (1.0 - late) * (1.0 - gone) - fading(-steps * (1.0 - late))) / steps
    return told if late > 0.0 else 0.0


@inlined
def kink(w, lag, rates, acts, t, span, x, y):
    """Add the kink of an edge of leg vector (x, y) that acts at acts (lanes,) s, in a segment begun at t (s)."""
    inverse = 1.0 / span
    for j in range(w.psi_a.size):
        late = min(max(acts[j] - t, 0.0), span) * inverse
        flux = w.link[j] * span * answer(late, span * rates[j], w.zeroth[lag, j])
        w.kink_a[lag, j] -= flux * x
        w.kink_b[lag, j] -= flux * y


@inlined
def bend(w, j, half):
    """Return half of what late edges add to a segment's mean flux (Wb), beside the straight line between its ends;
    half: of the segment, s."""
    return (
        0.5 * (w.mid_a[j] - w.psi_a[j] + half * w.drop_a[j] - 0.5 * w.volt_a[j]),
        0.5 * (w.mid_b[j] - w.psi_b[j] + half * w.drop_b[j] - 0.5 * w.volt_b[j]),
    )


@inlined
def stiff(w, j, a, b):
    """Return the current (A) that follows a flux (Wb) at once: the magnetising current, and the iron's."""
    g = w.core_g[j] * w.core_rate[j]
    return (w.faced_aa[j] + g) * a + w.faced_ab[j] * b, w.faced_ab[j] * a + (w.faced_bb[j] + g) * b


@kernel
def remember(w, span):
    """Keep the current at the start of the segment that ends (span, s), and the bend that late edges gave its flux.

    Lags close over them once the end is known: their input is a parabola with the right mean, and a late edge makes
    the flux's mean differ from that of its ends by twice `bend`, where Simpson's rule would see two thirds of it.
    """
    half = 0.5 * span
    for j in range(w.psi_a.size):
        w.last_a[j], w.last_b[j] = w.i_a[j], w.i_b[j]
        w.bend_a[j], w.bend_b[j] = bend(w, j, half)


@kernel
def close_iron(w, span):
    """Move the flux behind the iron's lag on by a segment (s) and write the iron-loss current at its end.

    The flux in the middle is less than predicted by what the drop grew on the way, S/4 (mean less start).  With the end
    the middle's current is known, too: of a parabola with this start, mean and end.
    """
    quarter = 0.25 * span
    for j in range(w.psi_a.size):
        a, b = finished(w, j, span)
        gone = w.zeroth[CORE, j]
        w_0, w_m, w_1 = lag_weights(gone, w.first[CORE, j], w.second[CORE, j])
        m_a = w.mid_a[j] - 2.0 * w.bend_a[j] - quarter * (w.fall_a[j] - w.drop_a[j])
        m_b = w.mid_b[j] - 2.0 * w.bend_b[j] - quarter * (w.fall_b[j] - w.drop_b[j])
        y_a = (1.0 - gone) * w.eddy_a[j] + w_0 * w.psi_a[j] + w_m * m_a + w_1 * a + w.kink_a[CORE, j]
        y_b = (1.0 - gone) * w.eddy_b[j] + w_0 * w.psi_b[j] + w_m * m_b + w_1 * b + w.kink_b[CORE, j]
        w.eddy_a[j], w.eddy_b[j] = y_a, y_b
        g = w.core_g[j] * w.core_rate[j]
        c_a, c_b = g * (a - y_a), g * (b - y_b)
        w.j_a[j] += 0.5 * w.core_a[j] - 0.25 * (w.begun_a[j] + c_a)
        w.j_b[j] += 0.5 * w.core_b[j] - 0.25 * (w.begun_b[j] + c_b)
        w.core_a[j], w.core_b[j] = c_a, c_b


@kernel
def iron_in_middle(w, span, u_a, u_b, x, y):
    """Write the mean iron-loss current of the segment, g/S times what the flux behind the lag moves by; the flux goes
    straight on through its middle, but for the kink."""
    inverse, half = 1.0 / span, 0.5 * span
    for j in range(w.psi_a.size):
        a, b = halfway(w, j, span, inverse, u_a, u_b, x, y)
        gone, first = w.zeroth[CORE, j], w.first[CORE, j]
        p, q, g = w.psi_a[j], w.psi_b[j], w.core_g[j] * inverse
        w.core_less[j] = w.core_g[j] * w.second[CORE, j]
        w.begun_a[j], w.begun_b[j] = w.core_a[j], w.core_b[j]
        bend_a, bend_b = bend(w, j, half)
        moved_a = gone * (p - w.eddy_a[j]) + 2.0 * first * (a - 2.0 * bend_a - p) + w.kink_a[CORE, j]
        moved_b = gone * (q - w.eddy_b[j]) + 2.0 * first * (b - 2.0 * bend_b - q) + w.kink_b[CORE, j]
        w.core_a[j], w.core_b[j] = g * moved_a, g * moved_b


@kernel
def iron_stays(w, turned):
    """Take from the drop what `electrical.settled` gave the iron-loss current for turning with the rotor (by `turned`,
    rad), which it does not."""
    square, across = turned * turned * (1.0 / 24.0), turned * (1.0 / 6.0)
    for j in range(w.psi_a.size):
        r, e_a, e_b = w.resistance[j], w.core_a[j] - w.begun_a[j], w.core_b[j] - w.begun_b[j]
        w.fall_a[j] -= r * (square * w.core_a[j] - across * e_b)
        w.fall_b[j] -= r * (square * w.core_b[j] + across * e_a)


@kernel
def iron_bends(w):
    """Take from the mean iron-loss current what the growth of the whole drop over the segment bends the flux: last,
    when all have said what they add to the drop."""
    for j in range(w.psi_a.size):
        r = w.resistance[j]
        a, b = w.core_less[j] * (w.fall_a[j] - w.drop_a[j]), w.core_less[j] * (w.fall_b[j] - w.drop_b[j])
        w.core_a[j], w.core_b[j] = w.core_a[j] - a, w.core_b[j] - b
        w.j_a[j], w.j_b[j] = w.j_a[j] - a, w.j_b[j] - b
        w.fall_a[j], w.fall_b[j] = w.fall_a[j] - r * a, w.fall_b[j] - r * b


@inlined
def behind(w, lag, j, x_a, x_b):
    """Return the current (A) behind a lag at the end of a segment that ends with the current as it is now.

    (x_a, x_b): the same at its start.  The magnetising current in the middle is that at the mean flux, so it holds the
    kink's mean once; the iron's, of a parabola, holds it one and a half times.
    """
    gone, p, q = w.zeroth[lag, j], 2.0 * w.bend_a[j], 2.0 * w.bend_b[j]
    w_0, w_m, w_1 = lag_weights(gone, w.first[lag, j], w.second[lag, j])
    g = 0.5 * w_m * w.core_g[j] * w.core_rate[j]
    k_a, k_b = stiff(w, j, w.kink_a[lag, j] - w_m * p, w.kink_b[lag, j] - w_m * q)
    return (
        (1.0 - gone) * x_a + w_0 * w.last_a[j] + w_m * w.j_a[j] + w_1 * w.i_a[j] + k_a - g * p,
        (1.0 - gone) * x_b + w_0 * w.last_b[j] + w_m * w.j_b[j] + w_1 * w.i_b[j] + k_b - g * q,
    )


@kernel
def close_filter(w):
    """Move the sensors' filter on by a segment."""
    for j in range(w.psi_a.size):
        w.filter_a[j], w.filter_b[j] = behind(w, FILTER, j, w.filter_a[j], w.filter_b[j])


@kernel
def close_skin(w):
    """Move the slow part of the current on by a segment, and add the skin effect's drop at its end."""
    for j in range(w.psi_a.size):
        x_a, x_b = behind(w, SKIN, j, w.slow_a[j], w.slow_b[j])
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
    """Add the skin effect's mean drop: R_1 tau/S times what its lag moves by, the current a parabola and the kink.

    The way to the middle was taken as if this drop grew with the current alone (e: the rest).
    """
    half = 0.5 * span
    for j in range(w.psi_a.size):
        gone, first = w.zeroth[SKIN, j], w.first[SKIN, j]
        i_a, i_b, square = w.i_a[j], w.i_b[j], 12.0 * (w.second[SKIN, j] - 0.5 * first)
        bend_a, bend_b = bend(w, j, half)
        k_a, k_b = stiff(w, j, w.kink_a[SKIN, j] - 4.0 * first * bend_a, w.kink_b[SKIN, j] - 4.0 * first * bend_b)
        moved_a = gone * (i_a - w.slow_a[j]) + 2.0 * first * (w.j_a[j] - i_a) + square * w.swell_a[j] + k_a
        moved_b = gone * (i_b - w.slow_b[j]) + 2.0 * first * (w.j_b[j] - i_b) + square * w.swell_b[j] + k_b
        r = w.skin_r[j] / (span * w.skin_rate[j])
        v_a, v_b = r * moved_a, r * moved_b
        d_a = 0.25 * span * (w.skin_r[j] * (w.j_a[j] - w.slow_a[j]) - v_a)
        d_b = 0.25 * span * (w.skin_r[j] * (w.j_b[j] - w.slow_b[j]) - v_b)
        e_a = w.stiff_aa[j] * d_a + w.stiff_ab[j] * d_b
        e_b = w.stiff_ab[j] * d_a + w.stiff_bb[j] * d_b
        w.j_a[j], w.j_b[j] = w.j_a[j] + e_a, w.j_b[j] + e_b
        w.fall_a[j] += v_a + w.resistance[j] * (4.0 / 3.0) * e_a
        w.fall_b[j] += v_b + w.resistance[j] * (4.0 / 3.0) * e_b
