"""Runs in the planes of current and flux: saliency plane, hodograph, lines of equal angle, by known
answers."""

from __future__ import annotations

import dataclasses
import math

import numpy as np
import pytest

from model.drive_files import load_drive
from model.saliency import local_angle
from sandbox.drive.recording import CHANNELS, Recording
from sandbox.evaluation.pages import planes
from sandbox.evaluation.pages.loci import contours

DRIVE = load_drive("ipm_exchanged")
PERIOD = DRIVE.converter.sampling_period


def recording(n, **channels):
    table = np.zeros((n, len(CHANNELS)))
    for name, values in ({"t": PERIOD * np.arange(n)} | channels).items():
        table[:, CHANNELS.index(name)] = values
    return Recording(table)


def test_the_plane_is_the_audits_angle_and_one_at_zero_current():
    plane = planes.plane(DRIVE, 1.0)
    middle = planes.GRID // 2
    assert plane.gain[middle, middle] == pytest.approx(1.0, abs=1e-9)
    i_q = plane.current[-1]
    expected = math.degrees(float(local_angle(DRIVE.motor.energy, 0.0, i_q)))
    assert plane.angle[middle, -1] == pytest.approx(expected, abs=1e-6)
    alphas = dict.fromkeys(("alpha_30", "alpha_12", "alpha_40", "alpha_22", "alpha_04"), 0.0)
    round_motor = dataclasses.replace(DRIVE.motor, inductance_q=DRIVE.motor.inductance_d, **alphas)
    assert planes.plane(dataclasses.replace(DRIVE, motor=round_motor), 1.0) is None


def test_currents_lose_their_ripple():
    n = 8 * 4000
    ripple = np.tile([1.0, -1.0], n // 2)  # means nothing over any even number of samples
    i_d, i_q = planes.currents(DRIVE, recording(n, i_d=0.5 + ripple, i_q=np.linspace(0.0, 1.0, n)))
    np.testing.assert_allclose(i_d, 0.5, atol=1e-12)
    assert planes.POINTS / 2 <= i_d.size <= planes.POINTS
    assert np.all(np.diff(i_q) > 0.0)


def test_a_hodograph_at_no_current_is_the_magnets_circle():
    n = 4000
    turning = recording(n, theta=2.0 * math.pi * 10.0 * PERIOD * np.arange(n))  # ten turns
    x, y = planes.hodograph(DRIVE, turning, [0.5, 1.0])
    known = np.isfinite(x)
    np.testing.assert_allclose(np.hypot(x[known], y[known]), DRIVE.motor.magnet_flux, rtol=1e-9)
    assert (~known).sum() == 2  # a gap after each of the two last turns
    # 0.1 s a turn in blocks of eight samples
    assert known.sum() == pytest.approx(2 * 0.1 / (8 * PERIOD), abs=2)
    x, y = planes.hodograph(DRIVE, recording(n, theta=1.0), [1.0])  # locked: the whole way
    np.testing.assert_allclose(np.arctan2(y, x), 1.0, atol=1e-12)
    assert (
        planes.hodograph(DRIVE, recording(0), [])[0].size
        == planes.currents(DRIVE, recording(0))[0].size
        == 0
    )
    spm = load_drive("spm")  # stops being convex at i_d = -0.786 A (audit)
    far = planes.hodograph(spm, recording(n, theta=1.0, i_d=-1.0), [1.0])
    assert np.isnan(far[0]).all()


def test_lines_of_equal_angle_lie_where_the_theory_has_it():
    plane = planes.plane(DRIVE, 1.0)
    # its points lie between two nodes: linear interpolation errs by an eighth of the second
    # difference at the most
    bound = max(float(np.max(np.abs(np.diff(plane.angle, 2, axis=k)))) for k in (0, 1)) / 8.0
    for degrees, line in contours(plane):
        theory = np.degrees(local_angle(DRIVE.motor.energy, line[:, 0], line[:, 1]))
        np.testing.assert_allclose(theory, degrees, atol=1.1 * bound)
    assert bound < 0.05  # degrees
    assert {degrees for degrees, _ in contours(plane)} >= {0.0}
    assert contours(plane._replace(angle=np.zeros_like(plane.angle))) == []
