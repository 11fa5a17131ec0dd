"""Blocked gates: no switch conducts, only diodes do; one parameter set, as in a closed loop.

A leg whose current flows out stands at the low rail, one whose current flows in at the high rail;
one without current floats between them.  Over a short segment the current at its end is a line in
the legs' mean levels x (of the link):

    i(end) = i + S (x - x_0),  S positive, but for what all legs have in common

and the diodes ask for x_k = 0 where i_k(end) > 0, x_k = 1 where i_k(end) < 0, anything between
where it is 0.  This is what makes x^T S x / 2 + (i - S x_0)^T x least in the unit cube: convex,
solved leg by leg (Gauss and Seidel).  Where a current comes to zero in a segment, the mean level is
the right one: flux knows volt-seconds alone.  A segment that begins off zero by what the line
leaves out ends nearer, so errors do not add up.
"""

from __future__ import annotations

from model.compiled import kernel
from model.lanes import turned
from sandbox.plant.edges import LEG_X, LEG_Y

PARTS = 128.0  # of a period: a segment with blocked gates is no longer
SWEEPS = 200  # each leaves a quarter of the error, less with saliency
SETTLED = 1e-13  # of the link
TWO_THIRDS = 2.0 / 3.0


@kernel
def block(room):
    """Make a period's pulses those of blocked gates: none, and nothing that waits."""
    for leg in range(3):
        room.duty[leg] = room.before[leg] = 0.0
    for m in range(room.until.size):
        room.until[m] = -1.0
    room.given[0] = room.given[1] = 0.0


@kernel
def float_legs(w, room, span, rate):
    """Return the vector of the legs' mean levels over a segment (s) with blocked gates; rate: rad/s
    electrical.

    Its volt-seconds are added to room.given.
    """
    v, (aa, ab, bb) = w.link[0], (w.stiff_aa[0], w.stiff_ab[0], w.stiff_bb[0])
    psi_alpha, psi_beta = turned(
        w.psi_alpha[0], w.psi_beta[0], 0.5 * rate * span
    )  # of the segment's middle: magnets turn
    u_alpha = u_beta = 0.0
    for leg in range(3):
        u_alpha += TWO_THIRDS * LEG_X[leg] * room.level[leg]
        u_beta += TWO_THIRDS * LEG_Y[leg] * room.level[leg]
    p = v * u_alpha - w.drop_alpha[0] + rate * psi_beta
    q = v * u_beta - w.drop_beta[0] - rate * psi_alpha
    i_alpha = w.i_alpha[0] + span * (aa * p + ab * q - rate * w.i_beta[0])
    i_beta = w.i_beta[0] + span * (ab * p + bb * q + rate * w.i_alpha[0])
    for _ in range(SWEEPS):
        moved = 0.0
        for leg in range(3):
            x, y = LEG_X[leg], LEG_Y[leg]
            s_alpha, s_beta = (
                TWO_THIRDS * v * span * (aa * x + ab * y),
                TWO_THIRDS * v * span * (ab * x + bb * y),
            )
            before = room.level[leg]
            room.level[leg] = min(
                max(before - (x * i_alpha + y * i_beta) / (x * s_alpha + y * s_beta), 0.0), 1.0
            )
            move = room.level[leg] - before
            i_alpha, i_beta = i_alpha + move * s_alpha, i_beta + move * s_beta
            u_alpha, u_beta = u_alpha + TWO_THIRDS * move * x, u_beta + TWO_THIRDS * move * y
            moved = max(moved, abs(move))
        if moved < SETTLED:
            break
    room.given[0] += v * span * u_alpha
    room.given[1] += v * span * u_beta
    return u_alpha, u_beta
