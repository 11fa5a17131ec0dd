"""What windings and the inverter's legs lose beside the resistance: at a segment's start, and on
average over it.

Around zero current a leg is a steep resistance, so its mean over a segment S hangs on the current's
course.  Without late edges that is a parabola (`leg_in_middle`).  An edge late by rho S puts a
corner into it: beside the straight line between its ends the flux then goes along a triangle, whose
peak is twice its mean, 4 `lags.bend`, wherever the corner is.  And where it is, 1 - rho, follows
from `electrical.early` (K): K = -(1 - rho) S/6 times the peak.  Of several late edges the corner is
one with their mean bend, at the place that their K say; they act within so short a time of each
other that no more shows.  Behind the corner the course is a parabola again (`leg_around_corner`).
"""

from __future__ import annotations

from model.compiled import inlined, kernel
from sandbox.plant import ports
from sandbox.plant.electrical import HALF_ROOT, ROOT_THIRD, THIRD
from sandbox.plant.lags import bend

# Of link voltage times segment: a smaller bend counts as none.  Rounding of the fluxes (1e-16 of
# some 0.1 Wb) would place its corner, here still to 1e-4; an edge late by so small a share moves
# the corner, and the drop, by as little.
SLIGHT = 1e-9


@kernel
def winding_at_start(w):
    """Add to the drop at the segment's start what windings lose beside their resistance."""
    for j in range(w.psi_alpha.size):
        v_alpha, v_beta = ports.winding(w, j, w.i_alpha[j], w.i_beta[j])
        w.drop_alpha[j], w.drop_beta[j] = w.drop_alpha[j] + v_alpha, w.drop_beta[j] + v_beta


@kernel
def winding_in_middle(w):
    """Add the same in its middle."""
    for j in range(w.psi_alpha.size):
        v_alpha, v_beta = ports.winding(w, j, w.j_alpha[j], w.j_beta[j])
        w.fall_alpha[j], w.fall_beta[j] = w.fall_alpha[j] + v_alpha, w.fall_beta[j] + v_beta


@inlined
def legs_lose(w, j, shape, x, y, p, q):
    """Return what legs lose on average (V, stationary frame) while the current (A) goes straight
    from x, y to p, q.

    shape: of the soft sign, from 0 (linear) to 1 (tanh).
    """
    k = w.soft[j]
    half, side, ahead, across = -0.5 * x, HALF_ROOT * y, -0.5 * p, HALF_ROOT * q
    v_a = ports.leg(w, j, k * x, k * p, shape)
    v_b = ports.leg(w, j, k * (half + side), k * (ahead + across), shape)
    v_c = ports.leg(w, j, k * (half - side), k * (ahead - across), shape)
    return (2.0 * v_a - v_b - v_c) * THIRD, (v_b - v_c) * ROOT_THIRD


@inlined
def leg_at_start(w, j, shape):
    """Add to lane j's drop what the legs lose for their currents at the segment's start."""
    v_alpha, v_beta = legs_lose(w, j, shape, w.i_alpha[j], w.i_beta[j], w.i_alpha[j], w.i_beta[j])
    w.leg_alpha[j], w.leg_beta[j] = v_alpha, v_beta
    w.drop_alpha[j], w.drop_beta[j] = w.drop_alpha[j] + v_alpha, w.drop_beta[j] + v_beta


@kernel
def legs_at_start(w, rounded):
    """Do so for all lanes; rounded: some lane's soft sign (a loop of its own: a straight sign is
    many times faster)."""
    if rounded:
        for j in range(w.psi_alpha.size):
            leg_at_start(w, j, w.shape[j])
    else:
        for j in range(w.psi_alpha.size):
            leg_at_start(w, j, 0.0)


@inlined
def leg_in_middle(w, j, span, shape):
    """Add their mean over the segment, the current's parabola as two straight pieces.

    Around zero a leg is a resistance of threshold over half-width, many times the winding's: what
    it loses more on the way to the middle takes as much from the flux there, and from the current
    (e); at the end it is four times as much.
    """
    x, y, r, half = w.i_alpha[j], w.i_beta[j], w.resistance[j], 0.5 * span
    v_alpha, v_beta = legs_lose(w, j, shape, x, y, w.j_alpha[j], w.j_beta[j])
    d_alpha, d_beta = half * (w.leg_alpha[j] - v_alpha), half * (w.leg_beta[j] - v_beta)
    e_alpha = w.stiff_aa[j] * d_alpha + w.stiff_ab[j] * d_beta
    e_beta = w.stiff_ab[j] * d_alpha + w.stiff_bb[j] * d_beta
    m_alpha, m_beta = w.j_alpha[j] + e_alpha, w.j_beta[j] + e_beta
    w.j_alpha[j], w.j_beta[j] = m_alpha, m_beta
    p, q = (
        2.0 * (m_alpha + e_alpha) - x + 6.0 * w.swell_alpha[j],
        2.0 * (m_beta + e_beta) - y + 6.0 * w.swell_beta[j],
    )
    z_alpha, z_beta = legs_lose(w, j, shape, m_alpha, m_beta, p, q)
    w.fall_alpha[j] += 0.5 * (v_alpha + z_alpha) + r * (4.0 / 3.0) * e_alpha
    w.fall_beta[j] += 0.5 * (v_beta + z_beta) + r * (4.0 / 3.0) * e_beta


