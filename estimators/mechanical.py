"""The inversion of both ripple components, tracked by a mechanical observer: believed torque and
inertia go ahead.

  d theta / dt = omega + l1 e,   d omega / dt = p/J (T(i) - T_load) + l2 e,   d T_load / dt = -l3 e,
so that a change of the motor's own torque needs no error to be followed; a change of load does.  A
wrong inertia, or a rotor held from outside, is taken up by the load torque.
"""

from __future__ import annotations

from estimators.believed import tracked
from estimators.contract import STEP, Estimator
from estimators.demodulation import AXIS, FLUX_D, FLUX_Q, OMEGA, PHASE, blank, demodulate
from estimators.inversion import believed_error
from estimators.startup import TRACKING, start, tell
from estimators.tracking import correct_mechanical, predict
from model.compiled import kernel_as
from model.energy import torque


@kernel_as(STEP)
def step(state, sample, belief, tuning):
    """Take one sample; see the module's text."""
    if state[PHASE] != TRACKING:
        return start(state, sample, belief, tuning)
    axis = predict(state, tuning)
    mean_d, mean_q, y_d, y_q = demodulate(state, sample, axis, state[OMEGA], tuning)
    error = believed_error(state, mean_d, mean_q, y_d, y_q, belief, tuning)
    driving = torque(
        belief.energy, state[FLUX_D], state[FLUX_Q], belief.magnet_flux, belief.pole_pairs
    )
    correct_mechanical(state, error, driving, belief, tuning)
    return tracked(state, state[AXIS], y_d, y_q, tuning)


def init(belief, tuning, angle=None):
    """Return the state before starting up, or ready to track from a known angle (rad)."""
    return tell(blank(), angle)


ESTIMATOR = Estimator(
    "mechanical",
    "inversion of both ripple components, tracked by a mechanical observer",
    init,
    step,
    type_2=False,
    delay="0.75 N - 0.5 samples of demodulation; none on the motor's own torque",
    speeds="0 to where the current loop behind the injection's average holds",
    source="Lorenz, Van Patten, IEEE Trans. Ind. Appl. 27 (1991) 701; error signal of `inversion`",
)
