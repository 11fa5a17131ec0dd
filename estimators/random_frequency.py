"""Random frequency: a square wave along the estimated d axis whose cycles have one of two lengths,
drawn by lot.

The drive's injection period N and half of it follow each other at random, each in a random sense,
so that the injection's energy lies in no line: it hisses and does not whistle.  (In one sense alone
a line would be left at twice the frequency, of (1/3)^2 of a square wave's, as short cycles take a
third of the time and all have one phase.)

A cycle of M samples, M a multiple of four, begins in the middle of a pulse (+ for M/4, - for M/2, +
for M/4), where the flux ripple is zero, so that cycles of either length and sense join without a
step of its mean; one of two samples is + -.  The drive's own square wave is turned by half a turn
where its sign differs.

The ripple is the least-squares slope of the current on the flux ripple F of the signs that were
sent, over three half periods, beside a constant and a straight line: exact for a steady ripple on a
linear trend, as the usual windows are, whatever the cycles.  Angle from it as in `qnull`.  Its
correction for resistance at speed is that of the long cycle, which has nine tenths of the power.

Needs a square waveform of four samples a period, or eight, twelve, ...
"""

from __future__ import annotations

import math

from estimators.believed import trust
from estimators.contract import RANDOM, STEP, Estimate, Estimator
from estimators.demodulation import (
    AXIS,
    CURSOR,
    FREE,
    OFFSET,
    OMEGA,
    PHASE,
    RING_ALPHA,
    RING_BETA,
    RING_C,
    RING_F,
    RING_S,
    blank,
)
from estimators.qnull import believed_null
from estimators.startup import TRACKING, start, tell
from estimators.tracking import correct, predict
from model.compiled import kernel, kernel_as

# place in the drive's own period at t_k; flux ripple (s) of what acted up to t_k; signs asked for
# last, and before; place and length of the cycle, its sense; the lot; samples since starting up
TURN, FLUX, SIGN, ACTING, PLACE, LENGTH, SENSE, LOT, SEEN = range(FREE, FREE + 9)
# Park, Miller, Comm. ACM 31 (1988) 1192
FIRST_LOT, FACTOR, MODULUS = 20161201.0, 16807.0, 2147483647.0


@kernel
def drawn(state):
    """Return an evenly distributed number in (0, 1), by the minimal standard generator: exact in
    doubles."""
    state[LOT] = (FACTOR * state[LOT]) % MODULUS
    return state[LOT] / MODULUS


