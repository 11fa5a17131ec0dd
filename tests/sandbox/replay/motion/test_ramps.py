"""Ramps behind an encoder's counts, against motions that are planted."""

import math

import numpy as np
import pytest

from sandbox.replay.motion import ramps, rounded
from sandbox.replay.motion.ramps import _least_squares, ramps_of
from sandbox.replay.motion.rounded import HALF, within_counts
from sandbox.replay.motion.smoothing import driven_motion

PERIOD, COUNT, PAIRS, N = 250e-6, 2.0 * math.pi * 2.0 / 4096.0, 2, 2400
DEVIATION = COUNT / math.sqrt(12.0)


def planted(corners, speeds, n=N):
    """Angle and speed of straight ramps: corners in samples, speeds (rad/s) there; integrated by
    the trapezoid, which is exact between corners on samples."""
    speed = np.interp(np.arange(n), corners, speeds)
    return np.concatenate([[0.3], 0.3 + np.cumsum(0.5 * (speed[1:] + speed[:-1])) * PERIOD]), speed


def counted(angle):
    return COUNT * np.round(angle / COUNT)


def test_corners_angle_and_speed_of_planted_ramps_are_found():
    """Bound on the angle: 9 unknowns behind n uniform errors leave DEVIATION sqrt(9/n) rms (linear
    least squares)."""
    angle, speed = planted([0, 650, 1130, 1660, N], [0.0, 37.4, 37.4, -56.2, -56.2])
    ramps = ramps_of(counted(angle), PAIRS, COUNT)
    assert ramps.corners * N == pytest.approx([650, 1130, 1660], abs=1.0)
    assert np.sqrt(np.mean((ramps.angle - angle) ** 2)) < 2.0 * DEVIATION * math.sqrt(9.0 / N)
    # one sample off a corner: 0.08 and 0.18 rad/s a sample
    assert np.abs(ramps.speed / PERIOD - speed).max() < 0.1


def test_a_steady_speed_has_no_corner_even_where_counts_beat_with_the_sampling():
    """0.2501 counts a sample: the error of counting is a sawtooth of 2500 samples, nothing
    independent in it."""
    for per_sample in (0.2501, 1.0003, 4.577):
        ramps = ramps_of(counted(0.1 + COUNT * per_sample * np.arange(8000)), PAIRS, COUNT)
        assert len(ramps.corners) == 0


@pytest.mark.parametrize("per_sample", [(13.0, -19.5), (-14.5, 21.75), (6.0, 6.25)])
def test_counts_that_beat_with_the_sampling_bound_the_motion(per_sample):
    """Steady speeds of simple fractions of counts a sample: their errors of rounding repeat, and
    least squares leave readings more than half a count off.  The planted motion is within the
    counts by construction; the centre of all that are lies nearer to it, and the steady speed
    drifts by far less than a count in the 523 samples it lasts.
    """
    first, last = (x * COUNT / PERIOD for x in per_sample)
    angle, _ = planted([0, 585, 1108, 1810, N], [0.0, first, first, last, last])
    read = counted(angle)
    rough = ramps_of(read, PAIRS, COUNT)
    fine = within_counts(read, rough, PAIRS, COUNT)
    assert np.abs(read - rough.angle - rough.sine).max() > 0.5 * COUNT
    assert np.abs(read - fine.angle - fine.sine).max() <= HALF * COUNT
    assert np.sqrt(np.mean((fine.angle - angle) ** 2)) < 0.5 * np.sqrt(
        np.mean((rough.angle - angle) ** 2)
    )
    assert fine.speed[700:1000] / COUNT == pytest.approx(per_sample[0], abs=0.1 / 523)


def test_readings_that_hold_more_than_rounding_keep_least_squares():
    """Noise of a count beside it: no ramps are within half a count of all readings."""
    angle, _ = planted([0, 650, 1130, N], [0.0, 37.4, 37.4, -56.2])
    read = counted(angle + COUNT * np.random.default_rng(5).standard_normal(N))
    rough = ramps_of(read, PAIRS, COUNT)
    assert within_counts(read, rough, PAIRS, COUNT) is rough


