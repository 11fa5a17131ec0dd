"""What the front page says is left of the gain follows from the kept numbers, and these from its
definition."""

from __future__ import annotations

import json
import re
from pathlib import Path

import pytest

from experiments.gain_left import NAME, RESULTS, Case, gain, ordered, page

ROOT = Path(__file__).resolve().parents[2]


@pytest.fixture(scope="module")
def kept():
    return json.loads((RESULTS / f"{NAME}.json").read_text(encoding="utf-8"))


@pytest.fixture(scope="module")
def cases(kept):
    return [Case(**c) for c in kept["cases"]]


def test_gain_is_the_way_from_linear_to_saturated_of_the_ideal_drive():
    best = Case("m", "e", "own", 0.0, linear=6.0, saturated=0.0, saturated_p95=0.0, lost=0)
    assert gain(best, best, 0.0) == 1.0
    assert gain(best, best, 6.0) == 0.0
    assert gain(best, best, 1.5) == pytest.approx(0.75)
    assert gain(best, best, 9.0) == pytest.approx(-0.5)
    assert gain(best, best, None) is None


def test_the_page_follows_from_the_numbers(kept, cases):
    assert (RESULTS / f"{NAME}.md").read_text(encoding="utf-8") == page(
        cases, kept["date"], kept["version"]
    )


def test_the_front_page_quotes_the_kept_numbers(kept, cases):
    text = (ROOT / "README.md").read_text(encoding="utf-8")
    assert kept["date"] in text
    by = {
        (c.motor, c.estimator, c.known, bool(c.dead_time)): (c, best) for c, best in ordered(cases)
    }
    rows = re.findall(r"^\| `(\w+)`, `(\w+)` \| (.*) \| (.*) \| (.*) \|$", text, re.M)
    assert {(motor, estimator) for motor, estimator, *_ in rows} == {key[:2] for key in by}
    for motor, estimator, *cells in rows:
        for cell, key in zip(cells, (("10 %", False), ("own", True), ("10 %", True)), strict=True):
            case, best = by[(motor, estimator, *key)]
            found = f"{100 * gain(case, best, case.saturated):.0f} %"
            if key[0] == "10 %":
                found += f" ({100 * gain(case, best, case.saturated_p95):.0f} %)"
            assert cell.replace("−", "-") == found, (motor, estimator, key)
