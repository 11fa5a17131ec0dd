"""What a belief says at a measured current, flux and Hessian, whether it has an answer at all, and
what is told."""

from __future__ import annotations

from estimators.contract import Estimate
from estimators.demodulation import AXIS, FLUX_D, FLUX_Q, OMEGA, OUTSIDE
from model.compiled import kernel
from model.energy import SOLVED, flux_newton, hessian

LEAST = 0.3  # of the slope at zero current, see `damped`
# Estimate.tracking; UNCERTAIN: the belief has no flux at the measured current
TRACKED, UNCERTAIN = 1.0, 2.0


@kernel
def believed_flux(state, energy, i_d, i_q):
    """Return phi_d, phi_q (Wb) at a current (A) of the rotor frame, the last one where the belief
    has none.

    state[OUTSIDE] says which of both; a second try from zero flux catches a start that had gone
    astray.
    """
    d, q, status = flux_newton(energy, i_d, i_q, state[FLUX_D], state[FLUX_Q])
    if status != SOLVED:
        d, q, status = flux_newton(energy, i_d, i_q, 0.0, 0.0)
    state[OUTSIDE] = 0.0 if status == SOLVED else 1.0
    if status == SOLVED:
        state[FLUX_D], state[FLUX_Q] = d, q
    return state[FLUX_D], state[FLUX_Q]


@kernel
def believed_hessian(state, energy, i_d, i_q):
    """Return Gamma_dd, Gamma_dq, Gamma_qq (1/H) there."""
    d, q = believed_flux(state, energy, i_d, i_q)
    return hessian(energy, d, q)


@kernel
def damped(step, power, energy):
    """Return a Gauss-Newton step (rad): its numerator over the slope's square (1/H^2), less of it
    where that is small.

    Noise goes through one over the slope, so a step is taken in full at the slope of zero current,
    by half at LEAST of it, where damping of the tracking loop has gone from 1 to 0.7, and not at
    all where the matrix carries no angle.
    """
    usual = energy.gamma_d - energy.gamma_q
    least = LEAST * LEAST
    return (1.0 + least) * step / (power + least * usual * usual)


@kernel
def trust(state):
    """Return what Estimate.tracking says: TRACKED, or UNCERTAIN while the belief has no answer."""
    return UNCERTAIN if state[OUTSIDE] != 0.0 else TRACKED


@kernel
def tracked(state, theta, y_d, y_q, tuning, injection=1.0):
    """Return the estimate of a tracking loop: an angle (rad), injected along its axis, and the
    ripple y (1/H) seen.

    injection: how much of it is wanted, 0 to 1.
    """
    size = tuning.amplitude * tuning.peak
    return Estimate(
        theta, state[OMEGA], state[AXIS], 0.0, trust(state), y_d * size, y_q * size, injection
    )
