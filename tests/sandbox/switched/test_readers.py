"""Current sensors of the switched bench that remember, and phases that are read one after
another."""

import dataclasses
import math

import numpy as np
import pytest

from model.drive_files import load_drive
from model.errors import BadInput
from sandbox.switched.advance import replay
from sandbox.switched.bench_numbers import bench, quiet
from sandbox.switched.unlisted import unlisted

DRIVE = load_drive("ipm_exchanged")
BENCH = quiet(bench(DRIVE.motor, DRIVE.converter))
PHASES = ("i_a", "i_b", "i_c")


def test_a_core_reads_low_after_a_rise_and_high_after_a_fall():
    """By remanence x radius, once the current has gone on by two radii since it last turned; never
    by more."""
    rated = DRIVE.motor.rated_current
    u = 1.2 * DRIVE.motor.resistance * rated * np.sin(2.0 * math.pi * np.arange(6000) / 2000)
    share, radius = 0.07, 0.1 * rated
    b = unlisted(BENCH, {"remanence": share, "remanence_radius": radius})
    straight, found = (replay(x, "locked", u, 0.4 * u, 400.0) for x in (BENCH, b))
    for phase in PHASES:
        i, off = straight[phase], found[phase] - straight[phase]
        back = 700  # samples in which a current of this size goes on by two radii
        rising = np.array(
            [
                k
                for k in range(back, len(i))
                if i[k] - i[k - back : k + 1].min() > 2.0 * radius
                and np.argmax(i[k - back : k + 1]) == back
            ]
        )
        falling = np.array(
            [
                k
                for k in range(back, len(i))
                if i[k - back : k + 1].max() - i[k] > 2.0 * radius
                and np.argmin(i[k - back : k + 1]) == back
            ]
        )
        assert min(len(rising), len(falling)) > 200
        assert off[rising] == pytest.approx(-share * radius, abs=1e-12)
        assert off[falling] == pytest.approx(share * radius, abs=1e-12)
        assert np.abs(off).max() < share * radius + 1e-12
    assert np.array_equal(straight["torque"], found["torque"])


def test_small_currents_are_read_smaller_by_a_core_that_has_not_moved():
    u = 2.0 * np.sin(np.arange(200) / 5.0)
    b = unlisted(BENCH, {"remanence": 0.1, "remanence_radius": 10.0})
    straight, found = (replay(x, "locked", u, 0.3 * u, 400.0) for x in (BENCH, b))
    for phase in PHASES:
        assert found[phase] == pytest.approx(0.9 * straight[phase], abs=1e-12)


def test_phases_read_one_after_another_follow_the_current_in_the_zero_vector():
    """No voltage acts there: di/dt = -(R i + j omega psi_m e^{j theta}) / L for a round motor; its
    bend over 6 us at 900 rad/s electrical is below 1 % of it."""
    flat = dict.fromkeys(("alpha_30", "alpha_12", "alpha_40", "alpha_22", "alpha_04"), 0.0)
    motor = dataclasses.replace(DRIVE.motor, inductance_q=DRIVE.motor.inductance_d, **flat)
    plain, lag, n, speed = quiet(bench(motor, DRIVE.converter)), 3e-6, 400, 150.0
    theta = motor.pole_pairs * speed * np.arange(n) * plain.period
    columns = {"theta": theta, "speed": np.full(n, speed)}
    u = motor.magnet_flux * motor.pole_pairs * speed
    turn = theta + 0.5 * motor.pole_pairs * speed * plain.period
    commands = (-u * np.sin(turn), u * np.cos(turn), 540.0)
    straight, found = (
        replay(b, "driven", *commands, **columns)
        for b in (plain, unlisted(plain, {"channel_lag": lag}))
    )
    i = straight["i_a"] + 1j * (straight["i_b"] - straight["i_c"]) / math.sqrt(3.0)
    slope = -(motor.resistance * i + 1j * u * np.exp(1j * theta)) / motor.inductance_d
    assert np.array_equal(found["i_a"], straight["i_a"])
    for phase, times in (("i_b", 1.0), ("i_c", 2.0)):
        back = np.exp(2j * math.pi / 3.0 * (-1.0 if phase == "i_b" else 1.0))
        expected = times * lag * (slope * back).real
        assert found[phase] - straight[phase] == pytest.approx(
            expected, abs=0.02 * np.abs(expected).max()
        )
        assert np.abs(expected).max() > 5e-3


@pytest.mark.parametrize("delay", [-5e-6, -3e-6, 0.0, 4e-6])
def test_each_phase_reads_as_if_all_were_sampled_then(delay):
    """Also where the first is read before t_k and the last is not."""
    lag, t = 2e-6, np.arange(120)
    u, v = 80.0 * np.cos(t / 9.0), 80.0 * np.sin(t / 9.0)
    found = replay(
        unlisted(BENCH._replace(sampling_delay=delay), {"channel_lag": lag}), "locked", u, v, 400.0
    )
    for k, phase in enumerate(PHASES):
        then = replay(BENCH._replace(sampling_delay=delay + k * lag), "locked", u, v, 400.0)
        assert found[phase] == pytest.approx(then[phase], abs=1e-9)


def test_channels_are_not_slower_than_a_tenth_of_the_period():
    with pytest.raises(
        BadInput,
        match="channel_lag = 3e-05 s is out of range; give less than a tenth of the PWM period",
    ):
        unlisted(BENCH, {"channel_lag": 3e-5})
    with pytest.raises(
        BadInput, match=r"remanence = 0\.1 alone does nothing sound; give remanence_radius"
    ):
        unlisted(BENCH, {"remanence": 0.1})
