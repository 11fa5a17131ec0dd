"""Core loss beside eddy currents: excess loss (Bertotti), hysteresis as a vector play (Bergqvist).

    excess: c e / (|e|^2 + width^2)^(1/4), e = (psi - y)/tau the slope of the flux behind the iron's
            lag: c sqrt|e| along it
    hysteresis: k q, q = psi - p, |q| <= r; the flux p that is held follows psi like a load on a
            rope of length r: it moves along q alone, and only while q is r long

Along a straight way the play is known exactly (`drag`).  With a the part of q along the way, b that
across it, and s the way gone: while |q| < r, a grows by s and b stays.  At |q| = r the end of the
rope moves on a tractrix: with phi the angle between q and the way, dphi/ds = -sin(phi)/r, so that
z = tan^2(phi/2) fades as exp(-2 s/r), with F = exp(-s/r) to z F^2; then a = r (1 - z)/(1 + z), and
on the way

    integral of a = r s - 2 r^2 artanh(z (1 - F^2)/(2 + z + z F^2)),
    of b = 2 r^2 (arctan sqrt(z) - arctan(F sqrt(z)))

The flux of a segment goes straight between the instants at which its edges act (`dragged`): a play
remembers a way's corners, so that each is gone to.  What is held when a recording begins nobody
knows; q is 0 then, the middle of what can be, and forgotten as soon as the flux has gone some r.
"""

from __future__ import annotations

import math

from model.compiled import inlined, kernel
from model.lanes import fading
from sandbox.plant.batch import CORE
from sandbox.plant.edges import EDGES
from sandbox.plant.electrical import THIRD, finished
from sandbox.plant.lags import moved_behind

LEAST = 1e-300  # Wb: no way at all
LITTLE = 1e-9  # of the reach: over so short a way nothing is dragged
SIXTH = 1.0 / 6.0


@inlined
def admittance(w, j, e_alpha, e_beta):
    """Return the excess-loss current over the lagged slope of the flux (V), 1/ohm."""
    size = e_alpha * e_alpha + e_beta * e_beta + w.slope_width[j] * w.slope_width[j]
    return w.excess[j] / math.sqrt(math.sqrt(size))


@inlined
def drag(q_alpha, q_beta, d_alpha, d_beta, r):
    """Return by how much the flux (Wb) is ahead of that held after a straight way d (Wb), its mean
    on the way, and how much of the way it dragged; q: at its beginning, r: at most."""
    length = max(math.sqrt(d_alpha * d_alpha + d_beta * d_beta), LEAST)
    inverse = 1.0 / length
    t_alpha, t_beta = d_alpha * inverse, d_beta * inverse
    along = q_alpha * t_alpha + q_beta * t_beta
    n_alpha, n_beta = q_alpha - along * t_alpha, q_beta - along * t_beta
    across = n_alpha * n_alpha + n_beta * n_beta
    corner = math.sqrt(max(r * r - across, 0.0))
    free = min(max(corner - along, 0.0), length)
    slid = length - free
    wide = 1.0 / (r + corner)
    fades, z = fading(-slid / r), across * wide * wide
    last = z * fades * fades
    over = 1.0 / (1.0 + last)
    slides = slid > LITTLE * r
    end = r * (1.0 - last) * over if slides else along + length
    less = fades * (1.0 + z) * over
    y, x = (1.0 - fades) / (1.0 + z * fades), (z - last) / (2.0 + z + last)
    ahead = free * (along + 0.5 * free) + r * (slid - 2.0 * r * inverse_tanh(x))
    aside = free + 2.0 * r * r * y * arc(z * y * y) * wide
    ahead = ahead * inverse if slides else along + 0.5 * length
    aside = aside * inverse if slides else 1.0
    return (
        (end * t_alpha + less * n_alpha, end * t_beta + less * n_beta),
        (ahead * t_alpha + aside * n_alpha, ahead * t_beta + aside * n_beta),
        slid * inverse,
    )


@inlined
def inverse_tanh(x):
    """Return artanh x for x from 0 to 1/3: its series, 1e-6 of it left out at most."""
    s = x * x
    return x * (1.0 + s * (1.0 / 3 + s * (1.0 / 5 + s * (1.0 / 7 + s * (1.0 / 9)))))


@inlined
def arc(square):
    """Return arctan(u)/u for u^2 = square up to 1: the series at the half of the angle, 2e-6 of it
    left out at most."""
    halved = 1.0 / (1.0 + math.sqrt(1.0 + square))
    s = square * halved * halved
    s = 1.0 - s * (1.0 / 3 - s * (1.0 / 5 - s * (1.0 / 7 - s * (1.0 / 9 - s * (1.0 / 11)))))
    return 2.0 * halved * s


@inlined
def acts_next(w, j, room, but, t, s, h):
    """Return when after s (s into the segment that began at t) the next edge acts in lane j, h at
    the latest; but: the edge just taken, whose lateness is the lane's own."""
    now = min(w.late[j], h) if w.late[j] > s else h
    for m in range(EDGES + 3):
        if m != but and room.until[m] > t:
            acts = room.acts[m, j] - t
            if s < acts < now:
                now = acts
    return now


