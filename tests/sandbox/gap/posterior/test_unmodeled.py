"""Probability of a cause outside the library, from what a fit leaves of each recording."""

import dataclasses

import numpy as np
import pytest
from scipy.integrate import quad
from scipy.stats import lomax, norm

from model.spline import SplineEnergy
from model.spline_correction import MapError
from sandbox.gap.evidence.fit import Fit, coordinates_of, stray
from sandbox.gap.evidence.normal import normal
from sandbox.gap.posterior.unmodeled import (
    _log_densities,
    log_bayes_factor,
    log_stretched,
    map_left,
)
from sandbox.gap.settings import USUAL
from tests.sandbox.gap.conftest import start
from tests.sandbox.gap.sizes import left_by


def left(excess, count=20000.0):
    """Normal equations of recordings whose currents leave so much."""
    return left_by(*(np.array([1.0 + e]) for e in excess), count=count)


@pytest.mark.parametrize("e", [-0.01, 0.0, 0.02, 0.1, 1.0])
def test_density_of_a_miss_is_lomax_convolved_with_noise(e):
    """scipy's Lomax distribution, integrated by quadrature; the grid is fine to 2 %."""
    scatter, mean = 0.01, USUAL.misses
    scale = mean * (USUAL.tail - 1.0)
    exact, _ = quad(
        lambda x: lomax.pdf(x, USUAL.tail, scale=scale) * norm.pdf(e - x, scale=scatter),
        0.0,
        20.0,
        points=[max(e, 1e-6)],
        limit=500,
    )
    assert np.exp(_log_densities(e, scatter, mean, USUAL)[0]) == pytest.approx(exact, rel=0.05)


def test_density_of_an_outside_cause_is_log_uniform():
    """Far above scatter it is 1 / (e log(farthest / misses))."""
    told = np.exp(_log_densities(1.0, 0.01, USUAL.misses, USUAL)[1])
    assert told == pytest.approx(1.0 / np.log(USUAL.farthest / USUAL.misses), rel=0.05)


def test_what_the_replay_misses_speaks_against_an_outside_cause():
    """Twelve recordings of the independent bench with their true effect (p06): excesses of 0 to 1.7
    %."""
    p06 = [
        0.0167,
        0.0167,
        0.0036,
        0.0114,
        0.0054,
        0.0036,
        -0.0027,
        0.0062,
        -0.0019,
        0.0003,
        -0.0011,
        -0.0025,
    ]
    before = left([100.0] * 12)
    assert log_bayes_factor(before, left(p06), 0.0) < -1.0


def test_a_larger_remainder_is_more_probably_outside():
    before, told = left([10.0] * 12), []
    for e in (0.0, 0.02, 0.1, 0.5, 2.0):
        told.append(log_bayes_factor(before, left([e] * 12), 0.0))
    assert np.all(np.diff(told[1:]) > 0.0)
    assert told[-1] > 20.0


def test_one_recording_of_twelve_can_show_it():
    """An outside cause that acts in one kind of recording only: squares 3 times the noise's there,
    none elsewhere."""
    before = left([10.0] * 12)
    assert log_bayes_factor(before, left([2.0] + [0.0] * 11), 0.0) > 3.0


def test_misstated_noise_is_allowed_for():
    """Noise misstated by 5 % of its square leaves 5 % everywhere."""
    before, after = left([10.0] * 12), left([0.05] * 12)
    assert log_bayes_factor(before, after, 0.05) < log_bayes_factor(before, after, 0.0)


def test_an_ordinary_deviation_that_goes_far_speaks_for_it(small_folder):
    """One of n at 4 deviations, all others at none: the mean of exp(z^2 (1 - 1/16) / 2) / 4, that
    is (1808 + n - 1) / 4 n."""
    here = start(small_folder)
    n = normal(here, coordinates_of(here, ())).bare()
    nominal = Fit((), here, n, 0.0, 0.0)
    of = stray(nominal)
    assert not any(z for _, z in of.values())
    assert log_stretched(nominal) == 0.0
    k = next(k for k, c in enumerate(n.coordinates) if c.label in of)
    x = n.x.copy()
    x[k] += 4.0 * n.coordinates[k].deviation
    far = Fit((), here, dataclasses.replace(n, x=x), 0.0, 0.0)
    expected = 0.25 * (np.exp(7.5) + len(of) - 1.0) / len(of)
    assert np.exp(log_stretched(far)) == pytest.approx(expected)


def test_what_a_map_leaves_grows_with_the_last_of_its_modes():
    """Modes of 3 deviations in the last half, after any in the first: nine times as much."""
    zero = np.zeros((1, 1, 5, 5, 4))
    for x, factor in (([9.0, 9.0, 3.0, -3.0], 9.0), ([9.0, 9.0, 0.1, 0.0], 1.0)):
        error = MapError(
            SplineEnergy(zero[..., 0], 0.0, 0.0, 1.0, 1.0, 0.0, 0.0), zero, np.array(x), 0.01
        )
        assert map_left(error) == pytest.approx(0.01 * factor)
    assert map_left(None) == 0.0


@pytest.mark.parametrize("mean", [0.008, 10.0, 1e3, 9999.9, 1e4, 1e6])
def test_a_prior_of_a_cause_outside_has_mass_one_however_large_the_gap(mean):
    """Units mistaken leave gaps of a billion.  Noise as narrow as the grid's step: the sum of
    densities over excesses is the prior's mass; the grid ends within half a step of 1 in 300."""
    z = np.linspace(np.log(mean / 3.0), np.log(max(USUAL.farthest, 1e3 * mean)) + 1.0, 4000)
    told = np.array([np.exp(_log_densities(e, 1e-6, mean, USUAL)[1]) for e in np.exp(z)])
    assert np.sum(told * np.exp(z)) * (z[1] - z[0]) == pytest.approx(1.0, abs=0.02)


def test_odds_of_a_large_gap_follow_its_ratio_to_what_the_replay_misses():
    """Both densities scale with the mean miss once that is beyond a thousandth of the farthest
    excess."""
    odds = [
        [np.diff(_log_densities(k * m, 1e-6, m, USUAL))[0] for k in (1.0, 10.0)]
        for m in (1e3, 1e4, 1e6)
    ]
    assert np.ptp(odds, axis=0) == pytest.approx(0.0, abs=1e-2)


def test_less_than_noise_says_nothing_of_causes():
    """Noise stated a quarter too large: every recording lies far below the floor, and one below it
    by less than the others is no sign of a cause."""
    before = left([10.0] * 12)
    even = log_bayes_factor(before, left([0.0] * 12), 0.0)
    assert log_bayes_factor(before, left([-0.44] * 12), 0.0) == pytest.approx(even)
    assert log_bayes_factor(before, left([-0.44] * 11 + [-0.1]), 0.0) == pytest.approx(even)
