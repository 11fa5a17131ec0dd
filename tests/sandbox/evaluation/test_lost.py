"""Why lock was lost: the current at which a motor's saliency ends, and a back-EMF that is too
small."""

import dataclasses
import math
import shutil

import numpy as np
import pytest

from estimators.registry import load_estimator
from estimators.startup import polarity_rise
from model.drive_files import load_drive
from model.energy import flux_from_current, hessian
from model.saliency import known_null_ends, null_turned
from sandbox import simulate
from sandbox.drive.scenario import Scenario, Segment
from sandbox.evaluation.compare import compare
from sandbox.evaluation.lost import reasons, why_lost, why_missed
from sandbox.evaluation.pages.compare_page import write_comparison
from sandbox.evaluation.pages.protocol_cells import why_lost as protocol_reasons
from sandbox.evaluation.pages.protocol_page import write_protocol
from sandbox.evaluation.protocol import Protocol, Row, Unit
from sandbox.evaluation.protocol_tests import Case, points_of, verdict
from tests.data import real_data

DRIVE = load_drive("ipm_exchanged")
# its q axis saturates early
ROUND = dataclasses.replace(DRIVE.motor, alpha_04=66.2, alpha_22=0.0, alpha_12=0.0)
DRIVE_ROUND = dataclasses.replace(DRIVE, motor=ROUND)


def closed_form_end():
    """Return the current on q at which 1/L_qq = gamma_q + 12 alpha_04 (L_q psi / psi_ref)^2 reaches
    gamma_d, A.

    Along q alone the quartic's slope is that of one variable: both sides are asked of the model at
    two fluxes and the parabola through them is solved.
    """
    m = ROUND.energy
    _, _, first = hessian.py_func(m, 0.0, 0.0)
    _, _, second = hessian.py_func(m, 0.0, 0.1)
    wanted = hessian.py_func(m, 0.0, 0.0)[0]
    flux = 0.1 * math.sqrt((wanted - first) / (second - first))
    slope = (second - first) / 0.01
    return first * flux + slope * flux**3 / 3.0  # the integral of the slope


def test_saliency_ends_where_both_inductances_meet():
    end, left = null_turned(ROUND.energy, 0.0, 2.0, 2000)
    assert left < 0.01
    assert end == pytest.approx(closed_form_end(), rel=2e-3)  # a step is 1e-3 of 2 A
    d, q = flux_from_current(ROUND.energy, 0.0, end)
    dd, _, qq = hessian.py_func(ROUND.energy, float(d), float(q))
    assert dd == pytest.approx(qq, rel=0.01)
    assert null_turned(DRIVE.motor.energy, 0.0, 1.8 * DRIVE.motor.rated_current) is None


def test_a_saturated_belief_is_lost_where_its_own_error_turns_the_saliency_further():
    """Finite elements of a machine whose L_q falls below L_d: the closed loop, without noise, holds
    below the current of the theory and is lost within 5 % above it. Measured maps that keep their
    slope have no such end."""
    real_data()
    drive = load_drive("thor_fea")
    quiet = dataclasses.replace(drive.converter, current_noise=0.0, current_resolution=0.0)
    end = (
        known_null_ends(drive.motor.energy, 0.0, 1.5 * drive.motor.rated_current)
        / drive.motor.rated_current
    )
    steps = tuple(Segment(0.4, load=x, ramp=0.1, settle=0.2) for x in (0.9, 0.97 * end, 1.05 * end))
    run = simulate(
        dataclasses.replace(drive, converter=quiet),
        Scenario("steps", steps, rotor="locked"),
        "qnull",
    )
    assert [r.lost_lock for r in run.rows] == [False, False, True]
    told = float(run.rows[-1].why_lost.removeprefix("beyond ").partition(" A")[0])
    assert told == pytest.approx(end * drive.motor.rated_current, rel=1 / 60)  # a step on the way
    assert "even with a saturated belief" in run.rows[-1].why_lost
    for name, load in (("brusa_hsm1", 1.8), ("baldor_pmsyrm", 1.6)):
        motor = load_drive(name).motor
        assert known_null_ends(motor.energy, 0.0, load * motor.rated_current) is None


