"""Direct inversion of both ripple components through the believed Hessian.

With injection along the estimated d axis, the believed ripple at error e is
  S(e) = R(e) Gamma_R(R(-e) i) R(-e) (1, 0),    Gamma_R = Gamma (1 - lag (R Gamma + omega J)^2),
the second term being the first effect of resistance and speed on the in-phase ripple (the one of
first order in R is in quadrature with F and drops out); of it, R^2 Gamma^2 and R omega (Gamma J + J
Gamma) = R omega trace(Gamma) J are taken, omega^2 is small.  The error that minimises |y - S(e)|
feeds the phase-locked loop: one Gauss-Newton step a sample.  It needs a non-zero slope vector S',
not a saliency of a given sign.
"""

from __future__ import annotations

import math

from estimators.believed import believed_hessian, damped, tracked
from estimators.contract import STEP, Estimator
from estimators.demodulation import AXIS, OMEGA, PHASE, SLOW_OMEGA, blank, demodulate
from estimators.startup import TRACKING, start, tell
from estimators.tracking import correct, predict
from model.compiled import kernel, kernel_as
from model.frames import rotate
from model.saliency import ripple

DELTA = 0.02  # rad, half width of the difference for S'


@kernel
def believed_ripple(state, mean_d, mean_q, e, belief, tuning):
    """Return S(e) in 1/H for the mean current (A) of the estimated frame."""
    m = belief.energy
    i_d, i_q = rotate(mean_d, mean_q, -e)
    dd, dq, qq = believed_hessian(state, m, i_d, i_q)
    c = tuning.lag * belief.resistance * belief.resistance
    s_dd, s_dq, s_qq = dd * dd + dq * dq, dq * (dd + qq), dq * dq + qq * qq  # Gamma^2
    r_dd = dd - c * (s_dd * dd + s_dq * dq)
    r_dq = dq - c * (s_dd * dq + s_dq * qq)
    r_qq = qq - c * (s_dq * dq + s_qq * qq)
    y_d, y_q = ripple(r_dd, r_dq, r_qq, e)
    c, s, w = (
        math.cos(e),
        math.sin(e),
        tuning.lag * belief.resistance * state[SLOW_OMEGA] * (dd + qq),
    )
    t_d, t_q = rotate(dd * s + dq * c, dq * s + qq * c, e)  # Gamma J times the injection
    return y_d - w * t_d, y_q - w * t_q


@kernel
def believed_error(state, mean_d, mean_q, y_d, y_q, belief, tuning):
    """Return the Gauss-Newton step (rad) from e = 0 towards the minimum of |y - S(e)|."""
    a_d, a_q = believed_ripple(state, mean_d, mean_q, -DELTA, belief, tuning)
    b_d, b_q = believed_ripple(state, mean_d, mean_q, DELTA, belief, tuning)
    s_d, s_q = believed_ripple(state, mean_d, mean_q, 0.0, belief, tuning)
    g_d, g_q = (b_d - a_d) / (2.0 * DELTA), (b_q - a_q) / (2.0 * DELTA)
    return damped(g_d * (y_d - s_d) + g_q * (y_q - s_q), g_d * g_d + g_q * g_q, belief.energy)


@kernel_as(STEP)
def step(state, sample, belief, tuning):
    """Take one sample; see the module's text."""
    if state[PHASE] != TRACKING:
        return start(state, sample, belief, tuning)
    axis = predict(state, tuning)
    mean_d, mean_q, y_d, y_q = demodulate(state, sample, axis, state[OMEGA], tuning)
    correct(state, believed_error(state, mean_d, mean_q, y_d, y_q, belief, tuning), tuning)
    return tracked(state, state[AXIS], y_d, y_q, tuning)


def init(belief, tuning, angle=None):
    """Return the state before starting up, or ready to track from a known angle (rad)."""
    return tell(blank(), angle)


ESTIMATOR = Estimator(
    "inversion",
    "both ripple components inverted through the believed Hessian",
    init,
    step,
    delay="0.75 N - 0.5 samples of demodulation (N samples an injection period)",
    speeds="0 to where the current loop behind the injection's average holds",
    source="Jebai, Malrait, Martin, Rouchon, IEMDC 2011, eqs. of the ripple; Gauss-Newton on "
    "both components",
)
