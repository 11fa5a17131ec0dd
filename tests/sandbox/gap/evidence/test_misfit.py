"""What a residual has beside noise, and the variance that a cause meets."""

import dataclasses
import math

import numpy as np
import pytest
from scipy.signal import lfilter

from sandbox.gap.evidence import misfit as misfits
from sandbox.gap.evidence.misfit import met, misfit, octaves
from sandbox.replay.replay import Residual
from tests.sandbox.gap.conftest import start

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


def test_coloured_noise_is_no_misfit(quiet_folder, monkeypatch):
    """Noise half of which is behind a filter that forgets 0.8 from reading to reading has five
    times its mean power at low frequencies.  Nothing of that is the model's: the variance is 1,
    within what six autocorrelations leave of it (0.8^7 / 2, 0.1) and chance in 20 000 readings of
    three phases (0.02).  With white noise in its place a quarter of all power is an excess, over 60
    shapes: 20 000 x 3 / 4 / 60 and more."""
    rng, rho, n = RNG(4), 0.8, 20_000
    own = math.sqrt(0.5) * rng.standard_normal((2, n + 100, 3))
    slow = lfilter([math.sqrt(1.0 - rho**2)], [1.0, -rho], own[1], axis=0)
    left = Residual("run", "driven", (own[0] + slow)[100:, :, None], None, None)
    monkeypatch.setattr(misfits, "shown", lambda point: [left])
    point = start(quiet_folder)
    colour = tuple(0.5 * rho**h for h in range(1, 7))
    own = dataclasses.replace(point, prepared=dataclasses.replace(point.prepared, colour=colour))
    assert misfit(own)[0, "current"] == pytest.approx(1.0, abs=0.15)
    assert misfit(point)[0, "current"] > 250.0
