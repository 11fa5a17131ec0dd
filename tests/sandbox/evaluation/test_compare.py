"""The main job's numbers against theory: what a linear belief misses, and that a saturated one does
not."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

from estimators.registry import load_estimator
from experiments import releases
from model.drive_files import load_drive
from model.errors import BadInput
from model.saliency import local_angle, self_consistent_angle
from sandbox.drive.scenario import Scenario, Segment, load_scenario
from sandbox.drive.simulate import simulate
from sandbox.evaluation.compare import compare, stride_of
from sandbox.evaluation.score import rows_of

MOTORS = ("ipm", "ipm_exchanged", "spm_exchanged")


@pytest.fixture(scope="module", params=MOTORS)
def staircase(request):
    return compare(load_drive(request.param), load_scenario("staircase"), seed=11)


def test_linear_belief_errs_by_the_theory(staircase):
    """Mean within 0.2 degrees of the cross-saturation angle: local (open) or self-consistent
    (closed)."""
    motor = staircase.drive.motor
    checked = 0
    for row in staircase.rows:
        exchanged_ekf = row.estimator == "ekf" and motor.name == "ipm_exchanged"
        if row.belief != "linear" or (row.estimator == "ekf" and not exchanged_ekf):
            continue
        i_q = row.load * motor.rated_current
        angle = (
            self_consistent_angle(motor.energy, 0.0, i_q)
            if row.closed_loop
            else local_angle(motor.energy, 0, i_q)
        )
        expected = np.degrees(float(angle))
        assert not row.lost_lock
        assert row.error_deg.mean == pytest.approx(expected, abs=0.2)
        if not exchanged_ekf:
            assert row.predicted_mean_deg == pytest.approx(expected, abs=1e-9)
        checked += 1
    assert checked == (3 if motor.name == "ipm_exchanged" else 2) * 2 * 13


def test_saturated_belief_is_right_at_every_load(staircase):
    for row in staircase.rows:
        if row.belief == "saturated":
            assert not row.lost_lock
            assert abs(row.error_deg.mean) < 0.3, row
            assert row.error_deg.p95 < 1.5, row


def test_no_position_error_grew_since_the_last_release(small_comparison):
    """By more than five standard deviations over seeds (experiments/results/releases.md)."""
    kept, own = releases.last(), releases.errors(small_comparison.rows)
    assert len(own) == len(kept["position"]) == 16  # two loads, beliefs, loops and estimators
    assert releases.worse(kept, "position", own) == []
    name, entry = next(iter(kept["position"].items()))
    assert (
        len(
            releases.worse(
                kept, "position", own | {name: entry["value"] + 0.02 + 6.0 * entry["noise"]}
            )
        )
        == 1
    )


def test_same_seed_same_numbers(small_comparison):
    c = small_comparison
    again = compare(c.drive, c.scenario, ("qnull", "ekf"), seed=3, jobs=1)
    for a, b in zip(c.runs, again.runs, strict=True):
        assert np.array_equal(a.recording.table, b.recording.table)
    other = compare(c.drive, c.scenario, ("qnull",), seed=4)
    assert not np.array_equal(other.runs[0].recording.table, c.runs[0].recording.table)


@pytest.mark.parametrize("name", ["creep_reversal", "speed_steps"])
def test_moving_scenarios(name):
    """Settled means meet the quasi-static theory; the rest is lag R omega of the ripple, see
    `estimators.qnull`."""
    result = compare(
        load_drive("ipm_exchanged"), load_scenario(name), ("qnull", "inversion"), seed=2
    )
    for row in result.rows:
        assert not row.lost_lock
        assert row.reference_held
        # 0.1 degree of that, and the tail of a load step: 1.6 s after it with a speed loop of 0.25
        # s
        assert row.error_deg.mean == pytest.approx(row.predicted_mean_deg, abs=0.3)
    speeds = np.concatenate([r.recording.omega for r in result.runs])
    assert speeds.max() > 0 > speeds.min()


def test_theory_at_imposed_torque_in_the_creeping_reversal():
    """Closed loop under speed control: i_q follows from the torque, the error from i_q; both must
    hold in the run."""
    drive = load_drive("ipm_exchanged")
    result = compare(drive, load_scenario("creep_reversal"), ("qnull",), seed=2)
    run = next(r for r in result.runs if r.closed_loop and r.belief == "linear")
    late = run.recording.between(run.rows[3].t_start, run.rows[3].t_end)
    expected = np.degrees(
        self_consistent_angle(drive.motor.energy, 0.0, float(late.i_q_ref.mean()))
    )
    assert np.degrees(late.error.mean()) == pytest.approx(expected, abs=0.2)
    assert run.rows[3].predicted_mean_deg == pytest.approx(expected, abs=0.1)


def test_lost_lock_is_found():
    """Whoever believes L_d and L_q exchanged tracks with the wrong sign and settles across the
    magnet."""
    drive = load_drive("ipm_exchanged")
    scenario = Scenario("s", (Segment(0.5),), settle=0.2)
    truth = load_drive("ipm").motor.energy
    run = simulate(drive, scenario, load_estimator("qnull"), closed_loop=False, truth=truth)
    (row,) = rows_of(drive, scenario, run.recording, run.start_time, "qnull", "saturated", False)
    assert row.lost_lock
    assert row.error_deg.mean is None
    assert row.error_deg.max is None
    assert abs(np.degrees(np.abs(run.recording.error[-1])) - 90.0) < 5.0


def test_sine_injection_meets_the_theory_too():
    drive = load_drive("ipm_exchanged")
    sine = dataclasses.replace(
        drive, injection=dataclasses.replace(drive.injection, waveform="sine", amplitude=35.0)
    )
    result = compare(
        sine, Scenario("s", (Segment(0.5, 1.0, ramp=0.1),), settle=0.3), ("qnull", "inversion")
    )
    for row in result.rows:
        expected = row.predicted_mean_deg if row.belief == "linear" else 0.0
        assert row.error_deg.mean == pytest.approx(expected, abs=0.2)


@pytest.mark.parametrize(
    ("period", "frequency"), [(125e-6, 1000.0), (62.5e-6, 500.0), (250e-6, 1000.0)]
)
def test_other_sampling_rates(period, frequency):
    drive = load_drive("ipm_exchanged")
    fast = dataclasses.replace(
        drive,
        converter=dataclasses.replace(drive.converter, sampling_period=period, pwm_frequency=None),
        injection=dataclasses.replace(
            drive.injection, frequency=frequency, amplitude=30.0 * frequency / 500.0
        ),
    )
    result = compare(
        fast,
        Scenario("s", (Segment(0.5, 1.0, ramp=0.1),), settle=0.3),
        ("qnull", "inversion", "ekf"),
    )
    for row in result.rows:
        m = drive.motor.energy
        angle = (
            self_consistent_angle(m, 0.0, 1.2)
            if row.closed_loop
            else float(local_angle(m, 0.0, 1.2))
        )
        expected = 0.0 if row.belief == "saturated" else np.degrees(angle)
        assert row.error_deg.mean == pytest.approx(expected, abs=0.2)


def test_no_estimator():
    with pytest.raises(BadInput, match="no estimator"):
        compare(load_drive("ipm"), load_scenario("staircase"), ())


def test_effects_reach_every_run():
    """Dead time moves the filter's mean in every run, open and closed, with either belief."""
    scenario = Scenario("short", (Segment(0.3, 1.0, ramp=0.1, settle=0.2),))
    drive = load_drive("ipm_exchanged")
    plain = compare(drive, scenario, ["ekf"], jobs=1)
    with_dead_time = compare(drive, scenario, ["ekf"], jobs=1, effects={"dead_time.time": 4e-6})
    for one, two in zip(plain.rows, with_dead_time.rows, strict=True):
        assert abs(one.error_deg.mean - two.error_deg.mean) > 1.0  # the filter lives on the voltage
    assert with_dead_time.as_json()["effects"] == {"dead_time.time": 4e-6}
    assert plain.as_json()["effects"] == {}


def test_an_hour_is_recorded_thinned():
    """3600 s and at most 5 s of starting up at 4 kHz are 14.42 million samples, of which ten
    million are kept at most: every second; of four such runs together every sixth.  Ten minutes at
    10 kHz are kept whole."""
    drive = load_drive("ipm_exchanged")
    hour, ten = (Scenario("long", (Segment(s),), rotor="locked") for s in (3600.0, 600.0))
    assert drive.converter.sampling_period == 2.5e-4
    assert (stride_of(drive, hour), stride_of(drive, hour, 4)) == (2, 6)
    quick = dataclasses.replace(drive.converter, sampling_period=1e-4, pwm_frequency=1e4)
    fast = dataclasses.replace(drive, converter=quick)
    assert stride_of(fast, ten) == 1
