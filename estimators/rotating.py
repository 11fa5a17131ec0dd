"""Rotating injection, position from the negative sequence of the current.

The injected voltage turns once in N samples, u_k = U exp(j rho_k), rho_k = 2 pi k/N.  A winding
with eigenvalues mu_1, mu_2 of Gamma (principal axis at angle chi from d) answers u_k along each
axis with mu H(mu),
  H(mu) = b/(z - a),  a = exp(-R mu h),  b = (1 - a)/(R mu),  z = exp(2 pi j/N),
exactly at standstill.  Beside the positive sequence the current has conj(P - Q)/2 exp(2j chi)
conj(u_k), P = mu_1 H(mu_1), Q = mu_2 H(mu_2): the negative one, which turns with twice the rotor's
angle.  Divided by the lossless flux ripple psi_k = h u_k/(z - 1) it is
  D = exp(2j chi) conj(P - Q) / (2 conj(h/(z - 1))),
Gamma_dd - Gamma_qq over 2 plus j Gamma_dq without resistance; the resistance turns it by about R
trace(Gamma)/Omega, degrees that the belief takes along.  Error e: half the angle between measured
and believed D.

Needs a square waveform of at least four samples: the axis of injection is turned from sample to
sample.
"""

from __future__ import annotations

import cmath
import math

from estimators.believed import believed_hessian, trust
from estimators.contract import ROTATING, STEP, Estimate, Estimator
from estimators.demodulation import (
    AXIS,
    CURSOR,
    FREE,
    OMEGA,
    PHASE,
    RING_ALPHA,
    RING_BETA,
    RING_C,
    RING_S,
    blank,
)
from estimators.startup import TRACKING, start, tell
from estimators.tracking import correct, predict
from model.compiled import kernel, kernel_as

TURN, SEEN = FREE, FREE + 1  # place in the turn at t_k; samples seen since starting up


@kernel
def answer(eigenvalue, resistance, h, z):
    """Return mu H(mu): the current at the samples per volt turning once in N samples, along an axis
    of stiffness mu."""
    a = math.exp(-resistance * eigenvalue * h)
    return (1.0 - a) / resistance / (z - a)


@kernel
def believed_sequence(dd, dq, qq, resistance, h, n):
    """Return D (1/H, complex) of a Hessian at standstill."""
    z = cmath.exp(2j * math.pi / n)
    middle, half = 0.5 * (dd + qq), math.hypot(0.5 * (dd - qq), dq)
    difference = answer(middle + half, resistance, h, z) - answer(middle - half, resistance, h, z)
    ideal = h / (z - 1.0)
    return cmath.exp(1j * math.atan2(2.0 * dq, dd - qq)) * (difference / ideal).conjugate() * 0.5


@kernel
def negative_sequence(state, sample, axis, omega, tuning):
    """Take one sample; return the mean current mean_d, mean_q (A) and D (1/H, complex), all from
    the present frame.

    Weights 1/2, 1, 1/2 over three half periods, as in `demodulation`: exact on a linear trend of
    the current.
    """
    period, half, h = tuning.period, tuning.period // 2, tuning.sampling_period
    n = 3 * half
    newest = int(state[CURSOR])
    ideal = (
        h
        / (cmath.exp(2j * math.pi / period) - 1.0)
        * cmath.exp(2j * math.pi * state[TURN] / period)
    )
    state[RING_ALPHA + newest], state[RING_BETA + newest] = sample.i_alpha, sample.i_beta
    state[RING_C + newest], state[RING_S + newest] = ideal.real, ideal.imag
    state[CURSOR] = (newest + 1) % n
    frame, back, j = cmath.exp(-1j * axis), cmath.exp(1j * h * omega), newest
    mean, product, raw, square = 0j, 0j, 0j, 0.0
    for k in range(n):
        weight = 1.0 if half <= k < 2 * half else 0.5
        current = frame * complex(state[RING_ALPHA + j], state[RING_BETA + j])
        flux = frame * complex(state[RING_C + j], state[RING_S + j])
        mean += weight * current
        raw += weight * flux
        product += weight * current * flux
        square += weight * abs(flux) ** 2
        frame *= back
        j = j - 1 if j > 0 else n - 1
    mean /= 2 * half
    return mean.real, mean.imag, (product - mean * raw) / (square * tuning.amplitude)


@kernel_as(STEP)
def step(state, sample, belief, tuning):
    """Take one sample; see the module's text."""
    n = tuning.period
    # the primitive starts lowest
    state[TURN] = 0.0 if sample.carrier < -0.999 * tuning.peak else state[TURN] + 1.0
    if state[PHASE] != TRACKING:
        return start(state, sample, belief, tuning)
    axis = predict(state, tuning)
    mean_d, mean_q, measured = negative_sequence(state, sample, axis, state[OMEGA], tuning)
    dd, dq, qq = believed_hessian(state, belief.energy, mean_d, mean_q)
    expected = believed_sequence(dd, dq, qq, belief.resistance, tuning.sampling_period, n)
    if state[SEEN] < 2 * n:  # until the window holds rotating injection alone
        state[SEEN] += 1.0
        measured = expected
    error = 0.5 * (measured * expected.conjugate()).imag / abs(expected) ** 2
    correct(state, error, tuning)
    turn = (state[TURN] + 1.0) % n
    # the waveform's sign is -1 there
    inject = 2.0 * math.pi * turn / n - (0.0 if turn < n // 2 else math.pi)
    inject -= 1.5 * tuning.sampling_period * state[OMEGA]  # which the drive adds
    size = tuning.amplitude * tuning.peak
    r_d, r_q = measured.real * size, measured.imag * size
    return Estimate(state[AXIS], state[OMEGA], inject, 0.0, trust(state), r_d, r_q, 1.0)


def init(belief, tuning, angle=None):
    """Return the state before starting up, or ready to track from a known angle (rad)."""
    return tell(blank(2), angle)


ESTIMATOR = Estimator(
    "rotating",
    "rotating injection, angle of the current's negative sequence",
    init,
    step,
    injection=ROTATING,
    delay="0.75 N - 0.5 samples of demodulation (N samples a turn of the injection)",
    speeds="0 to where the current loop behind the injection's average holds; torque ripple "
    "from the q injection",
    source="Jansen, Lorenz, IEEE Trans. Ind. Appl. 31 (1995) 240; resistance exactly, by the "
    "sampled winding",
)
