"""Layers of conductors in the plant: Dowell's formula as six first-order branches in series.

Of m layers with R ohm at rest, x^2 = s T, T = mu sigma h^2 of conductors h high:

    Z/R = x coth x + 2/3 (m^2 - 1) x tanh(x/2) = 1 + sum of w_n s tau_n/(1 + s tau_n)
    tau_n = tau/n^2, tau = T/pi^2; w_n = 2 + 8/3 (m^2 - 1) of odd n, 2 of even n

A branch drops R w (i - x), tau dx/dt = i - x, as the skin effect's one branch does.  In powers of
s, odd and even n are each a power series whose coefficients are moments of places tau_n/tau with
weights w_n tau_n/tau.  Three places with Gauss's weights have the same first six moments, hence
Z up to s^6 (Pade's approximant): nothing is left to add, at low frequencies neither resistance nor
inductance, and at high ones the tail has no inductance.  R and inductance are off by less than
0.2 % up to xi = 6.2, h over the skin's depth, R by less than 1 % up to 10.6, of any number of
layers (tests).

Over a segment of length S the current is a straight line from i_0 through j in its middle, what it
bends aside.  With z = S/tau, the moments of `lags`, d = i_0 - x_0 and b = 2 (j - i_0)/z - d, a
branch's drop

    begins with R w d, is R w (d + first b) in the mean, and lets the flux fall short of a
    constant drop's by R w b S second/2 in the mean and R w b S (3 second - first)/4 in the middle

(the middle of the parabola with this mean and end).  What the flux falls short of takes current
from j; both are linear, so j is solved for, however fast a branch is.  The drops' integral is known
once the end is: sum of R w tau_n times the change of x_n.  What the means make more of it goes to
the next segment (`over`), so that nothing adds up.
"""

from __future__ import annotations

from model.compiled import inlined, kernel
from model.lanes import lag_moments
from sandbox.plant.batch import BRANCHES, LAYER
from sandbox.plant.electrical import THIRD
from sandbox.plant.lags import behind, bend, kink, stiff, weigh

# tau_n/tau and weight of the branches that stand for all odd and all even n (tests derive them)
PLACES = (
    0.999999735978572405,
    0.108189149471891196,
    0.0133570692187816965,
    0.249991642303771763,
    0.0587766157882246485,
    0.00756521630189328778,
)
WEIGHTS = (
    1.0000016638106105,
    1.12627514557903443,
    8.37372319061035507,
    1.000226988368729,
    1.30091431446675285,
    11.1988586971645182,
)
ODD = 3  # of them, the first ones


@inlined
def spread(w, j, odd, even, rate):
    """Write lane j's branches: ohm of every odd and every even n, rate of the first (1/s)."""
    for n in range(BRANCHES):
        ohm = odd if n < ODD else even
        w.layer_r[n, j], w.layer_rate[n, j] = ohm * WEIGHTS[n], rate / PLACES[n]


@inlined
def close_branch(w, n):
    """Move the current behind branch n on by a segment, and add its drop at the end."""
    for j in range(w.psi_alpha.size):
        a, b = behind(w, LAYER + n, j, w.layer_alpha[n, j], w.layer_beta[n, j])
        held = w.layer_r[n, j] / w.layer_rate[n, j]
        w.over_alpha[j] -= held * (a - w.layer_alpha[n, j])
        w.over_beta[j] -= held * (b - w.layer_beta[n, j])
        w.layer_alpha[n, j], w.layer_beta[n, j] = a, b
        w.drop_alpha[j] += w.layer_r[n, j] * (w.i_alpha[j] - a)
        w.drop_beta[j] += w.layer_r[n, j] * (w.i_beta[j] - b)


@kernel
def close_layers(w):
    """Move the currents behind all branches on by a segment, and add their drops at its end.

    Branches stand one by one here and below: where their places are known, loops over lanes are
    vector loops.
    """
    close_branch(w, 0)
    close_branch(w, 1)
    close_branch(w, 2)
    close_branch(w, 3)
    close_branch(w, 4)
    close_branch(w, 5)


