"""Scoring a withheld check with diagnoses whose worth is known, and its limits against closed
forms."""

import hashlib
import json
import math

import numpy as np
import pytest

from model.errors import BadInput
from sandbox.engine.processes import Workers, spread
from sandbox.withheld.scoring.blind import read_report, score, taken_out
from sandbox.withheld.scoring.check_figure import withheld_figure
from sandbox.withheld.scoring.judge import alike, chances, closed, covered, f1, judge, located
from sandbox.withheld.scoring.limits import area, auroc, mean, mean_share, quantile, ratio, share
from sandbox.withheld.scoring.metrics import by_subsystem, confusion, figures, left_out
from sandbox.withheld.scoring.running import Check
from sandbox.withheld.scoring.tables_of_rows import table
from tests.sandbox.withheld.known import Oracle, diagnosis_of, truth_of

pytestmark = pytest.mark.usefixtures("in_this_process")


def test_a_right_diagnosis():
    j = judge("w", truth_of(), diagnosis_of((["dead_time"], 0.9), (["device_drop"], 0.1)))
    assert (j.hit, j.probability, j.f1, j.parts, j.closed) == (True, 0.9, 1.0, (1, 1), 0.9)
    assert (j.in_set, j.set_size, j.subsystem, j.label, j.unknown) == (
        True,
        1,
        True,
        "dead_time",
        0.0,
    )
    assert not j.confident


def test_a_wrong_name_and_a_failure_are_misses():
    j = judge(
        "w",
        truth_of(),
        diagnosis_of((["iron_loss"], 0.97), (["dead_time"], 0.03), subsystem="machine"),
    )
    assert (j.hit, j.probability, j.parts, j.in_set, j.subsystem) == (
        False,
        0.03,
        (0, 0),
        False,
        False,
    )
    assert j.confident
    j = judge("w", truth_of(), {"failed": "no"})
    assert (j.hit, j.probability, j.closed, j.in_set, j.subsystem, j.parts) == (
        False,
        0.0,
        0.0,
        False,
        False,
        (0, 1),
    )
    j = judge("w", truth_of((), "none", (), {}), {"failed": "no"})
    assert (j.hit, j.subsystem, j.verdict, j.unknown, j.label) == (
        False,
        None,
        "failed",
        1.0,
        "failed",
    )
    j = judge("w", truth_of(("unknown",), "outside", parameters={}), {"failed": "no"})
    assert (j.hit, j.subsystem, j.unknown) == (False, False, 0.0)
    cogging = {
        "cogging_torque.amplitude": 0.1,
        "cogging_torque.order_mech": 36.0,
        "cogging_torque.phase": 1.0,
    }
    assert judge(
        "w", truth_of(("cogging_torque",), parameters=cogging), {"failed": "no"}
    ).parts == (0, 2)


def test_a_failure_spoils_the_ranking_of_unknown_either_way():
    """Two outside, two known, one of each failed: of four pairs only that of the two that answered
    is in order."""
    outside, known = truth_of(("unknown",), "outside", parameters={}), truth_of()
    found = (
        diagnosis_of((["unknown"], 0.9), (["dead_time"], 0.1)),
        diagnosis_of((["dead_time"], 0.9), (["unknown"], 0.1)),
    )
    judged = [judge("a", outside, found[0]), judge("b", known, found[1])]
    assert figures(judged)["unknown_auroc"].value == 1.0
    judged += [judge("c", outside, {"failed": "no"}), judge("d", known, {"failed": "no"})]
    assert figures(judged)["unknown_auroc"].value == 0.25


def test_no_gap_locates_nothing_where_there_is_an_effect():
    none = diagnosis_of(([], 1.0), verdict="no_gap", shrunk=None)
    assert judge("w", truth_of(), none).subsystem is False
    assert judge("w", truth_of((), "none", (), {}), none).subsystem is None


def test_an_effect_outside_the_library_has_a_subsystem():
    where = [{"subsystem": "sensor"}]
    assert located(frozenset({"unknown"}), where, "sensor")
    assert not located(frozenset({"unknown"}), where, "mechanics")
    assert not located(frozenset({"unknown"}), where)  # seals of before: the machine's
    true = truth_of(("unknown",), "outside", parameters={}) | {"outside_subsystem": "sensor"}
    assert judge("w", true, diagnosis_of((["unknown"], 1.0), subsystem="sensor")).subsystem


