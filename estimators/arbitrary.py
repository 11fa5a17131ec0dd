"""Arbitrary injection: the matrix of incremental 1/inductance fitted to whatever voltage was
commanded, angle from it.

No carrier is known.  Flux ripple f and current ripple g are what one filter, real in the rotor's
frame, leaves of psi = integral of (u - R i) and of i: two zeros at rest there, two poles at half
the injection's frequency,
  H = (1 - r/z)^2 / (1 - a r/z)^2,   r = exp(j omega h),   a = exp(-pi/N),
so means, their ramps and the magnet are gone.  Seen from the estimated rotor frame the matrix
between them is fitted and its turn is the error (`matrix_fit`), the believed one being that at the
mean current.
"""

from __future__ import annotations

import cmath
import math

from estimators.believed import tracked
from estimators.contract import STEP, Estimator
from estimators.demodulation import AXIS, FREE, OMEGA, PHASE, SLOW_OMEGA, blank, demodulate
from estimators.matrix_fit import TAKEN, add, angle_error, believed, forgetting, get, put, solve
from estimators.startup import TRACKING, start, tell
from estimators.tracking import correct, predict
from model.compiled import kernel, kernel_as

# complex numbers, two slots each: current, flux, and both filtered, of the last two samples
I_1, I_2, PSI_1, PSI_2, F_1, F_2, G_1, G_2 = range(FREE + TAKEN, FREE + TAKEN + 16, 2)
SEEN = FREE + TAKEN + 16
OWN = TAKEN + 17
LEAK = 0.03  # of the filter's corner: where the integral forgets offsets of the voltage
BELIEVED = 0.2  # rho over the sum of |f|^2 that the injection makes


@kernel
def filtered(state, value, now, before, out, out_before, r, pole):
    """Take one value of the stator frame; return and remember H of it, two values of each being
    kept at the slots."""
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
    """Take one sample; return f (Wb) and g (A), complex, of the stator frame, at a speed omega
    (rad/s)."""
    h, corner = tuning.sampling_period, math.pi / tuning.period
    r = cmath.exp(1j * omega * h)
    pole = math.exp(-corner) * r
    i = complex(sample.i_alpha, sample.i_beta)
    psi = math.exp(-LEAK * corner) * get(state, PSI_1)
    psi += h * (complex(sample.u_alpha, sample.u_beta) - 0.5 * resistance * (i + get(state, I_1)))
    f = filtered(state, psi, PSI_1, PSI_2, F_1, F_2, r, pole)
    return f, filtered(state, i, I_1, I_2, G_1, G_2, r, pole)


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
    # y is shown, not used
    mean_d, mean_q, y_d, y_q = demodulate(state, sample, axis, state[OMEGA], tuning)
    f, g = ripples(state, sample, state[SLOW_OMEGA], belief.resistance, tuning)
    if state[SEEN] < 3 * tuning.period:  # filters and mean have a beginning of their own
        state[SEEN] += 1.0
        f = g = 0j
    back = cmath.exp(-1j * axis)
    f, g = f * back, g * back
    s, d, slope = believed(state, belief.energy, complex(mean_d, mean_q))
    add(state, f, g - s * f - d * f.conjugate(), forgetting(tuning.period))
    correct(
        state,
        angle_error(d, slope, solve(state, believed_weight(tuning))[1], belief.energy),
        tuning,
    )
    return tracked(state, state[AXIS], y_d, y_q, tuning)


def init(belief, tuning, angle=None):
    """Return the state before starting up, or ready to track from a known angle (rad)."""
    return tell(blank(OWN), angle)


ESTIMATOR = Estimator(
    "arbitrary",
    "1/inductance fitted to any commanded voltage by least squares, angle of its saliency",
    init,
    step,
    delay="0.5 (N - 1) samples of forgetting (N samples an injection period)",
    speeds="0 to where the current loop behind the injection's average holds",
    source="Paulus, Landsmann, Kennel, SLED 2011 (arbitrary injection, direct angle); filter "
    "and belief derived here",
)