@kernel
def weigh_layers(w, span):
    """Write the moments of all branches over a segment (s) and clear their kinks."""
    weigh(w, LAYER, w.layer_rate[0], span)
    weigh(w, LAYER + 1, w.layer_rate[1], span)
    weigh(w, LAYER + 2, w.layer_rate[2], span)
    weigh(w, LAYER + 3, w.layer_rate[3], span)
    weigh(w, LAYER + 4, w.layer_rate[4], span)
    weigh(w, LAYER + 5, w.layer_rate[5], span)


@kernel
def kink_layers(w, acts, t, span, x, y):
    """Add to all branches the kink of an edge, as `lags.kink` does to one lag."""
    kink(w, LAYER, w.layer_rate[0], acts, t, span, x, y)
    kink(w, LAYER + 1, w.layer_rate[1], acts, t, span, x, y)
    kink(w, LAYER + 2, w.layer_rate[2], acts, t, span, x, y)
    kink(w, LAYER + 3, w.layer_rate[3], acts, t, span, x, y)
    kink(w, LAYER + 4, w.layer_rate[4], acts, t, span, x, y)
    kink(w, LAYER + 5, w.layer_rate[5], acts, t, span, x, y)


@inlined
def gather_branch(w, n, span):
    """Add to the sums over branches what the flux falls short of for branch n, without and by
    ampere of 2 (j - i_0), over the segment (s)."""
    for j in range(w.psi_alpha.size):
        per = 1.0 / (span * w.layer_rate[n, j])
        first, second = w.first[LAYER + n, j], w.second[LAYER + n, j]
        in_middle = w.layer_r[n, j] * (0.75 * second - 0.25 * first)
        in_mean = 0.5 * w.layer_r[n, j] * second
        d_alpha, d_beta = w.i_alpha[j] - w.layer_alpha[n, j], w.i_beta[j] - w.layer_beta[n, j]
        w.by_middle[j] += in_middle * per
        w.by_mean[j] += in_mean * per
        w.middle_alpha[j] -= in_middle * d_alpha
        w.middle_beta[j] -= in_middle * d_beta
        w.mean_alpha[j] -= in_mean * d_alpha
        w.mean_beta[j] -= in_mean * d_beta


@kernel
def gather_layers(w, span):
    """Write these sums."""
    for j in range(w.psi_alpha.size):
        w.by_middle[j] = w.middle_alpha[j] = w.middle_beta[j] = 0.0
        w.by_mean[j] = w.mean_alpha[j] = w.mean_beta[j] = 0.0
    gather_branch(w, 0, span)
    gather_branch(w, 1, span)
    gather_branch(w, 2, span)
    gather_branch(w, 3, span)
    gather_branch(w, 4, span)
    gather_branch(w, 5, span)


@kernel
def settle_layers(w, span):
    """Take from the current in the middle what the branches' drops keep from it."""
    for j in range(w.psi_alpha.size):
        e_alpha, e_beta = 2.0 * (w.j_alpha[j] - w.i_alpha[j]), 2.0 * (w.j_beta[j] - w.i_beta[j])
        # j less what it was: x = - G S (what the drops at j + R x/4 leave out), a 2 x 2 system
        a = span * (w.middle_alpha[j] + w.by_middle[j] * e_alpha)
        b = span * (w.middle_beta[j] + w.by_middle[j] * e_beta)
        k = span * (2.0 * w.by_middle[j] + 0.25 * w.resistance[j])
        s_aa, s_ab, s_bb = w.stiff_aa[j], w.stiff_ab[j], w.stiff_bb[j]
        f_alpha, f_beta = s_aa * a + s_ab * b, s_ab * a + s_bb * b
        p, q, m = 1.0 + k * s_aa, 1.0 + k * s_bb, k * s_ab
        over = 1.0 / (p * q - m * m)
        x_alpha, x_beta = over * (m * f_beta - q * f_alpha), over * (m * f_alpha - p * f_beta)
        w.j_alpha[j], w.j_beta[j] = w.j_alpha[j] + x_alpha, w.j_beta[j] + x_beta
        # the mean current's share of it
        e_alpha, e_beta = e_alpha + 2.0 * x_alpha, e_beta + 2.0 * x_beta
        third = THIRD * w.resistance[j]
        a = span * (w.mean_alpha[j] + w.by_mean[j] * e_alpha + third * x_alpha)
        b = span * (w.mean_beta[j] + w.by_mean[j] * e_beta + third * x_beta)
        y_alpha, y_beta = -(s_aa * a + s_ab * b), -(s_ab * a + s_bb * b)
        # what the last segment took too much comes back
        w.fall_alpha[j] += w.resistance[j] * y_alpha - w.over_alpha[j] / span
        w.fall_beta[j] += w.resistance[j] * y_beta - w.over_beta[j] / span
        w.over_alpha[j] = w.over_beta[j] = 0.0
        w.swell_alpha[j] += y_alpha - x_alpha
        w.swell_beta[j] += y_beta - x_beta


