"""What is looked at beside time: spectra, error against angle, thinned lines, by known answers."""

from __future__ import annotations

import math

import numpy as np
import pytest

from sandbox.output import looks
from sandbox.output.sheets import upright

PERIOD = 125e-6  # s


def test_a_line_has_its_height_and_channels_add_as_powers():
    """On a bin of Hann windows a sine's peak is its amplitude; between two it is 15 % lower, Hann's
    scalloping loss."""
    n, t = 4 * looks.LONGEST, PERIOD * np.arange(4 * looks.LONGEST)
    step = 1.0 / (looks.LONGEST * PERIOD)  # Hz
    for at, expected in ((100.0, 0.3), (100.5, 0.3 * 0.8488)):  # 8 / (3 pi) = 0.8488
        f, size = looks.spectrum(5.0 + 0.3 * np.sin(2.0 * math.pi * at * step * t), PERIOD)
        assert abs(f[np.argmax(size)] - at * step) <= 0.5 * step + 1e-9
        assert size.max() == pytest.approx(expected, rel=1e-3)
    both = np.stack([np.sin(2.0 * math.pi * 100.0 * step * t), np.zeros(n)], axis=1)
    assert looks.spectrum(both, PERIOD)[1].max() == pytest.approx(math.sqrt(0.5), rel=1e-3)
    # shorter than a stretch; the mean is left out
    short_f, short = looks.spectrum(np.ones(64), PERIOD)
    assert short_f.size == 32
    assert short.max() < 1e-12


def test_an_error_against_the_angle_is_found_in_its_sectors():
    theta = np.linspace(0.0, 20.0 * math.pi, 200_001)
    found = looks.over_angle(2.0 * np.sin(3.0 * theta), -theta)
    at, mean, low, high = found
    # a sector's half width: its mean is the middle's value times sin(3 half) / (3 half)
    half = math.pi / looks.SECTORS
    expected = -2.0 * np.sin(3.0 * np.radians(at)) * math.sin(3.0 * half) / (3.0 * half)
    np.testing.assert_allclose(
        mean, expected, atol=2.0 * 3.0 * 20.0 * math.pi / 200_000
    )  # a sample more or less a sector
    assert np.all(low <= mean)
    assert np.all(mean <= high)
    assert looks.over_angle(np.ones(5000), np.linspace(0.0, 6.0, 5000)) is None  # less than a turn


def test_thinned_lines_keep_their_peaks():
    values = np.zeros(100_000)
    values[[777, 54_321]] = 5.0, -3.0
    t, y = looks.thinned(np.arange(values.size, dtype=float), values, 600)
    assert t.size <= 1200
    assert (t[np.argmax(y)], t[np.argmin(y)]) == (777.0, 54_321.0)
    assert np.all(np.diff(t) >= 0.0)


def test_bars_keep_the_largest_line_of_each_stretch():
    f, size = np.arange(1.0, 2049.0), np.full(2048, 1e-9)
    size[500] = 1e-3
    at, levels = looks.bars(f, size, 1e-6)
    assert at.size == looks.BARS
    k = int(np.argmax(levels))
    assert abs(at[k] - f[500]) <= 2048 / looks.BARS / 2
    assert levels[k] == pytest.approx(60.0)  # 1e-3 over 1e-6
    assert np.delete(levels, k).max() == 0.0  # what lies below `low` is cut


def test_a_line_on_a_sheet_points_upwards_and_breaks_at_the_undefined():
    x = np.array([0.0, 1.0, np.nan, 3.0, 4.0, 5.0, np.nan, 7.0])
    parts = upright(x, x)
    assert [part.tolist() for part in parts] == [
        [[0.0, 0.0], [1.0, -1.0]],
        [[3.0, -3.0], [4.0, -4.0], [5.0, -5.0]],
    ]
