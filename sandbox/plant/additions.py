"""What effects add to the electrical plant, each in a loop of its own that runs only where the
effect is on.

Lags stand in `lags`, what windings and legs lose in `losses`.
"""

from __future__ import annotations

from model.compiled import inlined, kernel
from model.lanes import sine_cosine
from sandbox.plant import ports
from sandbox.plant.electrical import HALF_ROOT, THIRD, facing, pull, seen

# what a batch may need beside the bare plant (bits)
LINK, DRAWN, LEG, WINDING, MAGNETS, ENERGY, IRON = (1 << k for k in range(7))
SKIN, FILTER, WOBBLE, DELAYED, TWIST, MOTION, MOVED, RUB, COMMUTE, ROUND, CURVE, BACKLASH, RING = (
    1 << k for k in range(7, 20)
)
LAYERS, BRISTLES, CHANNELS = (1 << k for k in range(20, 23))
CORE_LOSS = 1 << 23  # beside IRON: excess loss and hysteresis
LAGS = IRON | SKIN | FILTER | LAYERS
ANGULAR = MAGNETS | ENERGY
# of the flux, and Wb: by which the energy's further currents are compared
DIFFERENCE, LEAST_DIFFERENCE = 1e-4, 1e-12


@kernel
def orient(w, share, speed):
    """Write what the rotor stands behind the angle handed in: offset and deviation; it goes on by
    the pattern's delay, and by what the reading is old.

    share: of the period, at which the deviation is taken between the samples; speed: rad/s
    electrical.
    """
    for j in range(w.psi_alpha.size):
        orient_lane(w, j, share, speed)


@inlined
def orient_lane(w, j, share, speed):
    """Do so for lane j."""
    d = w.deviation[j]
    w.off_s[j], w.off_c[j] = sine_cosine(
        w.offset[j] + d + share * (w.next_deviation[j] - d) - speed * (w.delay[j] + w.latency[j])
    )


@kernel
def supply(w, early, late):
    """Write the link's voltage, mean of two instants of the recording (s), later by each lane's
    delay."""
    for j in range(w.psi_alpha.size):
        more = ports.link(w, j, early + w.delay[j]) + ports.link(w, j, late + w.delay[j])
        w.link[j] = w.supply[j] - w.link_sag[j] + 0.5 * more


@kernel
def draw(w, d_a, d_b, d_c):
    """Write by how much the period's mean current makes the link sag, and its voltage."""
    for j in range(w.psi_alpha.size):
        w.link_sag[j] = ports.drawn(w, j, d_a, d_b, d_c, w.i_alpha[j], w.i_beta[j])
        w.link[j] = w.supply[j] - w.link_sag[j]


@kernel
def ring(w, d_a, d_b, d_c):
    """Write the link's voltage in the middle of the period where its capacitor rings with its
    source, and move both on to the end; what legs draw is that at the pattern's start.

    x (dip below the source, V) and y (the source's current times Z) go round where they would
    rest, x_0 = 2 D Z i and y_0 = Z i, by the exponential of w [[0, -1], [1, -2 D]]: with
    q = sqrt(1 - D^2), over a time t exp(-D w t) (cos q w t + sin q w t/q [[D, -1], [1, -D]]).
    """
    for j in range(w.psi_alpha.size):
        if w.source_rate[j] > 0.0:
            x_0 = w.link_sag[j]
            y_0 = w.source_ohm[j] * (
                (d_a - 0.5 * (d_b + d_c)) * w.i_alpha[j] + HALF_ROOT * (d_b - d_c) * w.i_beta[j]
            )
            fed = w.fed[j] > 0.0  # else it rests as a recording begins
            x, y = (w.dip[j] - x_0, w.feed[j] - y_0) if fed else (0.0, 0.0)
            x, y = swung(w, j, x, y)
            w.link_sag[j] = x_0 + x
            x, y = swung(w, j, x, y)
            w.dip[j], w.feed[j], w.fed[j] = x_0 + x, y_0 + y, 1.0
            w.link[j] = w.supply[j] - w.link_sag[j]


@inlined
def swung(w, j, x, y):
    """Return dip and feed (V), from where they would rest, half a period on."""
    c, s = w.source_cos[j], w.source_sin[j]
    d = w.source_damping[j] * s
    return (c + d) * x - s * y, s * x + (c - d) * y


@kernel
def magnets(w, c_0, s_0):
    """Write the magnets' harmonics at an angle of cos c_0, sin s_0 (as handed in)."""
    for j in range(w.psi_alpha.size):
        c, s = facing(w, j, c_0, s_0)
        w.rest_d[j], w.rest_q[j], _, _ = ports.magnets(w, j, c, s)
    for k in range(w.more_magnets):
        for j in range(w.psi_alpha.size):
            c, s = facing(w, j, c_0, s_0)
            d, q, _, _ = ports.further_magnets(w, k, j, c, s)
            w.rest_d[j], w.rest_q[j] = w.rest_d[j] + d, w.rest_q[j] + q