def test_names_beside_unknown_are_counted():
    true = truth_of(("unknown",), "outside", parameters={})
    answers = [(["unknown"], 1.0)], [(["iron_loss", "unknown"], 1.0)], [(["iron_loss"], 1.0)]
    judged = [judge(f"w{k}", true, diagnosis_of(*a)) for k, a in enumerate(answers)]
    named = figures(judged)["outside_named"]
    assert (named.value, named.n) == (pytest.approx(1 / 3), 3)
    assert figures([*judged, judge("w3", true, {"failed": "no"})])["outside_named"].value == 0.5
    assert figures(judged)["outside_blamed"].value == pytest.approx(1 / 3)


def test_false_names_of_the_whole_list_are_counted():
    """Three answers say `unknown` alone; the list of the second has an absent effect above one half
    all the same, that of the third the one that is there.  A failed diagnosis counts as a false
    name."""
    true = truth_of(("dead_time", "unknown"), "outside", (1.0, 2.0))
    lists = [{"dead_time": 0.2, "iron_loss": 0.5}, {"iron_loss": 0.97}, {"dead_time": 0.9}]
    answers = [
        {
            **diagnosis_of((["unknown"], 1.0)),
            "effects": [{"name": e, "probability": p} for e, p in own.items()],
        }
        for own in lists
    ]
    judged = [judge(f"w{k}", true, a) for k, a in enumerate([*answers, {"failed": "no"}])]
    assert [sorted(j.listed(0.5)) for j in judged] == [[], ["iron_loss"], [], []]
    assert figures(judged)["outside_listed"].value == 0.5
    assert [
        f["leave_out_listed_wrong"].value for f in (left_out(judged), left_out(judged[:1]))
    ] == [0.5, 0.0]


def test_an_effect_that_is_there_beside_unknown_is_no_false_name():
    """With dead time there: alone or beside unknown no false name, iron loss one; without it,
    one."""
    both = truth_of(("dead_time", "unknown"), "outside", (1.0, 2.0)) | {
        "outside_subsystem": "mechanics"
    }
    answers = [
        diagnosis_of((["dead_time", "unknown"], 1.0), subsystem="mechanics"),
        diagnosis_of((["dead_time", "iron_loss", "unknown"], 1.0)),
        diagnosis_of((["dead_time"], 1.0)),
        diagnosis_of((["iron_loss"], 1.0)),
    ]
    judged = [judge(f"w{k}", both, a) for k, a in enumerate(answers)]
    assert [j.hit for j in judged] == [True, True, False, False]
    assert [j.outside for j in judged] == ["mechanics"] * 4
    assert (judged[0].parts_of["dead_time"], judged[0].subsystem, judged[0].f1) == (
        (1, 1),
        True,
        pytest.approx(2 / 3),
    )
    f = figures(judged)
    assert (f["outside_named"].value, f["outside_blamed"].value) == (0.25, 0.25)


def test_causes_outside_by_their_subsystem():
    """Two of the sensors, one missed; one of the machine, by an old seal that does not say so; two
    known ones, of which one ranks above the missed one: of the sensors' four pairs three are in
    order."""
    sensor = truth_of(("unknown",), "outside", parameters={}) | {"outside_subsystem": "sensor"}
    found, missed = (
        diagnosis_of((["unknown"], 0.9), ([], 0.1)),
        diagnosis_of((["dead_time"], 0.8), (["unknown"], 0.2)),
    )
    judged = [judge("a", sensor, found), judge("b", sensor, missed)]
    judged.append(judge("c", truth_of(("unknown",), "outside", parameters={}), found))
    known = [
        judge("d", truth_of(), diagnosis_of((["dead_time"], 0.9), (["unknown"], p)))
        for p in (0.1, 0.3)
    ]
    got = by_subsystem(judged, known)
    assert list(got) == ["machine", "sensor"]
    assert {k: f.value for k, f in got["sensor"].items()} == {
        "found": 0.5,
        "named": 0.0,
        "blamed": 0.5,
        "auroc": 0.75,
    }
    assert got["machine"]["auroc"].value == 1.0
    assert by_subsystem(judged)["sensor"]["auroc"].value is None
    assert by_subsystem(known) == {}


