"""What estimators/LIMITS.md says of the protocol follows from the kept numbers."""

from __future__ import annotations

import json
import re

import pytest

from experiments.estimator_protocol import LIMITS, NAME, RESULTS, kept, verdicts, with_table

WORDS = {"static map": "static_map", "hand-over": "hand_over", "load step": "load_step"}
PLANE = "static_map"


@pytest.fixture(scope="module")
def page():
    return LIMITS.read_text(encoding="utf-8")


@pytest.fixture(scope="module")
def tests():
    return json.loads((RESULTS / f"{NAME}.json").read_text(encoding="utf-8"))["tests"]


def missed(tests, motors, test):
    """Return how far (degrees) the means of linear beliefs lie from theory, by motor and
    estimator."""
    return {
        (r["motor"], r["estimator"]): r["metrics"]["theory_miss_deg"]
        for r in tests
        if r["belief"] == "linear"
        and r["motor"] in motors
        and r["test"] == test
        and r["passed"] is not None
    }


def test_the_table_is_written_from_the_kept_protocol(page):
    assert with_table(page, verdicts(kept()[0])) == page


def test_the_table_names_what_fails_and_nothing_else(page, tests):
    """Read back from the page, against the JSON itself."""
    table = next(block for block in page.split("\n\n") if block.startswith("| estimator | `ipm`"))
    heads, _, *lines = [line.strip("| ").split(" | ") for line in table.splitlines()]
    motors, found = [cell.strip("`") for cell in heads[1:]], set()
    for names, *cells in lines:
        for name in re.findall(r"`(\w+)`", names):
            for motor, cell in zip(motors, cells, strict=True):
                parts = (
                    []
                    if cell == "all passed"
                    else [part.split(" (")[0] for part in cell.split("; ")]
                )
                found |= {(name, motor, WORDS.get(part, part)) for part in parts}
    asked = ("static_map", "load_step", "creep", "hand_over", "mission")
    assert found == {
        (r["estimator"], r["motor"], r["test"])
        for r in tests
        if r["belief"] == "saturated" and r["test"] in asked and r["passed"] is False
    }


def test_sentences_on_linear_beliefs_hold(tests):
    ipm = "ipm", "ipm_exchanged"
    plane = missed(tests, ipm, PLANE)
    assert plane.pop(("ipm", "mechanical")) == pytest.approx(0.8, abs=0.05)
    assert max(plane.values()) <= 0.3
    quick = ("pll3", "mechanical", "pwm_ripple")
    ramps = missed(tests, ipm, "hand_over")
    assert max(v for (_, name), v in ramps.items() if name in quick) <= 0.3
    slow = [round(v, 1) for (_, name), v in ramps.items() if name not in quick]
    assert (min(slow), max(slow)) == (0.6, 1.5)
    for motor, low, high in (("spm_exchanged", 0.5, 0.7), ("baldor_pmsyrm", 1.1, 1.2)):
        found = [round(v, 1) for v in missed(tests, (motor,), PLANE).values()]
        assert (min(found), max(found)) == (low, high)
    assert max(missed(tests, ("spm_exchanged",), "creep").values()) <= 0.3


def test_who_misses_the_goal_over_the_measured_plane(tests):
    own = [
        r
        for r in tests
        if r["motor"] == "baldor_pmsyrm" and r["belief"] == "saturated" and r["test"] == PLANE
    ]
    assert {r["estimator"] for r in own if not r["passed"]} == {
        "table",
        "fluxdemod",
        "hfi45",
        "vesc_hfi",
    }
