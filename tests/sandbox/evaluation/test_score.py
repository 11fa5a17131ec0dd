"""Scores on recordings whose errors are known, and the theory's means."""

from __future__ import annotations

import math

import numpy as np
import pytest

from model.drive_files import load_drive
from model.saliency import current_for_torque, local_angle
from sandbox.drive.recording import CHANNELS, Recording
from sandbox.drive.scenario import Scenario, Segment
from sandbox.drive.simulate import torque_at_load
from sandbox.evaluation.score import error_of, is_lost, predicted_mean, rows_of, settled_part


def recording(error_deg, period=1e-3):
    error = np.radians(np.asarray(error_deg, dtype=float))
    table = np.zeros((error.size, len(CHANNELS)))
    table[:, 0] = np.arange(error.size) * period
    table[:, CHANNELS.index("theta")] = error + 6 * np.pi  # whole turns must not matter
    return Recording(table)


def test_statistics():
    e = error_of(recording([1.0, -2.0, 3.0, 4.0]))
    assert (e.mean, e.rms, e.max) == (
        pytest.approx(1.5),
        pytest.approx(math.sqrt(7.5)),
        pytest.approx(4.0),
    )
    assert e.p95 == pytest.approx(np.percentile([1, 2, 3, 4], 95))


def test_lost_lock_is_reported_not_averaged():
    held = recording([0.0] * 500 + [50.0] * 98 + [0.0] * 402)
    lost = recording([0.0] * 500 + [50.0] * 60 + [0.0] * 380 + [-50.0] * 60)  # 120 ms in all
    assert not is_lost(held)
    assert is_lost(lost)
    assert is_lost(recording([179.0] * 1000))
    assert is_lost(recording([60.0] * 20))  # all of a stretch shorter than 100 ms
    assert error_of(lost, lost=True).mean is None


@pytest.mark.parametrize("turns_per_second", [2.0, 8.0, 50.0, 400.0])
def test_slipping_poles_are_lost_however_fast(turns_per_second):
    """A slip spends three quarters of each turn beyond 45 degrees, but never 100 ms at a stretch
    when fast."""
    t = np.arange(1000) * 1e-3
    drive = load_drive("ipm_exchanged")
    scenario = Scenario("s", (Segment(1.0),))
    (row,) = rows_of(
        drive, scenario, recording(360.0 * turns_per_second * t), 0.0, "qnull", "linear", True
    )
    assert row.lost_lock
    assert row.error_deg.mean is None


def test_one_slip_within_twenty_milliseconds_is_lost():
    """One pole in 20 ms, 15 of them beyond 45 degrees, and no error before or after: no 100 ms are
    needed."""
    slipped = np.concatenate([np.zeros(500), np.linspace(0.0, 360.0, 21), np.full(479, 360.0)])
    assert np.sum(np.abs((slipped + 180.0) % 360.0 - 180.0) > 45.0) < 20
    assert is_lost(recording(slipped))
    assert not is_lost(recording(np.where(slipped == 360.0, 0.0, 0.3 * slipped)))


def test_lock_lost_before_the_window_counts_too():
    drive = load_drive("ipm_exchanged")
    r = recording([170.0] * 300 + [0.0] * 700)
    (row,) = rows_of(
        drive, Scenario("s", (Segment(1.0, settle=0.5),)), r, 0.0, "qnull", "linear", True
    )
    assert row.lost_lock
    r = recording([30.0] * 300 + [1.0] * 700)
    (row,) = rows_of(
        drive, Scenario("s", (Segment(1.0, settle=0.5),)), r, 0.0, "qnull", "linear", True
    )
    assert (row.transient_max_deg, row.error_deg.max) == (pytest.approx(30.0), pytest.approx(1.0))


def test_a_speed_that_is_not_reached_is_said():
    drive = load_drive("ipm_exchanged")
    scenario = Scenario("s", (Segment(1.0, 0.0, 0.05),), rotor="free", reference="speed")
    r = recording([0.0] * 1000)
    r.table[:, CHANNELS.index("omega_ref")] = 0.05 * drive.motor.rated_omega
    for reached, held in ((1.0, True), (0.2, False)):
        r.table[:, CHANNELS.index("omega")] = reached * 0.05 * drive.motor.rated_omega
        (row,) = rows_of(drive, scenario, r, 0.0, "qnull", "linear", True)
        assert row.reference_held is held


def test_a_creep_the_wrong_way_is_missed_and_a_change_that_dies_away_is_not():
    """0.2 % of rated speed asked for, 2.26 rad/s: 45 degrees in the last half second are 1.57
    rad/s."""
    drive = load_drive("ipm_exchanged")
    scenario = Scenario("s", (Segment(1.0, 0.0, 0.002),), rotor="free", reference="speed")
    asked = 0.002 * drive.motor.rated_omega
    r = recording([0.0] * 1000)
    r.table[:, CHANNELS.index("omega_ref")] = asked
    late = np.where(np.arange(1000) < 500, 40.0, asked)
    for omega, held in (
        (asked, True),
        (asked + 1.5, True),
        (asked + 1.7, False),
        (-6.5, False),
        (0.0, False),
        (late, True),
    ):
        r.table[:, CHANNELS.index("omega")] = omega
        (row,) = rows_of(drive, scenario, r, 0.0, "ekf", "saturated", True)
        assert row.reference_held is held
        second = float(np.broadcast_to(omega, 1000)[500:].mean())
        assert row.true_speed_rpm == pytest.approx(second * 30.0 / np.pi / drive.motor.pole_pairs)
        assert row.speed_rpm == pytest.approx(3.6)


def test_windows_of_rows():
    drive = load_drive("ipm_exchanged")
    scenario = Scenario(
        "s", (Segment(0.2), Segment(0.3, 0.5, settle=0.1), Segment(0.1, score=False)), settle=0.05
    )
    r = recording([1.0] * 100 + [5.0] * 200 + [9.0] * 700)
    rows = rows_of(drive, scenario, r, 0.1, "qnull", "linear", True)
    assert [(row.t_start, row.t_end) for row in rows] == [
        (pytest.approx(0.15), pytest.approx(0.3)),
        (pytest.approx(0.4), pytest.approx(0.6)),
    ]
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
    # viscous friction at speed adds to the load: more current, more error, of the sense of rotation
    forward, back = Segment(1.0, 0.5, 0.05), Segment(1.0, 0.5, -0.05)
    friction = drive.motor.viscous_friction * 0.05 * drive.motor.rated_omega / 6
    torque = torque_at_load(drive, 0.5)
    for segment, total in ((forward, torque + friction), (back, torque - friction)):
        i_q, _ = current_for_torque(drive.motor, total, False)
        expected = np.degrees(float(local_angle(drive.motor.energy, 0.0, i_q)))
        assert predicted_mean(drive, speed, segment, False) == pytest.approx(expected, abs=1e-6)
    assert predicted_mean(drive, speed, forward, False) < predicted_mean(drive, speed, back, False)
