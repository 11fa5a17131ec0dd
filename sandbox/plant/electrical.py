"""The electrical plant between two events: one explicit step of second order, exact in the applied voltage.

Stationary frame, psi the whole flux linkage, z what currents make of it in the rotor's frame:

    dpsi/dt = u - drop(i),  i = exp(j theta) dH/dz(z, theta) + i_c,  z = exp(-j theta) psi - magnets' flux

A segment is the time between two edges.  Over it u is constant but for edges that act late, so its volt-seconds and
their mean are known exactly; the drop is taken in the middle of the segment, at the mean flux.  Two terms make the
step one of third order or nearly so, e the current's change from start to middle, omega the rotor's speed, G the
inverse inductance at the period's start: the drop on the way to the middle (the flux there is off by R S/4 e), and the
current's curvature, of whose S^2/24 the middle knows nothing.  From i = exp(j theta) dH/dz, psi'' = -R i' and
z' = exp(-j theta) (psi' - j omega psi):

    i'' = -R G i' + omega^2 i + 2 j omega i' - G (omega^2 psi + 2 j omega psi') + exp(j theta) H'''[z', z']

An edge that acts the share rho of the segment late bends the current there: its change is no line, but has come about
sooner.  With v (x, y) what the edge changes and K = v (x, y) rho (1 - rho)^2 S^2/6 (`early`), the drop has let the flux
rise by R G K on average beside what the line's drop has, by three halves of it in the middle (rho small).

`begin` ends the last segment and gives the current at the edge; `middle` goes on to the segment's middle; `bend` adds
the last term (not of flux maps: their step stays of second order).  What an effect adds comes between, in a loop of its
own (`additions`, `commutation`): what is neutral costs nothing.
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
    return w.psi_a[j] + (w.volt_a[j] - span * w.fall_a[j]), w.psi_b[j] + (w.volt_b[j] - span * w.fall_b[j])


@inlined
def terminal(w, j, c, s, i_d, i_q):
    """Return the terminal current (A), stationary frame."""
    return c * i_d - s * i_q + w.core_a[j], s * i_d + c * i_q + w.core_b[j]


@inlined
def take(w, j, i_a, i_b):
    """Write lane j's current at the segment's start and its drop."""
    w.i_a[j], w.i_b[j] = i_a, i_b
    w.drop_a[j], w.drop_b[j] = w.resistance[j] * i_a, w.resistance[j] * i_b


@kernel
def begin(w, flux_map, c_0, s_0, span):
    """End the last segment (span, s) and write current and drop at the next one's start."""
    n = w.psi_a.size
    if flux_map is None:
        for j in range(n):
            a, b = finished(w, j, span)
            w.psi_a[j], w.psi_b[j] = a, b
            c, s = facing(w, j, c_0, s_0)
            d, q = seen(w, j, c, s, a, b)
            i_d, i_q = quartic(w, j, d, q)
            i_a, i_b = terminal(w, j, c, s, i_d, i_q)
            take(w, j, i_a, i_b)
    else:
        for j in range(n):
            a, b = finished(w, j, span)
            w.psi_a[j], w.psi_b[j] = a, b
            c, s = facing(w, j, c_0, s_0)
            w.z_d[j], w.z_q[j] = seen(w, j, c, s, a, b)
        mapped(w, flux_map)
        for j in range(n):
            c, s = facing(w, j, c_0, s_0)
            i_a, i_b = terminal(w, j, c, s, w.i_d[j], w.i_q[j])
            take(w, j, i_a, i_b)


@inlined
def early(late, span, inverse):
    """Return what K (s^2, see above) is for a volt of an edge that acts so late (s) in a segment; inverse: 1/span."""
    left = 1.0 - late * inverse
    return late * span * left * left * (1.0 / 6.0)


@inlined
def halfway(w, j, span, inverse, u_a, u_b, x, y):
    """Return the mean flux (Wb) over the segment, predicted with the drop at its start; write its volt-seconds.

    inverse: 1/span; (u_a, u_b): vector of the legs' levels; (x, y): what of it the edge just taken changes.
    """
    v, half = w.link[j], 0.5 * span
    r = min(w.late[j], span)
    m, k = r * (1.0 - 0.5 * inverse * r), v * early(r, span, inverse)
    w.early_a[j], w.early_b[j] = k * x + w.wait_a[j], k * y + w.wait_b[j]
    w.volt_a[j], w.volt_b[j] = v * (span * u_a - x * r) - w.lost_a[j], v * (span * u_b - y * r) - w.lost_b[j]
    a = w.psi_a[j] + (v * (half * u_a - x * m) - w.lose_a[j]) - half * w.drop_a[j]
    b = w.psi_b[j] + (v * (half * u_b - y * m) - w.lose_b[j]) - half * w.drop_b[j]
    w.mid_a[j], w.mid_b[j] = a, b
    return a, b