@inlined
def applied(w, j, room, but, t, s, u_alpha, u_beta, x, y):
    """Return what the legs have applied (V s) s into the segment that began at t."""
    r = min(w.late[j], s)
    p, q = s * u_alpha - x * r, s * u_beta - y * r
    for m in range(EDGES + 3):
        if m != but and room.until[m] > t:
            r = min(max(room.acts[m, j] - t, 0.0), s)
            p, q = p - r * room.change_x[m], q - r * room.change_y[m]
    return w.link[j] * p, w.link[j] * q


@kernel
def dragged(w, j, room, but, t, h, u_alpha, u_beta, x, y, drop, grows, to):
    """Return by how much lane j's flux (Wb) is ahead of that held h (s) into the segment that began
    at t, its mean until then, and the share of the way that it dragged.

    drop: V at the segment's start, grows: V/s; to: flux (Wb) gone to, less that at the start.
    """
    (q_alpha, q_beta), r = (w.ahead_alpha[j], w.ahead_beta[j]), w.play_reach[j]
    s = gone_alpha = gone_beta = mean_alpha = mean_beta = slid = 0.0
    while s < h:
        now = acts_next(w, j, room, but, t, s, h)
        p, q = applied(w, j, room, but, t, now, u_alpha, u_beta, x, y)
        p, q = (
            p - now * (drop[0] + 0.5 * now * grows[0]),
            q - now * (drop[1] + 0.5 * now * grows[1]),
        )
        if now >= h:
            p, q = to
        (q_alpha, q_beta), (m_alpha, m_beta), dragging = drag(
            q_alpha, q_beta, p - gone_alpha, q - gone_beta, r
        )
        part = (now - s) / h
        mean_alpha, mean_beta = mean_alpha + part * m_alpha, mean_beta + part * m_beta
        slid += part * dragging
        s, gone_alpha, gone_beta = now, p, q
    return (q_alpha, q_beta), (mean_alpha, mean_beta), slid


@inlined
def waits(room, but, t):
    """Return whether any edge but one still waits at t (s)."""
    any_waits = False
    for m in range(EDGES + 3):
        any_waits = any_waits or (m != but and room.until[m] > t)
    return any_waits


@inlined
def acts_late(w):
    """Return whether in any lane the edge just taken acts late."""
    latest = 0.0
    for j in range(w.psi_alpha.size):
        latest = max(latest, w.late[j])
    return latest > 0.0


@inlined
def bent(w, j, h, u_alpha, u_beta, x, y, drop, grows, to):
    """Return the same as `dragged` where no edge waits but the one just taken: a way of two
    straight parts."""
    s, v = min(w.late[j], h), w.link[j]
    p = s * (v * (u_alpha - x) - drop[0] - 0.5 * s * grows[0])
    q = s * (v * (u_beta - y) - drop[1] - 0.5 * s * grows[1])
    r, share = w.play_reach[j], s / h
    (q_alpha, q_beta), (m_alpha, m_beta), first = drag(w.ahead_alpha[j], w.ahead_beta[j], p, q, r)
    ahead, (n_alpha, n_beta), slid = drag(q_alpha, q_beta, to[0] - p, to[1] - q, r)
    mean = (
        n_alpha + share * (m_alpha - n_alpha),
        n_beta + share * (m_beta - n_beta),
    )
    return ahead, mean, slid + share * (first - slid)


@kernel
def core_ahead(w, room, but, t, span, u_alpha, u_beta, x, y):
    """Write how far the flux is ahead of that held on average in the segment from t on (s), as
    predicted with the drop at its start, and by how much hysteresis follows the flux at once."""
    if waits(room, but, t):
        for j in range(w.psi_alpha.size):
            drop = w.drop_alpha[j], w.drop_beta[j]
            p, q = applied(w, j, room, but, t, span, u_alpha, u_beta, x, y)
            to = p - span * drop[0], q - span * drop[1]
            _, mean, slid = dragged(
                w, j, room, but, t, span, u_alpha, u_beta, x, y, drop, (0.0, 0.0), to
            )
            keep_mean(w, j, mean, slid)
    elif acts_late(w):
        for j in range(w.psi_alpha.size):
            drop, s = (w.drop_alpha[j], w.drop_beta[j]), min(w.late[j], span)
            p = w.link[j] * (span * u_alpha - s * x) - span * drop[0]
            q = w.link[j] * (span * u_beta - s * y) - span * drop[1]
            _, mean, slid = bent(w, j, span, u_alpha, u_beta, x, y, drop, (0.0, 0.0), (p, q))
            keep_mean(w, j, mean, slid)
    else:
        for j in range(w.psi_alpha.size):
            p = span * (w.link[j] * u_alpha - w.drop_alpha[j])
            q = span * (w.link[j] * u_beta - w.drop_beta[j])
            _, mean, slid = drag(w.ahead_alpha[j], w.ahead_beta[j], p, q, w.play_reach[j])
            keep_mean(w, j, mean, slid)


