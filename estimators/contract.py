"""What every estimator is given and gives: commands and measurements in, position and speed out.

An estimator is two functions,
  init(belief, tuning, angle=None) -> state              state: flat float64 array, its only memory
  step(state, sample, belief, tuning) -> Estimate        updates the state in place
called once a sampling period.  A compiled one has the explicit signature STEP and is passed into the loop as a
function pointer; one written in Python keeps whatever object it likes as state and runs on the slower path.  One that
reads the current inside the PWM period (PWM) is given an Oversampled in place of the Sample: signature STEP_INSIDE.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, NamedTuple

import numba
import numpy as np
from numba import types

from model.compiled import compiled_as, kernel
from model.energy import AnyEnergy, Energy

PULSATING, ROTATING, NONE, PWM = "pulsating", "rotating", "none", "pwm"
MAX_PERIOD = 64  # samples in an injection period


class Sample(NamedTuple):
    """What the drive knows at t_k; nothing here comes from the true rotor."""

    i_alpha: float  # A, as the sensors read it at t_k
    i_beta: float  # A, the same along beta
    u_alpha: float  # V, commanded for the interval that ends at t_k
    u_beta: float  # V, the same along beta
    carrier: float  # s, zero-mean primitive F of the injected waveform at t_k: flux ripple per volt


@kernel
def as_sample(row):
    """Return the Sample whose numbers stand in a row (5,), in its order."""
    return Sample(i_alpha=row[0], i_beta=row[1], u_alpha=row[2], u_beta=row[3], carrier=row[4])


READ_ALPHA, READ_BETA, TOLD_ALPHA, TOLD_BETA = range(4)  # what stands in a row of `Oversampled.readings`


class Oversampled(NamedTuple):
    """A Sample, and what was read inside the PWM period that ends at t_k."""

    i_alpha: float  # A, as in Sample
    i_beta: float  # A, as in Sample
    u_alpha: float  # V, as in Sample
    u_beta: float  # V, as in Sample
    carrier: float  # s, as in Sample
    readings: np.ndarray  # (n, 4), see READ_ALPHA: A read at t_k - h + (j + 1/2) h/n, V s commanded since t_k - h


class Estimate(NamedTuple):
    """What the estimator makes of it."""

    theta: float  # rad, electrical, of the magnet axis at t_k
    omega: float  # rad/s, electrical
    axis: float  # rad, where to inject
    bias: float  # A, current to hold along theta while starting up
    tracking: float  # no unit: 0 while starting up, 1 after, 2 where the belief has no flux at the measured current
    ripple_d: float  # A, amplitude of the current's ripple along the axis
    ripple_q: float  # A, the same across the axis
    injection: float = 1.0  # no unit, 0 to 1: share of the injection's amplitude that is wanted


class Belief(NamedTuple):
    """What the estimator believes of the motor; never the truth, never changed."""

    energy: AnyEnergy  # magnetic model: a quartic (its coefficients in 1/H, A/Wb^2, A/Wb^3) or a flux map
    magnet_flux: float  # Wb, flux of the magnets along d
    resistance: float  # ohm, of a phase winding
    pole_pairs: float  # pairs of poles: electrical angle over mechanical angle
    inertia: float  # kg m^2, of the whole shaft


class Tuning(NamedTuple):
    """Everything set by design (`sandbox.drive.design`), none of it measured."""

    period: int  # samples in an injection period, N
    present: int  # 1: the whole window is looked at from the present frame, 0: from the axis of each sample
    settle: int  # injection periods to wait for in each step of starting up
    average: int  # injection periods to average, after these
    sampling_period: float  # s, from one sample to the next
    amplitude: float  # V, of the injected voltage
    power: float  # s^2, sum of F^2 over a period
    peak: float  # s, max |F|
    lag: float  # s^2, -<F, F''''>/<F, F''> of the sampled carrier: weight of the (R Gamma)^2 correction
    kp: float  # 1/s, proportional gain of the tracking loop
    ki: float  # 1/s^2, integral gain of the tracking loop
    bias: float  # A, current along d, either way, that tells the magnet's north from its south
    current_variance: float  # A^2, of the noise of a current reading, one axis
    flux_variance: float  # Wb^2 a step, of what the flux does beside the belief (Kalman filters)
    speed_variance: float  # (rad/s)^2 a step, of what the speed does unforeseen (Kalman filters)


_ZERO_BELIEF = Belief(Energy(*7 * (0.0,)), 0.0, 0.0, 0.0, 0.0)
_ZERO_TUNING = Tuning(0, 0, 0, 0, *11 * (0.0,))
SAMPLE = numba.typeof(Sample(*5 * (0.0,)))
OVERSAMPLED = numba.typeof(Oversampled(*5 * (0.0,), np.zeros((1, 4))))
ESTIMATE = numba.typeof(Estimate(*8 * (0.0,)))
BELIEF = numba.typeof(_ZERO_BELIEF)
TUNING = numba.typeof(_ZERO_TUNING)
STATE = types.Array(types.float64, 1, "C")
STEP = ESTIMATE(STATE, SAMPLE, BELIEF, TUNING)
STEP_INSIDE = ESTIMATE(STATE, OVERSAMPLED, BELIEF, TUNING)


def is_usual(belief: Belief) -> bool:
    """Tell whether a belief is plain floats about a quartic, hence of type BELIEF: asking numba takes 20 us."""
    return type(belief.energy) is Energy and all(type(x) is float for x in (*belief.energy, *belief[1:]))


@dataclass(frozen=True, repr=False)
class Estimator:
    """An estimator by name: its two functions, one line on what it does, and its card."""

    name: str  # as it is asked for
    summary: str  # one line: what it does
    init: Callable[..., Any]  # (belief, tuning, angle) -> state; angle: rad, None to find it
    # (state, sample, belief, tuning) -> Estimate, once a sampling period; changes the state
    step: Callable[[Any, Any, Belief, Tuning], Estimate]
    compiled: bool = True  # whether step has the signature STEP and runs inside the compiled loop
    injection: str = PULSATING  # PULSATING, ROTATING, NONE or PWM (its own ripple); starting up always pulsates
    delay: str = ""  # in words: how late it tells the angle
    speeds: str = ""  # where it may be used
    source: str = ""  # where it is published

    def __repr__(self) -> str:
        return f"<Estimator: {self.name}, {self.summary}>"

    @property
    def inside(self) -> bool:
        """Whether it reads the current inside the PWM period, pulses shifted for it."""
        return self.injection == PWM

    @property
    def sample(self) -> Any:
        """What it is given, as a numba type."""
        return OVERSAMPLED if self.inside else SAMPLE

    def step_for(self, belief: Belief) -> Any:
        """Return the compiled step for a belief's kind of energy: STEP, or another compiled when first asked for."""
        if not self.compiled or is_usual(belief) or (kind := numba.typeof(belief)) == BELIEF:
            return self.step
        return compiled_as(ESTIMATE(STATE, self.sample, kind, TUNING), self.step.py_func)  # type: ignore[attr-defined]