@kernel
def at_rest(w, c, s, rest):
    """Write the magnets' harmonics (2, lanes) in Wb at angles of cos c, sin s (lanes,)."""
    for j in range(w.psi_alpha.size):
        rest[0, j], rest[1, j], _, _ = ports.magnets(w, j, c[j], s[j])
        for k in range(w.more_magnets):
            d, q, _, _ = ports.further_magnets(w, k, j, c[j], s[j])
            rest[0, j], rest[1, j] = rest[0, j] + d, rest[1, j] + q


@inlined
def looked_at(w, j, c_0, s_0, a, b):
    """Return the current (A), stationary frame, of the energy's terms beside the motor's own at a
    flux (Wb), first parts of effects.  The flux stays in z_d, z_q for `further`."""
    c, s = facing(w, j, c_0, s_0)
    d, q = seen(w, j, c, s, a, b)
    w.z_d[j], w.z_q[j] = d, q
    i_d, i_q, _ = ports.energy(w, j, c, s, d, q)
    return c * i_d - s * i_q, s * i_d + c * i_q


@kernel
def further(w, c_0, s_0):
    """Write the same (extra_alpha, extra_beta) of further parts at the fluxes z_d, z_q; return
    whether there are any.

    What is done with these currents is linear in them, so they come in a second pass that mostly is
    none.
    """
    if w.more_energy == 0:
        return False
    for j in range(w.psi_alpha.size):
        w.extra_alpha[j] = w.extra_beta[j] = 0.0
    for k in range(w.more_energy):
        for j in range(w.psi_alpha.size):
            c, s = facing(w, j, c_0, s_0)
            i_d, i_q, _ = ports.further_energy(w, k, j, c, s, w.z_d[j], w.z_q[j])
            w.extra_alpha[j] += c * i_d - s * i_q
            w.extra_beta[j] += s * i_d + c * i_q
    return True


@inlined
def more_current(w, j, c_0, s_0, a, b):
    """Return the current (A), stationary frame, of all of the energy's terms beside the motor's own
    at a flux (Wb)."""
    i_alpha, i_beta = looked_at(w, j, c_0, s_0, a, b)
    c, s = facing(w, j, c_0, s_0)
    for k in range(w.more_energy):
        i_d, i_q, _ = ports.further_energy(w, k, j, c, s, w.z_d[j], w.z_q[j])
        i_alpha, i_beta = i_alpha + c * i_d - s * i_q, i_beta + s * i_d + c * i_q
    return i_alpha, i_beta


@kernel
def stiffen_further(w, c_0, s_0):
    """Write what these terms add to the inverse incremental inductance (1/H), stationary frame, at
    the flux of a period's start: central differences of their current, exact where it has no third
    degree."""
    for j in range(w.psi_alpha.size):
        a, b = w.psi_alpha[j], w.psi_beta[j]
        h = DIFFERENCE * (abs(a) + abs(b)) + LEAST_DIFFERENCE
        over = 0.5 / h
        x_alpha, x_beta = more_current(w, j, c_0, s_0, a + h, b)
        y_alpha, y_beta = more_current(w, j, c_0, s_0, a - h, b)
        u_alpha, u_beta = more_current(w, j, c_0, s_0, a, b + h)
        v_alpha, v_beta = more_current(w, j, c_0, s_0, a, b - h)
        w.stiffer_aa[j], w.stiffer_bb[j] = over * (x_alpha - y_alpha), over * (u_beta - v_beta)
        w.stiffer_ab[j] = 0.5 * over * (x_beta - y_beta + (u_alpha - v_alpha))


@inlined
def entered(w, j, i_alpha, i_beta):
    """Add a current (A) to that at the segment's start; its drop follows."""
    w.more_alpha[j], w.more_beta[j] = w.more_alpha[j] + i_alpha, w.more_beta[j] + i_beta
    i_alpha, i_beta = w.i_alpha[j] + i_alpha, w.i_beta[j] + i_beta
    w.i_alpha[j], w.i_beta[j] = i_alpha, i_beta
    w.drop_alpha[j], w.drop_beta[j] = w.resistance[j] * i_alpha, w.resistance[j] * i_beta


@kernel
def energy_at_start(w, c_0, s_0):
    """Add to the current at the segment's start what the energy's further terms say; the drop
    follows."""
    for j in range(w.psi_alpha.size):
        w.more_alpha[j] = w.more_beta[j] = 0.0
        i_alpha, i_beta = looked_at(w, j, c_0, s_0, w.psi_alpha[j], w.psi_beta[j])
        entered(w, j, i_alpha, i_beta)
    if further(w, c_0, s_0):
        for j in range(w.psi_alpha.size):
            entered(w, j, w.extra_alpha[j], w.extra_beta[j])


