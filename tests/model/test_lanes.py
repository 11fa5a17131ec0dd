"""Arithmetic without a library, over its whole range, against mpmath with fifty digits."""

import math

import mpmath
import numpy as np
import pytest

from model import lanes
from model.lanes import one_branch, one_lag
from sandbox.plant import electrical, lags, sampling

mpmath.mp.dps = 50
ANGLES = [
    *np.linspace(-9.9e4, 9.9e4, 401),
    *(k * math.pi / 4.0 * (1.0 + e) for k in range(-8, 9) for e in (0.0, 1e-15)),
]
STEPS = [
    0.0,
    *10.0 ** np.linspace(-12.0, 12.0, 97),
    0.25 * (1 - 1e-12),
    0.25 * (1 + 1e-12),
    59.9,
    60.1,
]


def test_sine_and_cosine():
    """pi/2 in two parts has 1e-20 or so of error a quarter turn: 1e-15 up to 1e5 rad beside
    rounding."""
    for x in ANGLES:
        s, c = lanes.sine_cosine.py_func(float(x))
        assert abs(s - mpmath.sin(mpmath.mpf(float(x)))) < 2e-15
        assert abs(c - mpmath.cos(mpmath.mpf(float(x)))) < 2e-15


def test_exponential():
    for x in np.linspace(-8.0, 0.0, 201):
        exact = mpmath.exp(mpmath.mpf(float(x)))
        assert abs(lanes.fading.py_func(float(x)) / exact - 1) < 1e-13
    for x in np.linspace(-80.0, -8.0, 73):
        assert abs(
            lanes.fading.py_func(float(x)) - mpmath.exp(mpmath.mpf(float(x)))
        ) < 1e-13 * math.exp(-8.0)


@pytest.mark.parametrize(
    ("function", "largest", "error"),
    [
        (lanes.turned_a_little, lanes.SHORT_TURN, 1e-13),
        (lanes.turned, math.pi / 4.0, 2e-15),
        (lanes.turned, 2.0, 1e-7),
    ],
)
def test_turning_by_an_angle(function, largest, error):
    for angle in np.linspace(-largest, largest, 201):
        c, s = function.py_func(math.cos(1.1), math.sin(1.1), float(angle))
        exact = mpmath.mpf(1.1) + mpmath.mpf(float(angle))
        assert abs(c - mpmath.cos(exact)) < error
        assert abs(s - mpmath.sin(exact)) < error


def exact_moments(x):
    """Return the integrals of x exp(-x (1 - s)) s^n over s in [0, 1], n = 0, 1, 2: by parts, with
    fifty digits."""
    x = mpmath.mpf(x)
    if x == 0:
        return [mpmath.mpf(0)] * 3
    if x < 1e-4:  # by parts loses digits: the power series sum of (-x)^k n! / (n + k + 1)!
        return [
            x
            * sum((-x) ** k * mpmath.factorial(n) / mpmath.factorial(n + k + 1) for k in range(12))
            for n in range(3)
        ]
    zeroth = 1 - mpmath.exp(-x)
    first = 1 - zeroth / x
    return [zeroth, first, 1 - 2 * first / x]


def test_a_lag_s_moments():
    """Relative error at 0.25, where the series ends: 3e-15 of exp(-x) (six squarings), over x^2/2
    and over x/3."""
    for x in STEPS:
        found, exact = lanes.lag_moments.py_func(float(x)), exact_moments(float(x))
        assert abs(1.0 - found[0] - mpmath.exp(-mpmath.mpf(float(x)))) < 1e-13
        for a, b in zip(found, exact, strict=True):
            assert abs(a - b) <= 2e-12 * abs(b)


def test_short_steps_have_the_same_moments():
    """To the bit: which of the two runs hangs on the other lanes of a batch."""
    for x in STEPS:
        if x <= lanes.SERIES_BELOW:
            assert lanes.short_lag_moments.py_func(float(x)) == lanes.lag_moments.py_func(float(x))


def test_a_lag_s_weights():
    """Weights sum to one minus the decay, and a lag answers a parabola t^2 exactly: the second
    moment."""
    for x in STEPS:
        zeroth, first, second = exact_moments(float(x))
        start, middle, end = lanes.lag_weights.py_func(*lanes.lag_moments.py_func(float(x)))
        size = float(zeroth) if zeroth else 1e-300
        assert abs(start + middle + end - zeroth) < 5e-11 * size
        assert abs(0.5 * middle + end - first) < 5e-11 * size
        assert abs(0.25 * middle + end - second) < 5e-11 * size


