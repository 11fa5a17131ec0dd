"""First-order lags in the plant: of the sensors, of eddy currents, and of the skin effect.

They are exact exponential steps, their input a parabola through the segment's start, middle and
end, and a kink.  The iron-loss current i_c, tau di_c/dt = g dpsi/dt - i_c, is g/tau times the flux
less the flux behind a lag of tau: its input is then continuous, whatever the voltage does.

The kink: an edge that acts the share rho of a segment S late takes v (x, y) from the voltage until
then.  The flux goes along v S (x, y) (s rho - min(s, rho)), s the share of the segment, beside the
straight line between its ends.  To this a lag of rate k answers exactly, with x = k S and
E = exp(-x), by

    -v S (x, y) (rho + (1 - rho) E - exp(-x (1 - rho)))/x

(`kink`).  The mean of the same is -v S (x, y) rho (1 - rho)/2, twice `bend`.  The parabolas and
lines below have the right mean, so they hold the kink's mean already: what they answer to it is
taken off again.
"""

from __future__ import annotations

from model.compiled import inlined, kernel
from model.lanes import SERIES_BELOW, fading, lag_moments, lag_weights, short_lag_moments
from sandbox.plant.batch import CORE, FILTER, SKIN
from sandbox.plant.electrical import finished, halfway


@kernel
def face(w, c, s):
    """Write the inverse inductance (1/H) with the rotor turned on by an angle of cos c, sin s since
    it was written."""
    c_2, s_2 = c * c - s * s, 2.0 * c * s
    for j in range(w.psi_alpha.size):
        mean, half = 0.5 * (w.stiff_aa[j] + w.stiff_bb[j]), 0.5 * (w.stiff_aa[j] - w.stiff_bb[j])
        across = half * c_2 - w.stiff_ab[j] * s_2
        w.faced_aa[j], w.faced_bb[j] = mean + across, mean - across
        w.faced_ab[j] = half * s_2 + w.stiff_ab[j] * c_2


@inlined
def weigh(w, lag, rates, span):
    """Write the moments of a lag over a segment of length span (s) and clear its kinks; rates:
    (lanes,) 1/s."""
    fastest = 0.0
    for j in range(w.psi_alpha.size):
        fastest = max(fastest, rates[j])
        w.kink_alpha[lag, j] = w.kink_beta[lag, j] = 0.0
    if span * fastest <= SERIES_BELOW:  # the same numbers sooner
        for j in range(w.psi_alpha.size):
            w.zeroth[lag, j], w.first[lag, j], w.second[lag, j] = short_lag_moments(span * rates[j])
    else:
        for j in range(w.psi_alpha.size):
            w.zeroth[lag, j], w.first[lag, j], w.second[lag, j] = lag_moments(span * rates[j])


@inlined
def answer(late, steps, gone):
    """Return what a lag answers to the kink of an edge over what that changes (see above); late:
    share of the segment;
    steps: the segment over the time constant; gone: one minus the decay."""
    answered = (late + (1.0 - late) * (1.0 - gone) - fading(-steps * (1.0 - late))) / steps
    return answered if late > 0.0 else 0.0


@inlined
def kink(w, lag, rates, acts, t, span, x, y):
    """Add the kink of an edge of leg vector (x, y) that acts at acts (lanes,) s, in a segment begun
    at t (s)."""
    inverse = 1.0 / span
    for j in range(w.psi_alpha.size):
        late = min(max(acts[j] - t, 0.0), span) * inverse
        flux = w.link[j] * span * answer(late, span * rates[j], w.zeroth[lag, j])
        w.kink_alpha[lag, j] -= flux * x
        w.kink_beta[lag, j] -= flux * y


@inlined
def bend(w, j, half):
    """Return half of what late edges add to a segment's mean flux (Wb), beside the straight line
    between its ends;
    half: of the segment, s."""
    return (
        0.5 * (w.mid_alpha[j] - w.psi_alpha[j] + half * w.drop_alpha[j] - 0.5 * w.volt_alpha[j]),
        0.5 * (w.mid_beta[j] - w.psi_beta[j] + half * w.drop_beta[j] - 0.5 * w.volt_beta[j]),
    )


@inlined
def stiff(w, j, a, b):
    """Return the current (A) that follows a flux (Wb) at once: the magnetising current, and the
    iron's."""
    g = w.core_stiff[j]
    return (w.faced_aa[j] + g) * a + w.faced_ab[j] * b, w.faced_ab[j] * a + (w.faced_bb[j] + g) * b


@kernel
def remember(w, span):
    """Keep the current at the start of the segment that ends (span, s), and the bend that late
    edges gave its flux.

    Lags close over them once the end is known: their input is a parabola with the right mean, and a
    late edge makes the flux's mean differ from that of its ends by twice `bend`, where Simpson's
    rule would see two thirds of it.
    """
    half = 0.5 * span
    for j in range(w.psi_alpha.size):
        w.last_alpha[j], w.last_beta[j] = w.i_alpha[j], w.i_beta[j]
        w.bend_alpha[j], w.bend_beta[j] = bend(w, j, half)


