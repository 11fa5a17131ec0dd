"""The inversion of both ripple components, tracked by a phase-locked loop of type 3: no lag on a
ramp of speed."""

from __future__ import annotations

from estimators.believed import tracked
from estimators.contract import STEP, Estimator
from estimators.demodulation import AXIS, OMEGA, PHASE, blank, demodulate
from estimators.inversion import believed_error
from estimators.startup import TRACKING, start, tell
from estimators.tracking import correct_type_3, predict
from model.compiled import kernel_as


@kernel_as(STEP)
def step(state, sample, belief, tuning):
    """Take one sample; see the module's text."""
    if state[PHASE] != TRACKING:
        return start(state, sample, belief, tuning)
    axis = predict(state, tuning)
    mean_d, mean_q, y_d, y_q = demodulate(state, sample, axis, state[OMEGA], tuning)
    correct_type_3(state, believed_error(state, mean_d, mean_q, y_d, y_q, belief, tuning), tuning)
    return tracked(state, state[AXIS], y_d, y_q, tuning)


def init(belief, tuning, angle=None):
    """Return the state before starting up, or ready to track from a known angle (rad)."""
    return tell(blank(), angle)


ESTIMATOR = Estimator(
    "pll3",
    "inversion of both ripple components, tracked by a loop of type 3",
    init,
    step,
    type_2=False,
    delay="0.75 N - 0.5 samples of demodulation (N samples an injection period)",
    speeds="0 to where the current loop behind the injection's average holds; no lag on a ramp",
    source="Gardner, Phaselock Techniques, 3rd ed., section 2.2 (third-order loop); error "
    "signal of `inversion`",
)
