"""Motors with a flux map: by name in every command, in the compiled loop, with errors as small as
the quartic's."""

import dataclasses
import json

import numpy as np
import pytest

from estimators.registry import load_estimator
from model.drive_files import load_drive, mapped_names
from model.mapped import MappedMotor, without_map
from model.parameters import Motor
from sandbox.cli import main
from sandbox.drive.record import campaign_of
from sandbox.drive.scenario import Scenario, Segment
from sandbox.drive.simulate import simulate
from sandbox.evaluation.compare import compare
from sandbox.recordings.campaign import read_folder
from sandbox.recordings.writing import write_campaign
from tests.data import real_data

# Winding time constants reach 0.2 s (Baldor's q axis): each load gets 0.8 s to settle.
# Loads at which a linear belief still locks with i_d = 0 (audit: angle and slope); beyond, THOR's
# q-null has no lock.
LOADS = {"brusa_hsm1": (0.6, 1.2), "baldor_pmsyrm": (0.6, 1.2), "thor_fea": (0.3, 0.6)}


@pytest.fixture(scope="module", params=mapped_names())
def mapped(request):
    real_data()
    return load_drive(request.param)


def staircase(name, start_up):
    segments = (Segment(0.25), *(Segment(1.2, load, ramp=0.1) for load in LOADS[name]))
    return Scenario("short", segments, settle=0.8, start_up=start_up)


def test_saturated_belief_has_no_error_and_a_linear_one_the_theory_s(mapped):
    """Told the first position: a linear belief takes the polarity for granted, which THOR's bridges
    turn round."""
    rows = compare(mapped, staircase(mapped.name, start_up=False), seed=2).rows
    assert {(r.estimator, r.belief) for r in rows} == {
        (e, b) for e in ("qnull", "inversion", "ekf") for b in ("saturated", "linear")
    }
    for r in rows:
        if r.belief == "saturated":
            assert abs(r.error_deg.mean) <= 0.3, r  # bias of a finite ripple, and noise
        elif r.predicted_mean_deg is not None:
            assert r.error_deg.mean == pytest.approx(r.predicted_mean_deg, abs=0.2), r
    assert max(abs(r.predicted_mean_deg or 0.0) for r in rows) > 5.0  # there was an error to see


def test_starting_up_finds_position_and_polarity(mapped):
    run = simulate(
        mapped, Scenario("still", (Segment(0.3),), start_angle=2.0), load_estimator("qnull"), seed=5
    )
    late = run.recording.between(run.start_time + 0.1, run.start_time + 0.3)
    assert abs(np.degrees(late.error.mean())) < 0.3


def test_linear_belief_is_the_map_at_zero_current(mapped):
    motor, h = mapped.motor, 1e-3 * mapped.motor.rated_current
    from model.energy import flux_from_current

    d, q = flux_from_current(motor.energy, [h, -h, 0.0, 0.0], [0.0, 0.0, h, -h])
    # curvature over 2e-3 of rated
    assert (d[0] - d[1]) / (2 * h) == pytest.approx(motor.inductance_d, rel=1e-3)
    assert (q[2] - q[3]) / (2 * h) == pytest.approx(motor.inductance_q, rel=1e-3)
    assert motor.linear_energy[:2] == pytest.approx(
        (motor.energy.gamma_d, motor.energy.gamma_q), rel=1e-12
    )


@pytest.mark.parametrize(("command", "name"), [("maps", "baldor_pmsyrm"), ("audit", "thor_fea")])
def test_commands_know_the_name(command, name, tmp_path):
    real_data()
    assert main([command, name, "--out", str(tmp_path), "--quiet"]) == 0
    content = json.loads((tmp_path / f"{command}.json").read_text())
    assert content["motor"] == name
    if command == "maps":
        assert content["first_order_error_l_dd"] is None  # first order needs alphas
    else:
        assert content["torque_at_rated_current"] > 0


def test_simulate_with_effects_and_record(mapped, tmp_path):
    call = [
        "simulate",
        "--motor",
        mapped.name,
        "--duration",
        "0.05",
        "--effects",
        "dead_time.time=1e-6",
        "--no-trace",
    ]
    assert (
        main([*call, "--record", str(tmp_path / "c"), "--out", str(tmp_path / "o"), "--quiet"]) == 0
    )
    nominal = read_folder(tmp_path / "c").drive.motor
    # the map goes along: without it a fault-free drive would look faulty
    assert isinstance(nominal, MappedMotor)
    assert nominal.map_hash == mapped.motor.map_hash


def twin(drive):
    """The drive with its quartic replaced by the spline of a flux map computed from it."""
    from experiments.spline_twin import twin

    return twin(drive)


