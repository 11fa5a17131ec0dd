"""Arithmetic without a library, over its whole range, against mpmath with fifty digits."""

import math

import mpmath
import numpy as np
import pytest

from model import lanes

mpmath.mp.dps = 50
ANGLES = [
    *np.linspace(-9.9e4, 9.9e4, 401),
    *(k * math.pi / 4.0 * (1.0 + e) for k in range(-8, 9) for e in (0.0, 1e-15)),
]
STEPS = [0.0, *10.0 ** np.linspace(-12.0, 12.0, 97), 0.06 * (1 - 1e-12), 0.06 * (1 + 1e-12), 59.9, 60.1]


def test_sine_and_cosine():
    """pi/2 in two parts has 1e-20 or so of error a quarter turn: 1e-15 up to 1e5 rad beside rounding."""
    for x in ANGLES:
        s, c = lanes.sine_cosine.py_func(float(x))
        assert abs(s - mpmath.sin(mpmath.mpf(float(x)))) < 2e-15
        assert abs(c - mpmath.cos(mpmath.mpf(float(x)))) < 2e-15


def test_exponential():
    for x in np.linspace(-8.0, 0.0, 201):
        exact = mpmath.exp(mpmath.mpf(float(x)))
        assert abs(lanes.fading.py_func(float(x)) / exact - 1) < 1e-13
    for x in np.linspace(-80.0, -8.0, 73):
        assert abs(lanes.fading.py_func(float(x)) - mpmath.exp(mpmath.mpf(float(x)))) < 1e-13 * math.exp(-8.0)


@pytest.mark.parametrize(("function", "largest", "error"), [
    (lanes.turned_a_little, lanes.SHORT_TURN, 1e-13), (lanes.turned, math.pi / 4.0, 2e-15), (lanes.turned, 2.0, 1e-7),
])  # fmt: skip
def test_turning_by_an_angle(function, largest, error):
    for angle in np.linspace(-largest, largest, 201):
        c, s = function.py_func(math.cos(1.1), math.sin(1.1), float(angle))
        exact = mpmath.mpf(1.1) + mpmath.mpf(float(angle))
        assert abs(c - mpmath.cos(exact)) < error
        assert abs(s - mpmath.sin(exact)) < error


def exact_moments(x):
    """Return the integrals of x exp(-x (1 - s)) s^n over s in [0, 1], n = 0, 1, 2: by parts, with fifty digits."""
    x = mpmath.mpf(x)
    if x == 0:
        return [mpmath.mpf(0)] * 3
    if x < 1e-4:  # by parts loses digits: the power series sum of (-x)^k n! / (n + k + 1)!
        return [
            x * sum((-x) ** k * mpmath.factorial(n) / mpmath.factorial(n + k + 1) for k in range(12)) for n in range(3)
        ]
    zeroth = 1 - mpmath.exp(-x)
    first = 1 - zeroth / x
    return [zeroth, first, 1 - 2 * first / x]


def test_a_lag_s_moments():
    """Relative error at 0.06, where the series end: 1e-15 of exp(-x), over x twice and over x/3."""
    for x in STEPS:
        told, exact = lanes.lag_moments.py_func(float(x)), exact_moments(float(x))
        assert abs(told[0] - mpmath.exp(-mpmath.mpf(float(x)))) < 1e-13
        for a, b in zip(told[1:], exact, strict=True):
            assert abs(a - b) <= 5e-11 * abs(b)


def test_a_lag_s_weights():
    """Weights sum to one minus the decay, and a lag answers a parabola t^2 exactly: the second moment."""
    for x in STEPS:
        decay, start, middle, end = lanes.lag_weights.py_func(float(x))
        zeroth, first, second = exact_moments(float(x))
        size = float(zeroth) if zeroth else 1e-300
        assert decay + start + middle + end == pytest.approx(1.0, abs=3e-13)
        assert abs(start + middle + end - zeroth) < 5e-11 * size
        assert abs(0.5 * middle + end - first) < 5e-11 * size
        assert abs(0.25 * middle + end - second) < 5e-11 * size
