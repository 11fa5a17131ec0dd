"""What effects add to the electrical plant, each in a loop of its own that runs only where the effect is on.

Lags are exact exponential steps, their input a parabola through the segment's start, middle and end.  The iron-loss
current i_c, tau di_c/dt = g dpsi/dt - i_c, is g/tau times the flux less the flux behind a lag of tau: its input is
then continuous, whatever the voltage does.
"""

from __future__ import annotations

import math

from model.compiled import inlined, kernel
from model.lanes import lag_moments, lag_weights, sine_cosine
from sandbox.plant import ports
from sandbox.plant.electrical import HALF_ROOT, ROOT_THIRD, THIRD, facing, finished, halfway, pull, seen

# what a batch may need beside the bare plant (bits)
LINK, DRAWN, LEG, WINDING, MAGNETS, ENERGY, IRON = (1 << k for k in range(7))
SKIN, FILTER, WOBBLE, DELAYED, TWIST, MOTION, MOVED, RUB, ZONE = (1 << k for k in range(7, 16))
LAGS = IRON | SKIN | FILTER
ANGULAR = MAGNETS | ENERGY


@kernel
def orient(w, share, speed):
    """Write what the rotor stands behind the angle handed in: offset, deviation, and the pattern's delay.

    share: of the period, at which the deviation is taken between the samples; speed: rad/s electrical.
    """
    for j in range(w.psi_a.size):
        d = w.deviation[j]
        w.off_s[j], w.off_c[j] = sine_cosine(w.offset[j] + d + share * (w.next_deviation[j] - d) - speed * w.delay[j])


@kernel
def supply(w, early, late):
    """Write the link's voltage, mean of two instants of the recording (s), later by each lane's delay."""
    for j in range(w.psi_a.size):
        more = ports.link(w, j, early + w.delay[j]) + ports.link(w, j, late + w.delay[j])
        w.link[j] = w.supply[j] - w.sunk[j] + 0.5 * more


@kernel
def draw(w, d_a, d_b, d_c):
    """Write by how much the period's mean current makes the link sag, and its voltage."""
    for j in range(w.psi_a.size):
        w.sunk[j] = ports.drawn(w, j, d_a, d_b, d_c, w.i_a[j], w.i_b[j])
        w.link[j] = w.supply[j] - w.sunk[j]


@kernel
def magnets(w, c_0, s_0):
    """Write the magnets' harmonics at an angle of cos c_0, sin s_0 (as handed in)."""
    for j in range(w.psi_a.size):
        c, s = facing(w, j, c_0, s_0)
        w.rest_d[j], w.rest_q[j], _, _ = ports.magnets(w, j, c, s)
    for k in range(w.more_magnets):
        for j in range(w.psi_a.size):
            c, s = facing(w, j, c_0, s_0)
            d, q, _, _ = ports.further_magnets(w, k, j, c, s)
            w.rest_d[j], w.rest_q[j] = w.rest_d[j] + d, w.rest_q[j] + q


@kernel
def further(w, c_0, s_0):
    """Write the current (A), stationary frame, of the energy's further terms at the fluxes z_d, z_q (Wb)."""
    for j in range(w.psi_a.size):
        c, s = facing(w, j, c_0, s_0)
        i_d, i_q, _ = ports.energy(w, j, c, s, w.z_d[j], w.z_q[j])
        w.extra_a[j], w.extra_b[j] = c * i_d - s * i_q, s * i_d + c * i_q
    for k in range(w.more_energy):
        for j in range(w.psi_a.size):
            c, s = facing(w, j, c_0, s_0)
            i_d, i_q, _ = ports.further_energy(w, k, j, c, s, w.z_d[j], w.z_q[j])
            w.extra_a[j] += c * i_d - s * i_q
            w.extra_b[j] += s * i_d + c * i_q


