"""Arbitrary injection: the matrix of incremental 1/inductance fitted to whatever voltage was commanded, angle from it.

No carrier is known.  Flux ripple f and current ripple g are what one filter, real in the rotor's frame, leaves of
psi = integral of (u - R i) and of i: two zeros at rest there, two poles at half the injection's frequency,
  H = (1 - r/z)^2 / (1 - a r/z)^2,   r = exp(j omega h),   a = exp(-pi/N),
so means, their ramps and the magnet are gone.  In the estimated rotor frame, as complex numbers,
  g = S f + D conj(f),   S = (Gamma_dd + Gamma_qq)/2,   D = (Gamma_dd - Gamma_qq)/2 + j Gamma_dq,
and an error e turns D by 2 e.  Of what the believed S and D at the mean current leave of g, v = g - S f - D conj(f),
recursive least squares with forgetting make dS and dD, q = sum |f|^2, p = sum f^2:
  (q + c rho) dS + Re(conj(p) dD) = sum Re(conj(f) v),    (q + rho) dD + p dS = sum f v,
  e = arg((D + dD)/D) / 2,
the angle directly, without a search.  rho is the belief's weight: along one axis only three of four entries show, and
c < 1 says that the scale S is known less well than the saliency, so that an inductance all wrong turns nothing.
"""

from __future__ import annotations

import cmath
import math

from estimators.believed import believed_hessian, tracked
from estimators.contract import STEP, Estimator
from estimators.demodulation import AXIS, FREE, OMEGA, PHASE, SLOW_OMEGA, blank, demodulate
from estimators.startup import TRACKING, start, tell
from estimators.tracking import correct, predict
from model.compiled import kernel, kernel_as

# complex numbers, two slots each: current, flux, and both filtered, of the last two samples; sums p and f v
I_1, I_2, PSI_1, PSI_2, F_1, F_2, G_1, G_2, P, FV = range(FREE, FREE + 20, 2)
Q, REAL_FV, SEEN = range(FREE + 20, FREE + 23)
OWN = 23
LEAK = 0.03  # of the filter's corner: where the integral forgets offsets of the voltage
BELIEVED = 0.2  # rho over the sum of |f|^2 that the injection makes
SCALE = 0.02  # c
LEAST = 0.05  # of the saliency at zero current: below it the matrix carries no angle


@kernel
def get(state, slot):
    """Return the complex number at a slot."""
    return complex(state[slot], state[slot + 1])


@kernel
def put(state, slot, value):
    """Write a complex number to a slot."""
    state[slot], state[slot + 1] = value.real, value.imag


@kernel
def filtered(state, value, now, before, out, out_before, r, pole):
    """Take one value of the stator frame; return and remember H of it, two values of each being kept at the slots."""
    last, result_1 = get(state, now), get(state, out)
    result = value - 2.0 * r * last + r * r * get(state, before)
    result += 2.0 * pole * result_1 - pole * pole * get(state, out_before)
    put(state, before, last)
    put(state, now, value)
    put(state, out_before, result_1)
    put(state, out, result)
    return result


@kernel
def ripples(state, sample, omega, resistance, tuning):
    """Take one sample; return f (Wb) and g (A), complex, of the stator frame, at a speed omega (rad/s)."""
    h, corner = tuning.sampling_period, math.pi / tuning.period
    r = cmath.exp(1j * omega * h)
    pole = math.exp(-corner) * r
    i = complex(sample.i_alpha, sample.i_beta)
    psi = math.exp(-LEAK * corner) * get(state, PSI_1)
    psi += h * (complex(sample.u_alpha, sample.u_beta) - 0.5 * resistance * (i + get(state, I_1)))
    f = filtered(state, psi, PSI_1, PSI_2, F_1, F_2, r, pole)
    return f, filtered(state, i, I_1, I_2, G_1, G_2, r, pole)


@kernel
def deviation(state, f, v, weight, keep):
    """Add a pair f (Wb), v (A) of the rotor frame, forgetting by `keep`; return dS, dD (1/H) at weight rho (Wb^2)."""
    p = keep * get(state, P) + f * f
    fv = keep * get(state, FV) + f * v
    put(state, P, p)
    put(state, FV, fv)
    state[Q] = keep * state[Q] + abs(f) ** 2
    state[REAL_FV] = keep * state[REAL_FV] + (f.conjugate() * v).real
    q = state[Q] + weight
    d_s = (state[REAL_FV] - (p.conjugate() * fv).real / q) / (state[Q] + SCALE * weight - abs(p) ** 2 / q)
    return d_s, (fv - d_s * p) / q


@kernel
def forgetting(n):
    """Return the factor a sample that makes the data as old in the mean as in an average over n samples."""
    age = 0.5 * (n - 1)
    return age / (1.0 + age)


@kernel
def believed_weight(tuning):
    """Return rho (Wb^2)."""
    energy = tuning.amplitude * tuning.amplitude * tuning.power / tuning.period
    return BELIEVED * energy / (1.0 - forgetting(tuning.period))


@kernel_as(STEP)
def step(state, sample, belief, tuning):
    """Take one sample; see the module's text."""
    if state[PHASE] != TRACKING:
        return start(state, sample, belief, tuning)
    axis = predict(state, tuning)
    mean_d, mean_q, y_d, y_q = demodulate(state, sample, axis, state[OMEGA], tuning)  # y is shown, not used
    f, g = ripples(state, sample, state[SLOW_OMEGA], belief.resistance, tuning)
    if state[SEEN] < 3 * tuning.period:  # filters and mean have a beginning of their own
        state[SEEN] += 1.0
        f = g = 0j
    back = cmath.exp(-1j * axis)
    f, g = f * back, g * back
    dd, dq, qq = believed_hessian(state, belief.energy, mean_d, mean_q)
    d = complex(0.5 * (dd - qq), dq)
    v = g - 0.5 * (dd + qq) * f - d * f.conjugate()
    _, d_d = deviation(state, f, v, believed_weight(tuning), forgetting(tuning.period))
    turned = (d + d_d) * d.conjugate()
    least = LEAST * 0.5 * (belief.energy.gamma_d - belief.energy.gamma_q)
    share = abs(d) ** 2 / max(abs(d) ** 2, least * least)
    correct(state, 0.5 * share * math.atan2(turned.imag, turned.real), tuning)
    return tracked(state, state[AXIS], y_d, y_q, tuning)


def init(belief, tuning, angle=None):
    """Return the state before starting up, or ready to track from a known angle (rad)."""
    return tell(blank(OWN), angle)


ESTIMATOR = Estimator(
    "arbitrary", "1/inductance fitted to any commanded voltage by least squares, angle of its saliency", init, step,
    delay="0.5 (N - 1) samples of forgetting (N samples an injection period)",
    speeds="0 to where the current loop behind the injection's average holds",
    source="Paulus, Landsmann, Kennel, SLED 2011 (arbitrary injection, direct angle); filter and belief derived here",
)  # fmt: skip
