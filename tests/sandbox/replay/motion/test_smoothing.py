"""The motion of a free rotor: the smoother against dense least squares, and against a motion that
is known."""

import numpy as np
import pytest
from scipy.signal import savgol_coeffs, savgol_filter
from scipy.stats import truncnorm

from model.compiled import kernel
from sandbox.replay.motion.free_rotor import (
    ANYWHERE,
    AROUND,
    STATES,
    STEP,
    KnownMotion,
    cut_normal,
    filtered,
    on_counts,
    parabolas,
    smoothed,
    within_readings,
)
from sandbox.replay.motion.smoothing import free_motion
from sandbox.replay.replay import prepare
from tests.sandbox.replay.benches import DRIVE, campaign

COUNT = 2.0 * np.pi * 2 / 4096


def test_the_smoother_solves_the_least_squares_problem_it_stands_for():
    """Every equation of motion as a row over its standard deviation, solved whole by numpy.

    Angles follow their mean speed exactly: a row of 1e-9 rad stands for that, 1e-6 of a reading's
    deviation.
    """
    rng = np.random.default_rng(0)
    n, period, variance, start, q = 40, 1e-3, 1e-6, 4.0, 1e3
    read = np.cumsum(rng.normal(size=n)) * 1e-3
    acceleration, noise = 50.0 * rng.normal(size=n), rng.uniform(1.0, 5.0, n)
    work, spread, alike = np.empty(n, STEP), np.empty(n), np.full(n, variance)
    filtered(
        read, alike, KnownMotion(acceleration, noise**2, period, read[0], variance, start), q, work
    )
    smoothed(work, alike, period, spread)

    unit, rows, right = np.eye(3 * n), [], []

    def told(row, value, deviation):
        rows.append(row / deviation)
        right.append(value / deviation)

    told(unit[0], read[0], np.sqrt(ANYWHERE * variance))
    told(unit[1], 0.0, np.sqrt(start))
    told(unit[2], 0.0, np.sqrt(start) / period)
    for k in range(n):
        told(unit[3 * k], read[k], np.sqrt(variance))
    for k in range(1, n):
        angle, speed, rest = (unit[3 * k + i] - unit[3 * k - 3 + i] for i in range(3))
        mean = 0.5 * (unit[3 * k - 2] + unit[3 * k + 1])
        told(speed - period * unit[3 * k - 1], period * acceleration[k - 1], period * noise[k - 1])
        told(angle - period * mean, 0.0, 1e-9)
        told(rest, 0.0, np.sqrt(q * period))
    x = np.linalg.lstsq(np.array(rows), np.array(right), rcond=None)[0].reshape(n, 3)
    for j in range(3):
        assert np.max(np.abs(work[STATES[j]] - x[:, j])) < 1e-6 * np.max(np.abs(x[:, j]))
    inverse = np.linalg.inv(np.linalg.qr(np.array(rows), mode="r"))
    assert spread == pytest.approx(np.sum(inverse**2, axis=1)[::3], rel=1e-4)