@inlined
def keep_mean(w, j, mean, slid):
    """Write it for lane j; slid: share of the way that the flux dragged that held."""
    w.held_back_alpha[j], w.held_back_beta[j] = mean
    w.core_stiff[j] = (1.0 - slid) * w.play[j]


@kernel
def core_in_middle(w, span):
    """Add to the mean iron-loss current of the segment (s) that of excess loss, by Simpson's rule
    over the parabola with the lagged slope's start, mean and end, and that of hysteresis; write by
    how much all of it follows the flux at once."""
    inverse, half = 1.0 / span, 0.5 * span
    for j in range(w.psi_alpha.size):
        rate = w.core_rate[j]
        moved_alpha, moved_beta = moved_behind(w, j, half)
        a, b = w.psi_alpha[j] - w.eddy_alpha[j], w.psi_beta[j] - w.eddy_beta[j]
        o_alpha, o_beta = rate * a, rate * b
        z_alpha = rate * (a + w.volt_alpha[j] - span * w.drop_alpha[j] - moved_alpha)
        z_beta = rate * (b + w.volt_beta[j] - span * w.drop_beta[j] - moved_beta)
        m_alpha = 1.5 * inverse * moved_alpha - 0.25 * (o_alpha + z_alpha)
        m_beta = 1.5 * inverse * moved_beta - 0.25 * (o_beta + z_beta)
        first, last = w.eased[j], admittance(w, j, z_alpha, z_beta)
        more = admittance(w, j, m_alpha, m_beta)
        w.core_alpha[j] += w.play[j] * w.held_back_alpha[j] + SIXTH * (
            first * o_alpha + 4.0 * more * m_alpha + last * z_alpha
        )
        w.core_beta[j] += w.play[j] * w.held_back_beta[j] + SIXTH * (
            first * o_beta + 4.0 * more * m_beta + last * z_beta
        )
        w.core_less[j] += more * w.second[CORE, j] + THIRD * span * w.core_stiff[j]
        w.core_stiff[j] += (w.core_g[j] + first) * rate


@inlined
def goes(w, j, span):
    """Return of lane j the drop at a segment's start (V), its slope (V/s), and what the flux goes
    in it (Wb), the drop known."""
    a, b = finished(w, j, span)
    drop, twice = (w.drop_alpha[j], w.drop_beta[j]), 2.0 / span
    grows = twice * (w.fall_alpha[j] - drop[0]), twice * (w.fall_beta[j] - drop[1])
    return drop, grows, (a - w.psi_alpha[j], b - w.psi_beta[j])


@kernel
def core_drags(w, room, but, t, span, u_alpha, u_beta, x, y):
    """Write how far the flux will be ahead of that held at the segment's end, its drop known."""
    if waits(room, but, t):
        for j in range(w.psi_alpha.size):
            drop, grows, to = goes(w, j, span)
            ahead, _, _ = dragged(w, j, room, but, t, span, u_alpha, u_beta, x, y, drop, grows, to)
            w.dragged_alpha[j], w.dragged_beta[j] = ahead
    elif acts_late(w):
        for j in range(w.psi_alpha.size):
            drop, grows, to = goes(w, j, span)
            ahead, _, _ = bent(w, j, span, u_alpha, u_beta, x, y, drop, grows, to)
            w.dragged_alpha[j], w.dragged_beta[j] = ahead
    else:
        for j in range(w.psi_alpha.size):
            _, _, to = goes(w, j, span)
            ahead, _, _ = drag(w.ahead_alpha[j], w.ahead_beta[j], to[0], to[1], w.play_reach[j])
            w.dragged_alpha[j], w.dragged_beta[j] = ahead


@kernel
def close_core(w, span):
    """Add excess loss and hysteresis to the iron-loss current at the end of a segment (s), whose
    eddy currents are closed; see `lags.close_iron`."""
    for j in range(w.psi_alpha.size):
        a, b = finished(w, j, span)
        rate = w.core_rate[j]
        e_alpha, e_beta = rate * (a - w.eddy_alpha[j]), rate * (b - w.eddy_beta[j])
        more = admittance(w, j, e_alpha, e_beta)
        w.eased[j] = more
        w.ahead_alpha[j], w.ahead_beta[j] = w.dragged_alpha[j], w.dragged_beta[j]
        i_alpha = more * e_alpha + w.play[j] * w.ahead_alpha[j]
        i_beta = more * e_beta + w.play[j] * w.ahead_beta[j]
        w.core_alpha[j], w.core_beta[j] = w.core_alpha[j] + i_alpha, w.core_beta[j] + i_beta
        w.j_alpha[j], w.j_beta[j] = w.j_alpha[j] - 0.25 * i_alpha, w.j_beta[j] - 0.25 * i_beta
