"""Injection 45 degrees beside the estimated d axis, the ripple along the injection: VESC's second and third HFI.

Along an axis at phi from d, one Wb of flux ripple along it makes a current ripple of
  G(phi) = S + D cos 2 phi,    S = (1/L_d + 1/L_q)/2,  D = (1/L_d - 1/L_q)/2,
along it, which at phi = 45 degrees - e is S + D sin 2e.  The firmware therefore takes
  e = (G - S) / (1/L_d - 1/L_q)
for the error, with inductances that its configuration states: one current difference between two samples, one division.
Here S and the slope are what a belief expects at the mean current, with resistance and speed to first order
(`inversion`); with a linear belief that is the firmware's equation.  As with `hfi45` inductances have to be known to a
part of the saliency: both x percent off turn the angle by S/(2 D) x percent of a rad.

What of the family is elsewhere: its first version turns the injection and reads the second harmonic of the answers over
a turn (`rotating`); its fourth and fifth inject along d and read the q ripple (`qnull`, at half the sampling rate).
Left out: its own loop (in the published defaults a proportional gain of 4000 and an integral one of 10 a sample, times
0.3), limits by another observer's speed, the change of the axis' side with the sign of the current.
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
    """Return the ripple along the injection (1/H) that a belief expects at an error e (rad).

    mean_d, mean_q: A, as seen from the injection's axis.
    """
    return believed_ripple(state, mean_d, mean_q, e - BESIDE, belief, tuning)[0]


@kernel_as(STEP)
def step(state, sample, belief, tuning):
    """Take one sample; see the module's text."""
    if state[PHASE] != TRACKING:
        return start(state, sample, belief, tuning)
    angle = predict(state, tuning)
    mean_d, mean_q, y_d, y_q = demodulate(state, sample, angle + BESIDE, state[OMEGA], tuning)
    along = expected(state, mean_d, mean_q, 0.0, belief, tuning)
    more = expected(state, mean_d, mean_q, DELTA, belief, tuning)
    less = expected(state, mean_d, mean_q, -DELTA, belief, tuning)
    slope = (more - less) / (2.0 * DELTA)
    if state[SEEN] < WAIT * tuning.period:  # until the window holds this axis alone, the mean at rest
        state[SEEN] += 1.0
    else:
        correct(state, damped(slope * (y_d - along), slope * slope, belief.energy), tuning)
    peak = tuning.amplitude * tuning.peak
    axis = state[AXIS] + BESIDE
    return Estimate(state[AXIS], state[OMEGA], axis, 0.0, trust(state), y_d * peak, y_q * peak, 1.0)


def init(belief, tuning, angle=None):
    """Return the state before starting up, or ready to track from a known angle (rad)."""
    return tell(blank(1), angle)


ESTIMATOR = Estimator(
    "vesc_hfi", "pulsating injection 45 degrees beside d, angle of the ripple along it", init, step,
    delay="0.75 N - 0.5 samples of demodulation (N samples an injection period)",
    speeds="0 to where the current loop behind the injection's average holds; torque ripple from the q injection",
    source="VESC firmware (Vedder), sensor modes HFI V2 and V3, by their equation (precalculated values of foc_math.c: "
    "half the sum of 1/L_d and 1/L_q, and 1/L_q - 1/L_d); belief, resistance and speed derived here",
)  # fmt: skip