def test_a_run_that_loses_its_saliency_says_so(capsys):
    run = simulate(DRIVE_ROUND, "staircase", "qnull", belief="linear")
    lost = [r for r in run.rows if r.lost_lock]
    assert lost
    assert all(
        r.why_lost.startswith("beyond 1.") and "no saliency is left" in r.why_lost for r in lost
    )
    assert all(r.why_lost is None for r in run.rows if not r.lost_lock)
    assert reasons(run.rows)[0].startswith("lost lock (qnull, linear, ")
    run.report()
    assert "no saliency is left" in " ".join(capsys.readouterr().out.split())


def test_page_and_protocol_say_why_too(tmp_path):
    """The comparison's page, and of the protocol page, terminal text and JSON, hold the sentence of
    a lost lock."""
    scene = Scenario("load", (Segment(0.2), Segment(0.3, 1.8, ramp=0.1, settle=0.2)))
    write_comparison(tmp_path / "compare.html", compare(DRIVE_ROUND, scene, ["qnull"]))
    assert "no saliency is left that turns the q ripple" in (tmp_path / "compare.html").read_text()
    case = Case(scene, "load", closed=False)
    points = points_of(case, DRIVE_ROUND, "qnull", "linear", 0)
    assert [p.lost_lock for p in points] == [p.why_lost is not None for p in points]
    row = Row(Unit("round", "load_step", "qnull", "linear"), verdict(points, "linear"), 0.0)
    (found,) = protocol_reasons(done := Protocol((row,), 0), "round")
    assert found.startswith("lost lock (qnull, linear, load_step): beyond 1.")
    assert row.as_json()["why_lost"] in found
    write_protocol(tmp_path / "protocol.html", done)
    assert "no saliency is left" in (tmp_path / "protocol.html").read_text()


def test_a_method_without_injection_needs_speed():
    row = simulate(DRIVE, "staircase", "qnull", duration=0.4).rows[0]
    slow = dataclasses.replace(row, estimator="active_flux", speed_rpm=18.0, lost_lock=True)
    found = why_lost(slow, DRIVE, DRIVE.motor, load_estimator("active_flux"))
    back = 2.0 * np.pi / 60.0 * 18.0 * 6 * 0.0981
    assert f"the back-EMF is {back:.2g} V" in found
    fast = dataclasses.replace(slow, speed_rpm=900.0)
    assert why_lost(fast, DRIVE, DRIVE.motor, load_estimator("active_flux")) is None


def test_a_turned_null_is_not_a_lost_saliency():
    """With cross-saturation L_dd = L_qq leaves 2 |L_dq|: the axis stands at 45 degrees, a null
    alone is lost."""
    crossed = dataclasses.replace(ROUND, alpha_12=DRIVE.motor.alpha_12)
    end, left = null_turned(crossed.energy, 0.0, 2.0, 2000)
    dd, dq, qq = hessian.py_func(
        crossed.energy, *(float(x) for x in flux_from_current(crossed.energy, 0.0, end))
    )
    assert abs(dd - qq) < 0.05 * abs(dq)
    assert left == pytest.approx(
        2.0 * abs(dq) / abs(1.0 / crossed.inductance_d - 1.0 / crossed.inductance_q), rel=0.01
    )
    row = dataclasses.replace(
        simulate(DRIVE, "staircase", "qnull", duration=0.4).rows[0], lost_lock=True, load=1.8
    )

    def told(estimator, belief, load_d=0.0):
        own = dataclasses.replace(
            row, estimator=estimator, belief=belief, speed_rpm=900.0, closed_loop=False
        )
        return why_lost(own, DRIVE, crossed, load_estimator(estimator), load_d)

    assert "45 degrees or more beside d" in told("qnull", "linear")
    assert "% of the saliency is left" in told("qnull", "linear")
    assert "i_d = -0.5" in told("qnull", "linear", -0.5 / crossed.rated_current)
    assert told("qnull", "saturated") is None
    assert told("arbitrary", "linear") is told("ekf", "linear") is told("ukf", "saturated") is None


