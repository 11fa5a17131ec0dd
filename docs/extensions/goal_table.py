"""Which goals of the protocol each estimator meets, as one small table from the kept result."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

from markdown import code, table

KEPT = Path(__file__).resolve().parents[2] / "experiments" / "results" / "estimator_protocol.json"
# tests of the position error with a goal
JUDGED = ("static_map", "load_step", "creep", "hand_over", "mission")


def goals() -> str:
    """Return a row for each estimator with a saturated belief, a column for each motor: the tests
    it fails."""
    kept = json.loads(KEPT.read_text(encoding="utf-8"))
    rows = [t for t in kept["tests"] if t["test"] in JUDGED and t["belief"] == "saturated"]
    motors, estimators = (
        list(dict.fromkeys(t[key] for t in rows)) for key in ("motor", "estimator")
    )
    lines = []
    for estimator in estimators:
        own = [t for t in rows if t["estimator"] == estimator]
        lines.append(
            [code(estimator), *(_said([t for t in own if t["motor"] == motor]) for motor in motors)]
        )
    head = (
        f"Protocol of {kept['date']}, saturated belief: ✓ where every goal is met, else the tests "
        "that fail; ○ where every goal of the error is met, but in these tests the drive did not "
        "reach its speed in time.\n\n"
    )
    return head + table(["estimator", *map(code, motors)], lines)


def _said(tests: list[dict[str, Any]]) -> str:
    """Return what one estimator did on one motor: the tests it fails, else those with a speed
    missed, else a tick."""
    failed, slow = ([t["test"].replace("_", " ") for t in tests if of(t)] for of in (_fails, _slow))
    return ", ".join(failed) or (f"○ {', '.join(slow)}" if slow else "✓")


def _fails(test: dict[str, Any]) -> bool:
    return test["passed"] is False


def _slow(test: dict[str, Any]) -> bool:
    return bool(test["metrics"].get("speed_missed"))