def test_campaigns_of_many_effects_count_for_the_whole_list():
    names = ("dead_time", "device_drop", "inertia", "iron_loss")
    j = judge("w", truth_of(names, "many", (1.0,) * 4, {}), diagnosis_of((list(names), 1.0)))
    f = figures([j])
    assert (f["included_f1"].value, f["included_f1"].n, f["exact_set"].n) == (1.0, 1, 0)
    one = judge("o", truth_of(), diagnosis_of((["dead_time"], 1.0), shrunk=0.2))
    both = figures([j, one])
    # of the list alone
    assert (both["closed_many_median"].value, both["closed_many_p10"].n) == (0.9, 1)
    assert both["closed_median"].value == pytest.approx(0.55)
    assert confusion([j])["counts"] == []


def test_who_asks_for_nothing_resolves_nothing():
    """Four ambiguous verdicts: one asks and is settled, one asks and is not, one does not ask, one
    is to be made."""
    pair = [["dead_time"], ["device_drop"]]
    first = diagnosis_of(
        (["dead_time"], 0.6), (["device_drop"], 0.4), verdict="ambiguous", members=pair
    )
    judged = [judge(name, truth_of(), first) for name in "abcd"]
    judged.append(judge("e", truth_of(), diagnosis_of((["dead_time"], 1.0))))
    settled, open_ = (
        judge("a", truth_of(), diagnosis_of((["dead_time"], 1.0))),
        judge("b", truth_of(), first),
    )
    assert (settled.settled, open_.settled) == (True, False)
    f = figures(judged, {"a": 0.9, "b": 0.8, "d": 0.6}, (settled, open_))
    assert f["resolved_promised"].value == pytest.approx(0.85)
    assert (f["resolved"].value, f["resolved"].n) == (0.5, 2)
    assert (f["recommended"].value, f["recommended"].n) == (0.75, 4)
    assert (f["resolved_of_all"].value, f["resolved_of_all"].n) == (pytest.approx(1 / 3), 3)
    # as with --finished: nothing was recorded
    assert figures(judged, {"a": 0.9})["resolved_of_all"].n == 0
    silent = figures(judged)
    assert (silent["recommended"].value, silent["resolved_of_all"].value, silent["resolved"].n) == (
        0.0,
        0.0,
        0,
    )


def test_what_is_said_where_the_true_effect_was_left_out():
    """Verdict unknown; unknown second; far second, in the set; a name for sure; "none" for sure;
    failed; the twin."""
    answers = [
        diagnosis_of((["unknown"], 0.9), (["iron_loss"], 0.1), verdict="unknown"),
        diagnosis_of((["iron_loss"], 0.9), (["unknown"], 0.1)),
        diagnosis_of(
            (["iron_loss"], 0.6),
            ([], 0.36),
            (["unknown"], 0.04),
            members=[["iron_loss"], [], ["unknown"]],
        ),
        diagnosis_of((["iron_loss"], 0.97), (["unknown"], 0.03)),
        diagnosis_of(([], 0.97), (["unknown"], 0.03), verdict="no_gap"),
        {"failed": "no"},
        diagnosis_of((["device_drop"], 1.0)),
    ]
    assert truth_of()["effects"] == ["dead_time"]
    f = left_out([judge(f"w{k}", truth_of(), a) for k, a in enumerate(answers)])
    assert f["leave_out_verdict_unknown"].value == pytest.approx(1 / 7)
    assert f["leave_out_unknown"].value == pytest.approx(3 / 7)
    assert f["leave_out_confident_wrong"].value == pytest.approx(3 / 7)
    assert f["leave_out_twin"].value == pytest.approx(1 / 7)
    # the iron loss, the drop, and what failed
    assert f["leave_out_listed_wrong"].value == pytest.approx(3 / 7)


