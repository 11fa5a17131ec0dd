"""What a residual has beside noise: its bands, and the variance that a cause of the same spectrum meets."""

import numpy as np
import pytest

from sandbox.gap.posterior.misfit import bands, met


def test_bands_hold_every_square():
    """An orthonormal transform keeps the sum of squares, and the counts add up."""
    x = np.random.default_rng(0).standard_normal((1000, 3))
    power, count = bands(x)
    assert power.sum() == pytest.approx(np.sum(x**2), rel=1e-12)
    assert count.sum() == x.size


def test_white_noise_meets_its_own_variance():
    """One band in 10 000 has more by chance: 20 residuals of 30 bands have 0.06 in the mean, two once in 500 draws."""
    told = [met(np.random.default_rng(seed).standard_normal((4000, 3))) for seed in range(20)]
    assert sum(x > 1.0 for x in told) <= 1


def test_a_slow_error_makes_estimates_as_uncertain_as_it_does():
    """A random offset of each of 300 long pieces, beside noise: the mean of a piece scatters as `met` says, within a
    factor of two (a third of an octave is a coarse band)."""
    rng, length = np.random.default_rng(1), 200
    slow = np.repeat(0.3 * rng.standard_normal(300), length)
    residual = (slow + rng.standard_normal(slow.size))[:, None]
    means = residual.reshape(300, length).mean(1)
    assert 0.5 < met(residual) / (length * np.var(means)) < 2.0
