"""Extended Kalman filter on the currents, as textbooks and small drives have it, with the injection
beside.

State x = (i_alpha, i_beta, omega, theta), measured: its first two.  In the rotor's frame, phi the
flux that a belief has at a current, Gamma its Hessian there, J a quarter turn:
  d i / dt = Gamma (u - R i - omega J (phi + phi_m)) + omega J i    (turned to the stationary frame),
  d omega / dt = noise,   d theta / dt = omega.
With a linear belief this is the usual filter of a salient motor with constant L_d and L_q.  Mean by
Heun's step, the transition by differences at its start.  The flux is not a state: what the voltage
lacks is noise of the currents alone, that of the flux times the mean of gamma_d^2 and gamma_q^2,
alike in both axes, and is forgotten with them; `ekf` remembers it as flux.  Injection makes theta
observable at standstill: Gamma u turns with theta.
"""  # noqa: E501

from __future__ import annotations

from estimators.believed import believed_flux
from estimators.contract import STEP, Estimator
from estimators.demodulation import AXIS, PHASE
from estimators.kalman import F, K, P, X, doubt, estimate_of, init, sandwich, shrink
from estimators.startup import TRACKING, start
from model.compiled import kernel, kernel_as
from model.energy import hessian
from model.frames import rotate

SMALL_CURRENT, SMALL_ANGLE = 1e-4, 1e-4  # of the rated current; rad: steps of differences


@kernel
def slope(s, i_alpha, i_beta, theta, u_alpha, u_beta, belief):
    """Return d i / dt (A/s) at a current, an angle and the state's speed."""
    omega = s[X + 2]
    i_d, i_q = rotate(i_alpha, i_beta, -theta)
    d, q = believed_flux(s, belief.energy, i_d, i_q)
    dd, dq, qq = hessian(belief.energy, d, q)
    v_d, v_q = rotate(
        u_alpha - belief.resistance * i_alpha, u_beta - belief.resistance * i_beta, -theta
    )
    v_d, v_q = v_d + omega * q, v_q - omega * (d + belief.magnet_flux)
    return rotate(dd * v_d + dq * v_q - omega * i_q, dq * v_d + qq * v_q + omega * i_d, theta)


@kernel
def predict(s, u_alpha, u_beta, belief, tuning):
    """Propagate mean (Heun) and covariance (differences at the start) over one sampling period."""
    t, a, b, omega, theta = tuning.sampling_period, s[X], s[X + 1], s[X + 2], s[X + 3]
    x, y, small = SMALL_CURRENT * tuning.bias, SMALL_ANGLE, 1.0 + abs(omega) * SMALL_ANGLE
    p_alpha, p_beta = slope(s, a, b, theta, u_alpha, u_beta, belief)
    for k in range(16):
        s[F + k] = 0.0
    for k in range(4):
        if k == 0:
            q_alpha, q_beta = slope(s, a + x, b, theta, u_alpha, u_beta, belief)
            over = t / x
        elif k == 1:
            q_alpha, q_beta = slope(s, a, b + x, theta, u_alpha, u_beta, belief)
            over = t / x
        elif k == 2:
            s[X + 2] = omega + small
            q_alpha, q_beta = slope(s, a, b, theta, u_alpha, u_beta, belief)
            over = t / small
            s[X + 2] = omega
        else:
            q_alpha, q_beta = slope(s, a, b, theta + y, u_alpha, u_beta, belief)
            over = t / y
        s[F + k], s[F + 4 + k] = over * (q_alpha - p_alpha), over * (q_beta - p_beta)
        s[F + 5 * k] += 1.0
    s[F + 14] = t
    e_alpha, e_beta = slope(
        s, a + t * p_alpha, b + t * p_beta, theta + t * omega, u_alpha, u_beta, belief
    )
    s[X], s[X + 1] = a + 0.5 * t * (p_alpha + e_alpha), b + 0.5 * t * (p_beta + e_beta)
    s[X + 3] = theta + t * omega
    sandwich(s, F, P, P)
    gain = 0.5 * (belief.energy.gamma_d**2 + belief.energy.gamma_q**2)
    s[P] += gain * tuning.flux_variance
    s[P + 5] += gain * tuning.flux_variance
    s[P + 10] += tuning.speed_variance


@kernel
def update(s, i_alpha, i_beta, tuning):
    """Correct with one current sample (Joseph form), the first two states themselves."""
    v, e_alpha, e_beta = tuning.current_variance, i_alpha - s[X], i_beta - s[X + 1]
    aa, ab, bb = s[P] + v, s[P + 1], s[P + 5] + v
    det = aa * bb - ab * ab
    for k in range(4):
        a, b = s[P + 4 * k], s[P + 4 * k + 1]
        s[F + 4 * k], s[F + 4 * k + 1] = -(a * bb - b * ab) / det, -(b * aa - a * ab) / det
        s[F + 4 * k + 2] = s[F + 4 * k + 3] = 0.0
    for k in range(4):
        s[X + k] -= s[F + 4 * k] * e_alpha + s[F + 4 * k + 1] * e_beta
        # minus K: the sign goes out in squares
        s[K + k], s[K + 4 + k] = s[F + 4 * k], s[F + 4 * k + 1]
    for k in range(4):
        s[F + 5 * k] += 1.0
    shrink(s, v)


@kernel
def begin(s, sample, tuning):
    """Set mean and covariance from the position found by starting up."""
    s[X], s[X + 1], s[X + 2], s[X + 3] = sample.i_alpha, sample.i_beta, 0.0, s[AXIS]
    doubt(s, tuning.current_variance)


@kernel_as(STEP)
def step(state, sample, belief, tuning):
    """Take one sample; see the module's text."""
    if state[PHASE] != TRACKING:
        estimate = start(state, sample, belief, tuning)
        if state[PHASE] == TRACKING:
            begin(state, sample, tuning)
        return estimate
    predict(state, sample.u_alpha, sample.u_beta, belief, tuning)
    update(state, sample.i_alpha, sample.i_beta, tuning)
    return estimate_of(state, sample, tuning)


ESTIMATOR = Estimator(
    "ekf_current",
    "extended Kalman filter on currents, speed and angle, the voltage's lack forgotten",
    init,
    step,
    type_2=False,
    delay="none of its own: a prediction by the model, corrected each sample",
    speeds="all; at standstill it needs the injection",
    source="Dhaouadi, Mohan, Norum, IEEE Trans. Power Electron. 6 (1991) 491 (states and "
    "measurement); Bolognani, Tubiana, Zigliotto, IEEE Trans. Ind. Appl. 39 (2003); any belief by "
    "its flux and Hessian, derived here",
)
