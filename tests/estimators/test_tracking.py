"""The loops that follow an angle by its error: what each lags by, in closed form."""

from types import SimpleNamespace

import pytest

from estimators.demodulation import AXIS, blank
from estimators.tracking import correct, correct_type_3, predict

H, KP, KI = 1e-4, 200.0, 1e4  # damped well: kp^2 = 4 ki
TUNING = SimpleNamespace(sampling_period=H, kp=KP, ki=KI)


def lag(loop, speed, acceleration, seconds=0.5):
    """Return the error (rad) that is left on a ramp of speed, of angles read without noise."""
    state, error = blank(), 0.0
    for k in range(round(seconds / H)):
        t = k * H
        angle = speed * t + 0.5 * acceleration * t * t
        error = angle - predict.py_func(state, TUNING)
        loop.py_func(state, error, TUNING)
    return error


@pytest.mark.parametrize("loop", [correct, correct_type_3])
def test_a_constant_speed_is_followed_without_error(loop):
    assert lag(loop, 50.0, 0.0) == pytest.approx(0.0, abs=1e-9)


def test_on_a_ramp_of_speed_type_two_lags_by_it_over_its_integral_gain_and_type_three_not():
    """omega' = ki e is the ramp once the error stands."""
    assert lag(correct, 0.0, 300.0) == pytest.approx(300.0 / KI, rel=1e-6)
    assert lag(correct_type_3, 0.0, 300.0) == pytest.approx(0.0, abs=1e-9)


def test_a_large_error_moves_the_angle_no_further_than_half_a_radian_would():
    """A slipped pole, or noise."""
    far, near = blank(), blank()
    correct.py_func(far, 3.0, TUNING)
    correct.py_func(near, 0.5, TUNING)
    assert far[AXIS] == near[AXIS] > 0.0
