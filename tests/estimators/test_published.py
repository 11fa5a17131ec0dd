"""Published gains: the firmwares' difference equations, played with a steady error, beside
`tracking.correct`'s."""

from __future__ import annotations

import math

import numpy as np
import pytest

from estimators.published import PUBLISHED
from model.parameters import TRACKINGS

PERIOD = 1e-4  # s, of the injection
GAMMA = (25.0, 60.0)  # 1/H
ERROR = 1e-3  # rad


def ours(gains, samples, period):
    """Return angle and speed after that time of a steady error: both integrals of a type 2 loop,
    see `correct`."""
    h, angle, omega = period / samples, 0.0, 0.0
    for _ in range(40 * samples):
        angle += h * (gains.kp * ERROR + omega)
        omega += h * gains.ki * ERROR
    return angle, omega


def test_vesc():
    """One update an injection period, gain 0.3: dt (4000 g e + I), I by 10 g e; forty of them."""
    angle = speed = 0.0
    for _ in range(40):
        speed += 10.0 * 0.3 * ERROR
        angle += PERIOD * (4000.0 * 0.3 * ERROR + speed)
    found = ours(PUBLISHED["vesc"](PERIOD, *GAMMA), 2, PERIOD)
    assert found == pytest.approx((angle, speed), rel=0.02)  # half a sample of 40 of the integral


def test_mesc():
    """Counts of a turn, from the sizes of the ripple of a linear motor at that error and on average
    over a turn."""
    phi = np.linspace(0.0, 2.0 * math.pi, 4001)[:-1]
    mean = np.hypot(GAMMA[0] * np.cos(phi), GAMMA[1] * np.sin(phi)).mean()
    at = 0.25 * math.pi
    slope = (size(at + 1e-5) - size(at - 1e-5)) / 2e-5
    error = abs(5000.0 * slope / mean * ERROR)  # counts of the first update
    counts = summed = 0.0
    for _ in range(80):
        summed += 0.05 * error
        counts += error + summed
    angle = counts * 2.0 * math.pi / 65536.0
    omega = summed * 2.0 * math.pi / 65536.0 / (0.5 * PERIOD)
    found = ours(PUBLISHED["mesc"](PERIOD, *GAMMA), 2, PERIOD)
    # the mean size is 0.951 of that at 45 degrees here
    assert found == pytest.approx((angle, omega), rel=0.1)


def size(phi):
    """Return |Gamma u| (1/H), u along phi (rad) from d."""
    return math.hypot(GAMMA[0] * math.cos(phi), GAMMA[1] * math.sin(phi))


def test_every_published_law_is_a_value_of_the_key():
    assert ("designed", *PUBLISHED) == TRACKINGS