@inlined
def settled(i_a, i_b, e_a, e_b, mid_a, mid_b, p_a, p_b, r, decay, turned, stiff, kink, core):
    """Return the current in a segment's middle, corrected, and its mean drop (V).

    i: current at the flux predicted; e, p: its and the flux' change from start to middle; r: ohm; decay: R S/4, with
    the skin effect's part; turned: rad by which the rotor turns in the segment; stiff: inverse inductance, 1/H; kink:
    4/S times K of late edges (Wb); core: 1/H, of the iron-loss current's kink beside the magnetising current's.
    """
    (stiff_aa, stiff_ab, stiff_bb), (k_a, k_b) = stiff, kink
    x, y = decay * (stiff_aa * e_a + stiff_ab * e_b), decay * (stiff_ab * e_a + stiff_bb * e_b)
    z_a = decay * ((stiff_aa + core) * k_a + stiff_ab * k_b)
    z_b = decay * (stiff_ab * k_a + (stiff_bb + core) * k_b)
    k_a, k_b = 0.5 * (stiff_aa * z_a + stiff_ab * z_b), 0.5 * (stiff_ab * z_a + stiff_bb * z_b)
    i_a, i_b = i_a - x + 3.0 * k_a, i_b - y + 3.0 * k_b
    x, y = x * THIRD + k_a, y * THIRD + k_b
    square, across = turned * turned * (1.0 / 24.0), turned * (1.0 / 6.0)
    p, q = across * p_b - square * mid_a, -across * p_a - square * mid_b
    y_a, y_b = stiff_aa * p + stiff_ab * q, stiff_ab * p + stiff_bb * q
    more = 1.0 + square
    f_a, f_b = r * (more * i_a - across * e_b - x + y_a), r * (more * i_b + across * e_a - y + y_b)
    return i_a, i_b, f_a, f_b


@inlined
def settle(w, j, i_a, i_b, span, turned):
    """Write lane j's current in the segment's middle and its mean drop; turned: rad by which the rotor turns in it."""
    r, k = w.resistance[j], 4.0 / span
    w.j_a[j], w.j_b[j], w.fall_a[j], w.fall_b[j] = settled(
        i_a, i_b, i_a - w.i_a[j], i_b - w.i_b[j], w.mid_a[j], w.mid_b[j], w.mid_a[j] - w.psi_a[j],
        w.mid_b[j] - w.psi_b[j], r, 0.25 * span * (r + w.skin_r[j]), turned,
        (w.stiff_aa[j], w.stiff_ab[j], w.stiff_bb[j]), (k * w.early_a[j], k * w.early_b[j]),
        w.core_g[j] * w.core_rate[j],
    )  # fmt: skip


@kernel
def middle(w, flux_map, c_0, s_0, span, turned, u_a, u_b, x, y):
    """Write volt-seconds, mean flux, and the current and drop at it, of a segment of length span (s)."""
    n, inverse = w.psi_a.size, 1.0 / span
    if flux_map is None:
        for j in range(n):
            a, b = halfway(w, j, span, inverse, u_a, u_b, x, y)
            c, s = facing(w, j, c_0, s_0)
            d, q = seen(w, j, c, s, a, b)
            i_d, i_q = quartic(w, j, d, q)
            i_a, i_b = terminal(w, j, c, s, i_d, i_q)
            settle(w, j, i_a, i_b, span, turned)
    else:
        for j in range(n):
            a, b = halfway(w, j, span, inverse, u_a, u_b, x, y)
            c, s = facing(w, j, c_0, s_0)
            w.z_d[j], w.z_q[j] = seen(w, j, c, s, a, b)
        mapped(w, flux_map)
        for j in range(n):
            c, s = facing(w, j, c_0, s_0)
            i_a, i_b = terminal(w, j, c, s, w.i_d[j], w.i_q[j])
            settle(w, j, i_a, i_b, span, turned)