@inlined
def follows(w, j, a, b):
    """Return the current (A) that follows a flux (Wb) at once."""
    return w.stiff_aa[j] * a + w.stiff_ab[j] * b, w.stiff_ab[j] * a + w.stiff_bb[j] * b


@inlined
def corner(w, j, span):
    """Return the share of the segment behind the corner that late edges make, and half of its peak
    (A)."""
    p, q = bend(w, j, 0.5 * span)
    along = w.early_alpha[j] * p + w.early_beta[j] * q
    least = SLIGHT * span * w.link[j]
    bent = along < 0.0 and p * p + q * q > least * least
    left = -1.5 * along / ((p * p + q * q) * span if bent else 1.0)
    p, q = follows(w, j, 2.0 * p, 2.0 * q)
    return min(left, 1.0) if bent else 1.0, p if bent else 0.0, q if bent else 0.0


@inlined
def leg_around_corner(w, j, span, shape):
    """Do so where edges may be late: start to corner, then two pieces; of a lane without late edges
    the same bits.

    d: flux that the drop's change lets through up to the corner (Wb); h: the same, had it stayed as
    it is there, from there to the middle of the rest; e: the current of both in that middle.
    """
    r, x, y, s_alpha, s_beta = (
        w.resistance[j],
        w.i_alpha[j],
        w.i_beta[j],
        w.swell_alpha[j],
        w.swell_beta[j],
    )
    left, b_alpha, b_beta = corner(w, j, span)
    late, half = 1.0 - left, 0.5 * span * left
    on_alpha = late * (2.0 * (w.j_alpha[j] - b_alpha - x) + 6.0 * s_alpha)
    on_beta = late * (2.0 * (w.j_beta[j] - b_beta - y) + 6.0 * s_beta)
    c_alpha, c_beta = x + (on_alpha + 2.0 * b_alpha), y + (on_beta + 2.0 * b_beta)
    v_alpha, v_beta = legs_lose(w, j, shape, x, y, c_alpha, c_beta)
    d_alpha, d_beta = (
        late * span * (w.leg_alpha[j] - v_alpha),
        late * span * (w.leg_beta[j] - v_beta),
    )
    p, q = follows(w, j, d_alpha, d_beta)
    c_alpha, c_beta = c_alpha + p, c_beta + q
    z_alpha, z_beta = legs_lose(w, j, shape, c_alpha, c_beta, c_alpha, c_beta)
    h_alpha, h_beta = half * (w.leg_alpha[j] - z_alpha), half * (w.leg_beta[j] - z_beta)
    s = 3.0 * (1.0 - left * left)
    on_alpha, on_beta = 0.5 * on_alpha + s * s_alpha, 0.5 * on_beta + s * s_beta
    p, q = follows(w, j, d_alpha + h_alpha, d_beta + h_beta)
    f_alpha, f_beta = legs_lose(
        w, j, shape, c_alpha, c_beta, w.j_alpha[j] + (on_alpha + p), w.j_beta[j] + (on_beta + q)
    )
    e_alpha, e_beta = follows(
        w, j, d_alpha + half * (w.leg_alpha[j] - f_alpha), d_beta + half * (w.leg_beta[j] - f_beta)
    )
    m_alpha, m_beta = w.j_alpha[j] + on_alpha + e_alpha, w.j_beta[j] + on_beta + e_beta
    p, q = follows(w, j, 3.0 * d_alpha + 2.0 * h_alpha, 3.0 * d_beta + 2.0 * h_beta)
    p, q = p + 2.0 * (b_alpha + on_alpha), q + 2.0 * (b_beta + on_beta)
    p, q = (
        2.0 * (m_alpha + e_alpha) - x + 6.0 * s_alpha - p,
        2.0 * (m_beta + e_beta) - y + 6.0 * s_beta - q,
    )
    z_alpha, z_beta = legs_lose(w, j, shape, m_alpha, m_beta, p, q)
    w.j_alpha[j], w.j_beta[j] = w.j_alpha[j] + e_alpha, w.j_beta[j] + e_beta
    k = left * THIRD
    p, q = follows(
        w, j, (0.5 * late - k) * d_alpha - k * h_alpha, (0.5 * late - k) * d_beta - k * h_beta
    )
    w.fall_alpha[j] += (
        late * v_alpha
        + left * 0.5 * (f_alpha + z_alpha)
        + (r * (4.0 / 3.0) * e_alpha * left + r * p)
    )
    w.fall_beta[j] += (
        late * v_beta + left * 0.5 * (f_beta + z_beta) + (r * (4.0 / 3.0) * e_beta * left + r * q)
    )