def test_a_speed_loop_that_swings_says_so(tmp_path):
    """SEW's measured map: from 12 % above rated load on the null turns so fast with the current
    that the speed loop swings at 25 Hz. The sentence stands where the run swings, and nowhere
    else."""
    shutil.copyfile(real_data() / "sew_map" / "LUT_SEW_jax_grad.mat", tmp_path / "sew.mat")
    (tmp_path / "sew.toml").write_text(
        "[motor]\npole_pairs = 4\nresistance = 0.208\ninertia = 0.02\nrated_current = 8.0\n"
        'rated_torque = 4.4\nrated_speed_rpm = 3000.0\n[flux_map]\nfile = "sew.mat"\n'
        "angle = 0.0439\ncells = [6, 6]\nsmooth = 0.1\n"
        "[drive]\nsampling_period = 1e-4\ndc_bus_voltage = 550.0\n"
    )
    loads = (0.9, 1.35)
    scene = Scenario(
        "steps",
        tuple(Segment(1.2, load=x, ramp=0.4, settle=0.8) for x in loads),
        rotor="free",
        reference="speed",
        start_up=False,
    )
    run = simulate(tmp_path / "sew.toml", scene, "qnull")
    still, swinging = run.rows
    assert (still.reference_held, swinging.reference_held) == (True, False)
    assert still.error_deg.rms < 0.2 * swinging.error_deg.rms
    drive = load_drive(tmp_path / "sew.toml")
    for row, swings in ((still, False), (swinging, True)):
        told = why_missed(row, drive, drive.motor, load_estimator("qnull"))
        assert (told is not None) == swings
    assert "takes that for speed and swings" in swinging.why_missed
    assert reasons(run.rows) == [f"speed missed (qnull, saturated, +135 % load): {told}"]
    assert simulate(tmp_path / "sew.toml", scene, "inversion").rows[1].reference_held


def test_a_start_at_the_other_end_says_so():
    """A linear belief takes for granted that the magnet's own direction saturates; of a motor whose
    odd alphas have the other sign it takes the other end, and every load is lost, also that at
    which nothing else is wrong."""
    steps = (Segment(0.3), Segment(0.3, load=0.3, ramp=0.1, settle=0.1))
    scene = Scenario("steps", steps, rotor="locked")
    mirrored = dataclasses.replace(
        DRIVE.motor, alpha_30=-DRIVE.motor.alpha_30, alpha_12=-DRIVE.motor.alpha_12
    )
    run = simulate(dataclasses.replace(DRIVE, motor=mirrored), scene, "qnull", belief="linear")
    bias = run.design.tuning.bias
    differ = polarity_rise.py_func(mirrored.energy, bias) / hessian(mirrored.energy, 0.0, 0.0)[0]
    assert differ < 0.0
    for row in run.rows:
        assert row.why_lost.startswith("starting up took the magnet's other end, half a turn off")
        assert f"+-{bias:.3g} A on d" in row.why_lost
        assert f"differ by {100.0 * differ:+.2g} % of that at no current" in row.why_lost
        flowed = float(row.why_lost.partition("and got ")[2].partition(" A")[0])
        assert flowed == pytest.approx(bias, rel=0.1)
        assert row.why_lost.endswith("start_up = false in the scenario")
    known = dataclasses.replace(scene, start_up=False)
    held = simulate(dataclasses.replace(DRIVE, motor=mirrored), known, "qnull", belief="linear")
    assert not any(row.lost_lock for row in held.rows)
