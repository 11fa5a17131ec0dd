"""What the samplers hold: the plant looked at inside a segment, and the sensors behind it."""

from __future__ import annotations

from model.compiled import inlined, kernel
from model.lanes import lag_moments, turned
from sandbox.plant import additions as add
from sandbox.plant import ports
from sandbox.plant.edges import EDGES
from sandbox.plant.electrical import HALF_ROOT, quartic
from sandbox.plant.iron import admittance, dragged
from sandbox.plant.lags import answer, bend, stiff
from sandbox.plant.layers import bow

SHORTEST = 1e-30  # s: edges at one instant; rounding keeps nothing of it


@inlined
def sooner(late, h, inverse):
    """Return the integral to h (s) of min(t, late) less that of a line with its mean over the
    segment (s^2): how much sooner than a line's the drop changes behind an edge that acts so late
    (s); inverse: 1/s of the segment."""
    r = min(late, h)
    late = min(late * inverse, 1.0)
    return r * (h - 0.5 * r) - h * h * late * (1.0 - 0.5 * late)


@inlined
def kinks(w, j, room, but, t, h, steps, gone, x, y):
    """Return of lane j, h (s) into the segment that began at t, what a lag answers to the kinks of
    late edges (Wb);
    steps: h over the lag's time constant; gone: one minus its decay.  See `lags`."""
    inverse, v = 1.0 / max(h, SHORTEST), w.link[j] * h
    answered = v * answer(min(w.late[j], h) * inverse, steps, gone)
    a, b = -answered * x, -answered * y
    for m in range(EDGES + 3):
        if m != but and room.until[m] > t:
            answered = v * answer(min(max(room.acts[m, j] - t, 0.0), h) * inverse, steps, gone)
            a, b = a - answered * room.change_x[m], b - answered * room.change_y[m]
    return a, b


@inlined
def glimpse(w, j, flux_map, features, room, but, trajectory, t, h, u_alpha, u_beta, x, y):
    """Return lane j's terminal current (A) h (s) into the segment that began at t, and of it the
    iron-loss current; see `sandbox.plant.electrical`.

    but: the edge just taken, whose lateness is the lane's own; what others that wait take until
    then comes off.
    """
    v, n = w.link[j], h * w.span_inv[j]
    r = min(w.late[j], h)
    p, q, k = h * u_alpha - x * r, h * u_beta - y * r, sooner(w.late[j], h, w.span_inv[j])
    k_alpha, k_beta = k * x, k * y
    for m in range(EDGES + 3):
        if m != but and room.until[m] > t:
            acts = max(room.acts[m, j] - t, 0.0)
            r, k = min(acts, h), sooner(acts, h, w.span_inv[j])
            p, q = p - r * room.change_x[m], q - r * room.change_y[m]
            k_alpha, k_beta = k_alpha + k * room.change_x[m], k_beta + k * room.change_y[m]
    k_alpha, k_beta = stiff(w, j, k_alpha, k_beta)
    a = (
        w.psi_alpha[j]
        + v * (p + w.resistance[j] * k_alpha)
        - h * (w.drop_alpha[j] + n * (w.fall_alpha[j] - w.drop_alpha[j]))
    )
    b = (
        w.psi_beta[j]
        + v * (q + w.resistance[j] * k_beta)
        - h * (w.drop_beta[j] + n * (w.fall_beta[j] - w.drop_beta[j]))
    )
    if features & add.LAYERS:
        k_alpha, k_beta = bow(w, j, h)
        a, b = a - k_alpha, b - k_beta
    z = t + h - trajectory.origin
    c_0, s_0 = turned(
        trajectory.cos,
        trajectory.sin,
        trajectory.lead + z * (trajectory.rate + z * (trajectory.bend + z * trajectory.jerk)),
    )
    c, s = c_0 * w.off_c[j] + s_0 * w.off_s[j], s_0 * w.off_c[j] - c_0 * w.off_s[j]
    d, q = c * a + s * b - w.magnet[j], c * b - s * a
    if features & add.MAGNETS:
        rest_d, rest_q, _, _ = ports.magnets(w, j, c, s)
        d, q = d - rest_d, q - rest_q
        for k in range(w.more_magnets):
            rest_d, rest_q, _, _ = ports.further_magnets(w, k, j, c, s)
            d, q = d - rest_d, q - rest_q
    i_d, i_q = quartic(w, j, d, q)
    if flux_map is not None:
        m_d, m_q = ports.map_currents(flux_map, d, q)
        i_d, i_q = i_d + m_d, i_q + m_q
    if features & add.ENERGY:
        e_d, e_q, _ = ports.energy(w, j, c, s, d, q)
        i_d, i_q = i_d + e_d, i_q + e_q
        for k in range(w.more_energy):
            e_d, e_q, _ = ports.further_energy(w, k, j, c, s, d, q)
            i_d, i_q = i_d + e_d, i_q + e_q
    i_alpha, i_beta = c * i_d - s * i_q, s * i_d + c * i_q
    if features & add.IRON:
        gone, first, second = lag_moments(h * w.core_rate[j])
        k_alpha, k_beta = kinks(w, j, room, but, t, h, h * w.core_rate[j], gone, x, y)
        # the flux bends as the drop grows, evenly
        g, bent = w.core_g[j] * w.core_rate[j], h * n * (first - second)
        y_alpha = (
            (gone - first) * w.psi_alpha[j] + first * a + bent * (w.fall_alpha[j] - w.drop_alpha[j])
        )
        y_beta = (
            (gone - first) * w.psi_beta[j] + first * b + bent * (w.fall_beta[j] - w.drop_beta[j])
        )
        y_alpha = a - ((1.0 - gone) * w.eddy_alpha[j] + y_alpha + k_alpha)
        y_beta = b - ((1.0 - gone) * w.eddy_beta[j] + y_beta + k_beta)
        c_alpha, c_beta = g * y_alpha, g * y_beta
        if features & add.CORE_LOSS:
            grows = 2.0 * w.span_inv[j]
            more = admittance(w, j, w.core_rate[j] * y_alpha, w.core_rate[j] * y_beta)
            (k_alpha, k_beta), _, _ = dragged(
                w,
                j,
                room,
                but,
                t,
                h,
                u_alpha,
                u_beta,
                x,
                y,
                (w.drop_alpha[j], w.drop_beta[j]),
                (
                    grows * (w.fall_alpha[j] - w.drop_alpha[j]),
                    grows * (w.fall_beta[j] - w.drop_beta[j]),
                ),
                (a - w.psi_alpha[j], b - w.psi_beta[j]),
            )
            c_alpha += more * w.core_rate[j] * y_alpha + w.play[j] * k_alpha
            c_beta += more * w.core_rate[j] * y_beta + w.play[j] * k_beta
        return i_alpha + c_alpha, i_beta + c_beta, c_alpha, c_beta
    return i_alpha, i_beta, 0.0, 0.0


