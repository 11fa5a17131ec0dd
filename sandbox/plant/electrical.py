"""The electrical plant between two events: one explicit step, exact in the applied voltage.

Stationary frame, psi the whole flux linkage, z what currents make of it in the rotor's frame:

    dpsi/dt = u - drop(i),  i = exp(j theta) dH/dz(z, theta) + i_c
    z = exp(-j theta) psi - magnets' flux

A segment is the time between two edges.  Over it u is constant but for edges that act late, so its
volt-seconds and their mean are known exactly; the drop is taken in the middle of the segment, at
the mean flux.  That is a step of second order.  Two terms make it one of third order where inverse
inductances are constant, nearly so elsewhere: the drop on the way to the middle (the flux there is
off by R S/4 e), and the current's curvature, of whose S^2/24 the middle knows nothing.  Here e is
the current's change from start to middle, omega the rotor's speed, G the inverse inductance at the
period's start.  From i = exp(j theta) dH/dz, psi'' = -R i' and z' = exp(-j theta) (psi' - j omega
psi):

    i'' = -R G i' + omega^2 i + 2 j omega i' - G (omega^2 psi + 2 j omega psi')
          + exp(j theta) H'''[z', z']

An edge that acts the share rho of the segment late bends the current there: its change is no line,
but has come about sooner.  With v (x, y) what the edge changes and K = v (x, y) rho (1 - rho)^2
S^2/6 (`early`), the drop has let the flux rise by R G K on average beside what the line's drop has,
by three halves of it in the middle (rho small).

`begin` ends the last segment and gives the current at the edge; `middle` goes on to the segment's
middle; `bend` adds the last term (not of flux maps: their step stays of second order).  What an
effect adds comes between, in a loop of its own (`additions`, `commutation`): what is neutral costs
nothing.
"""

from __future__ import annotations

from model.compiled import inlined, kernel
from model.spline import bending, gradient, hessian, polynomial
from sandbox.plant import ports

THIRD, ROOT_THIRD, HALF_ROOT = 1.0 / 3.0, 0.5773502691896258, 0.8660254037844386


@inlined
def quartic(w, j, d, q):
    """Return i_d, i_q (A) of lane j at fluxes due to currents (Wb), eqs. (id), (iq)."""
    qq, b, c = q * q, w.cubic_q[j], w.quartic_dq[j]
    i_d = d * (w.gamma_d[j] + d * (w.cubic_d[j] + w.quartic_d[j] * d)) + qq * (b + 2.0 * c * d)
    return i_d, q * (w.gamma_q[j] + 2.0 * d * (b + c * d) + w.quartic_q[j] * qq)


@inlined
def facing(w, j, c_0, s_0):
    """Return cos and sin of lane j's rotor angle where the angle handed in has c_0, s_0."""
    x, y = w.off_c[j], w.off_s[j]
    return c_0 * x + s_0 * y, s_0 * x - c_0 * y


@inlined
def seen(w, j, c, s, a, b):
    """Return the flux due to currents (Wb) in the rotor's frame."""
    return c * a + s * b - w.magnet[j] - w.rest_d[j], c * b - s * a - w.rest_q[j]


@inlined
def finished(w, j, span):
    """Return the flux (Wb) at the end of the last segment of length span (s)."""
    return w.psi_alpha[j] + (w.volt_alpha[j] - span * w.fall_alpha[j]), w.psi_beta[j] + (
        w.volt_beta[j] - span * w.fall_beta[j]
    )


@inlined
def terminal(w, j, c, s, i_d, i_q):
    """Return the terminal current (A), stationary frame."""
    return c * i_d - s * i_q + w.core_alpha[j], s * i_d + c * i_q + w.core_beta[j]


@inlined
def take(w, j, i_alpha, i_beta):
    """Write lane j's current at the segment's start and its drop."""
    w.i_alpha[j], w.i_beta[j] = i_alpha, i_beta
    w.drop_alpha[j], w.drop_beta[j] = w.resistance[j] * i_alpha, w.resistance[j] * i_beta