@inlined
def curved(w, j, c, s, d, q, mid_a, mid_b, p_a, p_b, turned):
    """Return what the quartic's curvature adds to a segment's mean drop (V): H'''/24 of its straight line's square.

    d, q: flux due to currents in the middle; mid: all of it, stationary frame; p: its change from the start.
    """
    p_a, p_b = 2.0 * p_a + turned * mid_b, 2.0 * p_b - turned * mid_a
    x, y = c * p_a + s * p_b, c * p_b - s * p_a
    ddd, ddq = 2.0 * w.cubic_d[j] + 6.0 * w.quartic_d[j] * d, 4.0 * w.quartic_dq[j] * q
    dqq, qqq = 2.0 * w.cubic_q[j] + 4.0 * w.quartic_dq[j] * d, 6.0 * w.quartic_q[j] * q
    xx, xy, yy = x * x, 2.0 * x * y, y * y
    r = w.resistance[j] * (1.0 / 24.0)
    i_d, i_q = r * (ddd * xx + ddq * xy + dqq * yy), r * (ddq * xx + dqq * xy + qqq * yy)
    return c * i_d - s * i_q, s * i_d + c * i_q


@kernel
def bend(w, c_0, s_0, turned):
    """Add to the mean drop what curvature makes of it."""
    for j in range(w.psi_a.size):
        a, b = w.mid_a[j], w.mid_b[j]
        c, s = facing(w, j, c_0, s_0)
        d, q = seen(w, j, c, s, a, b)
        x, y = curved(w, j, c, s, d, q, a, b, a - w.psi_a[j], b - w.psi_b[j], turned)
        w.fall_a[j], w.fall_b[j] = w.fall_a[j] + x, w.fall_b[j] + y


@kernel
def plain_step(w, here, there, span, turned, long, pulled, u_a, u_b, x, y):
    """Take a whole segment of a plant that nothing is added to, up to the next edge: `middle`, then `begin`, in one.

    here, there: cos and sin of the angle handed in, in the middle and at the end; long, pulled: whether curvature, and
    torque, count.
    """
    half, inverse = 0.5 * span, 1.0 / span
    for j in range(w.psi_a.size):
        v, late, res, psi_a, psi_b = w.link[j], min(w.late[j], span), w.resistance[j], w.psi_a[j], w.psi_b[j]
        m, o_a, o_b = late * (1.0 - 0.5 * inverse * late), w.i_a[j], w.i_b[j]
        left = 1.0 - late * inverse
        k = (2.0 / 3.0) * v * late * left * left  # 4/S K, see `early`
        p_a, p_b = v * (half * u_a - x * m) - half * res * o_a, v * (half * u_b - y * m) - half * res * o_b
        a, b = psi_a + p_a, psi_b + p_b
        c, s = facing(w, j, here[0], here[1])
        d, q = c * a + s * b - w.magnet[j], c * b - s * a
        i_d, i_q = quartic(w, j, d, q)
        i_a, i_b = c * i_d - s * i_q, s * i_d + c * i_q
        e_a, e_b = i_a - o_a, i_b - o_b
        i_a, i_b, f_a, f_b = settled(
            i_a, i_b, e_a, e_b, a, b, p_a, p_b, res, 0.25 * span * res, turned,
            (w.stiff_aa[j], w.stiff_ab[j], w.stiff_bb[j]), (k * x, k * y), 0.0,
        )  # fmt: skip
        if long:
            g_a, g_b = curved(w, j, c, s, d, q, a, b, p_a, p_b, turned)
            f_a, f_b = f_a + g_a, f_b + g_b
        if pulled:
            g_a, g_b = THIRD * span * (f_a - res * o_a), THIRD * span * (f_b - res * o_b)  # see `additions.air_gap`
            w.impulse[j] += span * pull(
                w.pairs[j], a - g_a, b - g_b, i_a, i_b, p_a - g_a, p_b - g_b, i_a - o_a, i_b - o_b
            )
        psi_a += v * (span * u_a - x * late) - span * f_a
        psi_b += v * (span * u_b - y * late) - span * f_b
        w.psi_a[j], w.psi_b[j] = psi_a, psi_b
        c, s = facing(w, j, there[0], there[1])
        i_d, i_q = quartic(w, j, c * psi_a + s * psi_b - w.magnet[j], c * psi_b - s * psi_a)
        i_a, i_b = c * i_d - s * i_q, s * i_d + c * i_q
        w.i_a[j], w.i_b[j] = i_a, i_b


@inlined
def pull(pairs, mid_a, mid_b, m_a, m_b, p_a, p_b, e_a, e_b):
    """Return the mean torque of a segment (N m) less what turns with the angle: flux and magnetising current go
    straight through (mid, m), having changed by (p, e) since the start."""
    return 1.5 * pairs * (mid_a * m_b - mid_b * m_a + THIRD * (p_a * e_b - p_b * e_a))