@kernel
def legs_in_middle(w, span, rounded, cornered):
    """Do so for all lanes; cornered: edges of some lane may be late."""
    if cornered and rounded:
        for j in range(w.psi_alpha.size):
            leg_around_corner(w, j, span, w.shape[j])
    elif cornered:
        for j in range(w.psi_alpha.size):
            leg_around_corner(w, j, span, 0.0)
    elif rounded:
        for j in range(w.psi_alpha.size):
            leg_in_middle(w, j, span, w.shape[j])
    else:
        for j in range(w.psi_alpha.size):
            leg_in_middle(w, j, span, 0.0)


@inlined
def table_says(w, current):
    """Return what a leg loses (V) at a current (A) by the measured table, and the integral of it
    from 0 on (A V)."""
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
    return volts if current >= 0.0 else -volts, w.table_sum[low] + on * (
        first + 0.5 * slope * on
    ) + over * volts


@inlined
def table_mean(w, before, after):
    """Return what a leg loses on average (V) while its current (A) goes straight from before to
    after."""
    step = after - before
    if abs(step) < 1e-6 * w.table_current[w.table_points - 1]:
        return table_says(w, 0.5 * (before + after))[0]
    return (table_says(w, after)[1] - table_says(w, before)[1]) / step


@inlined
def loses(w, j, measured, x, y, p, q):
    """Return the same as `legs_lose` by the measured table, or by the curves of effects."""
    half, side, ahead, across = -0.5 * x, HALF_ROOT * y, -0.5 * p, HALF_ROOT * q
    if measured:
        a, b = table_mean(w, x, p), table_mean(w, half + side, ahead + across)
        c = table_mean(w, half - side, ahead - across)
    else:
        a, b = ports.leg_curve(w, j, x, p), ports.leg_curve(w, j, half + side, ahead + across)
        c = ports.leg_curve(w, j, half - side, ahead - across)
    return (2.0 * a - b - c) * THIRD, (b - c) * ROOT_THIRD


@inlined
def curve_at_start(w, j, measured):
    """Add to lane j's drop what legs lose by their table or curve at a segment's start."""
    v_alpha, v_beta = loses(w, j, measured, w.i_alpha[j], w.i_beta[j], w.i_alpha[j], w.i_beta[j])
    w.drop_alpha[j], w.drop_beta[j] = w.drop_alpha[j] + v_alpha, w.drop_beta[j] + v_beta


@inlined
def curve_in_middle(w, j, span, measured):
    """Add their mean over the segment, as `leg_in_middle` does."""
    x, y, r, half = w.i_alpha[j], w.i_beta[j], w.resistance[j], 0.5 * span
    o_alpha, o_beta = loses(w, j, measured, x, y, x, y)
    v_alpha, v_beta = loses(w, j, measured, x, y, w.j_alpha[j], w.j_beta[j])
    d_alpha, d_beta = half * (o_alpha - v_alpha), half * (o_beta - v_beta)
    e_alpha = w.stiff_aa[j] * d_alpha + w.stiff_ab[j] * d_beta
    e_beta = w.stiff_ab[j] * d_alpha + w.stiff_bb[j] * d_beta
    m_alpha, m_beta = w.j_alpha[j] + e_alpha, w.j_beta[j] + e_beta
    w.j_alpha[j], w.j_beta[j] = m_alpha, m_beta
    v_alpha, v_beta = loses(w, j, measured, x, y, m_alpha, m_beta)
    p, q = (
        2.0 * (m_alpha + e_alpha) - x + 6.0 * w.swell_alpha[j],
        2.0 * (m_beta + e_beta) - y + 6.0 * w.swell_beta[j],
    )
    z_alpha, z_beta = loses(w, j, measured, m_alpha, m_beta, p, q)
    w.fall_alpha[j] += 0.5 * (v_alpha + z_alpha) + r * (4.0 / 3.0) * e_alpha
    w.fall_beta[j] += 0.5 * (v_beta + z_beta) + r * (4.0 / 3.0) * e_beta


@kernel
def table_at_start(w):
    """Add to the drop what legs lose by their measured table at a segment's start."""
    for j in range(w.psi_alpha.size):
        curve_at_start(w, j, True)


@kernel
def table_in_middle(w, span):
    """Add their mean over the segment."""
    for j in range(w.psi_alpha.size):
        curve_in_middle(w, j, span, True)


@kernel
def curves_at_start(w):
    """Add to the drop what legs lose by the curves of effects at a segment's start."""
    for j in range(w.psi_alpha.size):
        curve_at_start(w, j, False)


@kernel
def curves_in_middle(w, span):
    """Add their mean over the segment."""
    for j in range(w.psi_alpha.size):
        curve_in_middle(w, j, span, False)
