"""A protocol as tables of texts: the worst figures of each test, and beside every verdict the goal
that it is of.

A tick is for what is good in absolute terms.  What holds without being good has a mark of its own:
lock kept while the error is large, an error as large as theory predicts for a linear belief, wrong
starts that end at the wrong pole, a small error while the speed asked for was not reached in time.
"""

from __future__ import annotations

import re

from sandbox.evaluation.lost import grouped
from sandbox.evaluation.protocol import Protocol, Row
from sandbox.evaluation.protocol_tests import MEAN_GOAL, P95_GOAL, POLARITY_GOAL, THEORY_GOAL
from sandbox.output.tables import print_prose, print_table

MARKS = GOOD, BAD, HOLDS = "✓", "✗", "○"
GOAL = f"≤ {MEAN_GOAL:g} ({P95_GOAL:g})°"  # mean and 95th percentile of the error
CHECKS = {  # asked, instead of GOAL
    "robustness": "lock kept",
    "reversal": "lock kept",
    "modulation": "lock kept",
    "attraction": "no third rest",
}


def tables(result: Protocol) -> dict[str, tuple[list[str], list[list[str]]]]:
    """Return every motor's table."""
    return {
        motor: table(result, motor)
        for motor in dict.fromkeys(row.unit.motor for row in result.rows)
    }


def table(result: Protocol, motor: str) -> tuple[list[str], list[list[str]]]:
    """Return heads and cells of one motor's table: a line per estimator and belief, a column per
    test."""
    rows = {
        (r.unit.estimator, r.unit.belief, r.unit.test): r
        for r in result.rows
        if r.unit.motor == motor
    }
    tests = list(dict.fromkeys(test for _, _, test in rows))
    lines = []
    for estimator, belief in dict.fromkeys((e, b) for e, b, _ in rows):
        cells = [cell(rows.get((estimator, belief, test))) for test in tests]
        lines.append([f"{estimator} {belief[:3]}.", *cells])
    return ["estimator", *tests], lines


def judged(row: Row) -> tuple[str, str]:
    """Return a unit's mark, and the goal or the check that it says something of; nothing where
    there is neither."""
    m, passed, linear = row.outcome.metrics, row.outcome.passed, row.unit.belief == "linear"
    if passed is None:
        return "", ""
    check = CHECKS.get(row.unit.test, f"as theory ±{THEORY_GOAL:g}°" if linear else "")
    if m.get("rms_to_peer") is not None:
        check, goal, good = "", "≤ 1/2, ≤ 1/300", passed
    elif row.unit.test == "start":
        check, goal, good = "", f"≥ {100.0 * POLARITY_GOAL:g} %", passed
    elif row.unit.test == "attraction":
        goal, good = "all back", passed and m.get("back") == 1.0
    else:
        errors = m.get("mean_deg"), m.get("p95_deg")
        goal, good = GOAL, passed and (not check or _within_goal(*errors))
    if good:  # the error is, but a drive that does not get where it is asked to is not
        return HOLDS if m.get("speed_missed") else GOOD, goal
    return (HOLDS, check) if passed else (BAD, check or goal)


def reading(result: Protocol) -> str:
    """Return how to read the tables: only what stands in them is explained."""
    cells = [text for _, lines in tables(result).values() for line in lines for text in line[1:]]
    tests, metrics = (
        {row.unit.test for row in result.rows},
        [row.outcome.metrics for row in result.rows],
    )
    marks = [mark for mark in MARKS if any(f" {mark} " in text for text in cells)]
    parts = []
    if any("mean_deg" in m and "polarity_right" not in m for m in metrics):
        parts.append(
            "Worst mean (worst 95th percentile) of the position error, electrical degrees, up to "
            "180 % load where the ripple carries information"
        )
    if "start" in tests:
        parts.append("start: share of starts whose polarity was right")
    if "attraction" in tests:
        parts.append(
            "attraction: started wrong all round, share back / at the wrong pole / elsewhere"
        )
    if any(" slow" in text for text in cells):
        parts.append("slow: the speed asked for not reached in time")
    if "cost" in tests:
        parts.append(
            "cost: a step, torque ripple at standstill/at speed, copper loss and sound "
            "proxy of the injection"
        )
    goals = [mark for mark in marks if mark != HOLDS]
    if goals:
        met = {GOOD: "met", BAD: "not met"}
        parts.append(
            f"{' '.join(goals)}: the goal beside it is {' or '.join(met[mark] for mark in goals)}"
        )
    text = "; ".join(parts) + "." if parts else ""
    return f"{text} {_held(cells)}".strip() if HOLDS in marks else text


