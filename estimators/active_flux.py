"""Flux observer for speed, no injection: the voltage's flux against the current's through the
believed map.

  psi_i(theta) = R(theta) (phi(R(-theta) i) + (phi_m, 0))            flux of the measured current
  d psi / dt   = u - R i + g n (n . (psi_i - psi)) + g' (psi_i - psi)  flux of the voltage
  e = (psi - psi_i) . a / |a|^2,   a = d psi_i / d theta = R(theta) (J (phi + (phi_m, 0)) - L J i)
a is the auxiliary flux: for a linear motor psi_m + (L_d - L_q) i_d, the active flux, along q.  The
flux of the voltage is drawn to that of the current across a (n the unit vector there), where the
angle does not show; along a only as far as the angle is known from elsewhere (g', in `hybrid`), for
there it carries the angle.

Below about a tenth of rated speed resistance and inverter errors exceed the back-EMF: not to be
used alone there.
"""

from __future__ import annotations

from estimators.believed import believed_flux, trust
from estimators.contract import NONE, STEP, Estimate, Estimator
from estimators.demodulation import AXIS, FREE, OMEGA, PHASE, blank
from estimators.startup import TRACKING, start, tell
from estimators.tracking import correct, predict
from model.compiled import kernel, kernel_as
from model.energy import hessian
from model.frames import rotate

PSI_ALPHA, PSI_BETA, LAST_ALPHA, LAST_BETA, BEGUN = range(FREE, FREE + 5)
OWN = 5
DRAWN = 0.25  # g over the tracking loop's kp


@kernel
def current_flux(state, i_alpha, i_beta, theta, belief):
    """Return psi_i (Wb) and a = d psi_i / d theta (Wb/rad), both alpha, beta."""
    i_d, i_q = rotate(i_alpha, i_beta, -theta)
    d, q = believed_flux(state, belief.energy, i_d, i_q)
    dd, dq, qq = hessian(belief.energy, d, q)
    det = dd * qq - dq * dq
    l_dd, l_dq, l_qq = qq / det, -dq / det, dd / det
    d += belief.magnet_flux
    a_d, a_q = -q - (-l_dd * i_q + l_dq * i_d), d - (-l_dq * i_q + l_qq * i_d)  # J i = (-i_q, i_d)
    p_alpha, p_beta = rotate(d, q, theta)
    a_alpha, a_beta = rotate(a_d, a_q, theta)
    return p_alpha, p_beta, a_alpha, a_beta


@kernel
def observe(state, sample, known, belief, tuning):
    """Advance the flux of the voltage to t_k; return the angle error e (rad) at state[AXIS].

    known: 0 to 1, how far the angle is known from elsewhere.
    """
    h, g = tuning.sampling_period, DRAWN * tuning.kp
    p_alpha, p_beta, a_alpha, a_beta = current_flux(
        state, sample.i_alpha, sample.i_beta, state[AXIS], belief
    )
    if state[BEGUN] == 0.0:
        state[BEGUN], state[PSI_ALPHA], state[PSI_BETA] = 1.0, p_alpha, p_beta
        state[LAST_ALPHA], state[LAST_BETA] = sample.i_alpha, sample.i_beta
        return 0.0
    i_alpha, i_beta = (
        0.5 * (state[LAST_ALPHA] + sample.i_alpha),
        0.5 * (state[LAST_BETA] + sample.i_beta),
    )
    state[LAST_ALPHA], state[LAST_BETA] = sample.i_alpha, sample.i_beta
    state[PSI_ALPHA] += h * (sample.u_alpha - belief.resistance * i_alpha)
    state[PSI_BETA] += h * (sample.u_beta - belief.resistance * i_beta)
    m_alpha, m_beta = state[PSI_ALPHA] - p_alpha, state[PSI_BETA] - p_beta
    square = max(a_alpha * a_alpha + a_beta * a_beta, (0.05 * belief.magnet_flux) ** 2)
    e = (m_alpha * a_alpha + m_beta * a_beta) / square
    along, across = g * known, max(g, 0.5 * abs(state[OMEGA]))
    x_alpha, x_beta = e * a_alpha, e * a_beta
    state[PSI_ALPHA] -= h * (along * x_alpha + across * (m_alpha - x_alpha))
    state[PSI_BETA] -= h * (along * x_beta + across * (m_beta - x_beta))
    return e


@kernel_as(STEP)
def step(state, sample, belief, tuning):
    """Take one sample; see the module's text."""
    if state[PHASE] != TRACKING:
        return start(state, sample, belief, tuning)
    predict(state, tuning)
    correct(state, observe(state, sample, 0.0, belief, tuning), tuning)
    return Estimate(state[AXIS], state[OMEGA], state[AXIS], 0.0, trust(state), 0.0, 0.0, 0.0)


def init(belief, tuning, angle=None):
    """Return the state before starting up, or ready to track from a known angle (rad)."""
    return tell(blank(OWN), angle)


ESTIMATOR = Estimator(
    "active_flux",
    "flux observer without injection, active (auxiliary) flux; for speed",
    init,
    step,
    injection=NONE,
    delay="none: the flux of the voltage is up to date",
    speeds="from about a tenth of rated speed on, where the back-EMF exceeds errors of R i and "
    "of the inverter",
    source="Boldea, Paicu, Andreescu, IEEE Trans. Power Electron. 23 (2008) (active flux)",
)