@kernel
def energy_at_start(w, c_0, s_0, x, y, side, real):
    """Add to the current at the segment's start what the energy's further terms say; drop and lateness follow."""
    for j in range(w.psi_a.size):
        c, s = facing(w, j, c_0, s_0)
        w.z_d[j], w.z_q[j] = seen(w, j, c, s, w.psi_a[j], w.psi_b[j])
    further(w, c_0, s_0)
    for j in range(w.psi_a.size):
        w.more_a[j], w.more_b[j] = w.extra_a[j], w.extra_b[j]
        i_a, i_b = w.i_a[j] + w.more_a[j], w.i_b[j] + w.more_b[j]
        w.i_a[j], w.i_b[j] = i_a, i_b
        w.drop_a[j], w.drop_b[j] = w.resistance[j] * i_a, w.resistance[j] * i_b
        sign = min(max((x * i_a + y * i_b) * w.soft[j], -1.0), 1.0)
        w.late[j] = real * ports.edge(w, j, sign, side)


@kernel
def late_by_zone(w, x, y, side, real):
    """Write anew how late the edge of leg (x, y) acts, by a sign with a zone of its own; see `electrical.take`."""
    for j in range(w.psi_a.size):
        w.late[j] = real * ports.edge(w, j, sign_of(w, j, x * w.i_a[j] + y * w.i_b[j]), side)


@inlined
def sign_of(w, j, current):
    """Return the sign of a leg's current (A) with all that effects add to the soft one."""
    sign = min(max(current * w.soft[j], -1.0), 1.0)
    return sign + ports.sign(w, j, current, w.soft[j], sign)


@kernel
def energy_in_middle(w, c_0, s_0, span, turned):
    """Add the same in the segment's middle, and what it changes in the drop's terms of `electrical.settle`: the way to
    the middle has all of the current's change, the line that turns by `turned` (rad) none of these terms'."""
    across = turned * (1.0 / 6.0)
    for j in range(w.psi_a.size):
        c, s = facing(w, j, c_0, s_0)
        w.z_d[j], w.z_q[j] = seen(w, j, c, s, w.mid_a[j], w.mid_b[j])
    further(w, c_0, s_0)
    for j in range(w.psi_a.size):
        i_a, i_b = w.extra_a[j], w.extra_b[j]
        k = 0.25 * span * (w.resistance[j] + w.skin_r[j])
        x, y = k * (w.stiff_aa[j] * i_a + w.stiff_ab[j] * i_b), k * (w.stiff_ab[j] * i_a + w.stiff_bb[j] * i_b)
        w.j_a[j], w.j_b[j] = w.j_a[j] + i_a - x, w.j_b[j] + i_b - y
        w.fall_a[j] -= w.resistance[j] * (x * (4.0 / 3.0) + across * w.more_b[j])
        w.fall_b[j] -= w.resistance[j] * (y * (4.0 / 3.0) - across * w.more_a[j])


@kernel
def energy_at(w, c_0, s_0, share):
    """Add to the mean drop half of what further currents take at a share of the way from the middle to either end.

    Harmonics turn many times as fast as the rotor: their mean is taken at two places (Gauss), the flux on its line.
    """
    for j in range(w.psi_a.size):
        c, s = facing(w, j, c_0, s_0)
        a = w.mid_a[j] + share * (w.mid_a[j] - w.psi_a[j])
        b = w.mid_b[j] + share * (w.mid_b[j] - w.psi_b[j])
        w.z_d[j], w.z_q[j] = seen(w, j, c, s, a, b)
    further(w, c_0, s_0)
    for j in range(w.psi_a.size):
        w.fall_a[j] += 0.5 * w.resistance[j] * w.extra_a[j]
        w.fall_b[j] += 0.5 * w.resistance[j] * w.extra_b[j]


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


@kernel
def winding_at_start(w):
    """Add to the drop at the segment's start what windings lose beside their resistance."""
    for j in range(w.psi_a.size):
        v_a, v_b = ports.winding(w, j, w.i_a[j], w.i_b[j])
        w.drop_a[j], w.drop_b[j] = w.drop_a[j] + v_a, w.drop_b[j] + v_b


@kernel
def winding_in_middle(w):
    """Add the same in its middle."""
    for j in range(w.psi_a.size):
        v_a, v_b = ports.winding(w, j, w.j_a[j], w.j_b[j])
        w.fall_a[j], w.fall_b[j] = w.fall_a[j] + v_a, w.fall_b[j] + v_b