def test_the_cause_is_taken_out_by_every_name():
    assert taken_out(["cross_saturation", "dead_time"]) == (
        "cross_saturation",
        "dead_time",
        "saturation",
    )
    assert taken_out(["saturation"]) == ("saturation",)


def test_what_the_library_does_not_hold_is_unknown_also_beside_a_name():
    true = truth_of(("unknown",), "outside", parameters={})
    j = judge(
        "w",
        true,
        diagnosis_of((["iron_loss", "unknown"], 0.7), (["unknown"], 0.2), (["iron_loss"], 0.1)),
    )
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
    found = {
        "x.phase": {"ci95": [6.2, 6.6]},
        "x.amplitude": {"ci95": [2.1, 2.2]},
        "y.time": {"ci95": [0.0, 2.0]},
    }
    # the phase a turn on; the amplitude missed; y not named
    assert covered(true, found, ["x"]) == (1, 2)
    assert covered(true, {"x.phase": {"ci95": [None, 1.0]}}, ["x"]) == (1, 1)
    half = {"x.amplitude": {"ci95": [None, 1.9]}, "y.time": {"ci95": [0.9, None]}, "x.phase": {}}
    assert covered(true, half, ["x", "y"]) == (1, 2)  # open ends; no interval, not given
    kept = {"cogging_torque.order_mech": {"ci95": [36.0, 36.0]}}
    assert covered({"cogging_torque.order_mech": 36.0}, kept, ["cogging_torque"]) == (0, 0)
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
    pooled = ratio([(1, 1), (0, 3), (0, 0)])
    assert (pooled.value, pooled.n) == (0.25, 4)


def test_limits_of_quantiles_are_order_statistics():
    """Median of n: the smallest value is a limit where 2^-n <= 0.05; n = 8: of 256 cases 9 have
    less than two below."""
    four, five, eight = (quantile(np.arange(1.0, n + 1.0), 0.5) for n in (4, 5, 8))
    assert (four.value, four.low, four.high) == (2.5, None, None)
    assert (five.low, five.high) == (1.0, 5.0)
    assert (eight.low, eight.high) == (2.0, 7.0)  # (1 + 8)/256 = 0.035, (1 + 8 + 28)/256 = 0.14
    low, lower = quantile(np.arange(28.0), 0.1), quantile(np.arange(29.0), 0.1)
    assert (low.low, lower.low) == (None, 0.0)  # 0.9^28 = 0.0523, 0.9^29 = 0.0471
    assert quantile(np.arange(101.0), 0.1).value == pytest.approx(10.0)
    assert quantile([], 0.5).value is None


def test_limits_of_quantiles_hold_as_often_as_they_say():
    """2000 draws of 30: the true quantile is beyond a limit in at most 5 % of them (three sigma:
    1.5 %)."""
    rng, q = np.random.default_rng(3), 0.3
    found = [quantile(rng.uniform(size=30), q) for _ in range(2000)]
    assert np.mean([f.low > q for f in found]) < 0.065
    assert np.mean([f.high < q for f in found]) < 0.065


def test_equal_outcomes_are_no_certainty():
    """All of n the same: as the exact limit of a share, scaled; four outcomes never give [1, 1]."""
    for n in (4, 30):
        seen = 0.05 ** (1 / n)
        ones, zeros, halves = (mean_share([x] * n) for x in (1.0, 0.0, 0.5))
        assert (ones.low, ones.high) == (pytest.approx(seen), 1.0)
        assert ones.low == pytest.approx(share([True] * n).low)
        assert (zeros.low, zeros.high) == (0.0, pytest.approx(1.0 - seen))
        assert (halves.low, halves.high) == (
            pytest.approx(0.5 * seen),
            pytest.approx(1.0 - 0.5 * seen),
        )
        assert ratio([(3, 3)] * n).low == pytest.approx(seen)  # as many campaigns, not parameters
    assert mean([1.2] * 4).low == pytest.approx(1.2)  # of any numbers: the bootstrap alone
    wide = mean_share([0.0, 1.0] * 50)
    assert (wide.low, wide.high) == (mean([0.0, 1.0] * 50).low, mean([0.0, 1.0] * 50).high)


