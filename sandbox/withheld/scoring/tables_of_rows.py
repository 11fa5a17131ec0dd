"""Figures of a check from its rows, and from nothing else: one method at a time, and the tables of
several."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

from model.errors import BadInput
from sandbox.withheld.scoring.chances import coverage_by_effect
from sandbox.withheld.scoring.judge import Judgement, judge
from sandbox.withheld.scoring.limits import Figure, quantile
from sandbox.withheld.scoring.metrics import (
    GOALS,
    by_size,
    by_subsystem,
    confusion,
    detection_limit,
    figures,
    left_out,
    reliability,
)
from sandbox.withheld.scoring.recommended import recommended
from sandbox.withheld.scoring.rows import BLIND, LEFT_OUT, RESOLVED, Row, codes


@dataclass(frozen=True)
class Scores:
    """A scored check of one method: figures by name, judgements, those with the true effect left
    out, those with the recommended recording made, and the rows that all of it follows from."""

    method: str
    figures: dict[str, Figure]
    judged: tuple[Judgement, ...]
    left_out: tuple[Judgement, ...]
    followed: tuple[Judgement, ...]
    rows: tuple[Row, ...]

    @property
    def code(self) -> tuple[str, ...]:
        """The hashes of the code that diagnosed (`running.code_digest`), more than one where
        versions are mixed."""
        return codes(self.rows)

    def as_json(self) -> dict[str, Any]:
        """Return what `withheld.json` keeps of it."""
        sizes = {
            s: {k: f.as_json() for k, f in fs.items()} for s, fs in by_size(self.judged).items()
        }
        outside = {
            s: {k: f.as_json() for k, f in fs.items()}
            for s, fs in by_subsystem(self.judged).items()
        }
        covered = {e: f.as_json() for e, f in coverage_by_effect(self.judged).items()}
        return {
            **{k: f.as_json() for k, f in self.figures.items()},
            "by_size": sizes,
            "coverage_by_effect": covered,
            "outside_by_subsystem": outside,
            "detection_floor": detection_limit(self.judged),
            "confusion": confusion(self.judged),
            "reliability": reliability(self.judged),
            "failed": [j.name for j in self.judged if j.failed],
            "missed": [[j.name, *j.effects, "->", j.label] for j in self.judged if not j.hit],
            "unresolved": [
                [j.name, *j.effects, "->", j.label] for j in self.followed if not j.settled
            ],
            "code": self.code,
            **({"by_code": self.by_code()} if len(self.code) > 1 else {}),
        }

    def by_code(self) -> dict[str, dict[str, Any]]:
        """Return the figures of each state of the code alone, where several are mixed."""
        alone = {c: scored([r for r in self.rows if r.code == c]) for c in self.code}
        return {c: {k: f.as_json() for k, f in s.figures.items()} for c, s in alone.items()}


def scored(rows: Sequence[Row]) -> Scores:
    """Return the scores of one method's rows; BadInput where they are none, or of several
    methods."""
    methods = {r.method for r in rows}
    if len(methods) != 1:
        raise BadInput(
            f"rows of {len(methods)} methods ({', '.join(sorted(methods))}) have no "
            "figures; give one's"
        )
    blind = {r.campaign: r.answer for r in rows if r.part == BLIND}
    judged, others, followed = (
        tuple(judge(r.campaign, r.truth, r.answer) for r in rows if r.part == part)
        for part in (BLIND, LEFT_OUT, RESOLVED)
    )
    asked = [n for n, a in blind.items() if "failed" not in a and recommended(a) is not None]
    promised = {n: blind[n]["next_recording"].get("power") for n in asked}
    spent = [a["cpu_seconds"] for a in blind.values() if "failed" not in a and "cpu_seconds" in a]
    costs = {"cpu_seconds": quantile(spent, 0.5), "cpu_seconds_p99": quantile(spent, 0.99)}
    found = figures(judged, promised, followed) | costs
    found |= left_out(others) if others else {}
    return Scores(methods.pop(), found, judged, others, followed, tuple(rows))


def content_of(scores: Sequence[Scores]) -> dict[str, Any]:
    """Return what `withheld.json` holds: the first method's figures, then every method's by its
    name."""
    return {**scores[0].as_json(), "methods": {s.method: s.as_json() for s in scores}}


def by_method(rows: Sequence[Row]) -> list[Scores]:
    """Return the scores of every method in a file's rows, in the order of the file."""
    return [
        scored([r for r in rows if r.method == m]) for m in dict.fromkeys(r.method for r in rows)
    ]


def table(scores: Sequence[Scores]) -> tuple[list[str], list[list[str]]]:
    """Return heads and rows of the table of metrics, one column a method."""
    names = list(dict.fromkeys(k for s in scores for k in s.figures))
    rows = [[n, GOALS.get(n, ""), *(_cell(s.figures.get(n)) for s in scores)] for n in names]
    return ["metric", "goal", *(s.method for s in scores)], rows


def _cell(f: Figure | None) -> str:
    if f is None or f.value is None:
        return "–"
    low, high = ("–" if x is None else f"{x:.3g}" for x in (f.low, f.high))
    return f"{f.value:.3g} [{low}, {high}] n={f.n}"
