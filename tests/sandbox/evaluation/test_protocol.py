"""The protocol: its rows, verdicts, resumption, files; its measurements against theory and planted
faults."""

from __future__ import annotations

import json
import math
from contextlib import nullcontext
from importlib import import_module

import numpy as np
import pyarrow.parquet as pq
import pytest

import sandbox
from estimators.registry import load_estimator
from model.drive_files import MOTORS, load_drive
from model.errors import BadInput
from sandbox.cli import main
from sandbox.drive.scenario import Scenario, Segment
from sandbox.drive.simulate import simulate
from sandbox.engine import processes
from sandbox.engine.processes import ALONE
from sandbox.evaluation import protocol_tests as t
from sandbox.evaluation.starts import starts

p = import_module("sandbox.evaluation.protocol")  # the name in `sandbox` is the function
DRIVE = load_drive("ipm_exchanged")


def point(**changes):
    values = {
        "case": "c",
        "closed_loop": True,
        "load": 1.0,
        "load_d": 0.0,
        "speed": 0.0,
        "mean_deg": 0.5,
        "rms_deg": 0.6,
        "p95_deg": 2.0,
        "max_deg": 2.5,
        "lost_lock": False,
        "predicted_deg": None,
        "informative": True,
        "torque_deficit": None,
    }
    return t.EvaluatedSegment(**(values | changes))


def test_verdict_by_the_goals():
    """Each goal alone decides; what carries no information or lies beyond 180 % does not count."""
    assert t.verdict([point()], "saturated").passed is True
    for wrong in (
        {"mean_deg": -1.01},
        {"p95_deg": 3.01},
        {"lost_lock": True, "mean_deg": None, "p95_deg": None},
    ):
        assert t.verdict([point(), point(**wrong)], "saturated").passed is False
        assert t.verdict([point(), point(**wrong, informative=False)], "saturated").passed is True
        assert t.verdict([point(), point(**wrong, load=2.0)], "saturated").passed is True
    assert t.verdict([point(mean_deg=-7.0, predicted_deg=-6.8)], "linear").passed is True
    assert t.verdict([point(mean_deg=-7.0, predicted_deg=-6.6)], "linear").passed is False
    assert t.verdict([point(mean_deg=-7.0)], "linear").passed is None
    kept = point(mean_deg=-7.0, predicted_deg=-6.8)
    assert t.verdict([kept, point(lost_lock=True, mean_deg=None)], "linear").passed is False


def test_static_map_meets_theory_over_the_plane():
    """i_d and i_q both: the linear belief's mean is the cross-saturation angle, open and closed,
    within 0.3 degrees."""
    linear = t.static_map(DRIVE, "qnull", "linear", 0)
    assert linear.passed
    assert linear.metrics["mean_deg"] > 8.0  # it does err
    assert linear.metrics["judged"] == t.DIRECTIONS * 3 * 2  # every radius up to 150 %, both loops
    both = [q for q in linear.points if abs(q.load_d) > 0.4 and abs(q.load) > 0.4]
    assert both
    assert max(abs(q.mean_deg - q.predicted_deg) for q in both) < 0.3
    saturated = t.static_map(DRIVE, "qnull", "saturated", 0)
    assert saturated.passed
    assert saturated.metrics["mean_deg"] < 0.3


def test_current_on_d_is_delivered_and_refused_under_speed_control():
    scene = Scenario("d", (Segment(0.3, 0.5, settle=0.2, current_d=-0.8),), start_up=False)
    run = simulate(DRIVE, scene, load_estimator("qnull"), closed_loop=False)
    late = run.recording.between(0.2, 1.0)
    # integral action: mean within the quantiser's count (2.4 mA) of the reference
    assert late.i_d.mean() == pytest.approx(-0.8 * 1.2, abs=2.4e-3)
    assert late.i_q.mean() == pytest.approx(0.5 * 1.2, abs=2.4e-3)
    with pytest.raises(BadInput, match="current_d goes with"):
        Scenario("d", (Segment(0.3, current_d=0.1),), "free", "speed")
    with pytest.raises(BadInput, match="start_error needs start_up"):
        Scenario("d", (Segment(0.3),), start_error=0.1)


def test_starts_are_those_of_simulate():
    """The batch is the loop itself: angles within noise of `simulate`'s starting up, and every
    start different."""
    found = starts(DRIVE, load_estimator("qnull"), "saturated", count=72)
    assert found.errors.shape == (36, 2)
    assert found.right == 1.0
    assert np.unique(found.errors).size == 72
    # as tests/estimators: noise averaged, and the bias current's tail
    assert np.abs(found.axis_errors).max() < 1.5
    with pytest.raises(BadInput, match="at least 36"):
        starts(DRIVE, load_estimator("qnull"), "saturated", count=35)


