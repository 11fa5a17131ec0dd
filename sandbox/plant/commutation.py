"""When edges act: late, by the current of their leg and by how that changes behind the edge
(`model.commutation`).

Most edges find their current far from zero: one short loop over all lanes (`far`).  Nearer, how
fast the current changes counts; where it may come to zero, so do other legs' edges, taken before or
soon to come: the voltage is then the mean over the dead time.  What of this a lane takes depends on
that lane alone.
"""

from __future__ import annotations

from model.compiled import inlined, kernel
from sandbox.plant import ports
from sandbox.plant.edges import EDGES, LEG_X, LEG_Y
from sandbox.plant.electrical import dropped

TWO_THIRDS = 2.0 / 3.0
FAR = 1e12  # A: a current that keeps its leg
BENDS = (
    # of the latest edge: by how much a changing current may alter an edge unseen; 1e-4 of dead
    # time's own size
    1e-4
)
INSTANT = 1e-12  # s: in place of no time, where a share of it is asked for


@inlined
def slopes(w, j, rate, u_alpha, u_beta, x, y, side):
    """Return of leg (x, y) the current (A) that keeps it where it is, and its slopes (A/s): the leg
    there, gone over.

    di/dt = G (u - drop - j omega psi) + j omega i; rate: omega, rad/s electrical; u_alpha, u_beta:
    of the legs.
    """
    v, i_alpha, i_beta = w.link[j], w.i_alpha[j], w.i_beta[j]
    p = v * u_alpha - w.drop_alpha[j] + rate * w.psi_beta[j]
    q = v * u_beta - w.drop_beta[j] - rate * w.psi_alpha[j]
    g_alpha, g_beta = x * w.stiff_aa[j] + y * w.stiff_ab[j], x * w.stiff_ab[j] + y * w.stiff_bb[j]
    slope = side * (g_alpha * p + g_beta * q + rate * (y * i_alpha - x * i_beta))
    return (
        side * (x * i_alpha + y * i_beta),
        slope,
        slope + TWO_THIRDS * v * (g_alpha * x + g_beta * y),
    )


@inlined
def at_constant_current(w, j, x, y, side):
    """Return how late (s) lane j's edge acts for a constant current, whether that is right, and
    whether it is once `ports.commutation` is added.

    The current's slope stays below the link's voltage over the inductance,
    twice over as two legs may go with it: V trace G.  A leg that slews for 2 late is off by a third
    of the slope's share of the current, times late.
    """
    hold = side * (x * w.i_alpha[j] + y * w.i_beta[j])
    late, who = ports.edge(w, j, hold, 0.0, 0.0, w.link[j])
    steep, size = w.link[j] * (w.stiff_aa[j] + w.stiff_bb[j]), abs(hold)
    bends = (hold < 0.0) & (TWO_THIRDS * steep * late * late > BENDS * w.max_edge_delay[j] * size)
    return (
        late,
        (who < 1.0) | ((who == 1.0) & (size >= steep * w.max_edge_delay[j]) & (not bends)),
        (who > 0.0) & (who < 1.0),
    )


@kernel
def far(w, x, y, side):
    """Write how late the edge acts for a constant current; return whether that is right in all
    lanes."""
    wrong = asking = 0  # counts: a sum of floats in order would keep this from being a vector loop
    for j in range(w.psi_alpha.size):
        w.late[j], right, asked = at_constant_current(w, j, x, y, side)
        wrong += 0 if right else 1
        asking += 1 if asked else 0
    if asking > 0:
        for j in range(w.psi_alpha.size):
            hold = side * (x * w.i_alpha[j] + y * w.i_beta[j])
            if at_constant_current(w, j, x, y, side)[2]:
                w.late[j] += ports.commutation(w, j, hold, 0.0, 0.0, w.link[j])
    return wrong == 0


@inlined
def zero_in_reach(max_edge_delay, hold, before, after):
    """Return whether a current (A) may come to zero within the latest edge (s), slopes of two more
    legs added."""
    return abs(hold) < (abs(before) + 2.0 * (after - before)) * max_edge_delay


@kernel
def nearer(w, rate, u_alpha, u_beta, x, y, side):
    """Write how late the edge acts for a current that changes as the legs command; return whether
    any may pass zero, or is to be asked alone."""
    near = 0
    for j in range(w.psi_alpha.size):
        right = at_constant_current(w, j, x, y, side)[1]
        hold, before, after = slopes(w, j, rate, u_alpha, u_beta, x, y, side)
        late, who = ports.edge(w, j, hold, before, after, w.link[j])
        w.late[j] = w.late[j] if right else late
        near += (
            1
            if (not right) & ((who > 1.0) | zero_in_reach(w.max_edge_delay[j], hold, before, after))
            else 0
        )
    return near > 0