@inlined
def curving(w, j, span, e_alpha, e_beta, c_alpha, c_beta):
    """Return by how much the middle of the current's parabola over a segment (s), kinks apart, lies
    beside the line from its start to its end (e; c: iron-loss current there), A: the one that
    `lags.behind` moves a filter by."""
    p, q = bend(w, j, 0.5 * span)
    k_alpha, k_beta = stiff(w, j, 2.0 * p, 2.0 * q)
    g = w.core_stiff[j]
    m_alpha = (
        w.j_alpha[j] + 0.5 * w.core_alpha[j] - 0.25 * (w.begun_alpha[j] + c_alpha) - k_alpha - g * p
    )  # see `lags.close_iron`
    m_beta = w.j_beta[j] + 0.5 * w.core_beta[j] - 0.25 * (w.begun_beta[j] + c_beta) - k_beta - g * q
    return m_alpha - 0.5 * (w.i_alpha[j] + e_alpha), m_beta - 0.5 * (w.i_beta[j] + e_beta)


@inlined
def looked_at(w, t, until):
    """Return whether any lane's reading falls between t and until (s)."""
    hit = False
    for j in range(w.psi_alpha.size):
        hit = hit | ((w.when[j] >= t) & (w.when[j] < until))
    return hit


@kernel
def peek(
    w, flux_map, features, room, but, trajectory, t, span, until, u_alpha, u_beta, x, y, period
):
    """Hold the current (behind the filter) of every lane whose reading `when` falls between t and
    until (s)."""
    n = w.psi_alpha.size
    for j in range(n):
        w.span_inv[j] = 1.0 / span
    for j in range(n):
        inside = (w.when[j] >= t) & (w.when[j] < until)
        h = min(max(w.when[j] - t, 0.0), span)
        if features & add.WOBBLE:
            add.orient_lane(w, j, (t + h) / period, trajectory.rate)
        i_alpha, i_beta, _, _ = glimpse(
            w, j, flux_map, features, room, but, trajectory, t, h, u_alpha, u_beta, x, y
        )
        if features & add.FILTER:
            if features & add.WOBBLE:
                add.orient_lane(w, j, (t + span) / period, trajectory.rate)
            e_alpha, e_beta, c_alpha, c_beta = glimpse(
                w, j, flux_map, features, room, but, trajectory, t, span, u_alpha, u_beta, x, y
            )
            m_alpha, m_beta = curving(w, j, span, e_alpha, e_beta, c_alpha, c_beta)
            gone, first, second = lag_moments(h * w.filter_rate[j])
            bent, n = first - second, 2.0 * h * w.span_inv[j]
            k_alpha, k_beta = kinks(w, j, room, but, t, h, h * w.filter_rate[j], gone, x, y)
            k_alpha, k_beta = stiff(w, j, k_alpha, k_beta)
            i_alpha = (
                (1.0 - gone) * w.filter_alpha[j]
                + (gone - first) * w.i_alpha[j]
                + first * i_alpha
                + bent * n * n * m_alpha
                + k_alpha
            )
            i_beta = (
                (1.0 - gone) * w.filter_beta[j]
                + (gone - first) * w.i_beta[j]
                + first * i_beta
                + bent * n * n * m_beta
                + k_beta
            )
        w.held_alpha[j] = i_alpha if inside else w.held_alpha[j]
        w.held_beta[j] = i_beta if inside else w.held_beta[j]