def test_attraction_finds_the_wrong_pole():
    """q ripple goes with sin 2e: half of all first positions end at the wrong pole, none in between
    (linear belief)."""
    found = t.attraction(DRIVE, "qnull", "linear", 0)
    assert found.metrics["back"] + found.metrics["reversed"] == 1.0
    assert found.metrics["back"] == pytest.approx(0.5, abs=2.0 / t.FIRST_ANGLES)
    assert found.passed


def test_robustness_sees_each_thing_alone():
    found = t.robustness(DRIVE, "ekf", "saturated", 0)
    m = found.metrics
    assert m["nominal: mean_deg"] < 0.3
    assert m["dead time 4 us: mean_deg"] > 5.0  # the filter lives on the voltage
    assert m["gain 1 %: mean_deg"] < 1.0
    moved = t.perturbations(DRIVE)["alphas +"]
    assert moved["saturation.alpha_40"] == pytest.approx(19.42 + 1.34)  # as its file prints


def test_cost_of_the_ripple():
    """Ripple of a square wave on the d axis: a triangle of peak U Gamma_dd N h / 4, rms at the
    samples known."""
    m = t.costs(DRIVE, "qnull", "saturated", 0).metrics
    from model.energy import flux_from_current, hessian

    d, q = flux_from_current(DRIVE.motor.energy, 0.0, 1.2)
    dd, dq, _ = hessian(DRIVE.motor.energy, float(d), float(q))
    n, h = 8, 250e-6
    f = h * (np.abs(np.arange(n) - n / 2) - n / 4)
    expected = 30.0 * math.hypot(dd, dq) * np.sqrt(np.mean(f**2))
    # of it: R Gamma T / 2 pi = 0.1 squared, and noise
    assert m["ripple_a"] == pytest.approx(expected, rel=0.05)
    assert m["loss_w"] == pytest.approx(1.5 * 12.15 * (m["ripple_a"] ** 2 + m["pwm_ripple_a"] ** 2))
    assert 50.0 < m["step_ns"] < 20000.0
    assert m["at_speed"] == 0.3
    # injected at any speed
    assert m["torque_ripple_at_speed"] == pytest.approx(m["torque_ripple"], rel=0.1)


def test_who_injects_nothing_at_speed_ripples_no_more():
    """Hybrid has faded out at 30 % speed; the PWM's ripple is zero at the samples and costs inside
    the period."""
    faded, shifted = (
        t.costs(DRIVE, name, "saturated", 0).metrics for name in ("hybrid", "pwm_ripple")
    )
    assert faded["torque_ripple"] > 0.05
    assert (
        max(
            faded["torque_ripple_at_speed"],
            shifted["torque_ripple"],
            shifted["torque_ripple_at_speed"],
        )
        < 0.002
    )
    assert faded["pwm_ripple_a"] < 0.5 * shifted["pwm_ripple_a"]


@pytest.mark.parametrize(
    ("error", "cpu", "met"), [(0.5, 1 / 300, True), (0.51, 1e-3, False), (0.1, 1 / 299, False)]
)
def test_reversal_is_judged_by_the_peer(error, cpu, met):
    row = p.Row(
        p.Unit(p.PEER, "reversal", "ekf", "saturated"),
        t.Outcome((), {"rms_deg": 2.0 * error, "cpu_s_per_s": 3.0 * cpu}, True),
        0.0,
    )
    found = p.Protocol((row,), 0).with_reversal_of(3.0, 2.0).rows[0].outcome
    assert found.metrics["rms_to_peer"] == pytest.approx(error)
    assert found.passed is met


SMALL = [
    "protocol",
    "--estimators",
    "qnull",
    "--motors",
    "ipm_exchanged",
    "--tests",
    "creep,cost",
    "--quiet",
]


def test_command_writes_table_figure_and_parquet(tmp_path):
    assert main([*SMALL, "--out", str(tmp_path)]) == 0
    found = json.loads((tmp_path / "protocol.json").read_text())
    assert [(r["test"], r["belief"]) for r in found["tests"]] == [
        (test, belief) for belief in ("saturated", "linear") for test in ("creep", "cost")
    ]
    assert found["tests"][0]["passed"] is True
    rows = pq.read_table(tmp_path / found["table"]).to_pylist()
    assert {r["test"] for r in rows} == {"creep", "cost"}
    assert (
        max(abs(r["mean_deg"]) for r in rows if r["test"] == "creep" and r["belief"] == "saturated")
        < 1.0
    )
    assert (tmp_path / found["figure"]).stat().st_size > 5000
    assert sorted(f.name for f in tmp_path.iterdir()) == [
        f"protocol.{kind}" for kind in ("html", "json", "parquet", "png")
    ]