@kernel
def begin(w, flux_map, c_0, s_0, span):
    """End the last segment (span, s) and write current and drop at the next one's start."""
    n = w.psi_alpha.size
    if flux_map is None:
        for j in range(n):
            a, b = finished(w, j, span)
            w.psi_alpha[j], w.psi_beta[j] = a, b
            c, s = facing(w, j, c_0, s_0)
            d, q = seen(w, j, c, s, a, b)
            i_d, i_q = quartic(w, j, d, q)
            i_alpha, i_beta = terminal(w, j, c, s, i_d, i_q)
            take(w, j, i_alpha, i_beta)
    else:
        for j in range(n):
            a, b = finished(w, j, span)
            w.psi_alpha[j], w.psi_beta[j] = a, b
            c, s = facing(w, j, c_0, s_0)
            w.z_d[j], w.z_q[j] = seen(w, j, c, s, a, b)
        mapped(w, flux_map)
        for j in range(n):
            c, s = facing(w, j, c_0, s_0)
            i_alpha, i_beta = terminal(w, j, c, s, w.i_d[j], w.i_q[j])
            take(w, j, i_alpha, i_beta)


@inlined
def early(late, span, inverse):
    """Return what K (s^2, see above) is for a volt of an edge that acts so late (s) in a segment;
    inverse: 1/span."""
    left = 1.0 - late * inverse
    return late * span * left * left * (1.0 / 6.0)


@inlined
def halfway(w, j, span, inverse, u_alpha, u_beta, x, y):
    """Return the mean flux (Wb) over the segment, predicted with the drop at its start; write its
    volt-seconds.

    inverse: 1/span; (u_alpha, u_beta): vector of the legs' levels; (x, y): what of it the edge just
    taken changes.
    """
    v, half = w.link[j], 0.5 * span
    r = min(w.late[j], span)
    m, k = r * (1.0 - 0.5 * inverse * r), v * early(r, span, inverse)
    w.early_alpha[j], w.early_beta[j] = k * x + w.wait_alpha[j], k * y + w.wait_beta[j]
    w.volt_alpha[j], w.volt_beta[j] = (
        v * (span * u_alpha - x * r) - w.lost_alpha[j],
        v * (span * u_beta - y * r) - w.lost_beta[j],
    )
    a = w.psi_alpha[j] + (v * (half * u_alpha - x * m) - w.lose_alpha[j]) - half * w.drop_alpha[j]
    b = w.psi_beta[j] + (v * (half * u_beta - y * m) - w.lose_beta[j]) - half * w.drop_beta[j]
    w.mid_alpha[j], w.mid_beta[j] = a, b
    return a, b


@inlined
def settled(
    i_alpha,
    i_beta,
    e_alpha,
    e_beta,
    mid_alpha,
    mid_beta,
    p_alpha,
    p_beta,
    r,
    decay,
    turned,
    stiff,
    kink,
    core,
):
    """Return the current in a segment's middle, corrected, and its mean drop (V).

    i: current at the flux predicted; e, p: its and the flux' change from start to middle; r: ohm;
    decay: R S/4, with the skin effect's part; turned: rad by which the rotor turns in the segment;
    stiff: inverse inductance, 1/H; kink: 4/S times K of late edges (Wb); core: 1/H, of the
    iron-loss current's kink beside the magnetising current's.
    """
    (stiff_aa, stiff_ab, stiff_bb), (k_alpha, k_beta) = stiff, kink
    x, y = (
        decay * (stiff_aa * e_alpha + stiff_ab * e_beta),
        decay * (stiff_ab * e_alpha + stiff_bb * e_beta),
    )
    z_alpha = decay * ((stiff_aa + core) * k_alpha + stiff_ab * k_beta)
    z_beta = decay * (stiff_ab * k_alpha + (stiff_bb + core) * k_beta)
    k_alpha, k_beta = (
        0.5 * (stiff_aa * z_alpha + stiff_ab * z_beta),
        0.5 * (stiff_ab * z_alpha + stiff_bb * z_beta),
    )
    i_alpha, i_beta = i_alpha - x + 3.0 * k_alpha, i_beta - y + 3.0 * k_beta
    x, y = x * THIRD + k_alpha, y * THIRD + k_beta
    square, across = turned * turned * (1.0 / 24.0), turned * (1.0 / 6.0)
    p, q = across * p_beta - square * mid_alpha, -across * p_alpha - square * mid_beta
    y_alpha, y_beta = stiff_aa * p + stiff_ab * q, stiff_ab * p + stiff_bb * q
    more = 1.0 + square
    f_alpha, f_beta = (
        r * (more * i_alpha - across * e_beta - x + y_alpha),
        r * (more * i_beta + across * e_alpha - y + y_beta),
    )
    return i_alpha, i_beta, f_alpha, f_beta


