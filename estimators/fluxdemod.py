"""Flux-map demodulation: currents become fluxes through the believed map first, then the ripple is
demodulated.

Flux ripple lies along the injected voltage whatever the saturation, so in the right frame it has no
q component:
  y(e) = L(i) R(e) Gamma R(-e) (1, 0)  =  (1, 0)  at e = 0,    dy/de = L (J Gamma - Gamma J) (1, 0).
The believed map takes every sample, ripple included, so large ripple costs nothing.  But the map is
entered at the estimated angle, and y_q(e) has other zeros: second stable equilibria under load (see
LIMITS.md).
"""

from __future__ import annotations

from estimators.believed import believed_flux, trust
from estimators.contract import STEP, Estimate, Estimator, Sample
from estimators.demodulation import AXIS, OMEGA, PHASE, SLOW_OMEGA, blank, demodulate
from estimators.startup import TRACKING, start, tell
from estimators.tracking import correct, predict
from model.compiled import kernel, kernel_as
from model.energy import hessian
from model.frames import rotate


@kernel
def flux_slope(dd, dq, qq):
    """Return dy_q/de at e = 0 of a Hessian (1/H): row q of L times (-2 Gamma_dq,
    Gamma_dd - Gamma_qq)."""
    return (2.0 * dq * dq + dd * (dd - qq)) / (dd * qq - dq * dq)


@kernel_as(STEP)
def step(state, sample, belief, tuning):
    """Take one sample; see the module's text."""
    if state[PHASE] != TRACKING:
        return start(state, sample, belief, tuning)
    axis = predict(state, tuning)
    i_d, i_q = rotate(sample.i_alpha, sample.i_beta, -axis)
    phi_alpha, phi_beta = rotate(*believed_flux(state, belief.energy, i_d, i_q), axis)
    fluxes = Sample(phi_alpha, phi_beta, sample.u_alpha, sample.u_beta, sample.carrier)
    mean_d, mean_q, y_d, y_q = demodulate(state, fluxes, axis, state[OMEGA], tuning)
    dd, dq, qq = hessian(belief.energy, mean_d, mean_q)
    trace = dd + qq
    # what resistance takes: R^2 Gamma^2 and R omega trace(Gamma) J
    damped = tuning.lag * belief.resistance * trace
    y_q += damped * (belief.resistance * dq + state[SLOW_OMEGA])
    slope, least = (
        flux_slope(dd, dq, qq),
        0.05 * (belief.energy.gamma_d / belief.energy.gamma_q - 1.0),
    )
    if slope * least <= least * least:
        # the saliency has gone, or changed sign: hold that of zero current
        slope = 20.0 * least
    correct(state, y_q / slope, tuning)
    inductive = tuning.amplitude * tuning.peak
    r_d, r_q = (dd * y_d + dq * y_q) * inductive, (dq * y_d + qq * y_q) * inductive
    return Estimate(state[AXIS], state[OMEGA], state[AXIS], 0.0, trust(state), r_d, r_q, 1.0)


def init(belief, tuning, angle=None):
    """Return the state before starting up, or ready to track from a known angle (rad)."""
    return tell(blank(), angle)


ESTIMATOR = Estimator(
    "fluxdemod",
    "fluxes through the believed map, then null of the flux ripple across the injection",
    init,
    step,
    delay="0.75 N - 0.5 samples of demodulation (N samples an injection period)",
    speeds="0 to where the current loop behind the injection's average holds; started near the "
    "right angle",
    source="derived in the module's text from eqs. (id), (iq) of Jebai, Malrait, Martin, "
    "Rouchon, IEMDC 2011",
)