@pytest.mark.parametrize("late", [0.0, 1e-6, 0.01, 0.3, 0.7, 1.0])
@pytest.mark.parametrize("x", [1e-3, 0.1, 1.0, 8.0, 300.0])
def test_a_lag_s_answer_to_a_kink(late, x):
    """The integral of x exp(-x (1 - s)) times what min(s, rho) is beside its straight line, by
    quadrature.

    1e-15 of exp(-x) over x; rounding of what is late.
    """
    found = lags.answer.py_func(late, x, lanes.lag_moments.py_func(x)[0])
    x, rho = mpmath.mpf(x), mpmath.mpf(late)
    places = sorted({mpmath.mpf(0), rho, 1 - min(1, 40 / x), mpmath.mpf(1)})
    exact = mpmath.quad(lambda s: x * mpmath.exp(-x * (1 - s)) * (min(s, rho) - s * rho), places)
    assert abs(found - exact) < 1e-13 / min(1.0, float(x))
    assert late not in (0.0, 1.0) or abs(found) < 1e-12


def test_how_much_sooner_a_kinked_drop_changes():
    """Volt-seconds of a drop that follows min(t, r) less those of the line with its mean, by
    quadrature: all of it (`sooner`, which is nothing at the end), and K, the mean of what they
    leave in the flux (`early`)."""
    span = 4e-5
    for late in (1e-7, 2e-6, 2e-5, 3.9e-5, 4e-5):
        mean = mpmath.quad(lambda t: min(t, late), [0, late, span]) / span  # noqa: B023
        for h in (1e-7, 1e-5, 3e-5, span):
            places = sorted({0.0, min(late, h), h})
            exact = mpmath.quad(lambda t: min(t, late) - 2 * mean * t / span, places)  # noqa: B023
            assert abs(sampling.sooner.py_func(late, h, 1.0 / span) - exact) < 1e-15 * span
        whole = mpmath.quad(
            lambda t: (span - t) * (min(t, late) - 2 * mean * t / span),  # noqa: B023
            [0, late, span],
        )
        exact = whole / span
        found = electrical.early.py_func(late, span, 1.0 / span)
        assert abs(found - exact) < 1e-12 * span**2


def answers(gains, times, s, *, iron):
    """Return what lags side by side answer to s: a current of the slope of a flux (iron), or a drop
    of a current."""
    return sum(
        g / (1.0 + s * t) if iron else g * s * t / (1.0 + s * t)
        for g, t in zip(gains, times, strict=True)
    )


@pytest.mark.parametrize("iron", [True, False])
@pytest.mark.parametrize(("ratio", "most"), [(1.0, 1e-12), (2.0, 0.061), (4.0, 0.251)])
def test_two_lags_as_one(iron, ratio, most):
    """Slow (x 1e-4) and fast (x 1e4) changes are answered as by both to 1e-3; in between off by at
    most what model/effects/README.md says, over all shares of the two."""
    worst = 0.0
    for share in np.linspace(0.02, 0.98, 49):
        pair = (share, 2e-4), (1.0 - share, 2e-4 * ratio)
        one = (one_branch if iron else one_lag).py_func(*pair[0], *pair[1])
        for size in np.logspace(-4.0, 4.0, 81):
            s = 1j * size / 2e-4
            both = answers(*zip(*pair, strict=True), s, iron=iron)
            off = abs(answers((one[0],), (one[1],), s, iron=iron) - both) / abs(both)
            worst = max(worst, off)
            assert size not in (1e-4, 1e4) or off < 1e-3
    assert worst < most
    assert ratio == 1.0 or worst > 0.9 * most


@pytest.mark.parametrize("join", [one_lag, one_branch])
def test_lags_that_are_none(join):
    """No gain is no lag; opposite gains divide nothing, and are handed on to be refused."""
    assert join.py_func(2.0, 1e-4, 0.0, 3e-4) == (2.0, 1e-4)
    assert join.py_func(0.0, 1e-4, 2.0, 3e-4) == (2.0, 3e-4)
    assert join.py_func(0.0, 1e-4, 0.0, 3e-4) == (0.0, 0.0)
    assert join.py_func(2.0, 1e-4, -2.0, 3e-4)[0] == -2.0