@kernel
def hold_start(w, features):
    """Hold the current (behind the filter) at the pattern's start."""
    if features & add.FILTER:
        for j in range(w.psi_alpha.size):
            w.held_alpha[j], w.held_beta[j] = w.filter_alpha[j], w.filter_beta[j]
    else:
        for j in range(w.psi_alpha.size):
            w.held_alpha[j], w.held_beta[j] = w.i_alpha[j], w.i_beta[j]


@kernel
def slope(w, speed):
    """Write the current's slope in the zero vector (A/s) and the slope of that, the rotor at a
    speed w (rad/s electrical).

    The flux falls by the drop u, and turns backwards as the rotor sees it; with J the turn by 90
    degrees and G the inverse inductance, which turns with the rotor,

        i' = G v + w J i,   v = -u - w J psi,
        i'' = w (J G v - G J v) + G (w J u - R i') + w J i'.
    """
    for j in range(w.psi_alpha.size):
        a = speed * w.psi_beta[j] - w.drop_alpha[j]
        b = -speed * w.psi_alpha[j] - w.drop_beta[j]
        g_alpha, g_beta = within(w, j, a, b)
        s_alpha, s_beta = g_alpha - speed * w.i_beta[j], g_beta + speed * w.i_alpha[j]
        w.slope_alpha[j], w.slope_beta[j] = s_alpha, s_beta
        p, q = within(
            w,
            j,
            speed * (b - w.drop_beta[j]) - w.resistance[j] * s_alpha,
            speed * (w.drop_alpha[j] - a) - w.resistance[j] * s_beta,
        )
        w.slopes_alpha[j] = p - speed * (g_beta + s_beta)
        w.slopes_beta[j] = q + speed * (g_alpha + s_alpha)


@inlined
def within(w, j, a, b):
    """Return the inverse inductance, as at the period's start, times a vector."""
    return w.stiff_aa[j] * a + w.stiff_ab[j] * b, w.stiff_ab[j] * a + w.stiff_bb[j] * b


@inlined
def later(w, j, lag):
    """Return what the current (A) changes in the zero vector by so much later (s)."""
    half = 0.5 * lag
    return (
        lag * (w.slope_alpha[j] + half * w.slopes_alpha[j]),
        lag * (w.slope_beta[j] + half * w.slopes_beta[j]),
    )


@kernel
def read(w):
    """Write what the three sensors make of the current held (A)."""
    for j in range(w.psi_alpha.size):
        half, side, lag = -0.5 * w.held_alpha[j], HALF_ROOT * w.held_beta[j], w.channel_lag[j]
        ahead, across = later(w, j, lag)
        i_b = half + side + (HALF_ROOT * across - 0.5 * ahead)
        ahead, across = later(w, j, 2.0 * lag)
        i_c = half - side - (HALF_ROOT * across + 0.5 * ahead)
        a, b, c = ports.reading(w, j, w.held_alpha[j], i_b, i_c)
        w.read_a[j], w.read_b[j], w.read_c[j] = a + w.common[j], b + w.common[j], c + w.common[j]


@inlined
def misread(w, j, turn):
    """Return what lane j's angle is read off at a mechanical angle (rad), in rad electrical: all
    parts of effects together."""
    off = ports.angle(w, j, turn, w.pairs[j])
    for k in range(w.more_angle):
        off += ports.further_angle(w, k, j, turn, w.pairs[j])
    return off


@kernel
def deviate(w, turn):
    """Write by how much the angle's reading will be off where the encoder's mechanical angle is
    `turn` (rad)."""
    for j in range(w.psi_alpha.size):
        true = turn - (w.offset[j] + w.next_deviation[j]) / w.pairs[j]
        w.next_deviation[j] = misread(w, j, true)
