"""Scoring a withheld check with diagnoses whose worth is known, and its limits against closed forms."""

import json
import math
from types import SimpleNamespace

import numpy as np
import pytest

from model.errors import BadInput
from sandbox.gap.withheld.figure import withheld_figure
from sandbox.gap.withheld.judge import alike, closed, covered, f1, judge
from sandbox.gap.withheld.limits import area, auroc, mean, quantile, ratio, share
from sandbox.gap.withheld.score import score, table
from sandbox.gap.withheld.spread import spread


def truth_of(effects=("dead_time",), kind="one", sizes=(1.0,), parameters=None):
    """Return one entry of a seal."""
    values = {"dead_time.time": 2e-6} if parameters is None else parameters
    return {"effects": list(effects), "kind": kind, "family": "ipm", "sizes": list(sizes), "parameters": values}


def diagnosis_of(*hypotheses, verdict="explained", members=None, subsystem="inverter", before=3.0, shrunk=0.9):
    """Return a diagnosis of (effects, probability) pairs, its parameters around the truth."""
    time = {"dead_time.time": {"value": 2e-6, "ci95": [1.9e-6, 2.1e-6], "unit": "s"}}
    return {
        "verdict": verdict, "gap": {"before": before, "after": 1.0, "closed": shrunk},
        "where": [{"subsystem": subsystem, "share": 1.0}],
        "hypotheses": [{"effects": list(e), "probability": p, "parameters": time} for e, p in hypotheses],
        "ambiguity_set": [list(e) for e, _ in hypotheses[:1]] if members is None else members,
        "cost": {"simulations": 100, "seconds": 2.0},
    }  # fmt: skip


def test_a_right_diagnosis():
    j = judge("w", truth_of(), diagnosis_of((["dead_time"], 0.9), (["device_drop"], 0.1)))
    assert (j.hit, j.probability, j.f1, j.parts, j.closed) == (True, 0.9, 1.0, (1, 1), 0.9)
    assert (j.in_set, j.set_size, j.subsystem, j.label, j.unknown) == (True, 1, True, "dead_time", 0.0)
    assert not j.confident


def test_a_wrong_name_and_a_failure_are_misses():
    j = judge("w", truth_of(), diagnosis_of((["iron_loss"], 0.97), (["dead_time"], 0.03), subsystem="machine"))
    assert (j.hit, j.probability, j.parts, j.in_set, j.subsystem) == (False, 0.03, (0, 0), False, False)
    assert j.confident
    j = judge("w", truth_of(), {"failed": "no"})
    assert (j.hit, j.probability, j.closed, j.in_set, j.subsystem, j.parts) == (False, 0.0, 0.0, False, False, (0, 1))
    j = judge("w", truth_of((), "none", (), {}), {"failed": "no"})
    assert (j.hit, j.subsystem, j.verdict) == (False, None, "failed")


def test_what_the_library_does_not_hold_is_unknown_also_beside_a_name():
    true = truth_of(("unknown",), "outside", parameters={})
    j = judge("w", true, diagnosis_of((["iron_loss", "unknown"], 0.7), (["unknown"], 0.2), (["iron_loss"], 0.1)))
    assert (j.hit, j.in_set, j.label) == (True, True, "unknown")
    assert j.unknown == pytest.approx(0.9)
    assert not judge("w", true, diagnosis_of((["iron_loss"], 1.0))).hit
    assert not judge("w", truth_of(), diagnosis_of((["dead_time", "unknown"], 1.0))).hit


def test_an_effect_that_contains_the_other_counts_if_the_truth_is_in_the_set():
    true = truth_of(("cross_saturation",), parameters={})
    both = [["saturation"], ["cross_saturation"]]
    found = diagnosis_of((["saturation"], 0.6), (["cross_saturation"], 0.4), members=both)
    j = judge("w", true, found)
    assert (j.hit, j.probability, j.separable) == (True, 1.0, False)
    alone = judge("w", true, diagnosis_of((["saturation"], 0.6), (["cross_saturation"], 0.4)))
    assert (alone.hit, alone.probability, alone.in_set) == (False, 0.4, False)
    assert alike(frozenset({"a", "saturation"}), frozenset({"a", "cross_saturation"}))
    assert not alike(frozenset({"a", "saturation"}), frozenset({"b", "cross_saturation"}))


def test_parts():
    assert f1(frozenset("ab"), frozenset("bc")) == pytest.approx(0.5)
    assert f1(frozenset(), frozenset()) == 1.0
    true = {"x.phase": 0.1, "x.amplitude": 2.0, "y.time": 1.0}
    found = {"x.phase": {"ci95": [6.2, 6.6]}, "x.amplitude": {"ci95": [2.1, 2.2]}, "y.time": {"ci95": [0.0, 2.0]}}
    assert covered(true, found, ["x"]) == (1, 2)  # the phase a turn on; the amplitude missed; y not named
    assert covered(true, {"x.phase": {"ci95": [None, 1.0]}}, ["x"]) == (0, 0)
    some = frozenset({"dead_time"})
    assert closed(some, {"before": 3.0, "closed": None}) == 0.0
    assert closed(some, {"before": 1.01, "closed": None}) is None
    assert closed(frozenset(), {"before": 3.0, "closed": 0.5}) is None


