"""What is looked at beside time: spectra, error against angle, saliency plane, hodograph, by known answers."""

from __future__ import annotations

import dataclasses
import math

import numpy as np
import pytest

from model.drive_files import load_drive
from model.saliency import local_angle
from sandbox.drive.recording import CHANNELS, Recording
from sandbox.output import looks
from sandbox.output.loci import contours
from sandbox.output.sheets import upright

DRIVE = load_drive("ipm_exchanged")
PERIOD = DRIVE.converter.sampling_period


def recording(n, **channels):
    table = np.zeros((n, len(CHANNELS)))
    for name, values in ({"t": PERIOD * np.arange(n)} | channels).items():
        table[:, CHANNELS.index(name)] = values
    return Recording(table)


def test_a_line_has_its_height_and_channels_add_as_powers():
    """On a bin of Hann windows a sine's peak is its amplitude; between two it is 15 % lower, Hann's scalloping loss."""
    n, t = 4 * looks.LONGEST, PERIOD * np.arange(4 * looks.LONGEST)
    step = 1.0 / (looks.LONGEST * PERIOD)  # Hz
    for at, expected in ((100.0, 0.3), (100.5, 0.3 * 0.8488)):  # 8 / (3 pi) = 0.8488
        f, size = looks.spectrum(5.0 + 0.3 * np.sin(2.0 * math.pi * at * step * t), PERIOD)
        assert abs(f[np.argmax(size)] - at * step) <= 0.5 * step + 1e-9
        assert size.max() == pytest.approx(expected, rel=1e-3)
    both = np.stack([np.sin(2.0 * math.pi * 100.0 * step * t), np.zeros(n)], axis=1)
    assert looks.spectrum(both, PERIOD)[1].max() == pytest.approx(math.sqrt(0.5), rel=1e-3)
    short_f, short = looks.spectrum(np.ones(64), PERIOD)  # shorter than a stretch; the mean is left out
    assert short_f.size == 32
    assert short.max() < 1e-12


def test_an_error_against_the_angle_is_found_in_its_sectors():
    theta = np.linspace(0.0, 20.0 * math.pi, 200_001)
    found = looks.over_angle(2.0 * np.sin(3.0 * theta), -theta)
    at, mean, low, high = found
    half = math.pi / looks.SECTORS  # a sector's half width: its mean is the middle's value times sin(3 half) / (3 half)
    expected = -2.0 * np.sin(3.0 * np.radians(at)) * math.sin(3.0 * half) / (3.0 * half)
    np.testing.assert_allclose(
        mean, expected, atol=2.0 * 3.0 * 20.0 * math.pi / 200_000
    )  # a sample more or less a sector
    assert np.all(low <= mean)
    assert np.all(mean <= high)
    assert looks.over_angle(np.ones(5000), np.linspace(0.0, 6.0, 5000)) is None  # less than a turn


def test_the_plane_is_the_audits_angle_and_one_at_zero_current():
    plane = looks.plane(DRIVE, 1.0)
    middle = looks.GRID // 2
    assert plane.gain[middle, middle] == pytest.approx(1.0, abs=1e-9)
    i_q = plane.current[-1]
    expected = math.degrees(float(local_angle(DRIVE.motor.energy, 0.0, i_q)))
    assert plane.angle[middle, -1] == pytest.approx(expected, abs=1e-6)
    alphas = dict.fromkeys(("alpha_30", "alpha_12", "alpha_40", "alpha_22", "alpha_04"), 0.0)
    round_motor = dataclasses.replace(DRIVE.motor, inductance_q=DRIVE.motor.inductance_d, **alphas)
    assert looks.plane(dataclasses.replace(DRIVE, motor=round_motor), 1.0) is None


def test_currents_lose_their_ripple():
    n = 8 * 4000
    ripple = np.tile([1.0, -1.0], n // 2)  # means nothing over any even number of samples
    i_d, i_q = looks.currents(DRIVE, recording(n, i_d=0.5 + ripple, i_q=np.linspace(0.0, 1.0, n)))
    np.testing.assert_allclose(i_d, 0.5, atol=1e-12)
    assert looks.POINTS / 2 <= i_d.size <= looks.POINTS
    assert np.all(np.diff(i_q) > 0.0)


def test_a_hodograph_at_no_current_is_the_magnets_circle():
    n = 4000
    turning = recording(n, theta=2.0 * math.pi * 10.0 * PERIOD * np.arange(n))  # ten turns
    x, y = looks.hodograph(DRIVE, turning, [0.5, 1.0])
    known = np.isfinite(x)
    np.testing.assert_allclose(np.hypot(x[known], y[known]), DRIVE.motor.magnet_flux, rtol=1e-9)
    assert (~known).sum() == 2  # a gap after each of the two last turns
    assert known.sum() == pytest.approx(2 * 0.1 / (8 * PERIOD), abs=2)  # 0.1 s a turn in blocks of eight samples
    x, y = looks.hodograph(DRIVE, recording(n, theta=1.0), [1.0])  # locked: the whole way
    np.testing.assert_allclose(np.arctan2(y, x), 1.0, atol=1e-12)
    assert looks.hodograph(DRIVE, recording(0), [])[0].size == looks.currents(DRIVE, recording(0))[0].size == 0
    spm = load_drive("spm")  # stops being convex at i_d = -0.786 A (audit)
    far = looks.hodograph(spm, recording(n, theta=1.0, i_d=-1.0), [1.0])
    assert np.isnan(far[0]).all()


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
    assert [part.tolist() for part in parts] == [[[0.0, 0.0], [1.0, -1.0]], [[3.0, -3.0], [4.0, -4.0], [5.0, -5.0]]]


def test_lines_of_equal_angle_lie_where_the_theory_has_it():
    plane = looks.plane(DRIVE, 1.0)
    # its points lie between two nodes: linear interpolation errs by an eighth of the second difference at the most
    bound = max(float(np.max(np.abs(np.diff(plane.angle, 2, axis=k)))) for k in (0, 1)) / 8.0
    for degrees, line in contours(plane):
        theory = np.degrees(local_angle(DRIVE.motor.energy, line[:, 0], line[:, 1]))
        np.testing.assert_allclose(theory, degrees, atol=1.1 * bound)
    assert bound < 0.05  # degrees
    assert {degrees for degrees, _ in contours(plane)} >= {0.0}
    assert contours(plane._replace(angle=np.zeros_like(plane.angle))) == []