def test_a_sine_of_once_a_turn_stays_in_the_motion_and_is_an_encoder_s_or_the_rotor_s():
    """A sine of 0.01 rad mechanical, 23 counts' deviations: motion and speed have it to two
    deviations of the fit; who reads on takes an encoder's error off."""
    true, _ = planted([0, 500, 1500, N], [0.0, 120.0, -80.0, -80.0])
    angle = true + PAIRS * 0.01 * np.sin(true / PAIRS + 0.4)
    motion = driven_motion(counted(angle), PAIRS, PERIOD, COUNT)
    assert motion.eccentric
    away = motion.angle - angle - np.mean(motion.angle - angle)
    assert np.sqrt(np.mean(away**2)) < 2.0 * DEVIATION * math.sqrt(10.0 / N)
    speed = np.gradient(angle) / PERIOD
    assert np.abs(motion.speed - speed)[100:400].max() < 0.1  # as of ramps alone


@pytest.mark.parametrize(("once", "order"), [(0.01, 2), (0.0, 2), (0.01, 8)])
def test_further_orders_of_a_turn_stay_in_the_motion(once, order):
    """An encoder's second or eighth order, six counts large: ramps and a sine of once a turn miss
    it, so that a smooth motion about them has all of it, to half of what rounding leaves of one
    reading; who reads on takes an encoder's error off."""
    true, _ = planted([0, 500, 1500, N], [0.0, 120.0, -80.0, -80.0])
    turn = true / PAIRS
    angle = true + PAIRS * (once * np.sin(turn + 0.4) + 0.01 * np.sin(order * turn + 1.1))
    motion = driven_motion(counted(angle), PAIRS, PERIOD, COUNT)
    assert motion.eccentric
    assert np.sqrt(np.mean((motion.angle - angle) ** 2)) < 0.5 * DEVIATION


def test_ramps_without_a_sine_tell_that_the_encoder_has_none():
    """Then the reading is one of straight ramps, and an eccentric encoder would show in it."""
    angle, _ = planted([0, 500, 1500, N], [0.0, 120.0, -80.0, -80.0])
    assert not driven_motion(counted(angle), PAIRS, PERIOD, COUNT).eccentric


@pytest.mark.parametrize("twice", [0.15, 0.3])
def test_a_speed_that_wobbles_by_a_count_is_the_rotor_s(twice):
    """Once and twice a turn, as a machine that is not quite true wobbles: what once a turn leaves
    is more than rounding, so that no part of it is blamed on an eccentric encoder."""
    turn = 2.0 * math.pi * np.arange(8000) / 571.3
    angle = 0.3 + PAIRS * turn + COUNT * (1.1 * np.sin(turn) + twice * np.sin(2.0 * turn + 1.0))
    motion = driven_motion(counted(angle), PAIRS, PERIOD, COUNT)
    assert motion.eccentric
    assert np.sqrt(np.mean((motion.angle - angle) ** 2)) < 0.5 * DEVIATION


def test_a_corner_that_readings_cannot_show_is_not_made():
    """A step of acceleration that moves the angle by a tenth of a count's deviation until the end
    gains nothing: chi^2 = n (0.1)^2 / 5 = 5 (mean square of h^2/2 over half the recording is a
    fifth of its end's, half the time)."""
    k = np.arange(N)
    angle = 40.0 * PERIOD * k + 0.1 * DEVIATION * np.maximum(0.0, (k - N / 2) / (N / 2)) ** 2
    assert len(ramps_of(counted(angle), PAIRS, COUNT).corners) == 0


def test_a_motion_without_corners_is_smoothed():
    """A speed that swings by sixteen waves has more than the corners looked for: its motion follows
    within counts."""
    k = np.arange(N)
    angle = 20.0 * PERIOD * k + 0.2 * np.sin(2.0 * math.pi * 16.0 * k / N)
    motion = driven_motion(counted(angle), PAIRS, PERIOD, COUNT)
    assert np.sqrt(np.mean((motion.angle - angle) ** 2)) < DEVIATION


def test_a_reversal_is_no_sine_of_a_turn():
    """Some turns forward, a reversal within 60 samples, a speed that is uneven once and twice a
    turn, ten pole pairs: without corners a sine of half a radian would follow it best.  Behind the
    fit rounding alone is left: DEVIATION within `most_squares`."""
    pairs, period, n = 10, 50e-6, 6000
    count = 2.0 * math.pi * pairs / 16384
    speed = 33.0 * np.interp(np.arange(n), [0, 1050, 1110, n], [1.0, 1.0, -1.0, -1.0])
    turned = np.cumsum(speed) * period
    speed *= 1.0 + 2e-3 * np.sin(turned + 1.0) + 1e-3 * np.sin(2.0 * turned)
    angle = 0.3 + pairs * np.cumsum(speed) * period
    read = count * np.round(angle / count)
    motion = driven_motion(read, pairs, period, count)
    assert np.sqrt(np.mean((motion.angle - angle) ** 2)) < 0.3 * count / math.sqrt(12.0)
    assert np.abs(motion.speed - pairs * speed).max() < 0.02 * 330.0


