"""When edges act: late, by the current of their leg and by how that changes behind the edge (`model.commutation`).

Most edges find their current far from zero: one short loop over all lanes (`far`).  Nearer, how fast the current
changes counts; where one may come to zero, each lane is asked alone, and the voltage is the mean over the dead time:
other legs' edges, taken before or soon to come, act within it.
"""

from __future__ import annotations

from model.compiled import inlined, kernel
from sandbox.plant import ports
from sandbox.plant.edges import EDGES, LEG_X, LEG_Y
from sandbox.plant.electrical import dropped

TWO_THIRDS = 2.0 / 3.0
FAR = 1e12  # A: a current that keeps its leg
STRAIGHT = (
    2e-3  # of the current: by how much it may change while a leg slews and be constant; leaves 1e-3/3 of that time
)


@inlined
def slopes(w, j, rate, u_a, u_b, x, y, side):
    """Return of leg (x, y) the current (A) that keeps it where it is, and its slopes (A/s): the leg there, gone over.

    di/dt = G (u - drop - j omega psi) + j omega i; rate: omega, rad/s electrical; (u_a, u_b): vector of the legs.
    """
    v, i_a, i_b = w.link[j], w.i_a[j], w.i_b[j]
    p = v * u_a - w.drop_a[j] + rate * w.psi_b[j]
    q = v * u_b - w.drop_b[j] - rate * w.psi_a[j]
    g_a, g_b = x * w.stiff_aa[j] + y * w.stiff_ab[j], x * w.stiff_ab[j] + y * w.stiff_bb[j]
    slope = side * (g_a * p + g_b * q + rate * (y * i_a - x * i_b))
    return side * (x * i_a + y * i_b), slope, slope + TWO_THIRDS * v * (g_a * x + g_b * y)


@kernel
def far(w, tardy, x, y, side):
    """Write how late the edge acts for a constant current; return whether that is right in all lanes.

    tardy: the latest (s) that any edge acts.  The current's slope stays below the link's voltage over the inductance,
    twice over as two legs may go with it: V trace G.
    """
    wrong = 0.0
    for j in range(w.psi_a.size):
        hold = side * (x * w.i_a[j] + y * w.i_b[j])
        late, crossing = ports.edge(w, j, hold, 0.0, 0.0, w.link[j])
        steep, size = w.link[j] * (w.stiff_aa[j] + w.stiff_bb[j]), abs(hold)
        bends = (hold < 0.0) & (2.0 * steep * late > STRAIGHT * size)  # 2 late: what slewing takes
        w.late[j] = late
        wrong += crossing + (1.0 if (size < steep * tardy) | bends else 0.0)
    return wrong == 0.0


@kernel
def commutate(w, room, t, tardy, rate, u_a, u_b, edge, plain):
    """Write how late (s) the edge of leg (x, y) acts that is taken at t.

    edge: x, y, side (1 rises, -1 falls), real (0: none is switched); plain: steps leave the drop out.
    """
    x, y, side, real = edge
    if real == 0.0:
        for j in range(w.psi_a.size):
            w.late[j] = 0.0
        return
    if far(w, tardy, x, y, side):
        return
    if plain:
        dropped(w)
    near = 0.0
    for j in range(w.psi_a.size):
        hold, before, after = slopes(w, j, rate, u_a, u_b, x, y, side)
        late, crossing = ports.edge(w, j, hold, before, after, w.link[j])
        w.late[j] = late
        near = max(near, crossing)
    if near > 0.0:
        for j in range(w.psi_a.size):
            w.late[j] += nearby(w, j, room, t, rate, u_a, u_b, x, y, side)


@kernel
def nearby(w, j, room, t, rate, u_a, u_b, x, y, side):
    """Return by how much later (s) an edge acts whose current is near zero."""
    hold, before, after = slopes(w, j, rate, u_a, u_b, x, y, side)
    if ports.edge(w, j, hold, before, after, w.link[j])[1] == 0.0:
        return 0.0
    late = longest(w, j)
    p, q = others(w, j, room, t, late, x, y)
    hold, mean, gone = slopes(w, j, rate, u_a + p, u_b + q, x, y, side)
    told = ports.edge(w, j, hold, mean, gone, w.link[j])[0] - ports.edge(w, j, hold, before, after, w.link[j])[0]
    return told + ports.commutation(w, j, hold, mean, gone, w.link[j])


@kernel
def others(w, j, room, t, span, x, y):
    """Return by how much the vector of the legs, mean of a span (s) from t on, differs from that commanded at t, the
    leg (x, y) left out: edges that still wait, and edges to come."""
    p = q = 0.0
    for m in range(EDGES + 3 if room.until[EDGES + 3] > t else 0):
        leg = room.leg[m] if m < EDGES else m - EDGES
        if room.until[m] > t and not (LEG_X[leg] == x and LEG_Y[leg] == y):
            share = min(max(room.acts[m, j] - t, 0.0), span) / span
            p, q = p - share * room.change_x[m], q - share * room.change_y[m]
    for m in range(EDGES):
        z = room.time[m] - t
        own = room.x[m] == x and room.y[m] == y
        if 0.0 <= z < span and room.until[m] < 0.0 and room.real[m] > 0.0 and not own:
            side = room.side[m]
            hold = side * (room.x[m] * w.i_a[j] + room.y[m] * w.i_b[j])
            acts = z + ports.edge(w, j, hold, 0.0, 0.0, w.link[j])[0]
            share = TWO_THIRDS * side * max(span - acts, 0.0) / span
            p, q = p + share * room.x[m], q + share * room.y[m]
    return p, q


@inlined
def longest(w, j):
    """Return the latest (s) that any edge of a lane can act, but for its sign the same for all."""
    kept, gone = ports.edge(w, j, FAR, 0.0, 0.0, w.link[j])[0], ports.edge(w, j, -FAR, 0.0, 0.0, w.link[j])[0]
    return max(kept, gone)


@kernel
def latest(w):
    """Return the latest (s) that any edge of any lane can act."""
    most = 0.0
    for j in range(w.psi_a.size):
        most = max(most, longest(w, j))
    return most