@inlined
def legs_lose(w, j, x, y, p, q):
    """Return what legs lose on average (V, stationary frame) while the current (A) goes straight from x, y to p, q."""
    k = w.soft[j]
    half, side, ahead, beside = -0.5 * x, HALF_ROOT * y, -0.5 * p, HALF_ROOT * q
    v_a = ports.leg(w, j, k * x, k * p)
    v_b = ports.leg(w, j, k * (half + side), k * (ahead + beside))
    v_c = ports.leg(w, j, k * (half - side), k * (ahead - beside))
    return (2.0 * v_a - v_b - v_c) * THIRD, (v_b - v_c) * ROOT_THIRD


@kernel
def legs_at_start(w):
    """Add to the drop what the legs lose for their currents at the segment's start."""
    for j in range(w.psi_a.size):
        v_a, v_b = legs_lose(w, j, w.i_a[j], w.i_b[j], w.i_a[j], w.i_b[j])
        w.leg_a[j], w.leg_b[j] = v_a, v_b
        w.drop_a[j], w.drop_b[j] = w.drop_a[j] + v_a, w.drop_b[j] + v_b


@kernel
def legs_in_middle(w, span):
    """Add their mean over the segment, the current's parabola as two straight pieces.

    Around zero a leg is a resistance of threshold over half-width, many times the winding's: what it loses more on the
    way to the middle takes as much from the flux there, and from the current (e); at the end it is four times as much.
    """
    half = 0.5 * span
    for j in range(w.psi_a.size):
        x, y, r = w.i_a[j], w.i_b[j], w.resistance[j]
        v_a, v_b = legs_lose(w, j, x, y, w.j_a[j], w.j_b[j])
        d_a, d_b = half * (w.leg_a[j] - v_a), half * (w.leg_b[j] - v_b)
        e_a = w.stiff_aa[j] * d_a + w.stiff_ab[j] * d_b
        e_b = w.stiff_ab[j] * d_a + w.stiff_bb[j] * d_b
        m_a, m_b = w.j_a[j] + e_a, w.j_b[j] + e_b
        w.j_a[j], w.j_b[j] = m_a, m_b
        p, q = 2.0 * (m_a + e_a) - x + 6.0 * w.swell_a[j], 2.0 * (m_b + e_b) - y + 6.0 * w.swell_b[j]
        v_a, v_b = legs_lose(w, j, x, y, m_a, m_b)
        z_a, z_b = legs_lose(w, j, m_a, m_b, p, q)
        w.fall_a[j] += 0.5 * (v_a + z_a) + r * (4.0 / 3.0) * e_a
        w.fall_b[j] += 0.5 * (v_b + z_b) + r * (4.0 / 3.0) * e_b


@inlined
def table_says(w, current):
    """Return what a leg loses (V) at a current (A) by the measured table, and the integral of it from 0 on (A V)."""
    size, low, high = abs(current), 0, w.table_points - 1
    while high - low > 1:
        half = (low + high) // 2
        if w.table_current[half] <= size:
            low = half
        else:
            high = half
    over = max(size - w.table_current[high], 0.0)
    on = min(size, w.table_current[high]) - w.table_current[low]
    first, last = w.table_volts[low], w.table_volts[high]
    slope = (last - first) / (w.table_current[high] - w.table_current[low])
    volts = first + slope * on
    return math.copysign(volts, current), w.table_sum[low] + on * (first + 0.5 * slope * on) + over * volts


@inlined
def table_mean(w, before, after):
    """Return what a leg loses on average (V) while its current (A) goes straight from before to after."""
    step = after - before
    if abs(step) < 1e-6 * w.table_current[w.table_points - 1]:
        return table_says(w, 0.5 * (before + after))[0]
    return (table_says(w, after)[1] - table_says(w, before)[1]) / step


@inlined
def table_loses(w, x, y, p, q):
    """Return the same as `legs_lose` by the measured table."""
    half, side, ahead, beside = -0.5 * x, HALF_ROOT * y, -0.5 * p, HALF_ROOT * q
    a, b = table_mean(w, x, p), table_mean(w, half + side, ahead + beside)
    c = table_mean(w, half - side, ahead - beside)
    return (2.0 * a - b - c) * THIRD, (b - c) * ROOT_THIRD


