"""How probable it is that offsets which differ between recordings are more than ordinary."""

import numpy as np
import pytest
from scipy.stats import multivariate_normal

from model.drive_files import load_drive
from sandbox.gap.unstated.drifting import Drifting
from sandbox.gap.unstated.more_than_ordinary import chance_of_effect, log_likelihood
from sandbox.recordings.campaign import Campaign

DRIVE = load_drive("ipm_exchanged")
USUAL = 0.001  # A, of [background]; an effect's is ten times that: 1 % of 1.2 A


def chance(sizes, usual=USUAL, error=1e-5):
    """Return the chance for what sensor a reads more (A) in each recording."""
    campaign = Campaign("one", DRIVE, (), {}, {"current_offset": usual}, False)
    files = [f"r{k}" for k in range(len(sizes))]
    offsets = {f: (x, -x / 2, -x / 2) for f, x in zip(files, sizes, strict=True)}
    found = Drifting(offsets, dict.fromkeys(files, error), 0.0, tuple(files))
    return chance_of_effect(found, campaign)


def test_one_value_for_all_is_free():
    """Against the density of the differences to the first recording, whose covariance is D + d_1 1
    1': it is the same up to a constant."""
    rng = np.random.default_rng(1)
    x, d = rng.standard_normal((2, 4)), rng.uniform(0.5, 2.0, (2, 4))

    def brute(d):
        covariance = np.diag(d[1:] ** 2) + d[0] ** 2
        return sum(multivariate_normal.logpdf(y[1:] - y[0], np.zeros(3), covariance) for y in x)

    for shift in (0.0, 7.0):
        told = log_likelihood(x + shift, d[0]) - log_likelihood(x + shift, d[1])
        assert told == pytest.approx(brute(d[0]) - brute(d[1]), rel=1e-9)


def test_ordinary_ones_are_none():
    """Drawn with the stated deviation: 5 in 1000 is what one effect of all has before the data."""
    rng = np.random.default_rng(2)
    drawn = [chance(USUAL * rng.standard_normal(4)) for _ in range(50)]
    assert np.mean(drawn) < 0.005


@pytest.mark.parametrize("sizes", [(-0.012, 0.012), (0.0, 0.0, 0.0, 0.012)])
def test_twelve_deviations_are_an_effect(sizes):
    assert chance(sizes) > 0.999


def test_it_is_the_stated_deviation_that_counts():
    assert chance((-0.012, 0.012), usual=0.012) < 0.01
    assert chance((-0.012, 0.012), error=0.01) < 0.1