def test_spline_of_a_quartic_runs_as_the_quartic_does():
    # without counts: where one falls the other way, runs differ by a count
    drive = load_drive("ipm_exchanged")
    drive = dataclasses.replace(
        drive, converter=dataclasses.replace(drive.converter, current_resolution=0.0)
    )
    scenario = Scenario("two", (Segment(0.1), Segment(0.3, 1.0, ramp=0.05)), start_up=False)
    other = twin(drive)
    for name in ("qnull", "inversion", "ekf"):
        for belief in ("saturated", "linear"):
            a, b = (
                simulate(d, scenario, load_estimator(name), belief, seed=1).recording
                for d in (drive, other)
            )
            # the fit's currents are within 2e-4 A (test_spline_energy) of a 0.24 A ripple: 1e-3 rad
            np.testing.assert_allclose(b.theta_hat, a.theta_hat, atol=5e-3)


def test_python_loop_takes_a_spline_and_agrees(mapped):
    scenario = Scenario("x", (Segment(0.02, 0.3, ramp=0.01),), start_up=False)
    fast = load_estimator("qnull")
    slow = dataclasses.replace(fast, step=fast.step_for(_belief(mapped)), compiled=False)
    a, b = (simulate(mapped, scenario, e, seed=1).recording for e in (fast, slow))
    np.testing.assert_allclose(a.table, b.table, rtol=1e-9, atol=1e-9)


def test_filter_in_python_agrees_with_the_compiled_one(mapped):
    scenario = Scenario("x", (Segment(0.02, 0.3, ramp=0.01),), start_up=False)
    runs = [
        simulate(mapped, scenario, load_estimator(name), seed=1).recording
        for name in ("ekf", "ekf_filterpy")
    ]
    np.testing.assert_allclose(runs[1].theta_hat, runs[0].theta_hat, atol=1e-6)


def _belief(drive):
    from sandbox.drive.design import belief_of

    return belief_of(drive, "saturated")


def test_a_campaign_holds_the_numbers_of_its_nominal_motor(tmp_path):
    other = twin(load_drive("ipm_exchanged"))
    run = simulate(other, Scenario("x", (Segment(0.02),), start_up=False), load_estimator("qnull"))
    written = write_campaign(
        tmp_path / "c", campaign_of(other, Scenario("x", (Segment(0.02),)), run.recording, "c")
    )
    assert type(read_folder(written).drive.motor) is Motor
    assert isinstance(other.motor, MappedMotor)
    assert without_map(load_drive("ipm").motor) == load_drive("ipm").motor


@pytest.mark.parametrize(("name", "plant"), [("qnull", "switched"), ("pwm_ripple", "exact")])
def test_spline_of_a_quartic_runs_so_on_both_plants(name, plant):
    """Plant and belief both as a map, against both as the quartic; the map is met to 1e-4 of rated
    current."""
    drive, scene = (
        load_drive("ipm_exchanged"),
        Scenario("x", (Segment(0.3, 1.0, ramp=0.1),), start_up=False),
    )
    ends = [
        simulate(d, scene, load_estimator(name), seed=3, plant=plant) for d in (drive, twin(drive))
    ]
    known, found = (np.degrees(run.recording.between(0.15, 0.3).error) for run in ends)
    assert found.mean() == pytest.approx(known.mean(), abs=0.05)


@pytest.mark.parametrize(
    "effects",
    [
        {"saturation.alpha_30": 3.0, "cross_saturation.alpha_12": 2.0},
        {"inductance.scale_d": 0.85, "inductance.scale_q": 1.1, "magnet_flux.magnet_flux": 0.35},
    ],
)
def test_effects_on_the_magnetics_run_on_both_plants(effects):
    """What a diagnosis writes beside a map; the second plant evaluates maps and effects by code of
    its own."""
    real_data()
    drive = load_drive("baldor_pmsyrm")
    scenario = Scenario(
        "loaded", (Segment(0.1), Segment(0.3, 0.6, ramp=0.05)), start_up=False, rotor="locked"
    )
    both = [
        simulate(
            drive, scenario, load_estimator("qnull"), effects=effects, plant=plant, seed=3
        ).recording
        for plant in ("exact", "switched")
    ]
    plain = simulate(drive, scenario, load_estimator("qnull"), seed=3).recording
    late = plain.t > 0.35
    noise = 5.0 * drive.converter.current_noise
    means = [np.mean(r.error[late]) for r in (*both, plain)]
    assert means[0] == pytest.approx(means[1], abs=2e-3)
    assert abs(means[0] - means[2]) > 2e-3  # the effects are there
    assert np.mean(both[0].i_a[late]) == pytest.approx(np.mean(both[1].i_a[late]), abs=noise)
