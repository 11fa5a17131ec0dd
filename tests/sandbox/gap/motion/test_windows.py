"""Averages of a window are those of the motion, whatever happens between its rows; their intervals
hold the truth."""

import math

import numpy as np
import pytest

from sandbox.gap.motion.judging import judge
from sandbox.gap.motion.windows import SAMPLES, averages
from sandbox.recordings.motion_log import MotionRecording
from tests.sandbox.gap.motion.shafts import INERTIA, campaign, thrown


@pytest.mark.parametrize("power", [0, 1, 2])
def test_readings_are_averaged_as_parabolas_and_so_are_paths(power):
    """K is linear from row to row, so with level l and tilt k of each row the mean of t^2 is the
    sum of l (m^2 + 1/12) + k m/6, m being the middle of a row; shorter powers likewise.  A path
    knows t at four places of a row: its mean square is 1/12 (1 - 1/16) there."""
    t = np.arange(float(SAMPLES))
    a = averages(MotionRecording("rows", t, t**3, 0.0 * t, 0.0 * t), campaign())
    m, level, tilt = t[:-1] + 0.5, a.level[0], a.tilt[0]
    exact = [level.sum(), level @ m + tilt.sum() / 12.0, level @ (m**2 + 1 / 12) + tilt @ m / 6.0]
    assert a.kernel[0] @ t**power == pytest.approx(exact[power], rel=1e-12)
    places = t[:-1, None] + np.array([0.125, 0.375, 0.625, 0.875])
    assert a.along(places**power)[0] == pytest.approx(exact[power], rel=2e-4)
    # the parabola's speed and acceleration are those at K's centre: of t^3, 3 t^2 and 6 t
    assert a.acceleration[0] == pytest.approx(6.0 * exact[1], rel=1e-9)


def test_a_jump_is_averaged_right_wherever_it_stands():
    """On average over all places of a jump in a row; at each it is off by what one row holds."""
    t = np.arange(float(SAMPLES))
    shares, off = (np.arange(100) + 0.5) / 100.0, []
    for share in shares:
        torque = np.where(t < 11.0 + share, 0.0, 1.0)
        a = averages(MotionRecording("jump", t, t**2, torque, 0.0 * t), campaign())
        # what is left of row 11 after the jump, K being k + tilt (s - 1/2) there
        part = (1.0 - share) * a.level[0, 11] + a.tilt[0, 11] * 0.5 * share * (1.0 - share)
        off.append(a.torque[0] - a.level[0, 12:].sum() - part)
    largest = np.max(a.level)
    assert abs(np.mean(off)) < 0.01 * largest
    assert np.max(np.abs(off)) < 0.6 * largest


@pytest.mark.parametrize(
    ("rows", "count", "scatter", "tolerance"),
    [(20e-3, math.tau / 3600, 0.5e-3, 2e-3), (2e-3, math.tau / 512, 0.0, 5e-3)],
)
def test_slow_rows_and_coarse_encoders_leave_the_inertia_unbiased(rows, count, scatter, tolerance):
    """A throttle to and fro against 20 mN m of friction: rows of 20 ms made the inertia 0.3 to 3 %
    too large, an encoder of 512 counts 0.4 %.  Tolerance: the truth within twice the 95 % interval
    of every run, and on average over six runs within what four of these intervals allow."""
    found = []
    for seed in range(6):
        runs = (thrown(10 * seed + k, rows, count, scatter=scatter) for k in range(2))
        m = judge(campaign(*runs, inertia=1.2 * INERTIA, count=count))
        low, high = m.best.shaft.ci95("inertia")
        value = m.best.shaft.value("inertia")
        assert abs(value - INERTIA) < high - low
        found.append(value / INERTIA - 1.0)
    assert abs(np.mean(found)) < tolerance