def test_area_under_the_roc():
    assert area([1.0, 1.0], [0.0, 0.5]) == 1.0
    assert area([0.5], [0.5]) == 0.5
    assert area([0.0, 1.0], [0.5]) == 0.5
    every, none = auroc([1.0] * 6, [0.0] * 20), auroc([0.0] * 20, [1.0] * 6)
    assert (every.low, every.high) == (pytest.approx(0.05 ** (1 / 6)), 1.0)
    assert (none.low, none.high) == (0.0, pytest.approx(1.0 - 0.05 ** (1 / 6)))
    p, n = np.random.default_rng(2).standard_normal((2, 500))
    shifted = auroc(list(p + 1.0), list(n))
    assert shifted.value == pytest.approx(0.5 * (1.0 + math.erf(0.5)), abs=0.03)  # Phi(1/sqrt 2)
    assert shifted.low < shifted.value < shifted.high


def test_spread_on_processes_does_all_once():
    assert (
        sorted(spread(abs, [-3, 1, -2], Workers(2)))
        == [1, 2, 3]
        == sorted(spread(abs, [-3, 1, -2]))
    )


def test_score_counts_what_is_known(check, tmp_path):
    result = score(Check(check, Oracle()), leave_out=1.0)
    f = result.figures
    assert (f["top1"].value, f["top1"].n) == (0.5, 2)
    assert f["mean_probability"].value == pytest.approx(0.45)
    assert (
        f["exact_set"].value,
        f["set_f1"].value,
        f["unknown_auroc"].value,
        f["false_alarm"].value,
    ) == (1, 1, 1, 0)
    assert f["leave_out_unknown"].value == 1.0
    assert f["leave_out_unknown"].n == 1  # w004 is too small to be left out
    content = result.as_json()
    assert content["detection_floor"]["dead_time"] == {"found": 1.0, "missed": 0.25, "n": 2}
    assert content["by_size"]["1"]["top1"]["value"] == 1.0
    matrix = content["confusion"]
    assert (
        matrix["counts"][matrix["truth"].index("dead_time")][matrix["verdict"].index("none")] == 1
    )
    # 0.8 alone; 0.9 and 1 in the last bin
    assert [b["n"] for b in content["reliability"]] == [1, 4]
    heads, rows = table([result])
    assert heads == ["metric", "goal", "diagnosis"]
    assert [row[0] for row in rows[:5]] == [
        "top1",
        "top1_half",
        "mean_probability",
        "set_f1",
        "exact_set",
    ]
    assert {"resolved", "resolved_promised", "leave_out_twin"} <= {row[0] for row in rows}
    withheld_figure({**content, "methods": {"diagnosis": content}}, tmp_path / "page.png")
    assert (tmp_path / "page.png").stat().st_size > 10_000


def test_score_goes_on_where_it_stopped(check):
    first = Oracle()
    assert len(score(Check(check, first), limit=2).judged) == 2
    second = Oracle()
    score(Check(check, second))
    assert [name for name, _ in second.calls] == ["w002", "w003", "w004"]
    third = Oracle(failing="w000")
    again = score(Check(check, third), again=True)
    assert len(third.calls) == 5
    assert again.judged[0].failed
    assert again.figures["top1"].value == 0.0
    assert "no memory" in (check / "diagnoses" / "w000.json").read_text()


def test_methods_keep_their_reports_apart(check):
    score(Check(check, Oracle()))
    other = Oracle(failing="w000")
    assert score(Check(check, other), method="simple").judged[0].failed
    assert not score(Check(check, Oracle(failing="w000"))).judged[0].failed


def test_a_changed_truth_is_refused(check):
    data = (check / "truth.sealed").read_bytes()
    (check / "truth.sealed").write_bytes(data.replace(b"2e-06", b"3e-06"))
    with pytest.raises(BadInput, match="truth was changed"):
        score(Check(check, Oracle()))


def test_no_check_is_refused(tmp_path):
    with pytest.raises(BadInput, match="no withheld check"):
        score(Check(tmp_path, Oracle()))
    with pytest.raises(BadInput, match="is no share"):
        score(Check(tmp_path, Oracle()), leave_out=2.0)


