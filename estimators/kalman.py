"""Extended Kalman filter with the energy model, compiled.

State x = (psi_alpha, psi_beta, omega, theta): total stator flux linkage (Wb), electrical speed and
angle.
  d psi / dt = u - R i,   d omega / dt = noise,   d theta / dt = omega,
  i = R(theta) grad H(R(-theta) psi - (phi_m, 0)),
one Heun step a sampling period.  Injection makes theta observable at standstill: the ripple changes
the Jacobian of i by theta through Gamma_dd - Gamma_qq.  Twin on filterpy:
`estimators.kalman_filterpy`.
"""

from __future__ import annotations

from estimators.contract import STEP, Estimate, Estimator
from estimators.demodulation import AXIS, FREE, OMEGA, PHASE, blank, demodulate
from estimators.startup import TRACKING, start, tell
from model.compiled import kernel, kernel_as
from model.energy import currents, hessian
from model.frames import rotate

X = FREE
P = X + 4
F = P + 16  # scratch: transition, later I - K H
W = F + 16  # scratch: a product
K = W + 16  # gains, column a, then column b
SIZE = 4 + 3 * 16 + 8
START_ANGLE = 0.1  # rad, standard deviation after starting up
START_SPEED = 1.0  # rad/s
START_FLUX = 0.02  # of the magnet's


@kernel
def stator_current(psi_alpha, psi_beta, theta, belief):
    """Return i_alpha, i_beta (A) of the believed motor."""
    d, q = rotate(psi_alpha, psi_beta, -theta)
    i_d, i_q = currents(belief.energy, d - belief.magnet_flux, q)
    return rotate(i_d, i_q, theta)


@kernel
def current_jacobian(psi_alpha, psi_beta, theta, belief):
    """Return G_aa, G_ab, G_bb (1/H) and j_a, j_b (A/rad): derivatives of i by psi and by theta."""
    d, q = rotate(psi_alpha, psi_beta, -theta)
    d -= belief.magnet_flux
    dd, dq, qq = hessian(belief.energy, d, q)
    x, y = rotate(dd - qq, 2.0 * dq, 2.0 * theta)  # the traceless part turns by twice the angle
    g_aa, g_ab, g_bb = 0.5 * (dd + qq + x), 0.5 * y, 0.5 * (dd + qq - x)
    i_alpha, i_beta = stator_current(psi_alpha, psi_beta, theta, belief)
    j_alpha = -i_beta - (-g_aa * psi_beta + g_ab * psi_alpha)  # J i - G J psi
    j_beta = i_alpha - (-g_ab * psi_beta + g_bb * psi_alpha)
    return g_aa, g_ab, g_bb, j_alpha, j_beta


@kernel
def sandwich(s, left, middle, out):
    """Write left middle left^T (4 x 4, offsets into s) to `out`, through the scratch W; out may be
    middle."""
    for i in range(4):
        for j in range(4):
            total = 0.0
            for k in range(4):
                total += s[left + 4 * i + k] * s[middle + 4 * k + j]
            s[W + 4 * i + j] = total
    for i in range(4):
        for j in range(4):
            total = 0.0
            for k in range(4):
                total += s[W + 4 * i + k] * s[left + 4 * j + k]
            s[out + 4 * i + j] = total


@kernel
def blur(s, tuning):
    """Add a period's process noise to the covariance."""
    s[P] += tuning.flux_variance
    s[P + 5] += tuning.flux_variance
    s[P + 10] += tuning.speed_variance


@kernel
def predict(s, u_alpha, u_beta, belief, tuning):
    """Propagate mean (Heun) and covariance (Jacobian at the start) over one sampling period."""
    t, r = tuning.sampling_period, belief.resistance
    a, b, omega, theta = s[X], s[X + 1], s[X + 2], s[X + 3]
    g_aa, g_ab, g_bb, j_alpha, j_beta = current_jacobian(a, b, theta, belief)
    i_alpha, i_beta = stator_current(a, b, theta, belief)
    da, db = u_alpha - r * i_alpha, u_beta - r * i_beta
    n_alpha, n_beta = stator_current(a + t * da, b + t * db, theta + t * omega, belief)
    s[X] = a + 0.5 * t * (da + u_alpha - r * n_alpha)
    s[X + 1] = b + 0.5 * t * (db + u_beta - r * n_beta)
    s[X + 3] = theta + t * omega
    for k in range(16):
        s[F + k] = 0.0
    s[F], s[F + 1], s[F + 3] = 1.0 - t * r * g_aa, -t * r * g_ab, -t * r * j_alpha
    s[F + 4], s[F + 5], s[F + 7] = -t * r * g_ab, 1.0 - t * r * g_bb, -t * r * j_beta
    s[F + 10] = s[F + 15] = 1.0
    s[F + 14] = t
    sandwich(s, F, P, P)
    blur(s, tuning)


@kernel
def shrink(s, v):
    """Correct the covariance (Joseph form) with I - K H in F and the gains in K; v (A^2): variance
    of a reading."""
    sandwich(s, F, P, P)
    for i in range(4):
        for j in range(4):
            s[P + 4 * i + j] += v * (s[K + i] * s[K + j] + s[K + 4 + i] * s[K + 4 + j])


