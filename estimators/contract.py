"""What every estimator is given and gives: commands and measurements in, position and speed out.

An estimator is two functions,
  init(belief, tuning, angle=None) -> state              state: flat float64 array, its only memory
  step(state, sample, belief, tuning) -> Estimate        updates the state in place
called once a sampling period.  A compiled one has the explicit signature STEP and is passed into
the loop as a function pointer; one written in Python keeps whatever object it likes as state and
runs on the slower path.  One that reads the current inside the PWM period (PWM) is given an
Oversampled in place of the Sample: signature STEP_INSIDE.
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

PULSATING, ROTATING, NONE, PWM, RANDOM = "pulsating", "rotating", "none", "pwm", "random"
MAX_PERIOD = 64  # samples in an injection period


class Sample(NamedTuple):
    """What an estimator is given once a sampling period, at t_k; nothing in it comes from the true
    rotor.

    Parameters
    ----------
    i_alpha, i_beta : float
        A: current along alpha and beta, as the sensors read it at t_k.
    u_alpha, u_beta : float
        V: voltage commanded along alpha and beta for the interval that ends at t_k.
    carrier : float
        s: zero-mean primitive F of the injected waveform at t_k, the ripple of the flux (Wb) for
        each injected volt.

    Examples
    --------
    >>> from sandbox import Sample
    >>> Sample(i_alpha=0.5, i_beta=0.0, u_alpha=10.0, u_beta=0.0, carrier=1e-4).u_alpha
    10.0
    """

    i_alpha: float
    i_beta: float
    u_alpha: float
    u_beta: float
    carrier: float


@kernel
def as_sample(row):
    """Return the Sample whose numbers stand in a row (5,), in its order."""
    return Sample(i_alpha=row[0], i_beta=row[1], u_alpha=row[2], u_beta=row[3], carrier=row[4])


# what stands in a row of `Oversampled.readings`
READ_ALPHA, READ_BETA, COMMANDED_ALPHA, COMMANDED_BETA = range(4)


class Oversampled(NamedTuple):
    """A Sample, and what was read inside the PWM period that ends at t_k."""

    i_alpha: float  # A, as in Sample
    i_beta: float  # A, as in Sample
    u_alpha: float  # V, as in Sample
    u_beta: float  # V, as in Sample
    carrier: float  # s, as in Sample
    # (n, 4), see READ_ALPHA: A read at t_k - h + (j + 1/2) h/n, V s commanded since t_k - h
    readings: np.ndarray


class Estimate(NamedTuple):
    """What an estimator makes of a sample.

    Parameters
    ----------
    theta : float
        rad: electrical angle of the magnet axis at t_k.
    omega : float
        rad/s: electrical speed.
    axis : float
        rad: angle of the axis to inject along.
    bias : float
        A: current to hold along theta while starting up.
    tracking : float
        No unit: 0 while starting up, 1 after it, 2 where the belief has no flux at the measured
        current.
    ripple_d, ripple_q : float
        A: amplitude of the current's ripple along the axis and across it.
    injection : float, default 1.0
        No unit, 0 to 1: share of the injection's amplitude that is wanted.

    Examples
    --------
    >>> from sandbox import Estimate
    >>> Estimate(theta=0.1, omega=0.0, axis=0.1, bias=0.0, tracking=1.0, ripple_d=0.02, ripple_q=0.0).injection
    1.0
    """  # noqa: E501

    theta: float
    omega: float
    axis: float
    bias: float
    tracking: float
    ripple_d: float
    ripple_q: float
    injection: float = 1.0


class Belief(NamedTuple):
    """What an estimator believes of the motor; it is never the truth, and never changed.

    Parameters
    ----------
    energy : Energy or SplineEnergy
        The magnetic model: a quartic (its coefficients in 1/H, A/Wb^2 and A/Wb^3), or a flux map.
    magnet_flux : float
        Wb: peak flux of the magnets along d.
    resistance : float
        ohm: of a phase winding.
    pole_pairs : float
        Electrical angle over mechanical angle.
    inertia : float
        kg m^2: of the whole shaft.

    Examples
    --------
    >>> from sandbox import Belief, load_motor
    >>> motor = load_motor("ipm_exchanged").motor
    >>> linear = Belief(motor.linear_energy, motor.magnet_flux, motor.resistance, 6.0, motor.inertia)
    >>> round(1.0 / linear.energy.gamma_d, 6)  # H, along d
    0.0458
    """  # noqa: E501

    energy: AnyEnergy
    magnet_flux: float
    resistance: float
    pole_pairs: float
    inertia: float


class Tuning(NamedTuple):
    """What an estimator is told about the drive and its gains: set by design before the run, none
    of it measured.

    Parameters
    ----------
    period : int
        Samples in an injection period, N.
    present : int
        1: the whole window is looked at from the present frame; 0: from the axis of each sample.
    settle : int
        Injection periods to wait for in each step of starting up.
    average : int
        Injection periods to average after these.
    sampling_period : float
        s: from one sample to the next.
    amplitude : float
        V: of the injected voltage.
    power : float
        s^2: sum of F^2 over an injection period (F: see `Sample.carrier`).
    peak : float
        s: largest magnitude of F.
    lag : float
        s^2: -<F, F''''>/<F, F''> of the sampled carrier, the weight of the (R Gamma)^2 correction.
    kp : float
        1/s: proportional gain of the tracking loop.
    ki : float
        1/s^2: integral gain of the tracking loop.
    bias : float
        A: current along d, either way, that tells the magnet's north from its south.
    current_variance : float
        A^2: of the noise of a current reading, one axis.
    flux_variance : float
        Wb^2 a step: of what the flux does beside the belief (Kalman filters).
    speed_variance : float
        (rad/s)^2 a step: of what the speed does unforeseen (Kalman filters).

    Examples
    --------
    >>> from sandbox import simulate
    >>> tuning = simulate("ipm_exchanged", duration=0.05).design.tuning
    >>> tuning.period, tuning.sampling_period, tuning.amplitude
    (8, 0.00025, 30.0)
    """

    period: int
    present: int
    settle: int
    average: int
    sampling_period: float
    amplitude: float
    power: float
    peak: float
    lag: float
    kp: float
    ki: float
    bias: float
    current_variance: float
    flux_variance: float
    speed_variance: float


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
    """Tell whether a belief is plain floats about a quartic, hence of type BELIEF: asking numba
    takes 20 us."""
    return type(belief.energy) is Energy and all(
        type(x) is float for x in (*belief.energy, *belief[1:])
    )


@dataclass(frozen=True, repr=False)
class Estimator:
    """An estimator: its name, its two functions, and what its card says.

    Parameters
    ----------
    name : str
        As it is asked for; not that of a built-in one.
    summary : str
        One line: what it does.
    init : callable
        ``init(belief, tuning, angle=None) -> state``; angle: rad, where the rotor is, None to find
        it. The state is the estimator's only memory: an array of float64 if `compiled`, otherwise
        any object.
    step : callable
        ``step(state, sample, belief, tuning) -> Estimate``, called once a sampling period with a
        `Sample`, a `Belief` and a `Tuning`; it changes the state in place.
    compiled : bool, default True
        Whether `step` has the signature STEP of this module and runs inside the compiled loop. A
        step in Python (False) runs on a slower path.
    injection : {'pulsating', 'rotating', 'none', 'pwm', 'random'}, default 'pulsating'
        What it injects while it tracks ('pwm': nothing, it reads the ripple of the PWM itself;
        'random': a square wave of random cycles); starting up always pulsates.
    delay : str, default ''
        In words: how late it tells the angle.
    speeds : str, default ''
        In words: where it may be used.
    source : str, default ''
        Where it is published.
    type_2 : bool, default True
        Whether `Tuning.kp` and `Tuning.ki` are the gains of a type 2 loop around the injection's
        ripple, and nothing else. Gains that a firmware publishes (`[injection] tracking`) act on
        such a loop only.

    Examples
    --------
    An estimator that believes that the rotor never turns:

    >>> from sandbox import Estimate, Estimator, Sample
    >>> def init(belief, tuning, angle=None):
    ...     return [angle or 0.0]
    >>> def step(state, sample, belief, tuning):
    ...     return Estimate(state[0], 0.0, state[0], bias=0.0, tracking=1.0, ripple_d=0.0, ripple_q=0.0)
    >>> Estimator("still", "the rotor never turns", init, step, compiled=False)
    <Estimator: still, the rotor never turns>
    """  # noqa: E501

    name: str
    summary: str
    init: Callable[..., Any]
    step: Callable[[Any, Any, Belief, Tuning], Estimate]
    compiled: bool = True
    injection: str = PULSATING
    delay: str = ""
    speeds: str = ""
    source: str = ""
    type_2: bool = True

    def __repr__(self) -> str:
        return f"<Estimator: {self.name}, {self.summary}>"

    @property
    def takes_published(self) -> bool:
        """Whether gains that a firmware publishes for its tracking loop have a loop to act on."""
        return self.type_2 and self.injection not in (NONE, PWM)

    @property
    def inside(self) -> bool:
        """Whether it reads the current inside the PWM period, pulses shifted for it."""
        return self.injection == PWM

    @property
    def sample(self) -> Any:
        """What it is given, as a numba type."""
        return OVERSAMPLED if self.inside else SAMPLE

    def step_for(self, belief: Belief) -> Any:
        """Return the compiled step for a belief's kind of energy: STEP, or another compiled when
        first asked for."""
        if not self.compiled or is_usual(belief) or (kind := numba.typeof(belief)) == BELIEF:
            return self.step
        return compiled_as(ESTIMATE(STATE, self.sample, kind, TUNING), self.step.py_func)  # type: ignore[attr-defined]
