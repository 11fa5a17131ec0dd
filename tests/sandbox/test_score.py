"""Scores on recordings whose errors are known, and the theory's means."""

from __future__ import annotations

import math

import numpy as np
import pytest

from model.parameters import load_drive
from sandbox.recording import CHANNELS, Recording
from sandbox.scenario import Scenario, Segment
from sandbox.score import error_of, is_lost, longest_stretch, predicted_mean, rows_of, settled_part


def recording(error_deg, period=1e-3):
    error = np.radians(np.asarray(error_deg, dtype=float))
    table = np.zeros((error.size, len(CHANNELS)))
    table[:, 0] = np.arange(error.size) * period
    table[:, CHANNELS.index("theta")] = error + 6 * np.pi  # whole turns must not matter
    return Recording(table)


def test_statistics():
    e = error_of(recording([1.0, -2.0, 3.0, 4.0]))
    assert (e.mean, e.rms, e.max) == (pytest.approx(1.5), pytest.approx(math.sqrt(7.5)), pytest.approx(4.0))
    assert e.p95 == pytest.approx(np.percentile([1, 2, 3, 4], 95))


def test_lost_lock_is_reported_not_averaged():
    held = recording([0.0] * 500 + [50.0] * 100 + [0.0] * 400)
    lost = recording([0.0] * 500 + [50.0] * 102 + [0.0] * 398)
    turned = recording([179.0] * 1000)
    slipping = recording(np.linspace(0, 3000, 1000) % 360 - 180)
    assert not is_lost(held)
    assert is_lost(lost)
    assert is_lost(turned)
    assert is_lost(recording([60.0] * 20))  # all of a stretch shorter than 100 ms
    assert error_of(turned, lost=True).mean is None
    assert longest_stretch(np.array([True, True, False, True])) == 2
    # a pole slips every 120 ms: beyond 45 degrees for 90 ms at a time, so rows also look at the mean's spread
    assert error_of(slipping).rms > 90.0


def test_windows_of_rows():
    drive = load_drive("ipm_exchanged")
    scenario = Scenario("s", (Segment(0.2), Segment(0.3, 0.5, settle=0.1), Segment(0.1, score=False)), settle=0.05)
    r = recording([1.0] * 100 + [5.0] * 200 + [9.0] * 700)
    rows = rows_of(drive, scenario, r, 0.1, "qnull", "linear", True)
    assert [(row.t_start, row.t_end) for row in rows] == [
        (pytest.approx(0.15), pytest.approx(0.3)), (pytest.approx(0.4), pytest.approx(0.6)),
    ]  # fmt: skip
    assert [row.error_deg.mean for row in rows] == [pytest.approx(5.0), pytest.approx(9.0)]
    assert settled_part(r, rows).t.size == 350


def test_predictions_follow_control_and_torque():
    drive = load_drive("ipm_exchanged")
    current = Scenario("c", (Segment(1.0, 1.0),))
    speed = Scenario("s", (Segment(1.0, 1.0),), rotor="free", reference="speed")
    s = current.segments[0]
    assert predicted_mean(drive, current, s, False) == pytest.approx(-6.07, abs=0.01)
    assert predicted_mean(drive, current, s, True) == pytest.approx(-5.89, abs=0.01)
    # open loop under speed control: the same torque means the same current
    assert predicted_mean(drive, speed, s, False) == pytest.approx(-6.07, abs=0.01)
    # closed loop: the erroneous frame needs another current for the torque, so another error
    assert predicted_mean(drive, speed, s, True) != pytest.approx(-5.89, abs=0.005)
    # linear torque constant would do for viscous friction: tiny at 5 % speed
    turning = Segment(1.0, 0.0, 0.05)
    assert abs(predicted_mean(drive, speed, turning, False)) < 0.05
