"""What windings and the inverter's legs lose beside the resistance: at a segment's start, and on average over it.

Around zero current a leg is a steep resistance, so its mean over a segment S hangs on the current's course.  Without
late edges that is a parabola (`leg_in_middle`).  An edge late by rho S puts a corner into it: beside the straight line
between its ends the flux then goes along a triangle, whose peak is twice its mean, 4 `lags.bend`, wherever the corner
is.  And where it is, 1 - rho, follows from `electrical.early` (K): K = -(1 - rho) S/6 times the peak.  Of several late
edges the corner is one with their mean bend, at the place that their K say; they act within so short a time of each
other that no more shows.  Behind the corner the course is a parabola again (`leg_around_corner`).
"""

from __future__ import annotations

from model.compiled import inlined, kernel
from sandbox.plant import ports
from sandbox.plant.electrical import HALF_ROOT, ROOT_THIRD, THIRD
from sandbox.plant.lags import bend

# Of link voltage times segment: a smaller bend counts as none.  Rounding of the fluxes (1e-16 of some 0.1 Wb) would
# place its corner, here still to 1e-4; an edge late by so small a share moves the corner, and the drop, by as little.
SLIGHT = 1e-9


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
def legs_lose(w, j, shape, x, y, p, q):
    """Return what legs lose on average (V, stationary frame) while the current (A) goes straight from x, y to p, q.

    shape: of the soft sign, from 0 (linear) to 1 (tanh).
    """
    k = w.soft[j]
    half, side, ahead, beside = -0.5 * x, HALF_ROOT * y, -0.5 * p, HALF_ROOT * q
    v_a = ports.leg(w, j, k * x, k * p, shape)
    v_b = ports.leg(w, j, k * (half + side), k * (ahead + beside), shape)
    v_c = ports.leg(w, j, k * (half - side), k * (ahead - beside), shape)
    return (2.0 * v_a - v_b - v_c) * THIRD, (v_b - v_c) * ROOT_THIRD


@inlined
def leg_at_start(w, j, shape):
    """Add to lane j's drop what the legs lose for their currents at the segment's start."""
    v_a, v_b = legs_lose(w, j, shape, w.i_a[j], w.i_b[j], w.i_a[j], w.i_b[j])
    w.leg_a[j], w.leg_b[j] = v_a, v_b
    w.drop_a[j], w.drop_b[j] = w.drop_a[j] + v_a, w.drop_b[j] + v_b


@kernel
def legs_at_start(w, rounded):
    """Do so for all lanes; rounded: some lane's soft sign (a loop of its own: a straight sign is many times faster)."""
    if rounded:
        for j in range(w.psi_a.size):
            leg_at_start(w, j, w.shape[j])
    else:
        for j in range(w.psi_a.size):
            leg_at_start(w, j, 0.0)


@inlined
def leg_in_middle(w, j, span, shape):
    """Add their mean over the segment, the current's parabola as two straight pieces.

    Around zero a leg is a resistance of threshold over half-width, many times the winding's: what it loses more on the
    way to the middle takes as much from the flux there, and from the current (e); at the end it is four times as much.
    """
    x, y, r, half = w.i_a[j], w.i_b[j], w.resistance[j], 0.5 * span
    v_a, v_b = legs_lose(w, j, shape, x, y, w.j_a[j], w.j_b[j])
    d_a, d_b = half * (w.leg_a[j] - v_a), half * (w.leg_b[j] - v_b)
    e_a = w.stiff_aa[j] * d_a + w.stiff_ab[j] * d_b
    e_b = w.stiff_ab[j] * d_a + w.stiff_bb[j] * d_b
    m_a, m_b = w.j_a[j] + e_a, w.j_b[j] + e_b
    w.j_a[j], w.j_b[j] = m_a, m_b
    p, q = 2.0 * (m_a + e_a) - x + 6.0 * w.swell_a[j], 2.0 * (m_b + e_b) - y + 6.0 * w.swell_b[j]
    z_a, z_b = legs_lose(w, j, shape, m_a, m_b, p, q)
    w.fall_a[j] += 0.5 * (v_a + z_a) + r * (4.0 / 3.0) * e_a
    w.fall_b[j] += 0.5 * (v_b + z_b) + r * (4.0 / 3.0) * e_b