@inlined
def passed(w, j, i_alpha, i_beta, span):
    """Add a current (A) to that in the segment's middle, and what it changes in the terms of
    `electrical.settle`: the way to the middle has all of the current's change."""
    k = 0.25 * span * (w.resistance[j] + w.skin_r[j])
    x, y = (
        k * (w.stiff_aa[j] * i_alpha + w.stiff_ab[j] * i_beta),
        k * (w.stiff_ab[j] * i_alpha + w.stiff_bb[j] * i_beta),
    )
    w.j_alpha[j], w.j_beta[j] = w.j_alpha[j] + i_alpha - x, w.j_beta[j] + i_beta - y
    w.fall_alpha[j] -= w.resistance[j] * (x * (4.0 / 3.0))
    w.fall_beta[j] -= w.resistance[j] * (y * (4.0 / 3.0))


@kernel
def energy_in_middle(w, c_0, s_0, span, turned):
    """Add the same in the segment's middle; the line that turns by `turned` (rad) has none of these
    terms' change."""
    across = turned * (1.0 / 6.0)
    for j in range(w.psi_alpha.size):
        i_alpha, i_beta = looked_at(w, j, c_0, s_0, w.mid_alpha[j], w.mid_beta[j])
        passed(w, j, i_alpha, i_beta, span)
        w.fall_alpha[j] -= w.resistance[j] * across * w.more_beta[j]
        w.fall_beta[j] += w.resistance[j] * across * w.more_alpha[j]
    if further(w, c_0, s_0):
        for j in range(w.psi_alpha.size):
            passed(w, j, w.extra_alpha[j], w.extra_beta[j], span)


@kernel
def energy_at(w, c_0, s_0, share):
    """Add to the mean drop half of what further currents take at a share of the way from the middle
    to either end.

    Harmonics turn many times as fast as the rotor: their mean is taken at two places (Gauss), the
    flux on its line.
    """
    for j in range(w.psi_alpha.size):
        a = w.mid_alpha[j] + share * (w.mid_alpha[j] - w.psi_alpha[j])
        b = w.mid_beta[j] + share * (w.mid_beta[j] - w.psi_beta[j])
        i_alpha, i_beta = looked_at(w, j, c_0, s_0, a, b)
        w.fall_alpha[j] += 0.5 * w.resistance[j] * i_alpha
        w.fall_beta[j] += 0.5 * w.resistance[j] * i_beta
    if further(w, c_0, s_0):
        for j in range(w.psi_alpha.size):
            w.fall_alpha[j] += 0.5 * w.resistance[j] * w.extra_alpha[j]
            w.fall_beta[j] += 0.5 * w.resistance[j] * w.extra_beta[j]


@kernel
def turning(w, c_0, s_0):
    """Write dH/dtheta in the middle: of the energy's further terms, and of the magnets'
    harmonics."""
    for j in range(w.psi_alpha.size):
        c, s = facing(w, j, c_0, s_0)
        d, q = seen(w, j, c, s, w.mid_alpha[j], w.mid_beta[j])
        _, _, bent = ports.energy(w, j, c, s, d, q)
        _, _, t_d, t_q = ports.magnets(w, j, c, s)
        m_alpha, m_beta = w.j_alpha[j] - w.core_alpha[j], w.j_beta[j] - w.core_beta[j]
        w.turning[j] = bent - t_d * (c * m_alpha + s * m_beta) - t_q * (c * m_beta - s * m_alpha)
    for k in range(w.more_energy):
        for j in range(w.psi_alpha.size):
            c, s = facing(w, j, c_0, s_0)
            d, q = seen(w, j, c, s, w.mid_alpha[j], w.mid_beta[j])
            _, _, bent = ports.further_energy(w, k, j, c, s, d, q)
            w.turning[j] += bent
    for k in range(w.more_magnets):
        for j in range(w.psi_alpha.size):
            c, s = facing(w, j, c_0, s_0)
            _, _, t_d, t_q = ports.further_magnets(w, k, j, c, s)
            m_alpha, m_beta = w.j_alpha[j] - w.core_alpha[j], w.j_beta[j] - w.core_beta[j]
            w.turning[j] -= t_d * (c * m_alpha + s * m_beta) + t_q * (c * m_beta - s * m_alpha)


@kernel
def air_gap(w, span):
    """Write the mean torque of a segment (N m; flux and current straight through it), and add its
    integral (s).

    The mean flux is that of a drop that goes from its start through its mean, not that of the
    prediction.
    """
    part = THIRD * span
    for j in range(w.psi_alpha.size):
        a, b = (
            w.mid_alpha[j] - part * (w.fall_alpha[j] - w.drop_alpha[j]),
            w.mid_beta[j] - part * (w.fall_beta[j] - w.drop_beta[j]),
        )
        w.torque[j] = (
            pull(
                w.pairs[j],
                a,
                b,
                w.j_alpha[j] - w.core_alpha[j],
                w.j_beta[j] - w.core_beta[j],
                a - w.psi_alpha[j],
                b - w.psi_beta[j],
                w.j_alpha[j] - w.i_alpha[j],
                w.j_beta[j] - w.i_beta[j],
            )
            - 1.5 * w.pairs[j] * w.turning[j]
        )
        w.impulse[j] += span * w.torque[j]
