"""What effects add to the electrical plant, each in a loop of its own that runs only where the effect is on.

Lags are exact exponential steps, their input a parabola through the segment's start, middle and end.  The iron-loss
current i_c, tau di_c/dt = g dpsi/dt - i_c, is g/tau times the flux less the flux behind a lag of tau: its input is
then continuous, whatever the voltage does.
"""

from __future__ import annotations

from model.compiled import inlined, kernel
from model.lanes import lag_moments, lag_weights, sine_cosine
from sandbox.plant import ports
from sandbox.plant.electrical import HALF_ROOT, ROOT_THIRD, THIRD, facing, finished, halfway, pull, seen

# what a batch may need beside the bare plant (bits)
LINK, DRAWN, LEG, WINDING, MAGNETS, ENERGY, IRON = (1 << k for k in range(7))
SKIN, FILTER, WOBBLE, DELAYED, TWIST, MOTION, MOVED, RUB = (1 << k for k in range(7, 15))
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
    """Move the flux behind the iron's lag on by a segment (s) and write the iron-loss current at its end."""
    for j in range(w.psi_a.size):
        a, b = finished(w, j, span)
        decay, w_0, w_m, w_1 = lag_weights(span * w.core_rate[j])
        y_a = decay * w.eddy_a[j] + w_0 * w.psi_a[j] + w_m * (w.mid_a[j] + w.bend_a[j]) + w_1 * a
        y_b = decay * w.eddy_b[j] + w_0 * w.psi_b[j] + w_m * (w.mid_b[j] + w.bend_b[j]) + w_1 * b
        w.eddy_a[j], w.eddy_b[j] = y_a, y_b
        g = w.core_g[j] * w.core_rate[j]
        w.core_a[j], w.core_b[j] = g * (a - y_a), g * (b - y_b)


@kernel
def iron_in_middle(w, span, u_a, u_b, x, y):
    """Write the mean iron-loss current of the segment, g/S times what the flux behind the lag moves by; the flux goes
    straight on through its middle."""
    inverse = 1.0 / span
    for j in range(w.psi_a.size):
        a, b = halfway(w, j, span, inverse, u_a, u_b, x, y)
        decay, zeroth, first, _ = lag_moments(span * w.core_rate[j])
        p, q, g = w.psi_a[j], w.psi_b[j], w.core_g[j] * inverse
        w.core_a[j] = g * ((decay - 1.0) * w.eddy_a[j] + zeroth * p + 2.0 * first * (a - p))
        w.core_b[j] = g * ((decay - 1.0) * w.eddy_b[j] + zeroth * q + 2.0 * first * (b - q))


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
def skin_in_middle(w, span):
    """Add the skin effect's mean drop: R_1 tau/S times what its lag moves by, the current going on as it began."""
    for j in range(w.psi_a.size):
        x = span * w.skin_rate[j]
        decay, zeroth, first, _ = lag_moments(x)
        i_a, i_b = w.i_a[j], w.i_b[j]
        moved_a = (decay - 1.0) * w.slow_a[j] + zeroth * i_a + 2.0 * first * (w.j_a[j] - i_a)
        moved_b = (decay - 1.0) * w.slow_b[j] + zeroth * i_b + 2.0 * first * (w.j_b[j] - i_b)
        r = w.skin_r[j] / x
        w.fall_a[j] += r * moved_a
        w.fall_b[j] += r * moved_b


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


@kernel
def legs_at_start(w):
    """Add to the drop what the legs lose for their currents at the segment's start."""
    for j in range(w.psi_a.size):
        k = w.soft[j]
        half, side = -0.5 * w.i_a[j], HALF_ROOT * w.i_b[j]
        a, b, c = k * w.i_a[j], k * (half + side), k * (half - side)
        v_a, v_b, v_c = ports.leg(w, j, a, a), ports.leg(w, j, b, b), ports.leg(w, j, c, c)
        w.drop_a[j] += (2.0 * v_a - v_b - v_c) * THIRD
        w.drop_b[j] += (v_b - v_c) * ROOT_THIRD


@kernel
def legs_in_middle(w):
    """Add their mean over the segment, currents going on as they began."""
    for j in range(w.psi_a.size):
        k = w.soft[j]
        x, y = w.i_a[j], w.i_b[j]
        p, q = 2.0 * w.j_a[j] - x, 2.0 * w.j_b[j] - y
        half, side, ahead, beside = -0.5 * x, HALF_ROOT * y, -0.5 * p, HALF_ROOT * q
        v_a = ports.leg(w, j, k * x, k * p)
        v_b = ports.leg(w, j, k * (half + side), k * (ahead + beside))
        v_c = ports.leg(w, j, k * (half - side), k * (ahead - beside))
        w.fall_a[j] += (2.0 * v_a - v_b - v_c) * THIRD
        w.fall_b[j] += (v_b - v_c) * ROOT_THIRD


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