@inlined
def settle(w, j, i_alpha, i_beta, span, turned):
    """Write lane j's current in the segment's middle and its mean drop; turned: rad by which the
    rotor turns in it."""
    r, k = w.resistance[j], 4.0 / span
    w.j_alpha[j], w.j_beta[j], w.fall_alpha[j], w.fall_beta[j] = settled(
        i_alpha,
        i_beta,
        i_alpha - w.i_alpha[j],
        i_beta - w.i_beta[j],
        w.mid_alpha[j],
        w.mid_beta[j],
        w.mid_alpha[j] - w.psi_alpha[j],
        w.mid_beta[j] - w.psi_beta[j],
        r,
        0.25 * span * (r + w.skin_r[j]),
        turned,
        (w.stiff_aa[j], w.stiff_ab[j], w.stiff_bb[j]),
        (k * w.early_alpha[j], k * w.early_beta[j]),
        w.core_stiff[j],
    )


@kernel
def middle(w, flux_map, c_0, s_0, span, turned, u_alpha, u_beta, x, y):
    """Write volt-seconds, mean flux, and the current and drop at it, of a segment of length span
    (s)."""
    n, inverse = w.psi_alpha.size, 1.0 / span
    if flux_map is None:
        for j in range(n):
            a, b = halfway(w, j, span, inverse, u_alpha, u_beta, x, y)
            c, s = facing(w, j, c_0, s_0)
            d, q = seen(w, j, c, s, a, b)
            i_d, i_q = quartic(w, j, d, q)
            i_alpha, i_beta = terminal(w, j, c, s, i_d, i_q)
            settle(w, j, i_alpha, i_beta, span, turned)
    else:
        for j in range(n):
            a, b = halfway(w, j, span, inverse, u_alpha, u_beta, x, y)
            c, s = facing(w, j, c_0, s_0)
            w.z_d[j], w.z_q[j] = seen(w, j, c, s, a, b)
        mapped(w, flux_map)
        for j in range(n):
            c, s = facing(w, j, c_0, s_0)
            i_alpha, i_beta = terminal(w, j, c, s, w.i_d[j], w.i_q[j])
            settle(w, j, i_alpha, i_beta, span, turned)


@inlined
def curved(w, j, c, s, d, q, mid_alpha, mid_beta, p_alpha, p_beta, turned):
    """Return what the quartic's curvature adds to a segment's mean drop (V): H'''/24 of its
    straight line's square.

    d, q: flux due to currents in the middle; mid: all of it, stationary frame; p: its change from
    the start.
    """
    p_alpha, p_beta = 2.0 * p_alpha + turned * mid_beta, 2.0 * p_beta - turned * mid_alpha
    x, y = c * p_alpha + s * p_beta, c * p_beta - s * p_alpha
    ddd, ddq = 2.0 * w.cubic_d[j] + 6.0 * w.quartic_d[j] * d, 4.0 * w.quartic_dq[j] * q
    dqq, qqq = 2.0 * w.cubic_q[j] + 4.0 * w.quartic_dq[j] * d, 6.0 * w.quartic_q[j] * q
    xx, xy, yy = x * x, 2.0 * x * y, y * y
    r = w.resistance[j] * (1.0 / 24.0)
    i_d, i_q = r * (ddd * xx + ddq * xy + dqq * yy), r * (ddq * xx + dqq * xy + qqq * yy)
    return c * i_d - s * i_q, s * i_d + c * i_q


@kernel
def bend(w, c_0, s_0, turned):
    """Add to the mean drop what curvature makes of it."""
    for j in range(w.psi_alpha.size):
        a, b = w.mid_alpha[j], w.mid_beta[j]
        c, s = facing(w, j, c_0, s_0)
        d, q = seen(w, j, c, s, a, b)
        x, y = curved(w, j, c, s, d, q, a, b, a - w.psi_alpha[j], b - w.psi_beta[j], turned)
        w.fall_alpha[j], w.fall_beta[j] = w.fall_alpha[j] + x, w.fall_beta[j] + y