@inlined
def fall_branch(w, n, span):
    """Add the mean drop of branch n over the segment (s)."""
    for j in range(w.psi_alpha.size):
        first, per = w.first[LAYER + n, j], 1.0 / (span * w.layer_rate[n, j])
        d_alpha, d_beta = w.i_alpha[j] - w.layer_alpha[n, j], w.i_beta[j] - w.layer_beta[n, j]
        bend_alpha, bend_beta = bend(w, j, 0.5 * span)
        k_alpha, k_beta = stiff(
            w,
            j,
            w.kink_alpha[LAYER + n, j] - 4.0 * first * bend_alpha,
            w.kink_beta[LAYER + n, j] - 4.0 * first * bend_beta,
        )
        square = 12.0 * (w.second[LAYER + n, j] - 0.5 * first)
        b_alpha = 2.0 * per * (w.j_alpha[j] - w.i_alpha[j]) - d_alpha
        b_beta = 2.0 * per * (w.j_beta[j] - w.i_beta[j]) - d_beta
        bent_alpha = per * (square * w.swell_alpha[j] + k_alpha)
        bent_beta = per * (square * w.swell_beta[j] + k_beta)
        v_alpha = w.layer_r[n, j] * (d_alpha + first * b_alpha + bent_alpha)
        v_beta = w.layer_r[n, j] * (d_beta + first * b_beta + bent_beta)
        w.fall_alpha[j], w.fall_beta[j] = w.fall_alpha[j] + v_alpha, w.fall_beta[j] + v_beta
        w.over_alpha[j] += span * v_alpha
        w.over_beta[j] += span * v_beta


@kernel
def layers_in_middle(w, span):
    """Take from the current in the middle what the branches' drops keep from it, and add the mean
    of these drops."""
    gather_layers(w, span)
    settle_layers(w, span)
    fall_branch(w, 0, span)
    fall_branch(w, 1, span)
    fall_branch(w, 2, span)
    fall_branch(w, 3, span)
    fall_branch(w, 4, span)
    fall_branch(w, 5, span)


@inlined
def bow(w, j, h):
    """Return by how much more than a straight drop's the flux (Wb) has fallen h (s) into a
    segment: each branch's drop goes to its mean as it does, fast ones sooner."""
    n_0, out_alpha, out_beta = h * w.span_inv[j], 0.0, 0.0
    rise_alpha = 2.0 * w.span_inv[j] * (w.j_alpha[j] - w.i_alpha[j])
    rise_beta = 2.0 * w.span_inv[j] * (w.j_beta[j] - w.i_beta[j])
    for n in range(BRANCHES):
        rate, whole = w.layer_rate[n, j], n_0 * w.first[LAYER + n, j]
        r = w.layer_r[n, j]
        d_alpha, d_beta = w.i_alpha[j] - w.layer_alpha[n, j], w.i_beta[j] - w.layer_beta[n, j]
        gone, first, _ = lag_moments(h * rate)
        per, line = 1.0 / rate, h * (1.0 - whole)
        grown = h * (first - whole) * per
        out_alpha += r * ((per * gone - line) * d_alpha + grown * rise_alpha)
        out_beta += r * ((per * gone - line) * d_beta + grown * rise_beta)
    return out_alpha, out_beta
