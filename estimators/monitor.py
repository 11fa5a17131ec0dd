"""Inversion of both ripple components under a watch that tests other angles, and recovers.

Each sample tests one of M hypotheses e_j = 2 pi j/M: "the rotor stands e_j ahead of the estimate",
by the squared distance |y - S(e_j)|^2 between the ripple averaged over the last M samples and the
ripple believed there.  Filtered over sweeps, the hypothesis of least distance takes over once it
explains the ripple much better than any within the tracking loop's reach does, beyond noise, for
several sweeps. 0 and 180 degrees differ by saturation alone: with a linear belief, or without
current, the watch sees a lost axis but no wrong pole.
"""

from __future__ import annotations

import math

from estimators.believed import tracked
from estimators.contract import STEP, Estimator
from estimators.demodulation import (
    AXIS,
    FLUX_D,
    FLUX_Q,
    FREE,
    OMEGA,
    OUTSIDE,
    PHASE,
    blank,
    demodulate,
)
from estimators.inversion import believed_error, believed_ripple
from estimators.startup import TRACKING, start, tell
from estimators.tracking import correct, predict
from model.compiled import kernel, kernel_as

HYPOTHESES = 24
SWEEP, DOUBTS, WAITED = FREE, FREE + 1, FREE + 2
# mean_d, mean_q, y_d, y_q: summed over this sweep, averaged over the last
SUM, SEEN = FREE + 3, FREE + 7
DISTANCE = FREE + 11
OWN = 11 + HYPOTHESES
KEEP = 0.7  # of a distance, from sweep to sweep
BETTER = 4.0  # a hypothesis must be this many times nearer
NOISE = 25.0  # and the present one this many variances of the ripple away
MATERIAL = 0.04  # and this share of the saliency at zero current
NEAREST = 4  # hypotheses within 60 degrees are the tracking loop's own business
SWEEPS = 6  # in a row


@kernel
def distance(state, mean_d, mean_q, y_d, y_q, e, belief, tuning):
    """Return |y - S(e)|^2 in 1/H^2; a large number where the belief has no flux."""
    d, q, outside = state[FLUX_D], state[FLUX_Q], state[OUTSIDE]
    state[FLUX_D] = state[FLUX_Q] = 0.0
    s_d, s_q = believed_ripple(state, mean_d, mean_q, e, belief, tuning)
    failed = state[OUTSIDE] != 0.0
    state[FLUX_D], state[FLUX_Q], state[OUTSIDE] = d, q, outside
    if failed:
        return 1e12
    return (y_d - s_d) ** 2 + (y_q - s_q) ** 2


@kernel
def watch(state, mean_d, mean_q, y_d, y_q, belief, tuning):
    """Test one hypothesis; return the angle (rad) to jump by, 0 mostly."""
    if state[WAITED] < 4 * tuning.period:
        # until the window holds tracking alone, after a jump, too
        state[WAITED] += 1.0
        return 0.0
    j = int(state[SWEEP])
    state[SUM] += mean_d / HYPOTHESES
    state[SUM + 1] += mean_q / HYPOTHESES
    state[SUM + 2] += y_d / HYPOTHESES
    state[SUM + 3] += y_q / HYPOTHESES
    if state[SEEN + 2] != 0.0:
        e = 2.0 * math.pi * j / HYPOTHESES
        now = distance(
            state, state[SEEN], state[SEEN + 1], state[SEEN + 2], state[SEEN + 3], e, belief, tuning
        )
        state[DISTANCE + j] += (1.0 - KEEP) * (now - state[DISTANCE + j])
    state[SWEEP] = (j + 1) % HYPOTHESES
    if state[SWEEP] != 0.0:
        return 0.0
    for k in range(4):
        state[SEEN + k], state[SUM + k] = state[SUM + k], 0.0
    best = 0
    for k in range(NEAREST, HYPOTHESES - NEAREST + 1):
        if state[DISTANCE + k] < state[DISTANCE + best]:
            best = k
    variance = tuning.current_variance / (tuning.amplitude * tuning.amplitude * tuning.power)
    own = state[DISTANCE]
    for k in range(1, NEAREST):  # what a lag of the tracking loop explains is no doubt
        own = min(own, state[DISTANCE + k], state[DISTANCE + HYPOTHESES - k])
    least = max(NOISE * variance, (MATERIAL * (belief.energy.gamma_d - belief.energy.gamma_q)) ** 2)
    doubtful = best != 0 and own > BETTER * state[DISTANCE + best] and own > least
    state[DOUBTS] = state[DOUBTS] + 1.0 if doubtful else 0.0
    if state[DOUBTS] < SWEEPS:
        return 0.0
    state[DOUBTS] = state[WAITED] = 0.0
    for k in range(OWN - 3):  # sums, averages and distances belong to the old angle
        state[SUM + k] = 0.0
    return 2.0 * math.pi * best / HYPOTHESES


@kernel_as(STEP)
def step(state, sample, belief, tuning):
    """Take one sample; see the module's text."""
    if state[PHASE] != TRACKING:
        return start(state, sample, belief, tuning)
    axis = predict(state, tuning)
    mean_d, mean_q, y_d, y_q = demodulate(state, sample, axis, state[OMEGA], tuning)
    correct(state, believed_error(state, mean_d, mean_q, y_d, y_q, belief, tuning), tuning)
    jump = watch(state, mean_d, mean_q, y_d, y_q, belief, tuning)
    if jump != 0.0:
        state[AXIS] += jump
        state[OMEGA] = 0.0
    return tracked(state, state[AXIS], y_d, y_q, tuning)


def init(belief, tuning, angle=None):
    """Return the state before starting up, or ready to track from a known angle (rad)."""
    return tell(blank(OWN), angle)


ESTIMATOR = Estimator(
    "monitor",
    "inversion under a watch: hypothesis test of other angles, 180 degrees among them, "
    "and recovery",
    init,
    step,
    delay="as inversion; a lost lock is mended after about 6 sweeps of 24 samples",
    speeds="as inversion; the wrong pole shows under load, with a saturated belief",
    source="multiple hypotheses by squared residuals: Bar-Shalom, Li, Kirubarajan, Estimation "
    "(2001), section 11",
)