def test_limits_against_closed_forms():
    """No event in n: upper limit 1 - 0.05^(1/n), the "rule of three"; all: its mirror image."""
    none, every = share([False] * 300), share([True] * 30)
    assert (none.value, none.low) == (0.0, 0.0)
    assert none.high == pytest.approx(1.0 - 0.05 ** (1 / 300))
    assert none.high < 0.01  # 300 controls are what 1 % asks for
    assert every.low == pytest.approx(0.05 ** (1 / 30))
    assert share([]).value is None
    rng = np.random.default_rng(1)
    x = rng.standard_normal(400)
    found = mean(x)
    half = 1.645 / 20.0  # one-sided 95 %, sigma / sqrt(n)
    assert found.high - found.value == pytest.approx(half, rel=0.15)
    assert found.value - found.low == pytest.approx(half, rel=0.15)
    assert quantile(np.arange(101.0), 0.1).value == pytest.approx(10.0)
    pooled = ratio([(1, 1), (0, 3), (0, 0)])
    assert (pooled.value, pooled.n) == (0.25, 4)


def test_area_under_the_roc():
    assert area([1.0, 1.0], [0.0, 0.5]) == 1.0
    assert area([0.5], [0.5]) == 0.5
    assert area([0.0, 1.0], [0.5]) == 0.5
    p, n = np.random.default_rng(2).standard_normal((2, 500))
    shifted = auroc(list(p + 1.0), list(n))
    assert shifted.value == pytest.approx(0.5 * (1.0 + math.erf(0.5)), abs=0.03)  # Phi(1/sqrt 2)
    assert shifted.low < shifted.value < shifted.high


def test_spread_on_processes_does_all_once():
    assert sorted(spread(abs, [-3, 1, -2], 2)) == [1, 2, 3] == sorted(spread(abs, [-3, 1, -2], 1))


@pytest.fixture
def check(tmp_path):
    """A sealed check of five campaigns without recordings; a fake diagnosis needs their names only."""
    import hashlib

    truths = {
        "w000": truth_of(), "w001": truth_of((), "none", (), {}), "w002": truth_of(("unknown",), "outside", (1.0,), {}),
        "w003": truth_of(("dead_time", "inertia"), "several", (1.0, 1.0), {}), "w004": truth_of(sizes=(0.25,)),
    }  # fmt: skip
    data = json.dumps({"campaigns": truths}).encode()
    (tmp_path / "truth.sealed").write_bytes(data)
    (tmp_path / "SHA256").write_text(f"{hashlib.sha256(data).hexdigest()}  truth.sealed\n")
    for name in truths:
        (tmp_path / "campaigns" / name).mkdir(parents=True)
    return tmp_path


class Oracle:
    """A diagnosis that knows the answers of `check`; counts its calls, fails on one campaign while told to."""

    def __init__(self, failing=None):
        self.calls, self.failing = [], failing

    def __call__(self, folder, exclude):
        self.calls.append((folder.name, exclude))
        if folder.name == self.failing:
            raise RuntimeError("no memory")
        none, unknown = (
            diagnosis_of(([], 1.0), verdict="no_gap", shrunk=None, before=1.0),
            diagnosis_of((["unknown"], 1.0)),
        )
        answers = {"w001": none, "w002": unknown, "w004": none}
        answers["w003"] = diagnosis_of((["dead_time", "inertia"], 0.8), (["inertia"], 0.2))
        found = answers.get(folder.name, diagnosis_of((["dead_time"], 0.9), ([], 0.1)))
        return SimpleNamespace(json=unknown if exclude else found)


def test_score_counts_what_is_known(check, tmp_path):
    result = score(check, Oracle(), leave_out=1.0)
    f = result.figures
    assert (f["top1"].value, f["top1"].n) == (0.5, 2)
    assert f["mean_probability"].value == pytest.approx(0.45)
    assert (f["exact_set"].value, f["set_f1"].value, f["unknown_auroc"].value, f["false_alarm"].value) == (1, 1, 1, 0)
    assert f["leave_out_unknown"].value == 1.0
    assert f["leave_out_unknown"].n == 1  # w004 is too small to be left out
    content = result.as_json()
    assert content["detection_floor"]["dead_time"] == {"found": 1.0, "missed": 0.25, "n": 2}
    assert content["by_size"]["1"]["top1"]["value"] == 1.0
    matrix = content["confusion"]
    assert matrix["counts"][matrix["truth"].index("dead_time")][matrix["verdict"].index("none")] == 1
    assert [b["n"] for b in content["reliability"]] == [1, 4]  # 0.8 alone; 0.9 and 1 in the last bin
    heads, rows = table([result])
    assert heads == ["metric", "goal", "diagnosis"]
    assert len(rows) == 17
    withheld_figure({**content, "methods": {"diagnosis": content}}, tmp_path / "page.png")
    assert (tmp_path / "page.png").stat().st_size > 10_000


def test_score_goes_on_where_it_stopped(check):
    first = Oracle()
    assert len(score(check, first, limit=2).judged) == 2
    second = Oracle()
    score(check, second)
    assert [name for name, _ in second.calls] == ["w002", "w003", "w004"]
    third = Oracle(failing="w000")
    again = score(check, third, again=True)
    assert len(third.calls) == 5
    assert again.judged[0].failed
    assert again.figures["top1"].value == 0.0
    assert "no memory" in (check / "diagnoses" / "w000.json").read_text()


def test_methods_keep_their_reports_apart(check):
    score(check, Oracle())
    other = Oracle(failing="w000")
    assert score(check, other, method="simple").judged[0].failed
    assert not score(check, Oracle(failing="w000")).judged[0].failed


def test_a_changed_truth_is_refused(check):
    data = (check / "truth.sealed").read_bytes()
    (check / "truth.sealed").write_bytes(data.replace(b"2e-06", b"3e-06"))
    with pytest.raises(BadInput, match="truth was changed"):
        score(check, Oracle())


def test_no_check_is_refused(tmp_path):
    with pytest.raises(BadInput, match="no withheld check"):
        score(tmp_path, Oracle())
    with pytest.raises(BadInput, match="is no share"):
        score(tmp_path, Oracle(), leave_out=2.0)
