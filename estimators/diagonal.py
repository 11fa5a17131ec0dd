"""One step of the estimators that inject 45 degrees beside the estimated d axis and compare one
number of the ripple.

Along an axis at phi from d of a motor with mean inverse inductance S and half difference D of both
axes (1/H), one Wb of flux ripple makes a current ripple of
  S + D cos 2 phi              along it (`vesc_hfi`),
  sqrt(S^2 + D^2 + 2 S D cos 2 phi)   in size (`hfi45`),
which at phi = 45 degrees - e change most with the error e.  What a belief expects at the mean
current, with resistance and speed to first order, is the ripple of `inversion`; its difference over
its slope drives the tracking loop.
"""

from __future__ import annotations

import math

from estimators.believed import damped, trust
from estimators.contract import Estimate
from estimators.demodulation import AXIS, FREE, OMEGA, PHASE, blank, demodulate
from estimators.inversion import DELTA, believed_ripple
from estimators.startup import TRACKING, start, tell
from estimators.tracking import correct, predict
from model.compiled import kernel

ALONG, SIZE = True, False  # which number of the ripple is compared
DIAGONAL = 0.25 * math.pi
SEEN = FREE  # samples since starting up
# injection periods: the axis turns by 45 degrees at once, which leaves a step of the mean current
# to decay
WAIT = 4


@kernel
def compared(y_d, y_q, which):
    """Return the number of a ripple (1/H, in the injection's frame) that is compared: ALONG or
    SIZE."""
    return y_d if which else math.hypot(y_d, y_q)


@kernel
def expected(state, mean_d, mean_q, e, belief, tuning, which):
    """Return that number (1/H) as a belief expects it at an error e (rad).

    mean_d, mean_q: A, as seen from the injection's axis.
    """
    d, q = believed_ripple(state, mean_d, mean_q, e - DIAGONAL, belief, tuning)
    return compared(d, q, which)


@kernel
def diagonal_step(state, sample, belief, tuning, which):
    """Take one sample; see the module's text."""
    if state[PHASE] != TRACKING:
        return start(state, sample, belief, tuning)
    angle = predict(state, tuning)
    mean_d, mean_q, y_d, y_q = demodulate(state, sample, angle + DIAGONAL, state[OMEGA], tuning)
    here = expected(state, mean_d, mean_q, 0.0, belief, tuning, which)
    more = expected(state, mean_d, mean_q, DELTA, belief, tuning, which)
    less = expected(state, mean_d, mean_q, -DELTA, belief, tuning, which)
    slope = (more - less) / (2.0 * DELTA)
    if state[SEEN] < WAIT * tuning.period:
        # until the window holds this axis alone, the mean at rest
        state[SEEN] += 1.0
    else:
        correct(
            state,
            damped(slope * (compared(y_d, y_q, which) - here), slope * slope, belief.energy),
            tuning,
        )
    peak = tuning.amplitude * tuning.peak
    axis = state[AXIS] + DIAGONAL
    return Estimate(state[AXIS], state[OMEGA], axis, 0.0, trust(state), y_d * peak, y_q * peak, 1.0)


def init(belief, tuning, angle=None):
    """Return the state before starting up, or ready to track from a known angle (rad)."""
    return tell(blank(1), angle)