@kernel
def dropped(w):
    """Write the drop at a segment's start, which plain steps leave out."""
    for j in range(w.psi_a.size):
        w.drop_a[j], w.drop_b[j] = w.resistance[j] * w.i_a[j], w.resistance[j] * w.i_b[j]


@inlined
def shared_cell(w, m):
    """Return the map's cell (i, k) at the fluxes z_d, z_q, and whether all lanes are in it.

    Lanes are nearly alike, so they mostly are: the cell's polynomial is then a vector loop.
    """
    x_0, y_0 = (w.z_d[0] - m.low_d) * m.per_d, (w.z_q[0] - m.low_q) * m.per_q
    inside = 0.0 <= x_0 < m.cells.shape[0] and 0.0 <= y_0 < m.cells.shape[1]
    i, k = (int(x_0), int(y_0)) if inside else (0, 0)
    off = 0.0
    for j in range(w.psi_a.size):
        x, y = place(w, j, m, i, k)
        off = max(off, max(abs(x - 0.5), abs(y - 0.5)))
    return i, k, inside and off <= 0.5


@inlined
def place(w, j, m, i, k):
    """Return how far, in cells, lane j's flux z_d, z_q lies from the corner of cell (i, k) of the map."""
    return (w.z_d[j] - m.low_d) * m.per_d - i, (w.z_q[j] - m.low_q) * m.per_q - k


@kernel
def mapped(w, m):
    """Write i_d, i_q (A) at the fluxes z_d, z_q: those of the map and each lane's own addition to it."""
    n = w.psi_a.size
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
    """Write the inverse incremental inductance (1/H), stationary frame, at the flux of a period's start.

    On a flux map z_d, z_q are overwritten by that flux.
    """
    n = w.psi_a.size
    if flux_map is None:
        for j in range(n):
            c, s = facing(w, j, c_0, s_0)
            d, q = seen(w, j, c, s, w.psi_a[j], w.psi_b[j])
            stiff(w, j, c, s, d, q, (0.0, 0.0, 0.0))
    else:
        for j in range(n):
            c, s = facing(w, j, c_0, s_0)
            w.z_d[j], w.z_q[j] = seen(w, j, c, s, w.psi_a[j], w.psi_b[j])
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
    """Write lane j's inverse incremental inductance (1/H) at a flux due to currents (Wb); more: dd, dq, qq of the map
    beside those of the quartic, 1/H."""
    dd = w.gamma_d[j] + d * (2.0 * w.cubic_d[j] + 3.0 * w.quartic_d[j] * d) + 2.0 * w.quartic_dq[j] * q * q
    qq = w.gamma_q[j] + 2.0 * d * (w.cubic_q[j] + w.quartic_dq[j] * d) + 3.0 * w.quartic_q[j] * q * q
    dq = 2.0 * q * (w.cubic_q[j] + 2.0 * w.quartic_dq[j] * d)
    dd, dq, qq = dd + more[0], dq + more[1], qq + more[2]
    mean, half = 0.5 * (dd + qq), 0.5 * (dd - qq)
    c_2, s_2 = c * c - s * s, 2.0 * c * s
    across = half * c_2 - dq * s_2
    w.stiff_aa[j], w.stiff_bb[j], w.stiff_ab[j] = mean + across, mean - across, half * s_2 + dq * c_2


@kernel
def lose(w, acts, t, span, x, y):
    """Add what an earlier edge of leg vector (x, y), acting at acts (lanes,) s, takes from a segment begun at t (s)."""
    inverse = 1.0 / span
    for j in range(w.psi_a.size):
        r = min(max(acts[j] - t, 0.0), span)
        m, v = r * (1.0 - 0.5 * inverse * r), w.link[j]
        k = v * early(r, span, inverse)
        w.wait_a[j], w.wait_b[j] = w.wait_a[j] + k * x, w.wait_b[j] + k * y
        w.lost_a[j], w.lost_b[j] = w.lost_a[j] + v * x * r, w.lost_b[j] + v * y * r
        w.lose_a[j], w.lose_b[j] = w.lose_a[j] + v * x * m, w.lose_b[j] + v * y * m


@kernel
def nothing_lost(w):
    """Clear what earlier edges took."""
    for j in range(w.psi_a.size):
        w.lost_a[j] = w.lost_b[j] = w.lose_a[j] = w.lose_b[j] = w.wait_a[j] = w.wait_b[j] = 0.0