def test_parabolas_are_those_of_scipys_filter():
    read = np.random.default_rng(1).normal(size=10 * AROUND)
    curve, weight = parabolas(read)
    np.testing.assert_allclose(curve, savgol_filter(read, AROUND, 2), atol=1e-12)
    assert weight == pytest.approx(savgol_coeffs(AROUND, 2)[AROUND // 2], rel=1e-12)


def test_likelihood_is_that_of_the_readings_distribution():
    """Two readings, by hand: the second is the first, moved by what speed and acceleration at the
    start allow."""
    period, variance, start, q = 1e-2, 1e-4, 2.0, 0.0
    read = np.array([0.0, 0.05])
    known = KnownMotion(np.zeros(2), np.zeros(2), period, 0.0, variance, start)
    found = filtered(read, np.full(2, variance), known, q, np.empty(0, STEP))
    first = -0.5 * np.log((ANYWHERE + 1.0) * variance)
    first_known = variance * ANYWHERE / (ANYWHERE + 1.0)  # of the first angle, once read
    second = first_known + period**2 * start + 0.25 * period**2 * start + variance
    assert found == pytest.approx(first - 0.5 * (0.05**2 / second + np.log(second)), rel=1e-12)


@pytest.mark.parametrize("torque_known", [True, False])
def test_a_known_motion_is_found_far_below_a_count(torque_known):
    """A rotor swinging at 3 Hz, read in counts of 3 mrad; told its torque, or not.

    Unexplained, the best strength q is the mean square rate of change of the acceleration over the
    rate of readings at most; error of the speed by the least-squares bandwidth (variance / (q /
    period))^(1/6), a few counts a second.
    """
    rng = np.random.default_rng(1)
    n, period = 4000, 2.5e-4
    t = period * np.arange(n)
    w = 2.0 * np.pi * 3.0
    theta, speed, acceleration = (
        2.0 * np.sin(w * t),
        2.0 * w * np.cos(w * t),
        -2.0 * w * w * np.sin(w * t),
    )
    read = np.round(theta / COUNT + rng.uniform()) * COUNT
    read -= np.mean(read - theta)
    found = 0.5 * (acceleration + np.roll(acceleration, -1)) if torque_known else np.zeros(n)
    motion = free_motion(read, found, period, COUNT, np.full(n, 1.0))
    inner = slice(n // 10, -n // 10)
    angle_error = np.sqrt(np.mean((motion.angle - theta)[inner] ** 2))
    speed_error = np.sqrt(np.mean((motion.speed - speed)[inner] ** 2))
    # s over which readings of variance COUNT^2 / 12 are averaged
    window = 0.1 if torque_known else 0.01
    readings = window / period
    assert angle_error < 3.0 * COUNT / np.sqrt(12.0 * readings)
    assert speed_error < 3.0 * COUNT / np.sqrt(readings) / window


def test_a_step_of_load_acts_from_the_sample_it_is_asked_at():
    """Speed of the switched bench's free rotor about its step of load, by fourth-order differences
    of its angle.

    Taken half a sample wrong, the speed would miss by up to half of what the step changes in a
    sample; two hundredths of it are left by readings in counts (65536 a turn) and by torque inside
    a sample.
    """
    recorded = campaign({}, cases=(("free", 0.0),))
    (found,) = prepare(recorded, {}, steps=1).recordings
    theta, period, motor = (
        recorded.recordings[0].theta,
        DRIVE.converter.sampling_period,
        DRIVE.motor,
    )
    # the step comes at 301; differences reach over two
    k = np.concatenate([np.arange(280, 298), np.arange(304, 320)])
    differences = (theta[k - 2] - 8.0 * theta[k - 1] + 8.0 * theta[k + 1] - theta[k + 2]) / (
        12.0 * period
    )
    change = motor.pole_pairs * 0.2 / motor.inertia * period
    assert np.max(np.abs(found.motion.speed[k] - differences)) < 0.02 * change


@kernel
def mean_and_variance(low, high):
    return cut_normal(low, high)


@pytest.mark.parametrize(
    ("low", "high"),
    [
        (-1.0, 2.0),
        (0.5, 0.8),
        (-0.3, -0.2),
        (4.9, 5.3),
        (5.1, 5.3),
        (6.0, 60.0),
        (-40.0, -9.0),
        (3.0, 3.001),
        (30.0, 30.02),
        (30.0, 90.0),
    ],
)
def test_a_normal_distribution_between_bounds_has_the_moments_of_scipys(low, high):
    """Beyond 25 deviations x it counts as exponential: scale wrong by 2/x^2, variance by 5/x^2 (the
    tail's asymptotic series); between bounds closer than 1e-3 it is flat, which moves the mean by
    less than a twelfth of that."""
    mean, variance = mean_and_variance(low, high)
    exact = truncnorm(low, high)
    near = low if low > 0.0 else high if high < 0.0 else 0.0
    far = 2.0 / 625.0 if abs(near) > 25.0 else 1e-4
    assert mean - near == pytest.approx(exact.mean() - near, rel=far, abs=1e-7)
    assert variance == pytest.approx(exact.var(), rel=2.5 * far)


def turning(per_sample, first=0.37 * COUNT, n=4000, period=2.5e-4):
    """Angle of a rotor of so many counts a sample whose speed dips by a tenth for 30 ms, and what
    is told of it: its torque with noise."""
    t = period * np.arange(n)
    speed = per_sample * COUNT / period * (1.0 - 0.1 * np.exp(-0.5 * ((t - 0.5) / 0.03) ** 2))
    theta = first + np.concatenate([[0.0], np.cumsum(0.5 * (speed[1:] + speed[:-1]))]) * period
    found = np.append(np.diff(speed), 0.0) / period
    noise = 0.01 * np.abs(found).max()
    found += noise * np.random.default_rng(3).standard_normal(n)
    return theta, KnownMotion(
        found, np.full(n, noise**2), period, first, COUNT**2 / 12.0, (COUNT / period) ** 2
    )


def away(read, theta, known):
    """Deviations (counts, rms) of a motion that takes errors of rounding for noise, and of one
    within the readings."""
    work, alike = np.empty(len(read), STEP), np.full(len(read), known.variance)
    filtered(read, alike, known, 1.0, work)
    smoothed(work, alike, known.period, np.empty(len(read)))
    angles = work["x_0"], within_readings(read, COUNT, known, 1.0)["x_0"]
    return [np.sqrt(np.mean((x - theta) ** 2)) / COUNT for x in angles]


@pytest.mark.parametrize("first", [0.37 * COUNT, 3e6 * COUNT + 0.37 * COUNT])
@pytest.mark.parametrize(("per_sample", "nearer"), [(1.003, 0.5), (2.71, 0.9)])
def test_errors_of_rounding_that_repeat_do_not_bend_a_motion(per_sample, nearer, first):
    """Slow beats of counts and samples bend a motion that takes them for noise, quick ones less;
    wherever the angle begins."""
    theta, known = turning(per_sample, first)
    rough, fine = away(COUNT * np.round(theta / COUNT), theta, known)
    assert fine < nearer * rough


@pytest.mark.parametrize("noise", [0.05, 0.2, 1.0])
def test_an_encoder_that_is_noisy_bounds_softly(noise):
    """Noise before rounding, in counts: from a fifth of a count on errors of rounding are noise as
    well, and a motion that takes them so is as good as can be."""
    theta, known = turning(2.71)
    read = COUNT * np.round(
        theta / COUNT + noise * np.random.default_rng(4).standard_normal(len(theta))
    )
    rough, fine = away(read, theta, known)
    assert fine < 1.3 * rough


def test_a_reading_that_is_wrong_by_itself_says_nothing():
    theta, known = turning(1.003)
    read = COUNT * np.round(theta / COUNT)
    read[1700] += 5.0 * COUNT
    rough, fine = away(read, theta, known)
    assert fine < rough


def test_a_log_of_few_digits_is_on_the_counts_it_came_from():
    """Four decimals of 3.07 mrad: up to 0.016 counts off.  Readings that were interpolated are on
    none."""
    exact = 0.123 * COUNT + COUNT * np.round(np.linspace(0.0, 900.0, 5000) / COUNT)
    assert on_counts(np.round(exact, 4), COUNT) - exact == pytest.approx(
        np.zeros(5000), abs=1e-3 * COUNT
    )
    assert on_counts(np.linspace(0.0, 900.0, 5000), COUNT) is None
