"""Arithmetic for many parameter sets side by side: what compilers turn into vector code.

No library call and no branch: a loop over lanes that uses these stays a vector loop.  Strict IEEE
arithmetic: a set's numbers do not depend on its lane, its batch or the thread.
"""

from __future__ import annotations

import math

from model.compiled import inlined

HALF_PI = 0.5 * math.pi
PI_HIGH, PI_LOW = 1.5707963267341256, 6.077100506506192e-11  # pi/2 in two parts
SHORT_TURN = 0.25  # rad
SERIES_BELOW = 0.25  # of step over time constant: there the lag's closed form would lose digits


@inlined
def sine_cosine(x):
    """Return sin x, cos x (|x| below 1e5, error below 1e-15 or so)."""
    n = math.floor(x * (1.0 / HALF_PI) + 0.5)
    r = (x - n * PI_HIGH) - n * PI_LOW
    s, c = small_sine_cosine(r)
    turn = n - 4.0 * math.floor(0.25 * n)
    swap = (turn == 1.0) | (turn == 3.0)
    sine, cosine = (c if swap else s), (s if swap else c)
    return (-sine if turn >= 2.0 else sine), (-cosine if (turn == 1.0) | (turn == 2.0) else cosine)


@inlined
def small_sine_cosine(r):
    """Return sin r, cos r for |r| <= pi/4 (error below 1e-15), to 1e-7 up to |r| = 2."""
    a = r * r
    s = 1.0 / 6227020800.0 - a / 1307674368000.0
    s = r * (
        1.0
        - a
        * (
            1.0 / 6
            - a * (1.0 / 120 - a * (1.0 / 5040 - a * (1.0 / 362880 - a * (1.0 / 39916800 - a * s))))
        )
    )
    c = 1.0 / 479001600.0 - a * (1.0 / 87178291200.0 - a / 20922789888000.0)
    c = 1.0 - a * (
        0.5 - a * (1.0 / 24 - a * (1.0 / 720 - a * (1.0 / 40320 - a * (1.0 / 3628800 - a * c))))
    )
    return s, c


@inlined
def turned(c, s, angle):
    """Return cos and sin of an angle of cos c, sin s turned on by a small angle (rad)."""
    n, m = small_sine_cosine(angle)
    return c * m - s * n, s * m + c * n


@inlined
def turned_a_little(c, s, angle):
    """Return the same quickly for |angle| below SHORT_TURN (error below 1e-13): pairwise sums,
    little latency."""
    a = angle * angle
    b = a * a
    m = (1.0 - 0.5 * a) + b * (
        (1.0 / 24 - a * (1.0 / 720)) + b * (1.0 / 40320 - a * (1.0 / 3628800))
    )
    n = angle * ((1.0 - a * (1.0 / 6)) + b * ((1.0 / 120 - a * (1.0 / 5040)) + b * (1.0 / 362880)))
    return c * m - s * n, s * m + c * n


@inlined
def fading(x):
    """Return exp(x) for x <= 0: relative error below 1e-13 down to exp(-8), absolute beyond."""
    y = max(x, -60.0) * (1.0 / 64.0)
    y_2 = y * y
    y_4 = y_2 * y_2
    # the series to y^11, its parts side by side: less to wait for
    e = 1.0 + y + y_2 * (1.0 / 2 + y * (1.0 / 6))
    e += y_4 * (1.0 / 24 + y * (1.0 / 120) + y_2 * (1.0 / 720 + y * (1.0 / 5040)))
    e += (
        y_4
        * y_4
        * (1.0 / 40320 + y * (1.0 / 362880) + y_2 * (1.0 / 3628800 + y * (1.0 / 39916800)))
    )
    e *= e
    e *= e
    e *= e
    e *= e
    e *= e
    return e * e


@inlined
def soft_sign(x, shape):
    """Return the sign of a current over its half-width as it goes through zero: linear (shape 0) to
    tanh (1)."""
    e = fading(-2.0 * abs(x))
    tanh = (1.0 - e) / (1.0 + e)
    return (1.0 - shape) * min(max(x, -1.0), 1.0) + shape * (tanh if x >= 0.0 else -tanh)


@inlined
def lag_weights(zeroth, first, second):
    """Return of a first-order lag the weights of its input at a step's start, middle and end, the
    input a parabola through them, from the moments (`lag_moments`); they sum to the zeroth, which
    is one minus the decay."""
    return zeroth - 3.0 * first + 2.0 * second, 4.0 * (first - second), 2.0 * second - first


@inlined
def one_lag(gain, time_constant, more, other):
    """Return resistance and time constant (s) of two branches in series as one: each drops what its
    current has beside its lagged part.  Fast changes see the sum of the resistances, slow ones that
    of their products with the time constants.  In between, off by 6 % of the drop at most where the
    time constants are as 1 to 2, by 25 % at 1 to 4.

    A branch without gain is none; a negative gain is handed on as it is, to be refused
    (`sets.batch_of`).
    """
    both = gain + more
    if min(gain, more) < 0.0 or both == 0.0:
        return min(gain, more), 0.0
    if more == 0.0:
        return gain, time_constant
    if gain == 0.0:
        return more, other
    return both, (gain * time_constant + more * other) / both


@inlined
def one_branch(gain, time_constant, more, other):
    """Return conductance and time constant (s) of two branches across the slope of the flux, side
    by side, as one. Slow changes see the sum of the conductances, fast ones that of their quotients
    by the time constants.  In between, off as `one_lag`, of the current."""
    both, across = gain + more, gain * other + more * time_constant
    if min(gain, more) < 0.0 or both == 0.0:
        return min(gain, more), 0.0
    if more == 0.0:
        return gain, time_constant
    if gain == 0.0:
        return more, other
    return both, (both * time_constant * other / across if across > 0.0 else 0.0)


@inlined
def lag_moments(x):
    """Return of a lag, over a step of x time constants, the integrals over s in [0, 1] of x exp(-x
    (1 - s)) times 1, s, s^2; one minus the zeroth is the decay exp(-x).

    The closed forms divide differences by x; up to SERIES_BELOW a series stands in.
    """
    z = max(x, SERIES_BELOW)
    inverse, far_0 = 1.0 / z, 1.0 - fading(-z)
    far_1 = 1.0 - far_0 * inverse
    far_2 = 1.0 - 2.0 * far_1 * inverse
    near_0, near_1, near_2 = short_lag_moments(min(x, SERIES_BELOW))
    far = x > SERIES_BELOW
    return (far_0 if far else near_0), (far_1 if far else near_1), (far_2 if far else near_2)


@inlined
def short_lag_moments(x):
    """Return the same for x up to SERIES_BELOW: the second from its series 2 x sum of (-x)^k/(k +
    3)! up to k = 9 (of it, 1e-15 is left out), the others from it by parts, which divides
    nothing."""
    p = 1.0 / 181440 - x * (1.0 / 1814400 - x * (1.0 / 19958400 - x * (1.0 / 239500800)))
    p = 1.0 / 60 - x * (1.0 / 360 - x * (1.0 / 2520 - x * (1.0 / 20160 - x * p)))
    second = x * (1.0 / 3 - x * (1.0 / 12 - x * p))
    first = 0.5 * x * (1.0 - second)
    return x * (1.0 - first), first, second
