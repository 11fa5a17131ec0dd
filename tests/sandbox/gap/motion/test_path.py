"""The path between rows turns back where the rotor does, before and after which it accelerates
unlike; a coarse encoder hides it within what its counts allow."""

import math

import numpy as np
import pytest

from sandbox.gap.motion.path import COUNT, PLACES, path_of, vertices
from sandbox.recordings.motion_log import MotionRecording

BEFORE, AFTER = -500.0, -300.0  # rad/s^2: 40 +- 10 mN m of torque and friction on 1e-4 kg m^2


def turning(at, rows, count=0.0, *, speed=False):
    """A rotor that turns back at an instant, read 20 rows before it to 20 after it."""
    t = rows * np.arange(40.0)
    away = t - at
    slope = np.where(away < 0.0, BEFORE, AFTER)
    angle = 0.5 * slope * away**2
    read = count * np.round(angle / count) if count else angle
    beside = {"speed": slope * away} if speed else {}
    return MotionRecording("turn", t, read, 0.0 * t, 0.0 * t, beside)


@pytest.mark.parametrize("speed", [False, True])
@pytest.mark.parametrize("share", [0.1, 0.35, 0.5, 0.9])
def test_it_turns_back_at_the_instant_at_which_the_rotor_does(share, speed):
    """Two parabolas are what it looks for: what is left is a step of its search, 2 x 3 rows / 40 /
    40 of it."""
    rows = 0.02
    at = (20.0 + share) * rows
    _, path = path_of(turning(at, rows, speed=speed), 0.0, 0.0)
    true = rows * (np.arange(39.0)[:, None] + PLACES) - at
    near = np.abs(true) < 1.5 * rows
    assert path.shape[1] == COUNT
    np.testing.assert_allclose(
        path[near],
        (true * np.where(true < 0.0, BEFORE, AFTER))[near],
        atol=-BEFORE * rows * 6.0 / 40.0 / 40.0,
    )


def test_a_straight_line_between_speeds_turns_back_too_late():
    """What the path is for: on a line from (share x 500) to (1 - share) x -300 rad/s per row, the
    zero is at 500 share / (500 share + 300 (1 - share)) of the row."""
    share = 0.5
    late = 500.0 * share / (500.0 * share + 300.0 * (1.0 - share)) - share
    assert late == pytest.approx(0.125)


@pytest.mark.parametrize("share", [0.1, 0.5, 0.9])
def test_a_coarse_encoder_is_read_over_more_rows(share):
    """A count is 0.012 rad, 2 ms a row move the rotor by 0.001: the instant is told within a row
    (noise of two parabolas of 20 rows: (count^2/12)^0.5 / (400 x 20 rows) / 20^0.5 ~ 0.02 rows,
    and counts do not scatter at random: ten times that)."""
    rows = 2e-3
    at = (20.0 + share) * rows
    _, path = path_of(turning(at, rows, math.tau / 512), 0.0, math.tau / 512)
    flat = path.ravel()
    place = rows * (np.arange(39.0)[:, None] + PLACES).ravel()
    crossing = place[1:][(flat[1:] < 0.0) & (flat[:-1] >= 0.0)]
    assert len(crossing) == 1
    assert abs(crossing[0] - at) < rows


def test_a_rotor_that_stands_between_does_not_turn_back_at_an_instant():
    """Forward, a long stop, backward: no parabolas are drawn through the stop."""
    t = 1e-3 * np.arange(300)
    speed = np.where(t < 0.1, 10.0, np.where(t < 0.2, 0.0, -10.0))
    angle = np.concatenate([[0.0], np.cumsum(0.5 * (speed[1:] + speed[:-1]) * 1e-3)])
    count = 1e-3
    read = count * np.round(angle / count)
    _, path = path_of(MotionRecording("stop", t, read, 0 * t, 0 * t), 0.0, count)
    # what a count makes of a speed over 12 rows: it stands
    assert np.max(np.abs(path[115:185])) <= count / 12e-3


def test_turns_side_by_side_are_those_of_each_alone():
    """An angle that is noise turns back every other row: hundreds of turns of few and of many rows
    are padded to one length, which changes none."""
    rng = np.random.default_rng(2)
    t = 1e-3 * np.cumsum(rng.uniform(0.8, 1.2, 900))
    angle = np.concatenate([rng.standard_normal(450), 9.0 * np.sin(30.0 * t[450:])])
    low = np.arange(0, 850, 7)
    rows = np.stack([low, low + 4 + low % 41])
    within = np.stack([t[rows[0]], t[np.minimum(rows[1], 899)]])
    together = vertices(t, angle, rows, within)
    for k in range(len(low)):
        alone = vertices(t, angle, rows[:, [k]], within[:, [k]])
        np.testing.assert_allclose(together[[k]], alone, rtol=1e-9)
