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
    assert [(r.unit.estimator, r.unit.motor) for r in result.protocol.rows] == [
        ("mine", "ipm_exchanged")
    ] * 2
    # of objects and files nothing waits for another call
    assert not list(tmp_path.glob(".protocol-*"))
    import_module("sandbox.evaluation.pages.protocol_cells").show(result.protocol)
    said = capsys.readouterr().out
    assert "≤ 1 (3)°" in said
    assert "✓ as theory" not in " ".join(said.split())
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


def test_goal_beside_every_verdict_and_a_tick_only_for_what_is_good():
    """Issue 17: 12.9° and "51 % at the wrong pole" were green.  Goals: 1 (3)°, stated with the
    protocol's tests."""
    p, t, cells = (
        import_module(f"sandbox.evaluation.{m}")
        for m in ("protocol", "protocol_tests", "pages.protocol_cells")
    )

    def said(test, belief, passed, **metrics):
        return cells.cell(
            p.Row(p.Unit("m", test, "e", belief), t.Outcome((), metrics, passed), 0.0)
        )

    small, large = {"mean_deg": -0.9, "p95_deg": 2.9}, {"mean_deg": 12.9, "p95_deg": 14.0}
    for test in set(p.TESTS) - {"start", "attraction"}:
        for belief in ("saturated", "linear"):
            assert said(test, belief, True, **small) == "0.90 (2.9) ✓ ≤ 1 (3)°"
            assert said(test, belief, None, **large) == "12.90 (14.0)"
            for passed in (True, False):
                assert cells.judged(
                    p.Row(p.Unit("m", test, "e", belief), t.Outcome((), large, passed), 0.0)
                )[1]
    assert said("creep", "linear", True, **large) == "12.90 (14.0) ○ as theory ±0.3°"
    assert said("creep", "linear", False, **large) == "12.90 (14.0) ✗ as theory ±0.3°"
    assert said("creep", "saturated", False, **large) == "12.90 (14.0) ✗ ≤ 1 (3)°"
    assert said("robustness", "saturated", True, **large) == "12.90 (14.0) ○ lock kept"
    assert (
        said("robustness", "saturated", True, mean_deg=0.5, p95_deg=3.1) == "0.50 (3.1) ○ lock kept"
    )
    turned = {"back": 0.49, "reversed": 0.51, "elsewhere": 0.0}
    assert said("attraction", "saturated", True, **turned) == "49/51/0 % ○ no third rest"
    assert (
        said("attraction", "saturated", True, back=1.0, reversed=0.0, elsewhere=0.0)
        == "100/0/0 % ✓ all back"
    )
    assert said("start", "saturated", True, polarity_right=1.0) == "100.00 % ✓ ≥ 99.9 %"
    ratios = {"rms_to_peer": 0.4, "cpu_to_peer": 1 / 400}
    assert (
        said("reversal", "saturated", True, **ratios)
        == "rms 0.400, CPU 1/400 of peer ✓ ≤ 1/2, ≤ 1/300"
    )


@of("bench", "diagnose")
def test_results_of_long_work_are_results(tmp_path):
    """Those of minutes are tested with their commands; here that their results can do what all
    results can."""
    from sandbox.evaluation.bench import LOOP, PLANT, in_words
    from sandbox.public.campaigns.diagnosed import DiagnosisResult
    from sandbox.public.protocols import BenchResult
    from sandbox.public.result import Result

    measured = {PLANT: 0.002, LOOP: 0.01}
    result = BenchResult(measured, {"all_effects_to_none_cpu": 3.2})
    ratio = "CPU with every effect, to that without effects"
    said = [in_words(*figure) for part in (measured, result.ratios) for figure in part.items()]
    assert said == [
        ("a simulated second of the plant alone, saturated", "2 ms of CPU"),
        ("a simulated second in closed loop, qnull", "10 ms of CPU"),
        (ratio, "3.2 x"),
    ]
    assert (
        repr(result)
        == "<BenchResult: a second costs 2 ms of CPU for the plant, 10 ms for the closed loop>"
    )
    assert result.to_table().num_rows == 3
    assert [p.name for p in result.save(tmp_path).iterdir()] == ["bench.json"]
    assert issubclass(DiagnosisResult, Result)
    with pytest.raises(sandbox.BadInput, match="'nowhere'"):
        sandbox.diagnose("nowhere")
    with pytest.raises(sandbox.BadInput, match="unknown nominal model"):
        sandbox.diagnose("nowhere", nominal="quartic")


@of("sweep", "tolerances")
def test_results_of_many_runs(tmp_path):
    """What they hold: tests/sandbox/evaluation/sweep."""
    scene = {
        "scenario": {"start_up": False},
        "segment": [{"duration": 0.02, "load": 1.0, "settle": 0.01}],
    }
    done = sandbox.sweep(
        scene | {"grid": {"belief": ["linear", "saturated"]}}, tmp_path / "sweep", jobs=1
    )
    assert repr(done).startswith("<SweepResult: sweep, 2 runs, ")
    assert done.save(csv=True) == tmp_path / "sweep"
    names = {"journal.jsonl", "runs", "schema.json", "sweep.csv", "sweep.json", "sweep.png"}
    assert {p.name for p in (tmp_path / "sweep").iterdir()} == names
    assert done.to_dataframe().attrs["units"]["mean_deg"] == "deg"
    assert json.loads((tmp_path / "sweep" / "sweep.json").read_text())["status"] == {"ok": 2}
    short = sandbox.Scenario("short", (sandbox.Segment(0.02, 1.0, settle=0.01),), start_up=False)
    found = sandbox.tolerances("ipm_exchanged", short, "qnull", percent=[5], draws=2, jobs=1)
    assert [(r.belief, r.tolerance) for r in found.rows] == [
        (b, t) for t in (0, 0.05) for b in ("linear", "saturated")
    ]
    found.save(tmp_path / "tolerances")
    names = {"tolerances.json", "tolerances.parquet", "tolerances.png"}
    assert {p.name for p in (tmp_path / "tolerances").iterdir()} == names
    with pytest.raises(sandbox.BadInput, match="no name or file"):
        sandbox.tolerances(sandbox.load_motor("ipm_exchanged"))