@inlined
def follows(w, j, a, b):
    """Return the current (A) that follows a flux (Wb) at once."""
    return w.stiff_aa[j] * a + w.stiff_ab[j] * b, w.stiff_ab[j] * a + w.stiff_bb[j] * b


@inlined
def corner(w, j, span):
    """Return the share of the segment behind the corner that late edges make, and half of its peak (A)."""
    p, q = bend(w, j, 0.5 * span)
    along = w.early_a[j] * p + w.early_b[j] * q
    least = SLIGHT * span * w.link[j]
    bent = along < 0.0 and p * p + q * q > least * least
    left = -1.5 * along / ((p * p + q * q) * span if bent else 1.0)
    p, q = follows(w, j, 2.0 * p, 2.0 * q)
    return min(left, 1.0) if bent else 1.0, p if bent else 0.0, q if bent else 0.0


@inlined
def leg_around_corner(w, j, span, shape):
    """Do so where edges may be late: start to corner, then two pieces; of a lane without late edges the same bits.

    d: flux that the drop's change lets through up to the corner (Wb); h: the same, had it stayed as it is there, from
    there to the middle of the rest; e: the current of both in that middle.
    """
    r, x, y, s_a, s_b = w.resistance[j], w.i_a[j], w.i_b[j], w.swell_a[j], w.swell_b[j]
    left, b_a, b_b = corner(w, j, span)
    late, half = 1.0 - left, 0.5 * span * left
    on_a = late * (2.0 * (w.j_a[j] - b_a - x) + 6.0 * s_a)
    on_b = late * (2.0 * (w.j_b[j] - b_b - y) + 6.0 * s_b)
    c_a, c_b = x + (on_a + 2.0 * b_a), y + (on_b + 2.0 * b_b)
    v_a, v_b = legs_lose(w, j, shape, x, y, c_a, c_b)
    d_a, d_b = late * span * (w.leg_a[j] - v_a), late * span * (w.leg_b[j] - v_b)
    p, q = follows(w, j, d_a, d_b)
    c_a, c_b = c_a + p, c_b + q
    z_a, z_b = legs_lose(w, j, shape, c_a, c_b, c_a, c_b)
    h_a, h_b = half * (w.leg_a[j] - z_a), half * (w.leg_b[j] - z_b)
    s = 3.0 * (1.0 - left * left)
    on_a, on_b = 0.5 * on_a + s * s_a, 0.5 * on_b + s * s_b
    p, q = follows(w, j, d_a + h_a, d_b + h_b)
    f_a, f_b = legs_lose(w, j, shape, c_a, c_b, w.j_a[j] + (on_a + p), w.j_b[j] + (on_b + q))
    e_a, e_b = follows(w, j, d_a + half * (w.leg_a[j] - f_a), d_b + half * (w.leg_b[j] - f_b))
    m_a, m_b = w.j_a[j] + on_a + e_a, w.j_b[j] + on_b + e_b
    p, q = follows(w, j, 3.0 * d_a + 2.0 * h_a, 3.0 * d_b + 2.0 * h_b)
    p, q = p + 2.0 * (b_a + on_a), q + 2.0 * (b_b + on_b)
    p, q = 2.0 * (m_a + e_a) - x + 6.0 * s_a - p, 2.0 * (m_b + e_b) - y + 6.0 * s_b - q
    z_a, z_b = legs_lose(w, j, shape, m_a, m_b, p, q)
    w.j_a[j], w.j_b[j] = w.j_a[j] + e_a, w.j_b[j] + e_b
    k = left * THIRD
    p, q = follows(w, j, (0.5 * late - k) * d_a - k * h_a, (0.5 * late - k) * d_b - k * h_b)
    w.fall_a[j] += late * v_a + left * 0.5 * (f_a + z_a) + (r * (4.0 / 3.0) * e_a * left + r * p)
    w.fall_b[j] += late * v_b + left * 0.5 * (f_b + z_b) + (r * (4.0 / 3.0) * e_b * left + r * q)


