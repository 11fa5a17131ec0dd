"""Injection by the PWM itself: the matrix of incremental 1/inductance fitted to the ripple inside
the switching period.

Nothing is added to the commanded voltage.  The current is read n times a period; the pulses' edges
are known, so is the voltage's integral psi up to each reading.  Between readings j of one period
  i_j = Gamma (psi_j - R integral of i - t_j e) + const,
e the back-EMF. What of psi - R integral of i and of i is no straight line over the period are flux
ripple f_j and current ripple g_j: constants, ramps and with them e are gone. The pulses' shift
turns its sign from
one period to the next; where f opposes the last period's, the same readings of that period are
taken off: f doubles, and what both have alike goes, dead time, the arc of a turning magnet, the
curvature of saturation over the ripple. Each pair is seen from its own period's estimated rotor
frame; the matrix between them is fitted and its turn is the error (`matrix_fit`), the believed one
being that at the mean current of both.

The belief's weight is that of a Gaussian saliency as uncertain as it is large,
  rho = 2 (sigma_i^2 / |D_0|^2 + sigma_psi^2),
sigma_i the reading's noise and sigma_psi what the inverter leaves of the volt-seconds: without
ripple the error is zero.
"""

from __future__ import annotations

import cmath

from estimators.believed import tracked
from estimators.contract import (
    COMMANDED_ALPHA,
    COMMANDED_BETA,
    PWM,
    READ_ALPHA,
    READ_BETA,
    STEP_INSIDE,
    Estimator,
)
from estimators.demodulation import AXIS, FREE, OMEGA, PHASE, blank
from estimators.matrix_fit import TAKEN, add, angle_error, believed, forgetting, get, put, solve
from estimators.startup import TRACKING, start, tell
from estimators.tracking import correct_type_3, predict
from model.compiled import kernel, kernel_as

MAX_READINGS = 32  # readings of a period
AGE = 2  # periods, one pair: the fit has a matrix in each, what averages is the tracking loop
# flux and current ripple of the last period and of the new one, each from its own frame, complex
F, G, NEW_F, NEW_G = range(FREE + TAKEN, FREE + TAKEN + 8 * MAX_READINGS, 2 * MAX_READINGS)
MEAN = FREE + TAKEN + 8 * MAX_READINGS  # current of the last period, complex
OWN = TAKEN + 8 * MAX_READINGS + 2


@kernel
def flux_of(readings, j, area, resistance):
    """Return the flux (Wb) at a reading that the voltage and R i have made; area: integral of the
    current (A s)."""
    return complex(readings[j, COMMANDED_ALPHA], readings[j, COMMANDED_BETA]) - resistance * area


@kernel
def lines(readings, h, resistance):
    """Return means and slopes a period of flux (Wb) and current (A) over a period's readings, by
    least squares."""
    n = readings.shape[0]
    area = psi_0 = psi_1 = i_0 = i_1 = 0j
    last = complex(readings[0, READ_ALPHA], readings[0, READ_BETA])
    for j in range(n):
        x, i = (j + 0.5) / n - 0.5, complex(readings[j, READ_ALPHA], readings[j, READ_BETA])
        area += 0.5 * h / n * (last + i)
        last = i
        psi = flux_of(readings, j, area, resistance)
        psi_0, psi_1, i_0, i_1 = psi_0 + psi, psi_1 + x * psi, i_0 + i, i_1 + x * i
    square = (n - 1.0 / n) / 12.0  # sum of x^2
    return psi_0 / n, psi_1 / square, i_0 / n, i_1 / square


@kernel
def ripples(state, readings, back, resistance, h):
    """Write f (Wb) and g (A) of a period, turned by `back`; return the scalar product of f with the
    last period's."""
    psi_0, psi_1, i_0, i_1 = lines(readings, h, resistance)
    n, product = readings.shape[0], 0.0
    area, last = 0j, complex(readings[0, READ_ALPHA], readings[0, READ_BETA])
    for j in range(n):
        x, i = (j + 0.5) / n - 0.5, complex(readings[j, READ_ALPHA], readings[j, READ_BETA])
        area += 0.5 * h / n * (last + i)
        last = i
        f = back * (flux_of(readings, j, area, resistance) - psi_0 - x * psi_1)
        product += (f * get(state, F + 2 * j).conjugate()).real
        put(state, NEW_F + 2 * j, f)
        put(state, NEW_G + 2 * j, back * (i - i_0 - x * i_1))
    return product


@kernel
def collect(state, readings, back, s, d, resistance, tuning):
    """Add a period's ripples less the last one's to the sums, where they oppose; back: stator to
    rotor frame."""
    opposed = ripples(state, readings, back, resistance, tuning.sampling_period) < 0.0
    add(state, 0j, 0j, forgetting(AGE))
    for j in range(readings.shape[0]):
        f, g = get(state, NEW_F + 2 * j), get(state, NEW_G + 2 * j)
        if opposed:
            new, made = f - get(state, F + 2 * j), g - get(state, G + 2 * j)
            add(state, new, made - s * new - d * new.conjugate(), 1.0)
        put(state, F + 2 * j, f)
        put(state, G + 2 * j, g)


@kernel
def believed_weight(energy, tuning):
    """Return rho (Wb^2)."""
    saliency = 0.5 * (energy.gamma_d - energy.gamma_q)
    return 2.0 * (tuning.current_variance / (saliency * saliency) + tuning.flux_variance)


@kernel_as(STEP_INSIDE)
def step(state, sample, belief, tuning):
    """Take one sample with the readings of the period that ends with it; see the module's text."""
    if state[PHASE] != TRACKING:
        return start(state, sample, belief, tuning)
    axis = predict(state, tuning)
    back = cmath.exp(-1j * (axis - 0.5 * tuning.sampling_period * state[OMEGA]))
    mean = 0j
    for j in range(sample.readings.shape[0]):
        mean += complex(sample.readings[j, READ_ALPHA], sample.readings[j, READ_BETA])
    mean *= back / sample.readings.shape[0]
    both = 0.5 * (mean + get(state, MEAN))
    put(state, MEAN, mean)
    s, d, slope = believed(state, belief.energy, both)
    collect(state, sample.readings, back, s, d, belief.resistance, tuning)
    d_d = solve(state, believed_weight(belief.energy, tuning))[1]
    correct_type_3(state, angle_error(d, slope, d_d, belief.energy), tuning)
    return tracked(state, state[AXIS], 0.0, 0.0, tuning, 0.0)


def init(belief, tuning, angle=None):
    """Return the state before starting up, or ready to track from a known angle (rad)."""
    return tell(blank(OWN), angle)


ESTIMATOR = Estimator(
    "pwm_ripple",
    "1/inductance fitted to the PWM's own ripple, read inside the period; angle of it",
    init,
    step,
    injection=PWM,
    delay="1.5 periods: pairs of periods, forgotten as an average over two",
    speeds="0 to where the current loop holds",
    source="Schroedl, IAS 1996 (INFORM); Gao, Asher, Sumner, Makys, IEEE Trans. Ind. Appl. "
    "43 (2007) (PWM excitation); pairs of periods, fit and belief derived here",
)
