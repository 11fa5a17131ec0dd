"""q-null: inject along an axis, turn it until the ripple across it vanishes.

At the null the axis stands at the cross-saturation angle from the magnet.  The linear belief takes
it for the magnet; the saturated belief adds the angle its Hessian predicts at the measured current,
which makes axis and offset consistent with each other (the self-consistent offset).

At speed the resistance turns the null by lag R omega (Gamma_dd + Gamma_qq) Gamma_qq /
(Gamma_dd - Gamma_qq) rad (0.1 degree at 5 % of rated speed for `ipm_exchanged`, 0.25 for `ipm`),
which either belief adds.
"""

from __future__ import annotations

import math

from estimators.believed import believed_hessian, tracked
from estimators.contract import STEP, Estimator
from estimators.demodulation import AXIS, OFFSET, OMEGA, PHASE, SLOW_OMEGA, blank, demodulate
from estimators.startup import TRACKING, start, tell
from estimators.tracking import correct, predict
from model.compiled import kernel, kernel_as
from model.frames import rotate
from model.saliency import null_angle


@kernel
def believed_null(state, mean_d, mean_q, belief, tuning):
    """Return null angle (rad) and ripple slope (1/H) that the belief gives at the mean current of
    the axis frame."""
    e = belief.energy
    sign = 1.0 if e.gamma_d >= e.gamma_q else -1.0
    i_d, i_q = rotate(mean_d, mean_q, -state[OFFSET])  # into the estimated rotor frame
    dd, dq, qq = believed_hessian(state, e, i_d, i_q)
    slope = sign * math.hypot(dd - qq, 2.0 * dq)
    turned = tuning.lag * belief.resistance * state[SLOW_OMEGA] * (dd + qq) * qq / slope
    return null_angle(dd, dq, qq, sign) + turned, slope


@kernel_as(STEP)
def step(state, sample, belief, tuning):
    """Take one sample; see the module's text."""
    if state[PHASE] != TRACKING:
        return start(state, sample, belief, tuning)
    axis = predict(state, tuning)
    mean_d, mean_q, y_d, y_q = demodulate(state, sample, axis, state[OMEGA], tuning)
    state[OFFSET], slope = believed_null(state, mean_d, mean_q, belief, tuning)
    correct(state, y_q / slope, tuning)
    return tracked(state, state[AXIS] + state[OFFSET], y_d, y_q, tuning)


def init(belief, tuning, angle=None):
    """Return the state before starting up, or ready to track from a known angle (rad)."""
    return tell(blank(), angle)


ESTIMATOR = Estimator(
    "qnull",
    "pulsating injection, null of the ripple across it, phase-locked loop",
    init,
    step,
    delay="0.75 N - 0.5 samples of demodulation (N samples an injection period)",
    speeds="0 to where the current loop behind the injection's average holds",
    source="Jebai, Malrait, Martin, Rouchon, IEMDC 2011, section III; Linke, Kennel, Holtz, "
    "IEMDC 2003 (offset)",
)