@kernel
def plain_step(w, here, there, span, turned, long, pulled, u_alpha, u_beta, x, y):
    """Take a whole segment of a plant that nothing is added to, up to the next edge: `middle`, then
    `begin`, in one.

    here, there: cos and sin of the angle handed in, in the middle and at the end; long, pulled:
    whether curvature, and torque, count.
    """
    half, inverse = 0.5 * span, 1.0 / span
    for j in range(w.psi_alpha.size):
        v, late, res, psi_alpha, psi_beta = (
            w.link[j],
            min(w.late[j], span),
            w.resistance[j],
            w.psi_alpha[j],
            w.psi_beta[j],
        )
        m, o_alpha, o_beta = late * (1.0 - 0.5 * inverse * late), w.i_alpha[j], w.i_beta[j]
        left = 1.0 - late * inverse
        k = (2.0 / 3.0) * v * late * left * left  # 4/S K, see `early`
        p_alpha, p_beta = (
            v * (half * u_alpha - x * m) - half * res * o_alpha,
            v * (half * u_beta - y * m) - half * res * o_beta,
        )
        a, b = psi_alpha + p_alpha, psi_beta + p_beta
        c, s = facing(w, j, here[0], here[1])
        d, q = c * a + s * b - w.magnet[j], c * b - s * a
        i_d, i_q = quartic(w, j, d, q)
        i_alpha, i_beta = c * i_d - s * i_q, s * i_d + c * i_q
        e_alpha, e_beta = i_alpha - o_alpha, i_beta - o_beta
        i_alpha, i_beta, f_alpha, f_beta = settled(
            i_alpha,
            i_beta,
            e_alpha,
            e_beta,
            a,
            b,
            p_alpha,
            p_beta,
            res,
            0.25 * span * res,
            turned,
            (w.stiff_aa[j], w.stiff_ab[j], w.stiff_bb[j]),
            (k * x, k * y),
            0.0,
        )
        if long:
            g_alpha, g_beta = curved(w, j, c, s, d, q, a, b, p_alpha, p_beta, turned)
            f_alpha, f_beta = f_alpha + g_alpha, f_beta + g_beta
        if pulled:
            g_alpha, g_beta = (
                THIRD * span * (f_alpha - res * o_alpha),
                THIRD * span * (f_beta - res * o_beta),
            )  # see `additions.air_gap`
            w.impulse[j] += span * pull(
                w.pairs[j],
                a - g_alpha,
                b - g_beta,
                i_alpha,
                i_beta,
                p_alpha - g_alpha,
                p_beta - g_beta,
                i_alpha - o_alpha,
                i_beta - o_beta,
            )
        psi_alpha += v * (span * u_alpha - x * late) - span * f_alpha
        psi_beta += v * (span * u_beta - y * late) - span * f_beta
        w.psi_alpha[j], w.psi_beta[j] = psi_alpha, psi_beta
        c, s = facing(w, j, there[0], there[1])
        i_d, i_q = quartic(
            w, j, c * psi_alpha + s * psi_beta - w.magnet[j], c * psi_beta - s * psi_alpha
        )
        i_alpha, i_beta = c * i_d - s * i_q, s * i_d + c * i_q
        w.i_alpha[j], w.i_beta[j] = i_alpha, i_beta


@inlined
def pull(pairs, mid_alpha, mid_beta, m_alpha, m_beta, p_alpha, p_beta, e_alpha, e_beta):
    """Return the mean torque of a segment (N m) less what turns with the angle: flux and
    magnetising current go straight through (mid, m), having changed by (p, e) since the start."""
    return (
        1.5
        * pairs
        * (mid_alpha * m_beta - mid_beta * m_alpha + THIRD * (p_alpha * e_beta - p_beta * e_alpha))
    )


@kernel
def dropped(w):
    """Write the drop at a segment's start, which plain steps leave out."""
    for j in range(w.psi_alpha.size):
        w.drop_alpha[j], w.drop_beta[j] = (
            w.resistance[j] * w.i_alpha[j],
            w.resistance[j] * w.i_beta[j],
        )


@inlined
def shared_cell(w, m):
    """Return the map's cell (i, k) at the fluxes z_d, z_q, and whether all lanes are in it.

    Lanes are nearly alike, so they mostly are: the cell's polynomial is then a vector loop.
    """
    x_0, y_0 = (w.z_d[0] - m.low_d) * m.per_d, (w.z_q[0] - m.low_q) * m.per_q
    inside = 0.0 <= x_0 < m.cells.shape[0] and 0.0 <= y_0 < m.cells.shape[1]
    i, k = (int(x_0), int(y_0)) if inside else (0, 0)
    off = 0.0
    for j in range(w.psi_alpha.size):
        x, y = place(w, j, m, i, k)
        off = max(off, max(abs(x - 0.5), abs(y - 0.5)))
    return i, k, inside and off <= 0.5


@inlined
def place(w, j, m, i, k):
    """Return how far, in cells, lane j's flux z_d, z_q lies from the corner of cell (i, k) of the
    map."""
    return (w.z_d[j] - m.low_d) * m.per_d - i, (w.z_q[j] - m.low_q) * m.per_q - k