def test_resumes_after_an_interruption(tmp_path, monkeypatch):
    """What was finished is not run again; a line cut off in the middle is."""
    ran = []

    def fake(drive, estimator, belief, seed):
        ran.append((estimator.name, belief))
        if belief == "linear" and len(ran) == 2:
            raise KeyboardInterrupt
        return t.verdict([point()], belief)

    monkeypatch.setitem(p.TESTS, "creep", fake)
    choose = {
        "estimators": ["qnull"],
        "motors": ["ipm_exchanged"],
        "tests": ["creep"],
        "keep": tmp_path,
        "workers": ALONE,
    }
    with pytest.raises(KeyboardInterrupt):
        p.protocol(**choose)
    with next(tmp_path.glob(".protocol-*.jsonl")).open("a") as file:
        file.write('{"unit": {"motor"')
    result = p.protocol(**choose)
    assert ran == [("qnull", "saturated"), ("qnull", "linear"), ("qnull", "linear")]
    assert [r.outcome.passed for r in result.rows] == [True, None]
    path = next(tmp_path.glob(".protocol-*.jsonl"))
    # no longer what was written
    path.write_text(path.read_text().replace('"passed": true', '"passed": false'))
    assert [r.outcome.passed for r in p.protocol(**choose).rows] == [True, None]
    assert ran[3:] == [("qnull", "saturated")]
    p.forget(tmp_path)
    assert not list(tmp_path.iterdir())


def test_a_motor_file_changed_meanwhile_is_run_again(tmp_path, monkeypatch):
    found = []
    monkeypatch.setitem(
        p.TESTS,
        "creep",
        lambda drive, *_: found.append(drive.motor.resistance) or t.Outcome((), {}, True),
    )
    text, path = (MOTORS / "ipm_exchanged.toml").read_text(), tmp_path / "m.toml"
    for resistance in ("12.15", "13.0", "13.0"):
        path.write_text(text.replace("resistance = 12.15", f"resistance = {resistance}"))
        p.protocol(["qnull"], [path], ["creep"], keep=tmp_path)
    assert found == [12.15, 12.15, 13.0, 13.0]  # two beliefs each; the third call finds them kept


def test_a_cluster_is_handed_names_and_full_paths(tmp_path, monkeypatch):
    """`--dask` and `cluster=`: what its workers are told; a real one runs in the sweep's tests."""
    found = []

    def spread(task, work, workers):
        """Do the work here."""
        found.append(
            (
                workers.cluster,
                [(unit.belief, drive.name, place, seed) for unit, drive, place, seed in work],
            )
        )
        return map(task, work)

    monkeypatch.setattr(p, "spread", spread)
    monkeypatch.setattr(processes, "client_of", nullcontext)  # nobody has to answer
    monkeypatch.setitem(
        p.TESTS, "creep", lambda drive, which, belief, seed: t.verdict([point()], belief)
    )
    own = tmp_path / "mine.py"
    own.write_text(
        "import dataclasses, sandbox\nESTIMATOR = "
        'dataclasses.replace(sandbox.load_estimator("qnull"), name="mine")\n'
    )
    monkeypatch.chdir(tmp_path)
    call = [
        "protocol",
        "--estimators",
        "qnull",
        "--motors",
        "ipm_exchanged",
        "--tests",
        "creep",
        "--seed",
        "3",
    ]
    assert (
        main([*call, "--dask", "tcp://somewhere:8786", "--quiet", "--out", str(tmp_path / "out")])
        == 0
    )
    assert len(json.loads((tmp_path / "out" / "protocol.json").read_text())["tests"]) == 2
    beliefs = ("saturated", "linear")
    assert found.pop() == (
        "tcp://somewhere:8786",
        [(b, "ipm_exchanged", "qnull", 3) for b in beliefs],
    )
    result = sandbox.protocol(["mine.py"], ["ipm_exchanged"], ["creep"], cluster="tcp://other:1")
    assert found == [
        ("tcp://other:1", [(b, "ipm_exchanged", str(own.resolve()), 0) for b in beliefs])
    ]
    assert [row.outcome.passed for row in result.protocol.rows] == [True, None]
    with pytest.raises(BadInput, match="workers are told estimators by name or file"):
        sandbox.protocol(
            load_estimator("qnull"), ["ipm_exchanged"], ["creep"], cluster="tcp://other:1"
        )


@pytest.mark.parametrize(
    ("call", "words"),
    [
        (["--tests", "crep"], "did you mean 'creep'"),
        (["--tests", ","], "no test"),
        (["--estimators", "qnul"], "did you mean 'qnull'"),
        (["--motors", "ipmx"], "did you mean 'ipm'"),
    ],
)
def test_wrong_names_are_named(call, words, tmp_path, capsys):
    assert main(["protocol", *call, "--out", str(tmp_path)]) == 2
    assert words in capsys.readouterr().err
    assert not list(tmp_path.iterdir())
