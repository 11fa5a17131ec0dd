"""Results of many runs on the page: protocol, bench, sweep, tolerances."""

from __future__ import annotations

import json
from importlib import import_module

import pytest

import sandbox
from tests.sandbox.public.naming import of


@of("protocol")
def test_protocol_takes_objects_and_shows_goals(own_file, tmp_path, capsys):
    drive = sandbox.load_motor("ipm_exchanged")
    result = sandbox.protocol([own_file], [drive], ["load_step"], keep=tmp_path)
    assert [(r.unit.estimator, r.unit.motor) for r in result.protocol.rows] == [("mine", "ipm_exchanged")] * 2
    assert not list(tmp_path.glob(".protocol-*"))  # of objects and files nothing waits for another call
    import_module("sandbox.evaluation.protocol").show(result.protocol)
    said = capsys.readouterr().out
    assert "≤ 1 (3)°" in said
    assert "as theory ±0.3°" not in said or "✓" in said
    assert result.to_table().column("motor").to_pylist()[0] == "ipm_exchanged"
    with pytest.raises(sandbox.BadInput, match="no trace"):
        result.to_rerun(tmp_path / "x.rrd")
    with pytest.raises(sandbox.BadInput, match="no page of its own"):
        sandbox.maps("ipm", points=3).to_html(tmp_path / "x.html")
    assert repr(result.protocol) == "<Protocol: 2 rows, seed 0>"
    result.save(tmp_path / "out")
    names = [f"protocol.{kind}" for kind in ("html", "json", "parquet", "png")]
    assert sorted(p.name for p in (tmp_path / "out").iterdir()) == names
    assert json.loads((tmp_path / "out" / "protocol.json").read_text())["page"] == "protocol.html"


def test_goal_beside_every_verdict():
    p, t = import_module("sandbox.evaluation.protocol"), import_module("sandbox.evaluation.protocol_tests")
    outcome = t.Outcome((), {"mean_deg": 12.9, "p95_deg": 14.0, "lost": 0}, True)
    for test in p.TESTS:
        for belief in ("saturated", "linear"):
            row = p.Row(p.Unit("m", test, "e", belief), outcome, 0.0)
            text = p.cell(row)
            assert text.partition("✓ ")[2] == p.goal_of(row) != ""
    linear = p.cell(p.Row(p.Unit("m", "creep", "e", "linear"), outcome, 0.0))
    assert linear == "12.90 (14.0) ✓ as theory ±0.3°"


@of("bench", "diagnose")
def test_results_of_long_work_are_results(tmp_path):
    """Those of minutes are tested with their commands; here that their results can do what all results can."""
    from sandbox.evaluation.bench import LOOP, PLANT
    from sandbox.public.campaigns.diagnosed import DiagnosisResult
    from sandbox.public.protocols import BenchResult
    from sandbox.public.result import Result

    measured = {PLANT: 0.002, LOOP: 0.01}
    result = BenchResult(measured, {"all_effects_to_none_cpu": 3.2})
    assert repr(result) == "<BenchResult: a second costs 2 ms of CPU for the plant, 10 ms for the closed loop>"
    assert result.to_table().num_rows == 3
    assert [p.name for p in result.save(tmp_path).iterdir()] == ["bench.json"]
    assert issubclass(DiagnosisResult, Result)
    with pytest.raises(sandbox.BadInput, match="'nowhere'"):
        sandbox.diagnose("nowhere")
    with pytest.raises(sandbox.BadInput, match="unknown nominal model"):
        sandbox.diagnose("nowhere", nominal="quartic")


@of("sweep", "tolerances")
def test_results_of_many_runs(tmp_path):
    """What they hold: tests/sandbox/sweep."""
    scene = {"scenario": {"start_up": False}, "segment": [{"duration": 0.02, "load": 1.0, "settle": 0.01}]}
    done = sandbox.sweep(scene | {"grid": {"belief": ["linear", "saturated"]}}, tmp_path / "sweep", jobs=1)
    assert repr(done).startswith("<SweepResult: sweep, 2 runs, ")
    assert done.save(csv=True) == tmp_path / "sweep"
    names = {"manifest.json", "runs", "schema.json", "sweep.csv", "sweep.json", "sweep.png"}
    assert {p.name for p in (tmp_path / "sweep").iterdir()} == names
    assert done.to_dataframe().attrs["units"]["mean_deg"] == "deg"
    assert json.loads((tmp_path / "sweep" / "sweep.json").read_text())["status"] == {"ok": 2}
    short = sandbox.Scenario("short", (sandbox.Segment(0.02, 1.0, settle=0.01),), start_up=False)
    found = sandbox.tolerances("ipm_exchanged", short, "qnull", percent=[5], draws=2, jobs=1)
    assert [(r.belief, r.tolerance) for r in found.rows] == [(b, t) for t in (0, 0.05) for b in ("linear", "saturated")]
    found.save(tmp_path / "tolerances")
    names = {"tolerances.json", "tolerances.parquet", "tolerances.png"}
    assert {p.name for p in (tmp_path / "tolerances").iterdir()} == names
    with pytest.raises(sandbox.BadInput, match="no name or file"):
        sandbox.tolerances(sandbox.load_motor("ipm_exchanged"))
