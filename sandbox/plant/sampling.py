"""What the samplers hold: the plant looked at inside a segment, and the sensors behind it."""

from __future__ import annotations

from model.compiled import inlined, kernel
from model.lanes import lag_moments, lag_weights, turned
from sandbox.plant import additions as add
from sandbox.plant import ports
from sandbox.plant.edges import EDGES
from sandbox.plant.electrical import HALF_ROOT, quartic
from sandbox.plant.lags import answer, stiff

SHORTEST = 1e-14  # s: edges at one instant; 400 V for so long are 4e-12 V s


@inlined
def sooner(late, h, inverse):
    """Return the integral to h (s) of min(t, late) less that of a line with its mean over the segment (s^2): how much
    sooner than a line's the drop changes behind an edge that acts so late (s); inverse: 1/s of the segment."""
    r = min(late, h)
    late = min(late * inverse, 1.0)
    return r * (h - 0.5 * r) - h * h * late * (1.0 - 0.5 * late)


@inlined
def kinks(w, j, room, but, t, h, steps, gone, x, y):
    """Return of lane j, h (s) into the segment that began at t, what a lag answers to the kinks of late edges (Wb), and
    the kinks half-way there (Wb); steps: h over the lag's time constant; gone: one minus its decay.  See `lags`."""
    inverse, v = 1.0 / max(h, SHORTEST), w.link[j] * h
    late = min(w.late[j], h) * inverse
    told, half = v * answer(late, steps, gone), v * (min(0.5, late) - 0.5 * late)
    a, b, p, q = -told * x, -told * y, -half * x, -half * y
    for m in range(EDGES + 3):
        if m != but and room.until[m] > t:
            late = min(max(room.acts[m, j] - t, 0.0), h) * inverse
            told, half = v * answer(late, steps, gone), v * (min(0.5, late) - 0.5 * late)
            a, b = a - told * room.change_x[m], b - told * room.change_y[m]
            p, q = p - half * room.change_x[m], q - half * room.change_y[m]
    return a, b, p, q


@inlined
def glimpse(w, j, flux_map, features, room, but, course, t, h, u_a, u_b, x, y):
    """Return lane j's terminal current (A) h (s) into the segment that began at t; see `sandbox.plant.electrical`.

    but: the edge just taken, whose lateness is the lane's own; what others that wait take until then comes off.
    """
    v, n = w.link[j], h * w.span_inv[j]
    r = min(w.late[j], h)
    p, q, k = h * u_a - x * r, h * u_b - y * r, sooner(w.late[j], h, w.span_inv[j])
    k_a, k_b = k * x, k * y
    for m in range(EDGES + 3):
        if m != but and room.until[m] > t:
            acts = max(room.acts[m, j] - t, 0.0)
            r, k = min(acts, h), sooner(acts, h, w.span_inv[j])
            p, q = p - r * room.change_x[m], q - r * room.change_y[m]
            k_a, k_b = k_a + k * room.change_x[m], k_b + k * room.change_y[m]
    k_a, k_b = stiff(w, j, k_a, k_b)
    a = w.psi_a[j] + v * (p + w.resistance[j] * k_a) - h * (w.drop_a[j] + n * (w.fall_a[j] - w.drop_a[j]))
    b = w.psi_b[j] + v * (q + w.resistance[j] * k_b) - h * (w.drop_b[j] + n * (w.fall_b[j] - w.drop_b[j]))
    z = t + h - course.origin
    c_0, s_0 = turned(course.cos, course.sin, course.lead + z * (course.rate + z * (course.bend + z * course.jerk)))
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
    i_a, i_b = c * i_d - s * i_q, s * i_d + c * i_q
    if features & add.IRON:
        gone, first, _ = lag_moments(h * w.core_rate[j])
        k_a, k_b, _, _ = kinks(w, j, room, but, t, h, h * w.core_rate[j], gone, x, y)
        g = w.core_g[j] * w.core_rate[j]
        i_a += g * (a - ((1.0 - gone) * w.eddy_a[j] + (gone - first) * w.psi_a[j] + first * a + k_a))
        i_b += g * (b - ((1.0 - gone) * w.eddy_b[j] + (gone - first) * w.psi_b[j] + first * b + k_b))
    return i_a, i_b


@kernel
def peek(w, flux_map, features, room, but, course, t, span, until, u_a, u_b, x, y):
    """Hold the current (behind the filter) of every lane whose reading `when` falls between t and until (s)."""
    n = w.psi_a.size
    hit = False
    for j in range(n):
        hit = hit | ((w.when[j] >= t) & (w.when[j] < until))
    if not hit:
        return
    for j in range(n):
        w.span_inv[j] = 1.0 / span
    for j in range(n):
        inside = (w.when[j] >= t) & (w.when[j] < until)
        h = min(max(w.when[j] - t, 0.0), span)
        i_a, i_b = glimpse(w, j, flux_map, features, room, but, course, t, h, u_a, u_b, x, y)
        if features & add.FILTER:
            m_a, m_b = glimpse(w, j, flux_map, features, room, but, course, t, 0.5 * h, u_a, u_b, x, y)
            gone, first, second = lag_moments(h * w.filter_rate[j])
            w_0, w_m, w_1 = lag_weights(gone, first, second)
            k_a, k_b, p, q = kinks(w, j, room, but, t, h, h * w.filter_rate[j], gone, x, y)
            k_a, k_b = stiff(w, j, k_a - w_m * p, k_b - w_m * q)
            i_a = (1.0 - gone) * w.filter_a[j] + w_0 * w.i_a[j] + w_m * m_a + w_1 * i_a + k_a
            i_b = (1.0 - gone) * w.filter_b[j] + w_0 * w.i_b[j] + w_m * m_b + w_1 * i_b + k_b
        w.held_a[j] = i_a if inside else w.held_a[j]
        w.held_b[j] = i_b if inside else w.held_b[j]


@kernel
def hold_start(w, features):
    """Hold the current (behind the filter) at the pattern's start."""
    if features & add.FILTER:
        for j in range(w.psi_a.size):
            w.held_a[j], w.held_b[j] = w.filter_a[j], w.filter_b[j]
    else:
        for j in range(w.psi_a.size):
            w.held_a[j], w.held_b[j] = w.i_a[j], w.i_b[j]


@kernel
def read(w):
    """Write what the three sensors make of the current held (A)."""
    for j in range(w.psi_a.size):
        half, side = -0.5 * w.held_a[j], HALF_ROOT * w.held_b[j]
        a, b, c = ports.reading(w, j, w.held_a[j], half + side, half - side)
        w.read_a[j], w.read_b[j], w.read_c[j] = a + w.common[j], b + w.common[j], c + w.common[j]


@kernel
def deviate(w, turn):
    """Write by how much the angle's reading will be off where the encoder's mechanical angle is `turn` (rad)."""
    for j in range(w.psi_a.size):
        true = turn - (w.offset[j] + w.next_deviation[j]) / w.pairs[j]
        w.next_deviation[j] = ports.angle(w, j, true, w.pairs[j])
