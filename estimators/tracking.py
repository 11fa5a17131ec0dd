"""Tracking loops: from a position error signal to angle and speed."""

from __future__ import annotations

from estimators.demodulation import ACCELERATION, AXIS, LOAD_TORQUE, OMEGA, SLOW_OMEGA
from model.compiled import kernel

SLOW = 0.05  # of kp: a correction by the speed must not close a loop of its own
LARGEST_ERROR = 0.5  # rad; a demodulated error beyond it is noise or a slipped pole


@kernel
def predict(state, tuning):
    """Advance the angle to t_k with the last speed; return it.  SLOW_OMEGA is that speed without
    its noise."""
    state[SLOW_OMEGA] += (
        SLOW * tuning.sampling_period * tuning.kp * (state[OMEGA] - state[SLOW_OMEGA])
    )
    state[AXIS] += tuning.sampling_period * state[OMEGA]
    return state[AXIS]


@kernel
def correct(state, error, tuning):
    """Type-2 phase-locked loop: proportional and integral action on the error signal (rad)."""
    error = min(max(error, -LARGEST_ERROR), LARGEST_ERROR)
    state[AXIS] += tuning.sampling_period * tuning.kp * error
    state[OMEGA] += tuning.sampling_period * tuning.ki * error


@kernel
def correct_type_3(state, error, tuning):
    """Type-3 loop: no lag on a ramp of speed.  Triple pole at kp/3, which keeps the crossover of
    the type-2 loop.

    (s + w)^3 = s^3 + kp s^2 + kp^2/3 s + kp^3/27, kp = 3 w.
    """
    error = min(max(error, -LARGEST_ERROR), LARGEST_ERROR)
    h, kp = tuning.sampling_period, tuning.kp
    state[ACCELERATION] += h * kp**3 / 27.0 * error
    state[OMEGA] += h * (state[ACCELERATION] + kp * kp / 3.0 * error)
    state[AXIS] += h * kp * error


@kernel
def correct_mechanical(state, error, torque, belief, tuning):
    """Mechanical observer: the believed motor torque (N m) turns a believed inertia, a load torque
    takes up the rest.

    The same triple pole; the load torque (N m) is the acceleration of `correct_type_3` in other
    units.
    """
    error = min(max(error, -LARGEST_ERROR), LARGEST_ERROR)
    h, kp, per_torque = tuning.sampling_period, tuning.kp, belief.pole_pairs / belief.inertia
    state[LOAD_TORQUE] -= h * kp**3 / 27.0 * error / per_torque
    state[OMEGA] += h * (per_torque * (torque - state[LOAD_TORQUE]) + kp * kp / 3.0 * error)
    state[AXIS] += h * kp * error