def _held(cells: list[str]) -> str:
    """Return what a circle stands for in these cells."""
    held = [text for text in cells if f" {HOLDS} " in text]
    reasons = {
        f"the error is beyond {MEAN_GOAL:g} ({P95_GOAL:g})°": ("as theory", CHECKS["robustness"]),
        "starts end at the wrong pole": (CHECKS["attraction"],),
        "the speed asked for was not reached in time": (" slow",),
    }
    but = [
        reason
        for reason, of in reasons.items()
        if any(what in text for what in of for text in held)
    ]
    theory = "; 'as theory': it is as large as theory predicts for a linear belief"
    said = f"{HOLDS}: what stands beside it holds, but {', or '.join(but)}"
    return said + (theory if any("as theory" in text for text in held) else "") + "."


def _within_goal(mean: float | None, p95: float | None) -> bool:
    return mean is not None and p95 is not None and abs(mean) <= MEAN_GOAL and p95 <= P95_GOAL


def cell(row: Row | None) -> str:
    """Return a unit as text: worst mean (worst p95) in degrees, segments lost, a mark for the
    verdict, the goal."""
    if row is None:
        return ""
    mark = " ".join(["", *judged(row)]).rstrip()
    m = row.outcome.metrics
    if row.failure:
        return f"{'refused' if 'refused' in m else 'failed'}{mark}"
    if m.get("rms_to_peer") is not None:
        return (
            f"rms {m['rms_to_peer']:.3f}, CPU 1/{1.0 / (m['cpu_to_peer'] or 1.0):.0f} of peer{mark}"
        )
    if "polarity_right" in m:
        return f"{100 * (m['polarity_right'] or 0):.2f} %{mark}"
    if "back" in m:
        return f"{100 * (m['back'] or 0):.0f}/{100 * (m['reversed'] or 0):.0f}/{100 * (m['elsewhere'] or 0):.0f} %{mark}"  # noqa: E501
    if m.get("step_ns") is not None:
        ripples = [m.get(name) for name in ("torque_ripple", "torque_ripple_at_speed")]
        said = "/".join("–" if v is None else f"{100 * v:.1f}" for v in ripples)
        loss, sound = m.get("copper_w"), m.get("sound_db")
        costs = "" if loss is None or sound is None else f", {loss:.2g} W, {sound:.0f} dB"
        return f"{m['step_ns']:.0f} ns, {said} %{costs}{mark}"
    if "bandwidth_hz" in m:
        return f"{m['bandwidth_hz']:.0f} Hz{mark}" if m["bandwidth_hz"] is not None else f"–{mark}"
    lost = f", {m['lost']:.0f} lost" if m.get("lost") else ""
    lost += f", {m['speed_missed']:.0f} slow" if m.get("speed_missed") else ""
    mean = m.get("mean_deg")
    if mean is None:
        return f"lost{mark}"
    return f"{abs(mean):.2f} ({m['p95_deg']:.1f}){lost}{mark}"


def why_lost(result: Protocol, motor: str) -> list[str]:
    """Return a sentence for each reason why tests on a motor lost lock, with their estimators and
    beliefs."""
    own = [r for r in result.rows if r.unit.motor == motor]
    return grouped(
        (r.outcome.why_lost, f"{r.unit.estimator}, {r.unit.belief}, {r.unit.test}") for r in own
    )


def show(result: Protocol) -> None:
    """Print a table per motor, how to read it, and the cost."""
    for motor in dict.fromkeys(row.unit.motor for row in result.rows):
        heads, lines = table(result, motor)
        lines = [
            [re.sub(f" ([{''.join(MARKS)}]) ", r" \1\n", text) for text in line] for line in lines
        ]
        print_table(f"{motor}: worst mean ° (worst 95 %)", heads, lines)
        for text in why_lost(result, motor):
            print_prose(text)
    print_prose(reading(result))
    print_prose(f"{sum(row.cpu_seconds for row in result.rows):.0f} s of CPU")