@kernel
def table_at_start(w):
    """Add to the drop what legs lose by their measured table at a segment's start."""
    for j in range(w.psi_a.size):
        v_a, v_b = table_loses(w, w.i_a[j], w.i_b[j], w.i_a[j], w.i_b[j])
        w.drop_a[j], w.drop_b[j] = w.drop_a[j] + v_a, w.drop_b[j] + v_b


@kernel
def table_in_middle(w, span):
    """Add their mean over the segment, as `legs_in_middle` does."""
    half = 0.5 * span
    for j in range(w.psi_a.size):
        x, y, r = w.i_a[j], w.i_b[j], w.resistance[j]
        o_a, o_b = table_loses(w, x, y, x, y)
        v_a, v_b = table_loses(w, x, y, w.j_a[j], w.j_b[j])
        d_a, d_b = half * (o_a - v_a), half * (o_b - v_b)
        e_a = w.stiff_aa[j] * d_a + w.stiff_ab[j] * d_b
        e_b = w.stiff_ab[j] * d_a + w.stiff_bb[j] * d_b
        m_a, m_b = w.j_a[j] + e_a, w.j_b[j] + e_b
        w.j_a[j], w.j_b[j] = m_a, m_b
        v_a, v_b = table_loses(w, x, y, m_a, m_b)
        z_a, z_b = table_loses(w, m_a, m_b, 2.0 * (m_a + e_a) - x, 2.0 * (m_b + e_b) - y)
        w.fall_a[j] += 0.5 * (v_a + z_a) + r * (4.0 / 3.0) * e_a
        w.fall_b[j] += 0.5 * (v_b + z_b) + r * (4.0 / 3.0) * e_b


@kernel
def turning(w, c_0, s_0):
    """Write dH/dtheta in the middle: of the energy's further terms, and of the magnets' harmonics."""
    for j in range(w.psi_a.size):
        c, s = facing(w, j, c_0, s_0)
        d, q = seen(w, j, c, s, w.mid_a[j], w.mid_b[j])
        _, _, bent = ports.energy(w, j, c, s, d, q)
        _, _, t_d, t_q = ports.magnets(w, j, c, s)
        m_a, m_b = w.j_a[j] - w.core_a[j], w.j_b[j] - w.core_b[j]
        w.turning[j] = bent - t_d * (c * m_a + s * m_b) - t_q * (c * m_b - s * m_a)
    for k in range(w.more_energy):
        for j in range(w.psi_a.size):
            c, s = facing(w, j, c_0, s_0)
            d, q = seen(w, j, c, s, w.mid_a[j], w.mid_b[j])
            _, _, bent = ports.further_energy(w, k, j, c, s, d, q)
            w.turning[j] += bent
    for k in range(w.more_magnets):
        for j in range(w.psi_a.size):
            c, s = facing(w, j, c_0, s_0)
            _, _, t_d, t_q = ports.further_magnets(w, k, j, c, s)
            m_a, m_b = w.j_a[j] - w.core_a[j], w.j_b[j] - w.core_b[j]
            w.turning[j] -= t_d * (c * m_a + s * m_b) + t_q * (c * m_b - s * m_a)


@kernel
def air_gap(w, span):
    """Write the mean torque of a segment (N m; flux and current straight through it), and add its integral (s).

    The mean flux is that of a drop that goes from its start through its mean, not that of the prediction.
    """
    part = THIRD * span
    for j in range(w.psi_a.size):
        a, b = w.mid_a[j] - part * (w.fall_a[j] - w.drop_a[j]), w.mid_b[j] - part * (w.fall_b[j] - w.drop_b[j])
        w.torque[j] = pull(
            w.pairs[j], a, b, w.j_a[j] - w.core_a[j], w.j_b[j] - w.core_b[j], a - w.psi_a[j], b - w.psi_b[j],
            w.j_a[j] - w.i_a[j], w.j_b[j] - w.i_b[j],
        ) - 1.5 * w.pairs[j] * w.turning[j]  # fmt: skip
        w.impulse[j] += span * w.torque[j]