def test_what_failed_is_tried_again(check):
    assert score(Check(check, Oracle(failing="w000")), limit=1).judged[0].failed
    second = Oracle()
    assert not score(Check(check, second), limit=1).judged[0].failed
    assert [name for name, _ in second.calls] == ["w000"]


def test_a_changed_truth_is_refused_before_anything_is_diagnosed(check):
    (check / "truth.sealed").write_bytes((check / "truth.sealed").read_bytes() + b" ")
    oracle = Oracle()
    with pytest.raises(BadInput, match="truth was changed"):
        score(Check(check, oracle))
    assert not oracle.calls


@pytest.mark.parametrize("text", [b"", b"\xff\xfe\x00", b"   \n"])
def test_a_damaged_hash_is_one_sentence(check, text):
    (check / "SHA256").write_bytes(text)
    with pytest.raises(BadInput, match="SHA"):
        score(Check(check, Oracle()))


@pytest.mark.parametrize("text", ["{}", "[]", "no JSON", '{"campaigns": 3}'])
def test_a_seal_without_a_truth_is_one_sentence(check, text):
    (check / "truth.sealed").write_text(text)
    (check / "SHA256").write_text(hashlib.sha256(text.encode()).hexdigest())
    with pytest.raises(BadInput, match="holds no truth"):
        score(Check(check, Oracle()))


@pytest.mark.parametrize(
    "report",
    [
        {},
        {"hypotheses": []},
        {"hypotheses": [{"effects": ["a"], "probability": "high"}]},
        {"campaign": "w001"},
    ],
)
def test_a_damaged_report_or_anothers_is_one_sentence(check, report):
    score(Check(check, Oracle()))
    whole = json.loads((check / "diagnoses" / "w000.json").read_text())
    new = {**whole, **report} if report else report
    (check / "diagnoses" / "w000.json").write_text(json.dumps(new))
    with pytest.raises(BadInput, match="holds no report of w000"):
        score(Check(check, Oracle()))


def test_a_foreign_campaign_is_named(check):
    (check / "campaigns" / "w900").mkdir()
    with pytest.raises(BadInput, match="w900' is no campaign of this check"):
        score(Check(check, Oracle()))


def test_the_page_of_several_effects_only_has_no_confusion(check, tmp_path):
    """Confusion counts single causes: none among campaigns of several effects."""
    content = score(Check(check, Oracle())).as_json()
    content["confusion"] = {"truth": [], "verdict": [], "counts": []}
    withheld_figure({**content, "methods": {"diagnosis": content}}, tmp_path / "page.png")
    assert (tmp_path / "page.png").stat().st_size > 10_000


@pytest.mark.parametrize(
    "damage",
    [
        {"next_recording": "locked"},
        {"next_recording": {"entry": "x", "seconds": 1e9}},
        {"next_recording": {"entry": "x", "seconds": "long"}},
        {"next_recording": {"entry": "x"}},
        {"next_recording": {"entry": 5, "seconds": 1.0}},
        {"next_recording": {"power": 7}},
        {"next_recording": {"power": "high"}},
        {"ambiguity_set": None},
        {"gap": None},
        {"verdict": None},
        {"verdict": "none"},
        {"cost": None},
        {"where": [{}]},
        {"hypotheses": [{"effects": ["dead_time"], "probability": 5.0}]},
    ],
)
def test_a_damaged_report_is_named(damage, tmp_path):
    """Whatever is not what judging reads, with the file and what to do."""
    whole = diagnosis_of((["dead_time"], 1.0))
    (tmp_path / "w000.json").write_text(json.dumps(whole))
    assert read_report(tmp_path, "w000") == whole
    (tmp_path / "w000.json").write_text(json.dumps({**whole, **damage}))
    with pytest.raises(
        BadInput, match=r"w000\.json' holds no report of w000; delete it and score again"
    ):
        read_report(tmp_path, "w000")


def test_chances_of_effects_are_summed_over_hypotheses_where_none_are_stated():
    got = [(["a", "unknown"], 0.5), (["a", "b"], 0.3), ([], 0.2)]
    found = chances({"hypotheses": [{"effects": e, "probability": p} for e, p in got]})
    assert found == pytest.approx({"a": 0.8, "b": 0.3})