@kernel
def close_iron(w, span):
    """Move the flux behind the iron's lag on by a segment (s) and write the iron-loss current at
    its end.

    The flux in the middle is less than predicted by what the drop grew on the way, S/4 (mean less
    start).  With the end the middle's current is known, too: of a parabola with this start, mean
    and end.
    """
    quarter = 0.25 * span
    for j in range(w.psi_alpha.size):
        a, b = finished(w, j, span)
        gone = w.zeroth[CORE, j]
        w_0, w_m, w_1 = lag_weights(gone, w.first[CORE, j], w.second[CORE, j])
        m_alpha = (
            w.mid_alpha[j] - 2.0 * w.bend_alpha[j] - quarter * (w.fall_alpha[j] - w.drop_alpha[j])
        )
        m_beta = w.mid_beta[j] - 2.0 * w.bend_beta[j] - quarter * (w.fall_beta[j] - w.drop_beta[j])
        y_alpha = (
            (1.0 - gone) * w.eddy_alpha[j]
            + w_0 * w.psi_alpha[j]
            + w_m * m_alpha
            + w_1 * a
            + w.kink_alpha[CORE, j]
        )
        y_beta = (
            (1.0 - gone) * w.eddy_beta[j]
            + w_0 * w.psi_beta[j]
            + w_m * m_beta
            + w_1 * b
            + w.kink_beta[CORE, j]
        )
        w.eddy_alpha[j], w.eddy_beta[j] = y_alpha, y_beta
        g = w.core_g[j] * w.core_rate[j]
        c_alpha, c_beta = g * (a - y_alpha), g * (b - y_beta)
        w.j_alpha[j] += 0.5 * w.core_alpha[j] - 0.25 * (w.begun_alpha[j] + c_alpha)
        w.j_beta[j] += 0.5 * w.core_beta[j] - 0.25 * (w.begun_beta[j] + c_beta)
        w.core_alpha[j], w.core_beta[j] = c_alpha, c_beta


@inlined
def moved_behind(w, j, half):
    """Return by how much the flux behind the iron's lag moves in a segment (Wb), as predicted with
    the drop at its start; half: of the segment, s."""
    gone, first = w.zeroth[CORE, j], w.first[CORE, j]
    p, q, a, b = w.psi_alpha[j], w.psi_beta[j], w.mid_alpha[j], w.mid_beta[j]
    bend_alpha, bend_beta = bend(w, j, half)
    return (
        gone * (p - w.eddy_alpha[j])
        + 2.0 * first * (a - 2.0 * bend_alpha - p)
        + w.kink_alpha[CORE, j],
        gone * (q - w.eddy_beta[j])
        + 2.0 * first * (b - 2.0 * bend_beta - q)
        + w.kink_beta[CORE, j],
    )


@kernel
def iron_in_middle(w, span, u_alpha, u_beta, x, y):
    """Write the mean iron-loss current of the segment, g/S times what the flux behind the lag moves
    by; the flux goes straight on through its middle, but for the kink."""
    inverse, half = 1.0 / span, 0.5 * span
    for j in range(w.psi_alpha.size):
        halfway(w, j, span, inverse, u_alpha, u_beta, x, y)
        g = w.core_g[j] * inverse
        w.core_less[j] = w.core_g[j] * w.second[CORE, j]
        w.begun_alpha[j], w.begun_beta[j] = w.core_alpha[j], w.core_beta[j]
        moved_alpha, moved_beta = moved_behind(w, j, half)
        w.core_alpha[j], w.core_beta[j] = g * moved_alpha, g * moved_beta


@kernel
def iron_stays(w, turned):
    """Take from the drop what `electrical.settled` gave the iron-loss current for turning with the
    rotor (by `turned`, rad), which it does not."""
    square, across = turned * turned * (1.0 / 24.0), turned * (1.0 / 6.0)
    for j in range(w.psi_alpha.size):
        r, e_alpha, e_beta = (
            w.resistance[j],
            w.core_alpha[j] - w.begun_alpha[j],
            w.core_beta[j] - w.begun_beta[j],
        )
        w.fall_alpha[j] -= r * (square * w.core_alpha[j] - across * e_beta)
        w.fall_beta[j] -= r * (square * w.core_beta[j] + across * e_alpha)


@kernel
def iron_bends(w):
    """Take from the mean iron-loss current what the growth of the whole drop over the segment bends
    the flux: last, when all have said what they add to the drop."""
    for j in range(w.psi_alpha.size):
        r = w.resistance[j]
        a, b = (
            w.core_less[j] * (w.fall_alpha[j] - w.drop_alpha[j]),
            w.core_less[j] * (w.fall_beta[j] - w.drop_beta[j]),
        )
        w.core_alpha[j], w.core_beta[j] = w.core_alpha[j] - a, w.core_beta[j] - b
        w.j_alpha[j], w.j_beta[j] = w.j_alpha[j] - a, w.j_beta[j] - b
        w.fall_alpha[j], w.fall_beta[j] = w.fall_alpha[j] - r * a, w.fall_beta[j] - r * b


