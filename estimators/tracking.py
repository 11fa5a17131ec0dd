"""Tracking loops: from a position error signal to angle and speed."""

from __future__ import annotations

from estimators.demodulation import AXIS, OMEGA
from model.compiled import kernel

LARGEST_ERROR = 0.5  # rad; a demodulated error beyond it is noise or a slipped pole


@kernel
def predict(state, tuning):
    """Advance the angle to t_k with the last speed; return it."""
    state[AXIS] += tuning.sampling_period * state[OMEGA]
    return state[AXIS]


@kernel
def correct(state, error, tuning):
    """Type-2 phase-locked loop: proportional and integral action on the error signal (rad)."""
    error = min(max(error, -LARGEST_ERROR), LARGEST_ERROR)
    state[AXIS] += tuning.sampling_period * tuning.kp * error
    state[OMEGA] += tuning.sampling_period * tuning.ki * error