@kernel
def mapped(w, m):
    """Write i_d, i_q (A) at the fluxes z_d, z_q: those of the map and each lane's own addition to
    it."""
    n = w.psi_alpha.size
    i, k, alike = shared_cell(w, m)
    if alike:
        p = polynomial(m.cells[i, k])
        for j in range(n):
            x, y = place(w, j, m, i, k)
            w.i_d[j], w.i_q[j] = gradient(m, p, x, y)
    else:
        for j in range(n):
            w.i_d[j], w.i_q[j] = ports.map_currents(m, w.z_d[j], w.z_q[j])
    for j in range(n):
        i_d, i_q = quartic(w, j, w.z_d[j], w.z_q[j])
        w.i_d[j], w.i_q[j] = w.i_d[j] + i_d, w.i_q[j] + i_q


@kernel
def stiffen(w, flux_map, c_0, s_0):
    """Write the inverse incremental inductance (1/H), stationary frame, at the flux of a period's
    start.

    On a flux map z_d, z_q are overwritten by that flux.
    """
    n = w.psi_alpha.size
    if flux_map is None:
        for j in range(n):
            c, s = facing(w, j, c_0, s_0)
            d, q = seen(w, j, c, s, w.psi_alpha[j], w.psi_beta[j])
            stiff(w, j, c, s, d, q, (0.0, 0.0, 0.0))
    else:
        for j in range(n):
            c, s = facing(w, j, c_0, s_0)
            w.z_d[j], w.z_q[j] = seen(w, j, c, s, w.psi_alpha[j], w.psi_beta[j])
        i, k, alike = shared_cell(w, flux_map)
        if alike:
            p = polynomial(flux_map.cells[i, k])
            for j in range(n):
                x, y = place(w, j, flux_map, i, k)
                c, s = facing(w, j, c_0, s_0)
                stiff(w, j, c, s, w.z_d[j], w.z_q[j], bending(flux_map, p, x, y))
        else:
            for j in range(n):
                c, s = facing(w, j, c_0, s_0)
                stiff(w, j, c, s, w.z_d[j], w.z_q[j], hessian(flux_map, w.z_d[j], w.z_q[j]))


@inlined
def stiff(w, j, c, s, d, q, more):
    """Write lane j's inverse incremental inductance (1/H) at a flux due to currents (Wb); more: dd,
    dq, qq of the map beside those of the quartic, 1/H."""
    dd = (
        w.gamma_d[j]
        + d * (2.0 * w.cubic_d[j] + 3.0 * w.quartic_d[j] * d)
        + 2.0 * w.quartic_dq[j] * q * q
    )
    qq = (
        w.gamma_q[j] + 2.0 * d * (w.cubic_q[j] + w.quartic_dq[j] * d) + 3.0 * w.quartic_q[j] * q * q
    )
    dq = 2.0 * q * (w.cubic_q[j] + 2.0 * w.quartic_dq[j] * d)
    dd, dq, qq = dd + more[0], dq + more[1], qq + more[2]
    mean, half = 0.5 * (dd + qq), 0.5 * (dd - qq)
    c_2, s_2 = c * c - s * s, 2.0 * c * s
    across = half * c_2 - dq * s_2
    w.stiff_aa[j], w.stiff_bb[j], w.stiff_ab[j] = (
        mean + across,
        mean - across,
        half * s_2 + dq * c_2,
    )


@kernel
def lose(w, acts, t, span, x, y):
    """Add what an earlier edge of leg vector (x, y), acting at acts (lanes,) s, takes from a
    segment begun at t (s)."""
    inverse = 1.0 / span
    for j in range(w.psi_alpha.size):
        r = min(max(acts[j] - t, 0.0), span)
        m, v = r * (1.0 - 0.5 * inverse * r), w.link[j]
        k = v * early(r, span, inverse)
        w.wait_alpha[j], w.wait_beta[j] = w.wait_alpha[j] + k * x, w.wait_beta[j] + k * y
        w.lost_alpha[j], w.lost_beta[j] = w.lost_alpha[j] + v * x * r, w.lost_beta[j] + v * y * r
        w.lose_alpha[j], w.lose_beta[j] = w.lose_alpha[j] + v * x * m, w.lose_beta[j] + v * y * m


@kernel
def nothing_lost(w):
    """Clear what earlier edges took."""
    for j in range(w.psi_alpha.size):
        w.lost_alpha[j] = w.lost_beta[j] = w.lose_alpha[j] = w.lose_beta[j] = w.wait_alpha[
            j
        ] = w.wait_beta[j] = 0.0
