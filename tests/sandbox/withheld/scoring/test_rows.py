"""Rows of a check: what they keep, that all figures follow from their file, that they belong to
their seal."""

import copy
import json
import math

import pytest

from model.errors import BadInput
from sandbox.output.files import rounded
from sandbox.withheld.scoring.blind import score
from sandbox.withheld.scoring.metrics import by_size, rung
from sandbox.withheld.scoring.rows import (
    BLIND,
    DIGITS,
    LEFT_OUT,
    check_seal,
    codes,
    one_code,
    read_rows,
    row,
    write_rows,
)
from sandbox.withheld.scoring.running import Check
from sandbox.withheld.scoring.tables_of_rows import by_method, content_of, scored
from tests.sandbox.withheld.known import Oracle, diagnosis_of, truth_of, twelve

pytestmark = pytest.mark.usefixtures("in_this_process")


def test_figures_of_a_file_are_those_of_the_run(tmp_path):
    """All of them to the last bit, after writing and reading; some by value, counted by hand from
    `twelve`."""
    rows = twelve()
    again = read_rows(write_rows(tmp_path / "rows.jsonl", rows))
    assert again == rows
    content, second = (content_of(by_method(r)) for r in (rows, again))
    assert json.dumps(content) == json.dumps(second)
    # w000 and w003; not w001, w002, w011
    assert (content["top1"]["value"], content["top1"]["n"]) == (2 / 5, 5)
    # not w011, of a quarter
    assert (content["top1_half"]["value"], content["top1_half"]["n"]) == (2 / 4, 4)
    assert content["cpu_seconds_p99"]["value"] == 1.5
    assert (content["false_alarm"]["value"], content["false_alarm"]["n"]) == (
        pytest.approx(1 / 3),
        3,
    )
    assert (content["exact_two"]["value"], content["exact_three"]["n"]) == (0.5, 0)
    assert (content["resolved_sure"]["value"], content["resolved_else"]["n"]) == (1.0, 0)
    assert content["resolved_promised"]["value"] == 0.925
    assert content["leave_out_verdict_unknown"]["n"] == 1
    assert content["by_size"]["0.25"]["top1"]["n"] == 1
    assert content["failed"] == ["w002"]
    assert content["simulations"]["value"] == 100.0
    # w002 failed
    assert (content["cpu_seconds"]["value"], content["cpu_seconds"]["n"]) == (1.5, 11)


def test_score_says_what_its_rows_say(check, tmp_path):
    """One path: the figures of `score` are those of the rows that it returns, read back from their
    file."""
    result = score(Check(check, Oracle()), leave_out=1.0)
    rows = read_rows(write_rows(tmp_path / "rows.jsonl", result.rows))
    assert scored(rows).as_json() == result.as_json()
    assert [r.part for r in rows].count(LEFT_OUT) == 1
    check_seal(rows, json.loads((check / "truth.sealed").read_text()))


def test_any_change_of_a_row_moves_a_figure():
    """Each row counts: changed from right to failed, or back, no row leaves the content as it
    was."""
    rows = twelve()
    whole = json.dumps(content_of(by_method(rows)))
    for k, r in enumerate(rows):
        other = {"failed": "no"} if "failed" not in r.answer else rows[0].answer
        changed = [*rows[:k], type(r)(**{**vars(r), "answer": other}), *rows[k + 1 :]]
        assert json.dumps(content_of(by_method(changed))) != whole, r


def test_a_row_is_short_and_keeps_what_counts():
    long = diagnosis_of((["dead_time"], 1.0 / 3.0))
    long["hypotheses"][0]["closed"], long["where"][0]["text"] = 0.5, "a sentence"
    long["effects"] = [
        {
            "name": "dead_time",
            "probability": 0.9999999,
            "share": {"value": 0.4, "ci95": [0.3, 0.5]},
            "group": None,
            "parameters": {"dead_time.time": {"value": 2e-6, "ci95": [1e-6, 3e-6], "unit": "s"}},
        },
        {
            "name": "inertia",
            "probability": 0.1,
            "parameters": {"inertia.inertia": {"value": 1.0, "ci95": [0.0, 2.0]}},
        },
    ]
    answer = row("m", BLIND, "w000", truth_of(), long).answer
    assert answer["hypotheses"][0]["probability"] == 0.333333
    assert answer["where"] == [{"subsystem": "inverter", "share": 1.0}]
    assert answer["hypotheses"][0]["parameters"] == {
        "dead_time.time": {"value": 2e-6, "ci95": [1.9e-6, 2.1e-6]}
    }
    assert answer["effects"][0]["parameters"]["dead_time.time"]["ci95"] == [1e-6, 3e-6]
    assert answer["effects"][1] == {"name": "inertia", "probability": 0.1}
    assert "sentence" not in json.dumps(answer)


def test_rounding_keeps_whole_numbers_and_what_is_no_number():
    found = rounded({"a": [1.23456789e-9, None, "x", True], "n": 123456789, "open": -0.0}, DIGITS)
    assert found == {"a": [1.23457e-9, None, "x", True], "n": 123456789, "open": 0.0}
    assert math.isinf(rounded(math.inf, DIGITS))


def test_a_truth_that_is_not_the_sealed_one_is_named():
    rows = twelve()
    seal = {"campaigns": {r.campaign: copy.deepcopy(dict(r.truth)) for r in rows}}
    check_seal(rows, seal)
    seal["campaigns"]["w004"]["effects"] = ["inertia"]
    with pytest.raises(BadInput, match="row of w004: its truth is not the sealed one"):
        check_seal(rows, seal)


def test_mixed_states_of_the_code_are_counted():
    rows = twelve()
    one_code(rows, "this check")
    mixed = [*rows, row("diagnosis", BLIND, "w900", truth_of(), {"failed": "no", "code": "new"})]
    assert codes(mixed) == ("abc", "new")
    with pytest.raises(
        BadInput, match=r"this check mixes 2 states of the code \(abc: 14, new: 1\)"
    ):
        one_code(mixed, "this check")


@pytest.mark.parametrize(
    "line", ["{}", "[]", "no JSON", '{"method":"m","part":"none","campaign":"w"}']
)
def test_a_damaged_line_is_named(line, tmp_path):
    path = write_rows(tmp_path / "rows.jsonl", twelve()[:2])
    path.write_text(path.read_text() + line + "\n")
    with pytest.raises(BadInput, match=r"rows\.jsonl' line 3 is no row of a check"):
        read_rows(path)


def test_sizes_are_counted_under_the_nearest_power_of_two():
    """Between rungs on a logarithmic scale: 0.35 < 1/(2 sqrt 2) < 0.36; beyond 1/16 and 16
    together."""
    assert [rung(s) for s in (0.25, 0.35, 0.36, 1.0, 2.0, 1e-4, 99.0)] == [
        0.25,
        0.25,
        0.5,
        1.0,
        2.0,
        1 / 16,
        16.0,
    ]
    assert list(by_size(scored(twelve()).judged)) == ["0.25", "1"]