@kernel
def commutate(w, room, t, max_edge_delay, rate, u_alpha, u_beta, edge, plain):
    """Write how late (s) the edge of leg (x, y) acts that is taken at t.

    edge: x, y, side (1 rises, -1 falls), real (0: none is switched); plain: steps leave the drop
    out.
    """
    x, y, side, real = edge
    if real == 0.0:
        for j in range(w.psi_alpha.size):
            w.late[j] = 0.0
        return
    if far(w, x, y, side):
        return
    if plain:
        dropped(w)
    if nearer(w, rate, u_alpha, u_beta, x, y, side):
        others(w, room, t, max_edge_delay, x, y)
        passing_zero(w, rate, u_alpha, u_beta, x, y, side)


@kernel
def passing_zero(w, rate, u_alpha, u_beta, x, y, side):
    """Write how late the edge acts where its current may pass zero: other legs as in the mean
    (`others`)."""
    asking = 0
    for j in range(w.psi_alpha.size):
        hold, before, after = slopes(w, j, rate, u_alpha, u_beta, x, y, side)
        right = at_constant_current(w, j, x, y, side)[1]
        who = ports.edge(w, j, hold, before, after, w.link[j])[1]
        near = (not right) & ((who > 1.0) | zero_in_reach(w.max_edge_delay[j], hold, before, after))
        p, q = (w.extra_alpha[j], w.extra_beta[j]) if near else (0.0, 0.0)
        hold, mean, gone = slopes(w, j, rate, u_alpha + p, u_beta + q, x, y, side)
        late, who = ports.edge(w, j, hold, mean, gone, w.link[j])
        w.late[j] = late if near else w.late[j]
        w.extra_alpha[j], w.extra_beta[j] = p, q
        asking += 0 if right | (who <= 1.0) else 1
    if asking > 0:
        for j in range(w.psi_alpha.size):
            hold, mean, gone = slopes(
                w, j, rate, u_alpha + w.extra_alpha[j], u_beta + w.extra_beta[j], x, y, side
            )
            right = at_constant_current(w, j, x, y, side)[1]
            if not right and ports.edge(w, j, hold, mean, gone, w.link[j])[1] > 1.0:
                w.late[j] += ports.commutation(w, j, hold, mean, gone, w.link[j])


@kernel
def others(w, room, t, max_edge_delay, x, y):
    """Write (extra_alpha, extra_beta) by how much the vector of the legs, mean of a lane's latest
    edge from t on, differs from that commanded at t, the leg (x, y) left out: edges that still
    wait, and edges to come."""
    for j in range(w.psi_alpha.size):
        w.extra_alpha[j] = w.extra_beta[j] = 0.0
    for m in range(EDGES + 3 if room.until[EDGES + 3] > t else 0):
        leg = room.leg[m] if m < EDGES else m - EDGES
        if room.until[m] > t and not (LEG_X[leg] == x and LEG_Y[leg] == y):
            acts, c_x, c_y = room.acts[m], room.change_x[m], room.change_y[m]
            for j in range(w.psi_alpha.size):
                span = max(w.max_edge_delay[j], INSTANT)
                share = min(max(acts[j] - t, 0.0), span) / span
                w.extra_alpha[j], w.extra_beta[j] = (
                    w.extra_alpha[j] - share * c_x,
                    w.extra_beta[j] - share * c_y,
                )
    for m in range(EDGES):
        z, side = room.time[m] - t, room.side[m]
        own = room.x[m] == x and room.y[m] == y
        if 0.0 <= z < max_edge_delay and room.until[m] < 0.0 and room.real[m] > 0.0 and not own:
            r_x, r_y = room.x[m], room.y[m]
            for j in range(w.psi_alpha.size):
                span, hold = (
                    max(w.max_edge_delay[j], INSTANT),
                    side * (r_x * w.i_alpha[j] + r_y * w.i_beta[j]),
                )
                acts = z + ports.edge(w, j, hold, 0.0, 0.0, w.link[j])[0]
                share = TWO_THIRDS * side * max(span - acts, 0.0) / span
                w.extra_alpha[j], w.extra_beta[j] = (
                    w.extra_alpha[j] + share * r_x,
                    w.extra_beta[j] + share * r_y,
                )


@kernel
def latest(w):
    """Write the latest (s) that any edge of each lane can act; return that of all."""
    most = 0.0
    for j in range(w.psi_alpha.size):
        kept, gone = (
            ports.edge(w, j, FAR, 0.0, 0.0, w.link[j])[0],
            ports.edge(w, j, -FAR, 0.0, 0.0, w.link[j])[0],
        )
        w.max_edge_delay[j] = max(kept, gone, 0.0)
        most = max(most, w.max_edge_delay[j])
    return most