def test_places_tried_a_few_at_a_time_are_the_same_places(monkeypatch):
    """As of a long recording, whose 39 places together would take too much memory."""
    read = counted(planted([0, 650, 1660, N], [0.0, 37.4, -56.2, -56.2])[0])
    together = ramps_of(read, PAIRS, COUNT)
    monkeypatch.setattr(ramps, "TOGETHER", 10.0 * N)
    apart = ramps_of(read, PAIRS, COUNT)
    assert len(together.corners) == 2
    assert np.array_equal(together.angle, apart.angle)


def test_a_long_recording_takes_the_readings_that_bound_most(monkeypatch):
    """Two of each 12 readings: the same motion to a hundredth of a count."""
    first, last = (x * COUNT / PERIOD for x in (13.0, -19.5))
    read = counted(planted([0, 585, 1108, 1810, N], [0.0, first, first, last, last])[0])
    rough = ramps_of(read, PAIRS, COUNT)
    whole = within_counts(read, rough, PAIRS, COUNT)
    monkeypatch.setattr(rounded, "BLOCKS", N // 12)
    part = within_counts(read, rough, PAIRS, COUNT)
    assert np.abs(part.angle - whole.angle).max() < 0.01 * COUNT


def test_an_uneven_speed_that_is_reversed_in_a_hurry_is_smoothed_about_its_ramps():
    """200 rad/s to -200 within 12 samples, uneven by 0.3 % once and twice a turn, which ramps with
    one sine do not hold: readings on counts bound the angle, and the turn is as sharp as planted. A
    smoother that knows of no ramps bends the angle by 1.8 counts there."""
    share = [0.0, 0.49, 0.49 + 12.0 / N, 1.0]
    angle, speed = planted([x * N for x in share], [200.0, 200.0, -200.0, -200.0])
    once = angle / PAIRS
    uneven = speed * (0.003 * np.sin(once) + 0.0015 * np.sin(2.0 * once))
    angle = angle + np.concatenate([[0.0], np.cumsum(0.5 * (uneven[1:] + uneven[:-1]))]) * PERIOD
    motion = driven_motion(counted(angle), PAIRS, PERIOD, COUNT)
    assert np.abs(motion.angle - angle).max() < 0.5 * COUNT
    # one sample off a corner is 33 rad/s
    assert np.abs(motion.speed - speed - uneven).max() < 33.0


@pytest.mark.parametrize("corners", [(), (0.3,), (0.2, 0.25, 0.7, 0.9), (0.5, 0.5 + 1e-7)])
def test_least_squares_are_those_of_the_columns_themselves(corners):
    """Coefficients that make an angle of 1e4 rad, what they leave, and the places of corners,
    against a decomposition of the columns (LAPACK); corners in one place by that alone.  Rounding
    of 1e4 rad is 1e-12 rad."""
    n, draw = 3000, np.random.default_rng(3)
    tau = np.arange(n) / n
    h = np.maximum(0.0, tau[:, None] - np.array(corners))
    a = np.column_stack([np.ones(n), tau, tau**2, *(h**2).T, np.sin(9e3 * tau), *(-h).T])
    own = 4 + len(corners)
    angle = a[:, :own] @ (1e4 * draw.standard_normal(own)) + 1e-3 * draw.uniform(-1.0, 1.0, n)
    x, left, moved = _least_squares(a, angle, own)
    exact = np.linalg.lstsq(a[:, :own], angle, rcond=1e-12)[0]
    np.testing.assert_allclose(left, angle - a[:, :own] @ exact, atol=1e-9)
    assert np.sum(left**2) == pytest.approx(np.sum((angle - a[:, :own] @ exact) ** 2), rel=1e-9)
    if len(set(np.round(corners, 3))) == len(corners):
        np.testing.assert_allclose(x, exact, rtol=1e-8, atol=1e-8)
        whole = np.linalg.lstsq(a, angle, rcond=1e-12)[0]
        np.testing.assert_allclose(moved, whole[own:], rtol=1e-6, atol=1e-7)