@kernel
def next_sign(state, n):
    """Return the sign of the next sample, and begin another cycle where one ends."""
    if state[PLACE] >= state[LENGTH]:
        state[PLACE], state[LENGTH] = 0.0, float(n if drawn(state) < 0.5 else n // 2)
        state[SENSE] = 1.0 if drawn(state) < 0.5 else -1.0
    at, length = int(state[PLACE]), int(state[LENGTH])
    state[PLACE] += 1.0
    if length % 4:
        return state[SENSE] if at < length // 2 else -state[SENSE]
    return -state[SENSE] if length // 4 <= at < length - length // 4 else state[SENSE]


@kernel
def demodulated(state, sample, axis, omega, tuning):
    """Take one sample; return mean_d, mean_q (A) and ripple y_d, y_q (1/H) in the axis' frame.

    As `demodulation.demodulate`, on the ripple F of the signs sent in place of the carrier.
    """
    n, h = 3 * (tuning.period // 2), tuning.sampling_period
    newest = int(state[CURSOR])
    state[RING_ALPHA + newest], state[RING_BETA + newest] = sample.i_alpha, sample.i_beta
    state[RING_F + newest] = state[FLUX]
    state[RING_C + newest], state[RING_S + newest] = math.cos(axis), math.sin(axis)
    state[CURSOR] = (newest + 1) % n
    dc, ds = math.cos(h * omega), math.sin(h * omega)
    mean_f = trend = 0.0
    for k in range(n):  # from the newest sample back
        f = state[RING_F + (newest - k) % n]
        mean_f += f / n
        trend += f * (k - 0.5 * (n - 1))
    trend /= n * (n * n - 1.0) / 12.0
    c, s = state[RING_C + newest], state[RING_S + newest]
    mean_d = mean_q = y_d = y_q = power = 0.0
    for k in range(n):
        j = (newest - k) % n
        f = state[RING_F + j] - mean_f - trend * (k - 0.5 * (n - 1))
        a, b = state[RING_ALPHA + j], state[RING_BETA + j]
        mean_d += (c * a + s * b) / n
        mean_q += (c * b - s * a) / n
        power += f * f
        c, s = c * dc + s * ds, s * dc - c * ds
    c, s = state[RING_C + newest], state[RING_S + newest]
    for k in range(n):
        j = (newest - k) % n
        f = state[RING_F + j] - mean_f - trend * (k - 0.5 * (n - 1))
        r_alpha = state[RING_ALPHA + j] - (c * mean_d - s * mean_q)
        r_beta = state[RING_BETA + j] - (s * mean_d + c * mean_q)
        v_c, v_s = (c, s) if tuning.present else (state[RING_C + j], state[RING_S + j])
        y_d += f * (v_c * r_alpha + v_s * r_beta)
        y_q += f * (v_c * r_beta - v_s * r_alpha)
        c, s = c * dc + s * ds, s * dc - c * ds
    scale = 1.0 / (tuning.amplitude * max(power, 1e-6 * tuning.power))
    return mean_d, mean_q, y_d * scale, y_q * scale


@kernel_as(STEP)
def step(state, sample, belief, tuning):
    """Take one sample; see the module's text."""
    n, h = tuning.period, tuning.sampling_period
    # the primitive starts lowest
    state[TURN] = 0.0 if sample.carrier < -0.999 * tuning.peak else state[TURN] + 1.0
    if state[PHASE] != TRACKING:
        return start(state, sample, belief, tuning)
    axis = predict(state, tuning)
    # what was asked for at t_(k-2) acts over the interval that ends at t_k
    state[FLUX] += h * state[ACTING]
    mean_d, mean_q, y_d, y_q = demodulated(state, sample, axis, state[OMEGA], tuning)
    state[OFFSET], slope = believed_null(state, mean_d, mean_q, belief, tuning)
    if state[SEEN] < 2 * n:  # until the window holds these signs alone
        state[SEEN] += 1.0
    else:
        correct(state, y_q / slope, tuning)
    state[ACTING], state[SIGN] = state[SIGN], next_sign(state, n)
    # the drive's wave over the interval that begins at t_k+1
    own = 1.0 if (state[TURN] + 1.0) % n < n // 2 else -1.0
    inject = state[AXIS] + (0.0 if own == state[SIGN] else math.pi)
    size = tuning.amplitude * tuning.peak
    theta = state[AXIS] + state[OFFSET]
    return Estimate(theta, state[OMEGA], inject, 0.0, trust(state), y_d * size, y_q * size, 1.0)


def init(belief, tuning, angle=None):
    """Return the state before starting up, or ready to track from a known angle (rad)."""
    state = blank(9)
    state[LOT] = FIRST_LOT
    return tell(state, angle)


ESTIMATOR = Estimator(
    "random_frequency",
    "square wave of random frequency and sense, null of the ripple across it",
    init,
    step,
    injection=RANDOM,
    delay="0.75 N - 0.5 samples of demodulation (N samples of the longer cycle)",
    speeds="0 to where the current loop behind the injection's average holds",
    source="Wang, Yang, Yuan, Wang, Zhang, Xu, IEEE Trans. Ind. Electron. 63 (2016) 7423 "
    "(two frequencies at random, cycle by cycle); Zhang, Wang, Xu, IEEE Trans. Ind. Electron. 65 "
    "(2018) (random phase); least squares derived here",
)
