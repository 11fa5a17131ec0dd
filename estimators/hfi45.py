"""Injection 45 degrees beside the estimated d axis: the size of the ripple alone tells the error.

Along an axis at phi from d of a motor with mean inverse inductance S and half difference D of both axes (1/H), one Wb
of flux ripple makes a current ripple of size
  |Gamma u| = sqrt(S^2 + D^2 + 2 S D cos 2 phi),
which at phi = 45 degrees - e changes most with the error e: by 2 S D sin 2e under the root.  Where other methods ask
for the direction of the ripple, one number is compared with the one that the belief expects; so the inductances have to
be known to a part of the saliency: if both are x percent off, the angle is (S^2 + D^2)/(2 S D) x percent of a rad off.
Half of the injection's power is along q, where it makes torque.  What a belief expects at the mean current, with
resistance and speed to first order, is the ripple of `inversion`.
"""

from __future__ import annotations

import math

from estimators.believed import damped, trust
from estimators.contract import STEP, Estimate, Estimator
from estimators.demodulation import AXIS, FREE, OMEGA, PHASE, blank, demodulate
from estimators.inversion import DELTA, believed_ripple
from estimators.startup import TRACKING, start, tell
from estimators.tracking import correct, predict
from model.compiled import kernel, kernel_as

BESIDE = 0.25 * math.pi
SEEN = FREE  # samples since starting up
WAIT = 4  # injection periods: the axis turns by 45 degrees at once, which leaves a step of the mean current to decay


@kernel
def expected(state, mean_d, mean_q, e, belief, tuning):
    """Return the size of the ripple (1/H) that a belief expects at an error e (rad).

    mean_d, mean_q: A, as seen from the injection's axis.
    """
    d, q = believed_ripple(state, mean_d, mean_q, e - BESIDE, belief, tuning)
    return math.hypot(d, q)


@kernel_as(STEP)
def step(state, sample, belief, tuning):
    """Take one sample; see the module's text."""
    if state[PHASE] != TRACKING:
        return start(state, sample, belief, tuning)
    angle = predict(state, tuning)
    mean_d, mean_q, y_d, y_q = demodulate(state, sample, angle + BESIDE, state[OMEGA], tuning)
    size = expected(state, mean_d, mean_q, 0.0, belief, tuning)
    more = expected(state, mean_d, mean_q, DELTA, belief, tuning)
    less = expected(state, mean_d, mean_q, -DELTA, belief, tuning)
    slope = (more - less) / (2.0 * DELTA)
    if state[SEEN] < WAIT * tuning.period:  # until the window holds this axis alone, the mean at rest
        state[SEEN] += 1.0
    else:
        correct(state, damped(slope * (math.hypot(y_d, y_q) - size), slope * slope, belief.energy), tuning)
    peak = tuning.amplitude * tuning.peak
    axis = state[AXIS] + BESIDE
    return Estimate(state[AXIS], state[OMEGA], axis, 0.0, trust(state), y_d * peak, y_q * peak, 1.0)


def init(belief, tuning, angle=None):
    """Return the state before starting up, or ready to track from a known angle (rad)."""
    return tell(blank(1), angle)


ESTIMATOR = Estimator(
    "hfi45", "pulsating injection 45 degrees beside d, angle of the ripple's size alone", init, step,
    delay="0.75 N - 0.5 samples of demodulation (N samples an injection period)",
    speeds="0 to where the current loop behind the injection's average holds; torque ripple from the q injection",
    source="the 45 degree injection of the open firmwares MESC and VESC by its principle; equations derived here",
)  # fmt: skip