@kernel
def legs_in_middle(w, span, rounded, cornered):
    """Do so for all lanes; cornered: edges of some lane may be late."""
    if cornered and rounded:
        for j in range(w.psi_a.size):
            leg_around_corner(w, j, span, w.shape[j])
    elif cornered:
        for j in range(w.psi_a.size):
            leg_around_corner(w, j, span, 0.0)
    elif rounded:
        for j in range(w.psi_a.size):
            leg_in_middle(w, j, span, w.shape[j])
    else:
        for j in range(w.psi_a.size):
            leg_in_middle(w, j, span, 0.0)


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
    return volts if current >= 0.0 else -volts, w.table_sum[low] + on * (first + 0.5 * slope * on) + over * volts


@inlined
def table_mean(w, before, after):
    """Return what a leg loses on average (V) while its current (A) goes straight from before to after."""
    step = after - before
    if abs(step) < 1e-6 * w.table_current[w.table_points - 1]:
        return table_says(w, 0.5 * (before + after))[0]
    return (table_says(w, after)[1] - table_says(w, before)[1]) / step


@inlined
def loses(w, j, measured, x, y, p, q):
    """Return the same as `legs_lose` by the measured table, or by the curves of effects."""
    half, side, ahead, beside = -0.5 * x, HALF_ROOT * y, -0.5 * p, HALF_ROOT * q
    if measured:
        a, b = table_mean(w, x, p), table_mean(w, half + side, ahead + beside)
        c = table_mean(w, half - side, ahead - beside)
    else:
        a, b = ports.leg_curve(w, j, x, p), ports.leg_curve(w, j, half + side, ahead + beside)
        c = ports.leg_curve(w, j, half - side, ahead - beside)
    return (2.0 * a - b - c) * THIRD, (b - c) * ROOT_THIRD


@inlined
def told_at_start(w, j, measured):
    """Add to lane j's drop what legs lose by their table or curve at a segment's start."""
    v_a, v_b = loses(w, j, measured, w.i_a[j], w.i_b[j], w.i_a[j], w.i_b[j])
    w.drop_a[j], w.drop_b[j] = w.drop_a[j] + v_a, w.drop_b[j] + v_b


@inlined
def told_in_middle(w, j, span, measured):
    """Add their mean over the segment, as `leg_in_middle` does."""
    x, y, r, half = w.i_a[j], w.i_b[j], w.resistance[j], 0.5 * span
    o_a, o_b = loses(w, j, measured, x, y, x, y)
    v_a, v_b = loses(w, j, measured, x, y, w.j_a[j], w.j_b[j])
    d_a, d_b = half * (o_a - v_a), half * (o_b - v_b)
    e_a = w.stiff_aa[j] * d_a + w.stiff_ab[j] * d_b
    e_b = w.stiff_ab[j] * d_a + w.stiff_bb[j] * d_b
    m_a, m_b = w.j_a[j] + e_a, w.j_b[j] + e_b
    w.j_a[j], w.j_b[j] = m_a, m_b
    v_a, v_b = loses(w, j, measured, x, y, m_a, m_b)
    p, q = 2.0 * (m_a + e_a) - x + 6.0 * w.swell_a[j], 2.0 * (m_b + e_b) - y + 6.0 * w.swell_b[j]
    z_a, z_b = loses(w, j, measured, m_a, m_b, p, q)
    w.fall_a[j] += 0.5 * (v_a + z_a) + r * (4.0 / 3.0) * e_a
    w.fall_b[j] += 0.5 * (v_b + z_b) + r * (4.0 / 3.0) * e_b


@kernel
def table_at_start(w):
    """Add to the drop what legs lose by their measured table at a segment's start."""
    for j in range(w.psi_a.size):
        told_at_start(w, j, True)


@kernel
def table_in_middle(w, span):
    """Add their mean over the segment."""
    for j in range(w.psi_a.size):
        told_in_middle(w, j, span, True)


@kernel
def curves_at_start(w):
    """Add to the drop what legs lose by the curves of effects at a segment's start."""
    for j in range(w.psi_a.size):
        told_at_start(w, j, False)


@kernel
def curves_in_middle(w, span):
    """Add their mean over the segment."""
    for j in range(w.psi_a.size):
        told_in_middle(w, j, span, False)
