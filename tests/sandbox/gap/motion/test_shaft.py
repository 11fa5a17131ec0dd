"""A fit of the shaft's equation: what noise of the acceleration makes of the inertia, and how wide
intervals are."""

import math

import numpy as np
import pytest

from sandbox.gap.motion.shaft import (
    TAIL,
    Nominal,
    Terms,
    design_of,
    firmness,
    fitted,
    of_width,
    reweighted,
    widened,
)
from sandbox.gap.motion.windows import averages
from tests.sandbox.gap.motion.shafts import COUNT, INERTIA, campaign, thrown

TERMS = Terms(inertia=True, viscous=True, dry=0.2)


def design(seed=1, count=math.tau / 512, rows=2e-3):
    own = campaign(*(thrown(s, rows, count) for s in (seed, seed + 1)), count=count)
    return design_of([averages(r, own) for r in own.recordings])


def test_a_stated_inertia_that_says_nothing_changes_nothing():
    """Noise of the acceleration is known and taken out of the inertia, all of it, whatever the fit
    begins with: 1000 times its value as a deviation is as good as free."""
    d = design()
    free = fitted(d, TERMS, Nominal(None, 0.0, 0.0, 0.0))
    for stated in (0.5 * INERTIA, 3.0 * INERTIA):
        loose = fitted(d, Terms(viscous=True, dry=0.2), Nominal(stated, 0.0, 1e3, 0.0))
        assert loose.value("inertia") == pytest.approx(free.value("inertia"), rel=1e-6)


def test_variances_are_the_larger_of_both():
    a, b = np.array([[4.0, 1.0], [1.0, 1.0]]), np.diag([1.0, 9.0])
    own = widened(a, b)
    np.testing.assert_allclose(np.diag(own), [4.0, 9.0])
    assert own[0, 1] / math.sqrt(own[0, 0] * own[1, 1]) == pytest.approx(0.5)


def test_a_fitted_width_widens_as_one_more_column_does():
    """What the inverse of the whole equations has more, the width known to 1 before."""
    rng = np.random.default_rng(3)
    a, c = rng.standard_normal((50, 3)), rng.standard_normal(50)
    alone, whole = np.linalg.inv(a.T @ a), np.column_stack([a, c])
    both = np.linalg.inv(whole.T @ whole + np.diag([0.0, 0.0, 0.0, 1.0]))
    more = of_width(a, alone, c, 0.0)
    np.testing.assert_allclose(alone + more, both[:3, :3], atol=1e-12)
    assert np.all(np.diag(of_width(a, alone, c, 1.0)) >= np.diag(more))


def test_intervals_hold_the_truth():
    """Inertia, viscous and dry friction of 12 logs: of 36 intervals of 95 % fewer than 30 hold the
    truth twice in a thousand (binomial)."""
    held = 0
    for seed in range(0, 24, 2):
        shaft = fitted(design(10 + seed, math.tau / 3600), TERMS, Nominal(None, 0.0, 0.0, 0.0))
        for name, true in (("inertia", INERTIA), ("viscous", 1e-4), ("dry", 0.02)):
            low, high = shaft.ci95(name)
            held += low < true < high
    assert held >= 30


def test_weights_that_yield_hold_less_information():
    """The pull w^2 r of a row, its weight told by the residual r itself, grows by firmness times
    w^2 on average: by differences of all residuals at once."""
    d = design()
    residual = np.random.default_rng(5).standard_normal(len(d.torque))
    for size in (0.1, 1.0, 3.0):  # of the spread
        r = size * residual

        def pull(x):
            return x / (1.0 + (x / TAIL) ** 2)

        weight, h = 1.0 / np.hypot(1.0, r / TAIL), 1e-6
        grown = np.sum(pull(r + h) - pull(r - h)) / (2.0 * h)
        assert firmness(weight, r) == pytest.approx(grown / np.sum(weight**2), rel=1e-6)
    assert firmness(np.zeros(3), np.ones(3)) == 1.0


@pytest.mark.parametrize("rows", [1e-3, 2e-3, 5e-3])
def test_intervals_hold_the_truth_where_weights_yield(rows):
    """Inertia, viscous and dry friction of 24 logs, outliers weighted down as in a diagnosis: of 72
    intervals of 95 % ten or more miss the truth four times in a thousand (binomial)."""
    free, missed = Nominal(None, 0.0, 0.0, 0.0), 0
    for seed in range(0, 48, 2):
        plain = own = design(50 + seed, COUNT, rows)
        for _ in range(3):
            shaft = fitted(own, TERMS, free)
            own = reweighted(plain, shaft)
        for name, true in (("inertia", INERTIA), ("viscous", 1e-4), ("dry", 0.02)):
            low, high = shaft.ci95(name)
            missed += not low < true < high
    assert missed < 10
