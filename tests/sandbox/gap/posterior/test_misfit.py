"""What a residual has beside noise: its bands, and the variance that a cause of the same spectrum meets."""

import numpy as np
import pytest
from scipy.fft import idct

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


def test_removing_what_is_missed_gains_what_the_likelihood_says():
    """One band with power 1 + e: 1/2 n e/v is 1/2 n log(1 + e), the gain of the variance's own likelihood."""
    n, rng = 4096, np.random.default_rng(3)
    spectrum = np.ones(n)
    spectrum[1024:1290] = 7.0  # a third of an octave
    residual = idct(spectrum * np.sign(rng.standard_normal(n)), norm="ortho")[:, None]
    power, count = bands(residual)
    excess = power / count - 1.0
    own = excess > 1.0
    gain = 0.5 * np.sum(count[own] * excess[own]) / met(residual)
    assert gain == pytest.approx(0.5 * np.sum(count[own] * np.log1p(excess[own])), rel=0.05)


def test_a_slow_error_makes_estimates_more_uncertain():
    """A random offset of each of 300 pieces, beside noise: a mean over a piece scatters by its power, 18 times the
    noise's; weights for the whole gain of removing it say between a quarter of that (log(1 + 18) = 3 times less) and
    all."""
    rng, length = np.random.default_rng(1), 200
    slow = np.repeat(0.3 * rng.standard_normal(300), length)
    residual = (slow + rng.standard_normal(slow.size))[:, None]
    means = residual.reshape(300, length).mean(1)
    assert 0.25 < met(residual) / (length * np.var(means)) < 1.0
