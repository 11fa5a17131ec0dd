"""Inversion of the ripple at low speed, flux observer at high speed, handed over by the estimated
speed.

One tracking loop takes (1 - w) e_injection + w e_flux; w rises linearly between the speed whose
back-EMF is half the voltage that rated current drops in the resistance, and twice that: below, an
error of a few percent in R would be an error of degrees.  While injection leads, the flux of the
voltage is drawn to that of the current wholly, so that the hand-over finds it ready.  Beyond the
hand-over nothing reads the ripple and injection fades out with speed.
"""

from __future__ import annotations

from estimators.active_flux import OWN, observe
from estimators.believed import tracked
from estimators.contract import STEP, Estimator
from estimators.demodulation import AXIS, OMEGA, PHASE, blank, demodulate
from estimators.inversion import believed_error
from estimators.startup import TRACKING, start, tell
from estimators.tracking import correct, predict
from model.compiled import kernel, kernel_as

BEGIN = 0.5  # back-EMF over R x rated current where the hand-over begins; it ends at twice that


@kernel
def share(omega, belief, tuning):
    """Return w, the flux observer's share, at a speed (rad/s)."""
    first = BEGIN * belief.resistance * tuning.bias / belief.magnet_flux
    return min(max(abs(omega) / first - 1.0, 0.0), 1.0)


@kernel
def wanted(omega, belief, tuning):
    """Return the share of injection wanted: all up to the end of the hand-over, none from half as
    much again on."""
    first = BEGIN * belief.resistance * tuning.bias / belief.magnet_flux
    return min(max(3.0 - abs(omega) / first, 0.0), 1.0)


@kernel_as(STEP)
def step(state, sample, belief, tuning):
    """Take one sample; see the module's text."""
    if state[PHASE] != TRACKING:
        return start(state, sample, belief, tuning)
    axis = predict(state, tuning)
    w = share(state[OMEGA], belief, tuning)
    flux_error = observe(state, sample, 1.0 - w, belief, tuning)
    mean_d, mean_q, y_d, y_q = demodulate(state, sample, axis, state[OMEGA], tuning)
    ripple_error = (
        believed_error(state, mean_d, mean_q, y_d, y_q, belief, tuning) if w < 1.0 else 0.0
    )
    correct(state, (1.0 - w) * ripple_error + w * flux_error, tuning)
    return tracked(state, state[AXIS], y_d, y_q, tuning, wanted(state[OMEGA], belief, tuning))


def init(belief, tuning, angle=None):
    """Return the state before starting up, or ready to track from a known angle (rad)."""
    return tell(blank(OWN), angle)


ESTIMATOR = Estimator(
    "hybrid",
    "inversion of the ripple at low, flux observer at high speed, handed over by speed",
    init,
    step,
    type_2=False,
    delay="0.75 N - 0.5 samples of demodulation at low, none at high speed",
    speeds="all; the hand-over lies between 0.5 and 1 times R x rated current / magnet flux",
    source="Piippo, Hinkkanen, Luomi, IEEE Trans. Ind. Electron. 55 (2008) (adaptive observer "
    "with fading injection)",
)