@kernel
def update(s, i_alpha, i_beta, belief, tuning):
    """Correct with one current sample (Joseph form)."""
    g_aa, g_ab, g_bb, j_alpha, j_beta = current_jacobian(s[X], s[X + 1], s[X + 3], belief)
    e_alpha, e_beta = stator_current(s[X], s[X + 1], s[X + 3], belief)
    e_alpha, e_beta = i_alpha - e_alpha, i_beta - e_beta
    v = tuning.current_variance
    s_aa = s_ab = s_bb = 0.0
    for k in range(4):  # P H^T, two columns into the scratch W
        p = P + 4 * k
        s[W + k] = s[p] * g_aa + s[p + 1] * g_ab + s[p + 3] * j_alpha
        s[W + 4 + k] = s[p] * g_ab + s[p + 1] * g_bb + s[p + 3] * j_beta
    s_aa = g_aa * s[W] + g_ab * s[W + 1] + j_alpha * s[W + 3] + v
    s_ab = g_aa * s[W + 4] + g_ab * s[W + 5] + j_alpha * s[W + 7]
    s_bb = g_ab * s[W + 4] + g_bb * s[W + 5] + j_beta * s[W + 7] + v
    det = s_aa * s_bb - s_ab * s_ab
    for k in range(4):  # I - K H into F
        k_alpha = (s[W + k] * s_bb - s[W + 4 + k] * s_ab) / det
        k_beta = (s[W + 4 + k] * s_aa - s[W + k] * s_ab) / det
        s[K + k], s[K + 4 + k] = k_alpha, k_beta
        s[X + k] += k_alpha * e_alpha + k_beta * e_beta
        s[F + 4 * k] = -(k_alpha * g_aa + k_beta * g_ab)
        s[F + 4 * k + 1] = -(k_alpha * g_ab + k_beta * g_bb)
        s[F + 4 * k + 2] = 0.0
        s[F + 4 * k + 3] = -(k_alpha * j_alpha + k_beta * j_beta)
        s[F + 5 * k] += 1.0
    shrink(s, v)


@kernel
def doubt(s, variance):
    """Set the covariance from starting up: a variance of the first two states, those of speed and
    angle."""
    for k in range(16):
        s[P + k] = 0.0
    s[P] = s[P + 5] = variance
    s[P + 10] = START_SPEED**2
    s[P + 15] = START_ANGLE**2


@kernel
def begin(s, sample, belief):
    """Set mean and covariance from the position found by starting up."""
    theta = s[AXIS]
    x, y = rotate(belief.magnet_flux, 0.0, theta)
    g_aa, g_ab, g_bb, _, _ = current_jacobian(x, y, theta, belief)
    det = g_aa * g_bb - g_ab * g_ab
    s[X] = x + (g_bb * sample.i_alpha - g_ab * sample.i_beta) / det
    s[X + 1] = y + (g_aa * sample.i_beta - g_ab * sample.i_alpha) / det
    s[X + 2], s[X + 3] = 0.0, theta
    doubt(s, (START_FLUX * belief.magnet_flux) ** 2)


@kernel
def started(state, sample, belief, tuning):
    """Take one sample while starting up; begin the filter at the position found."""
    estimate = start(state, sample, belief, tuning)
    if state[PHASE] == TRACKING:
        begin(state, sample, belief)
    return estimate


@kernel
def estimate_of(state, sample, tuning):
    """Return the estimate at the filter's mean, and the ripple there, which is shown, not used."""
    theta, omega = state[X + 3], state[X + 2]
    state[AXIS], state[OMEGA] = theta, omega
    _, _, y_d, y_q = demodulate(state, sample, theta, omega, tuning)
    amplitude = tuning.amplitude * tuning.peak
    return Estimate(theta, omega, theta, 0.0, 1.0, y_d * amplitude, y_q * amplitude, 1.0)


@kernel_as(STEP)
def step(state, sample, belief, tuning):
    """Take one sample; see the module's text."""
    if state[PHASE] != TRACKING:
        return started(state, sample, belief, tuning)
    predict(state, sample.u_alpha, sample.u_beta, belief, tuning)
    update(state, sample.i_alpha, sample.i_beta, belief, tuning)
    return estimate_of(state, sample, tuning)


def init(belief, tuning, angle=None):
    """Return the state before starting up, or ready to track from a known angle (rad)."""
    return tell(blank(SIZE), angle)


ESTIMATOR = Estimator(
    "ekf",
    "extended Kalman filter on flux, speed and angle with the energy model",
    init,
    step,
    type_2=False,
    delay="none of its own: a prediction by the model, corrected each sample",
    speeds="all; at standstill it needs the injection, and R and the inverter's voltage well known",
    source="Bolognani, Tubiana, Zigliotto, IEEE Trans. Ind. Appl. 39 (2003), with the energy of "
    "IEMDC 2011",
)
