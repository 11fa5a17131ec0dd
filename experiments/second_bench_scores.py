"""Scores of the second bench's rows: each figure with its goal, its limits, and a verdict."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.stats import binomtest

from sandbox.withheld.scoring.limits import Figure, mean, quantile, ratio, share

Row = Mapping[str, Any]
UNKNOWN = "unknown"
NAMED = 0.5  # chance from which an effect counts as named
HALF = 0.5  # of the medium size: smaller ones are drawn, too, and some cannot be seen at all
LEAST = 1e-6  # chance that a log score gives to a set that was not listed


@dataclass(frozen=True)
class Goal:
    """A figure: of which rows, in words, its goal ("" beneath), and how it is computed."""

    title: str
    least: float | None
    most: float | None
    of: Callable[[Sequence[Row]], Figure]

    def verdict(self, f: Figure) -> str:
        """Return a tick where the figure meets the goal, limits and all, a cross where it does not,
        a circle where its limits allow either, a dash where there is none."""
        if f.value is None or (self.least is None and self.most is None):
            return "–"
        least, most = (
            -math.inf if self.least is None else self.least,
            math.inf if self.most is None else self.most,
        )
        low, high = (f.value if x is None else x for x in (f.low, f.high))
        if least <= low and high <= most:
            return "✓"
        return "✗" if high < least or most < low else "○"


def truth_of(row: Row) -> frozenset[str]:
    """Return the true set, `unknown` for what is outside the library."""
    t = row["truth"]
    return frozenset([c["name"] for c in t["causes"]] + ([UNKNOWN] if t["outside"] else []))


def first(row: Row) -> tuple[frozenset[str], float]:
    """Return the first set and its chance; of a failed diagnosis a wrong one for sure."""
    if "failed" in row["found"]:
        return frozenset(["failed"]), 1.0
    top = row["found"]["sets"][0]
    return frozenset(top["effects"]), float(top["probability"])


def right(row: Row) -> bool:
    """Tell whether the first set is the true one."""
    return first(row)[0] == truth_of(row)


def leading(row: Row) -> str:
    """Return the most probable effect."""
    chances = row["found"].get("chances", {})
    return max(chances, key=lambda e: chances[e], default="")


def false_names(row: Row) -> bool:
    """Tell whether an effect that is not there has a chance above one half."""
    named = {e for e, p in row["found"].get("chances", {"failed": 1.0}).items() if p > NAMED}
    return bool(named - truth_of(row))


def f1(row: Row) -> float:
    """Return F1 of the named effects."""
    named = {e for e, p in row["found"].get("chances", {}).items() if p > NAMED}
    there = truth_of(row) - {UNKNOWN}
    return 2.0 * len(named & there) / (len(named) + len(there)) if named or there else 1.0


def listed(row: Row) -> float:
    """Return the chance that was given to the true set."""
    sets = row["found"].get("sets", [])
    return sum((s["probability"] for s in sets if frozenset(s["effects"]) == truth_of(row)), 0.0)


def deviations(row: Row) -> list[float]:
    """Return by how many standard deviations true sizes lie off, of rightly named effects."""
    out, found = [], row["found"].get("parameters", {})
    for cause in row["truth"]["causes"]:
        for name, true in cause["with_background"].items():
            value, low, high = found.get(f"{cause['name']}.{name}", (None, None, None))
            if (
                value is not None
                and None not in (low, high)
                and high > low
                and cause["name"] in first(row)[0]
            ):
                side = value - low if true < value else high - value
                out.append(abs(true - value) / (side / 1.96) if side > 0.0 else math.inf)
    return out


def brier(rows: Sequence[Row]) -> Figure:
    """Return the Brier score of first sets less that of a constant, the share that is right."""
    hit = np.array([right(r) for r in rows], dtype=float)
    p = np.array([first(r)[1] for r in rows])
    return (
        mean((p - hit) ** 2 - (hit.mean() - hit) ** 2) if len(rows) else Figure(None, None, None, 0)
    )


def of_share(test: Callable[[Row], bool], chosen: Callable[[Row], bool] = lambda _: True):
    """Return the share of the chosen rows that pass a test."""
    return lambda rows: share([test(r) for r in rows if chosen(r)])


def large(row: Row) -> bool:
    """Tell whether every cause has half the medium size or more."""
    return all((c["size"] or 1.0) >= HALF for c in row["truth"]["causes"])


def form(name: str) -> Callable[[Row], bool]:
    """Return a test for the form of a single effect: "library" or "own"."""
    return lambda row: large(row) and all(c["form"] == name for c in row["truth"]["causes"])


def within(k: float) -> Callable[[Sequence[Row]], Figure]:
    """Return the share of intervals that hold the truth within k of their standard deviations."""
    return lambda rows: ratio([(sum(z <= k for z in d), len(d)) for d in map(deviations, rows)])


def raised(row: Row) -> bool:
    """Tell whether naming effects raised the error on recordings held out."""
    f = row["found"]
    return "failed" in f or f["after"] > f["before"] * (1.0 + 1e-6)


def noticed(row: Row) -> bool:
    """Tell whether a cause outside the library is thought more likely than not."""
    return bool(row["found"].get("unknown", 0.0) > NAMED)


COST = [
    Goal("CPU seconds, median", None, 10.0, lambda rows: quantile([r["cpu"] for r in rows], 0.5)),
    Goal(
        "CPU seconds, 99th percentile",
        None,
        60.0,
        lambda rows: quantile([r["cpu"] for r in rows], 0.99),
    ),
]
GOALS: dict[str, tuple[str, list[Goal]]] = {
    "none": (
        "no effect (controls)",
        [
            Goal("an effect is named although there is none", None, 0.01, of_share(false_names)),
            Goal(
                "`unknown` has more than one half although there is nothing",
                None,
                0.05,
                of_share(lambda r: r["found"].get("unknown", 1.0) > NAMED),
            ),
        ],
    ),
    "one": (
        "one effect of half the medium size and more",
        [
            Goal(
                "library's form: the first set is the truth",
                0.98,
                None,
                of_share(right, form("library")),
            ),
            Goal(
                "another form: the true name is the most probable one",
                0.90,
                None,
                of_share(lambda r: leading(r) in truth_of(r), form("own")),
            ),
            Goal(
                "another form: a false name above one half",
                None,
                0.05,
                of_share(false_names, form("own")),
            ),
        ],
    ),
    "several": (
        "two or three effects",
        [
            Goal("the first set is the truth", 0.90, None, of_share(right)),
            Goal("Brier score of first sets less that of a constant", None, 0.0, brier),
        ],
    ),
    "many": (
        "four to ten effects",
        [
            Goal("mean F1 of named effects", 0.94, None, lambda rows: mean([f1(r) for r in rows])),
            Goal("Brier score of first sets less that of a constant", None, 0.0, brier),
        ],
    ),
    "outside": (
        "a cause outside the library, alone or beside one inside",
        [
            Goal("`unknown` has more than one half", 0.97, None, of_share(noticed)),
            Goal("a false name above one half", None, 0.10, of_share(false_names)),
        ],
    ),
    "all": (
        "all campaigns",
        [
            Goal(
                "the 95 % set of sets holds the truth",
                0.93,
                0.97,
                of_share(
                    lambda r: truth_of(r) in [frozenset(s) for s in r["found"].get("in_set", [])]
                ),
            ),
            Goal(
                "mean log of the chance given to the true set",
                None,
                None,
                lambda rows: mean([math.log(max(LEAST, listed(r))) for r in rows]),
            ),
            Goal("intervals hold the true size (1.96 deviations)", 0.93, 0.97, within(1.96)),
            Goal("... within five deviations", 0.998, None, within(5.0)),
            Goal("naming effects raised J on recordings held out", None, 0.02, of_share(raised)),
            *COST,
        ],
    ),
}


def bound(goal: Goal) -> str:
    """Return a goal in signs."""
    if goal.least is None and goal.most is None:
        return ""
    if goal.least is not None and goal.most is not None:
        return f"{goal.least:g} to {goal.most:g}"
    return f"≥ {goal.least:g}" if goal.least is not None else f"≤ {goal.most:g}"


def cell(x: float | None) -> str:
    """Return a number of a table."""
    return "" if x is None else f"{x:.3g}"


def fifths(rows: Sequence[Row]) -> list[str]:
    """Return the lines of a table: the chance of first sets against how many of them are right."""
    out = [
        "| chance of the first set | campaigns | mean chance | right | 90 % limits |",
        "|---|--:|--:|--:|---|",
    ]
    for low in (0.0, 0.2, 0.4, 0.6, 0.8):
        own = [
            r for r in rows if low <= first(r)[1] < low + 0.2 or (low == 0.8 and first(r)[1] >= 1.0)
        ]
        if own:
            f, p = share([right(r) for r in own]), float(np.mean([first(r)[1] for r in own]))
            limits = f"{cell(f.low)} to {cell(f.high)}"
            out.append(
                f"| {low:.1f} to {low + 0.2:.1f} | {f.n} | {p:.2f} | {cell(f.value)} | {limits} |"
            )
    return out


def against_rivals(rows: Sequence[Row], rivals: Sequence[Row]) -> list[str]:
    """Return the lines of a table: each rival and the diagnosis on the campaigns that both
    answered.

    The sign test says how probable so uneven a split of campaigns is, of which one alone is right,
    if both were alike.
    """
    out = [
        "| rival | campaigns | first set right | diagnosis | only it | only the diagnosis | sign "
        "test | mean log chance of the truth | diagnosis | CPU s |",
        "|---|--:|--:|--:|--:|--:|--:|--:|--:|--:|",
    ]
    mine = {r["name"]: r for r in rows}
    for method in dict.fromkeys(r["method"] for r in rivals if r["name"] in mine):
        own = [r for r in rivals if r["method"] == method and r["name"] in mine]
        pairs = [(right(r), right(mine[r["name"]])) for r in own]
        it, we = sum(a and not b for a, b in pairs), sum(b and not a for a, b in pairs)
        p = binomtest(it, it + we).pvalue if it + we else 1.0
        logs = [
            float(np.mean([math.log(max(LEAST, listed(r))) for r in each]))
            for each in (own, [mine[r["name"]] for r in own])
        ]
        hits = [sum(x) for x in zip(*pairs, strict=True)]
        cpu = float(np.median([r["cpu"] for r in own]))
        counts = f"| {method} | {len(own)} | {hits[0]} | {hits[1]} | {it} | {we} | {p:.2g} "
        out.append(f"{counts}| {logs[0]:.2f} | {logs[1]:.2f} | {cpu:.0f} |")
    return out


def page(
    rows: Sequence[Row], planned: Mapping[str, int], seed: int, rivals: Sequence[Row] = ()
) -> str:
    """Return the page: what was run, every goal with its figure and verdict, chances against what
    is right."""
    lines = ["# The diagnosis on the second bench", ""]
    count = {kind: sum(r["kind"] == kind for r in rows) for kind in planned}
    ran = ", ".join(f"{count[k]} of {n} {k}" for k, n in planned.items())
    code = len({r["code"] for r in rows})
    lines += [
        (
            f"Seed {seed}, plan in `experiments/second_bench.py`, by {code} version(s) of "
            f"the code; run: {ran}.  Batch 0 of each kind comes last: its seal was opened while "
            "the code was mended, so its rows are no blind result."
        ),
        "",
        "✓ the goal is met, ✗ it is missed, both with the limits of chance; ○ the limits allow "
        "either: too few campaigns; – no campaign of the kind, or no goal.",
        "",
    ]
    lines += [
        "| campaigns | figure | goal | value | one-sided 95 % limits | n | |",
        "|---|---|---|--:|---|--:|---|",
    ]
    for kind, (title, goals) in GOALS.items():
        own = [r for r in rows if kind in ("all", r["kind"])]
        for goal in goals:
            f = goal.of(own)
            limits = "" if f.low is None and f.high is None else f"{cell(f.low)} to {cell(f.high)}"
            lines.append(
                f"| {title} | {goal.title} | {bound(goal)} | {cell(f.value)} | {limits} "
                f"| {f.n} | {goal.verdict(f)} |"
            )
    return "\n".join(
        [*lines, "", *fifths(rows), "", *(against_rivals(rows, rivals) if rivals else []), ""]
    )
