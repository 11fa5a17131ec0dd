"""What a residual has beside noise, and the variance that a cause meets."""

import numpy as np
import pytest

from sandbox.gap.evidence.misfit import met, octaves

RNG = np.random.default_rng


def test_octaves_hold_every_square():
    """Sums of parts are the sum of all; 512 numbers have 9 octaves of three bands, the first ones
    share a number."""
    x = RNG(0).standard_normal(512) ** 2
    power, count = octaves(x, np.ones(512))
    assert power.sum() == pytest.approx(x.sum(), rel=1e-12)
    assert count.sum() == 512
    assert 18 < len(count) <= 27


def test_white_noise_meets_its_own_variance():
    """The median of 4000 squares of three phases scatters by some 3 %, and one line or band in 10
    000 stands out."""
    told = [met(RNG(seed).standard_normal((4000, 3))) for seed in range(20)]
    assert max(told) < 1.1
    assert sum(x > 1.05 for x in told) <= 2


def test_white_noise_of_twice_the_size_is_white():
    """Its excess takes as many shapes as there are readings: a factor of four in variance, whatever
    d is."""
    assert met(2.0 * RNG(1).standard_normal((4000, 3)), shapes=1.0) == pytest.approx(4.0, rel=0.05)


def test_random_shapes_meet_what_the_variance_says():
    """A misfit of d random smooth shapes alike: the size of one of them, estimated beside noise,
    scatters by v."""
    rng, n, d = RNG(2), 4000, 20
    t = np.arange(n) / n
    shapes = np.array(
        [
            np.sin(2.0 * np.pi * f * t + p)
            for f, p in zip(range(5, 5 + 3 * d, 3), rng.uniform(0, 6, d), strict=True)
        ]
    )
    shapes *= np.sqrt(2.0 / n)  # of norm 1
    z2, told = [], []
    for _ in range(60):
        residual = 30.0 * rng.standard_normal(d) @ shapes + rng.standard_normal(n)
        z2.append(float(shapes[rng.integers(d)] @ residual) ** 2)
        told.append(met(residual[:, None], shapes=d))
    assert np.mean(told) == pytest.approx(np.mean(z2), rel=4.0 * np.sqrt(2.0 / 60))
    assert np.mean(told) == pytest.approx(901.0, rel=0.15)  # 1 + 30^2
