"""Current read several times inside the PWM period, and pulses shifted leg by leg so that there is
a ripple to read.

Centred pulses of equal duty switch together: at standstill without load the three legs leave next
to no voltage between them. Moving one leg's pulse late and another's early by the same time puts an
active vector at either end of the pulses and leaves every leg's volt-seconds of the period as they
were. Which two legs move changes from period to period, each pair in both senses before the next,
so that over six periods the ripple has every direction and its mean none; the reading at t_k stays
in the zero vector. Phase-shifted carriers are one such shift for good, edge shifting is what
current reconstruction from one shunt does to gain time.

This is what the drive commands and hands to its estimator, whichever plant it runs on.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numba import types
from numba.extending import overload

from estimators.contract import Oversampled
from model.compiled import kernel
from model.frames import stationary
from model.parameters import Converter

USUAL_READINGS = 16  # a period
USUAL_SHIFT = 0.05  # of a period: 12.5 us at 4 kHz, a few times a dead time


class Inside(NamedTuple):
    """Room for what is read inside a period, and how far pulses are shifted for it."""

    # (n, 4), of the period that ends with the sample: see `estimators.contract.Oversampled`
    readings: Any
    # (n, 2), A: currents held before the pattern of their period begins, where it comes late
    ahead: Any
    shift: float  # s


def inside_of(converter: Converter) -> Inside:
    """Return room for a drive's readings inside the period, no current read yet, and its shift of
    pulses."""
    n = converter.readings or USUAL_READINGS
    return Inside(np.zeros((n, 4)), np.zeros((n, 2)), shift_of(converter))


def shift_of(converter: Converter) -> float:
    """Return by how much pulses are shifted (s)."""
    share = USUAL_SHIFT if converter.pulse_shift is None else converter.pulse_shift
    return share * converter.sampling_period


@kernel
def shift_pulses(legs, k, shift):
    """Write by how much each leg's pulse of period k is late (s): leg k/2 by shift, the next one
    early; in odd periods the reverse."""
    first = (k // 2) % 3
    late = shift if k % 2 == 0 else -shift
    legs[0] = legs[1] = legs[2] = 0.0
    legs[first] = late
    legs[(first + 1) % 3] = -late


@kernel
def volt_seconds(t, period, duty, shift, u_dc):
    """Return what one leg has commanded t after its period began (V s); its pulse stays within the
    period."""
    room = 0.5 * (1.0 - duty) * period
    late = min(max(shift, -room), room)
    return u_dc * min(max(t - room - late, 0.0), duty * period)


@kernel
def commanded(t, period, duties, legs, u_dc):
    """Return alpha, beta (V s) of what three legs have commanded t after their period began.

    duties, legs: three each, the latter their pulses' shift (s); u_dc: the link as read, by which
    duties were formed.
    """
    return stationary(
        volt_seconds(t, period, duties[0], legs[0], u_dc),
        volt_seconds(t, period, duties[1], legs[1], u_dc),
        volt_seconds(t, period, duties[2], legs[2], u_dc),
    )


def ask(step, state, sample, inside, belief, tuning):
    """Return the estimate of a sample, or of it and the readings inside the period where there are
    any."""
    if inside is None:
        return step(state, sample, belief, tuning)
    i_alpha, i_beta, u_alpha, u_beta, carrier = sample
    return step(
        state,
        Oversampled(i_alpha, i_beta, u_alpha, u_beta, carrier, inside.readings),
        belief,
        tuning,
    )


@overload(ask)
def _ask(step, state, sample, inside, belief, tuning):
    """Choose the branch by type: only one of them fits the step."""
    if isinstance(inside, types.NoneType):
        return lambda step, state, sample, inside, belief, tuning: step(
            state, sample, belief, tuning
        )

    def oversampled(step, state, sample, inside, belief, tuning):
        """Hand the readings inside over with the sample."""
        i_alpha, i_beta, u_alpha, u_beta, carrier = sample
        return step(
            state,
            Oversampled(i_alpha, i_beta, u_alpha, u_beta, carrier, inside.readings),
            belief,
            tuning,
        )

    return oversampled