@inlined
def behind(w, lag, j, x_alpha, x_beta):
    """Return the current (A) behind a lag at the end of a segment that ends with the current as it
    is now.

    (x_alpha, x_beta): the same at its start.  The magnetising current in the middle is that at the
    mean flux, so it holds the kink's mean once; the iron's, of a parabola, holds it one and a half
    times.
    """
    gone, p, q = w.zeroth[lag, j], 2.0 * w.bend_alpha[j], 2.0 * w.bend_beta[j]
    w_0, w_m, w_1 = lag_weights(gone, w.first[lag, j], w.second[lag, j])
    g = 0.5 * w_m * w.core_stiff[j]
    k_alpha, k_beta = stiff(w, j, w.kink_alpha[lag, j] - w_m * p, w.kink_beta[lag, j] - w_m * q)
    return (
        (1.0 - gone) * x_alpha
        + w_0 * w.last_alpha[j]
        + w_m * w.j_alpha[j]
        + w_1 * w.i_alpha[j]
        + k_alpha
        - g * p,
        (1.0 - gone) * x_beta
        + w_0 * w.last_beta[j]
        + w_m * w.j_beta[j]
        + w_1 * w.i_beta[j]
        + k_beta
        - g * q,
    )


@kernel
def close_filter(w):
    """Move the sensors' filter on by a segment."""
    for j in range(w.psi_alpha.size):
        w.filter_alpha[j], w.filter_beta[j] = behind(
            w, FILTER, j, w.filter_alpha[j], w.filter_beta[j]
        )


@kernel
def close_skin(w):
    """Move the slow part of the current on by a segment, and add the skin effect's drop at its
    end."""
    for j in range(w.psi_alpha.size):
        x_alpha, x_beta = behind(w, SKIN, j, w.slow_alpha[j], w.slow_beta[j])
        w.slow_alpha[j], w.slow_beta[j] = x_alpha, x_beta
        w.drop_alpha[j] += w.skin_r[j] * (w.i_alpha[j] - x_alpha)
        w.drop_beta[j] += w.skin_r[j] * (w.i_beta[j] - x_beta)


@kernel
def swelling(w):
    """Write by how much the mean current exceeds that in the middle (A): the parabola through start
    and middle is the line through them plus 12 times this times s (s - 1/2), s the share of the
    segment."""
    for j in range(w.psi_alpha.size):
        inverse = 1.0 / max(w.resistance[j], 1e-9)
        w.swell_alpha[j] = (w.fall_alpha[j] - w.resistance[j] * w.j_alpha[j]) * inverse
        w.swell_beta[j] = (w.fall_beta[j] - w.resistance[j] * w.j_beta[j]) * inverse


@kernel
def skin_in_middle(w, span):
    """Add the skin effect's mean drop: R_1 tau/S times what its lag moves by, the current a
    parabola and the kink.

    The way to the middle was taken as if this drop grew with the current alone (e: the rest).
    """
    half = 0.5 * span
    for j in range(w.psi_alpha.size):
        gone, first = w.zeroth[SKIN, j], w.first[SKIN, j]
        i_alpha, i_beta, square = (
            w.i_alpha[j],
            w.i_beta[j],
            12.0 * (w.second[SKIN, j] - 0.5 * first),
        )
        bend_alpha, bend_beta = bend(w, j, half)
        k_alpha, k_beta = stiff(
            w,
            j,
            w.kink_alpha[SKIN, j] - 4.0 * first * bend_alpha,
            w.kink_beta[SKIN, j] - 4.0 * first * bend_beta,
        )
        moved_alpha = (
            gone * (i_alpha - w.slow_alpha[j])
            + 2.0 * first * (w.j_alpha[j] - i_alpha)
            + square * w.swell_alpha[j]
            + k_alpha
        )
        moved_beta = (
            gone * (i_beta - w.slow_beta[j])
            + 2.0 * first * (w.j_beta[j] - i_beta)
            + square * w.swell_beta[j]
            + k_beta
        )
        r = w.skin_r[j] / (span * w.skin_rate[j])
        v_alpha, v_beta = r * moved_alpha, r * moved_beta
        d_alpha = 0.25 * span * (w.skin_r[j] * (w.j_alpha[j] - w.slow_alpha[j]) - v_alpha)
        d_beta = 0.25 * span * (w.skin_r[j] * (w.j_beta[j] - w.slow_beta[j]) - v_beta)
        e_alpha = w.stiff_aa[j] * d_alpha + w.stiff_ab[j] * d_beta
        e_beta = w.stiff_ab[j] * d_alpha + w.stiff_bb[j] * d_beta
        w.j_alpha[j], w.j_beta[j] = w.j_alpha[j] + e_alpha, w.j_beta[j] + e_beta
        w.fall_alpha[j] += v_alpha + w.resistance[j] * (4.0 / 3.0) * e_alpha
        w.fall_beta[j] += v_beta + w.resistance[j] * (4.0 / 3.0) * e_beta
