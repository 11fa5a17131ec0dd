"""The page of `constants.py`: what answers do when a constant of the diagnosis is halved or doubled."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

MOVED = 0.05  # of the first hypothesis' probability: less is told of no constant
TITLE = "Which answers hang on a constant of the diagnosis?"
Answer = Mapping[str, Any]
Truths = Mapping[str, Sequence[str]]


class Listed(NamedTuple):
    """A constant on the page: module and name, what it is, where it was chosen."""

    label: str
    what: str
    chosen: str


class Tried(NamedTuple):
    """A constant times a factor: the changed answers in words, how many were tried, the largest move of a chance."""

    constant: Listed
    factor: float
    notes: list[str]
    count: int
    moved: float


def page(found: Sequence[Answer], truths: Truths, listed: Sequence[Listed], title: str = TITLE) -> list[str]:
    """Return the page in markdown; found: answers by one state of the code."""
    base = {a["case"]: a for a in found if not a["constant"]}
    rows = tried(found, base, truths, listed)
    shown = [r for r in rows if r.notes or r.moved > MOVED]
    quiet = [c for c in listed if any(r.constant == c for r in rows) and all(r.constant != c for r in shown)]
    code = " ".join(sorted({a["code"] for a in found}))
    count, changed = sum(r.count for r in rows), sum(len(r.notes) for r in rows)
    wrong = sum("wrong" in note for r in rows for note in r.notes)
    return [
        f"# {title}",
        "",
        f"{len(base)} campaigns were diagnosed with each of {len(quiet) + len({r.constant for r in shown})} constants "
        f"halved and doubled, all else as it is: {count} diagnoses by one state of the code (`{code}`, "
        "`python -m experiments.constants`).",
        "",
        f"{changed} of the {count} answers change: another verdict or first hypothesis, or the truth leaves or enters "
        f"the ambiguity set. In {wrong} of them the first hypothesis is wrong.",
        "",
        *_before(base, truths),
        "",
        "## Constants that change an answer",
        "",
        f"Or that move the first hypothesis' probability by more than {MOVED:g}.",
        "",
        *(table(shown) if shown else ["None."]),
        "",
        "## Constants that change none",
        "",
        (", ".join(f"`{c.label}` ({c.what})" for c in quiet) or "None") + ".",
    ]


def tried(found: Sequence[Answer], base: Mapping[str, Answer], truths: Truths, listed: Sequence[Listed]) -> list[Tried]:
    """Return what every constant and factor does to the answers as they are (base: by case)."""
    out = []
    for constant in listed:
        for factor in sorted({a["factor"] for a in found if a["constant"] == constant.label}):
            own = [a for a in found if (a["constant"], a["factor"]) == (constant.label, factor) and a["case"] in base]
            if own:
                notes = [n for a in own if (n := change(base[a["case"]], a, truths.get(a["case"])))]
                out.append(Tried(constant, factor, notes, len(own), max(_moved(base[a["case"]], a) for a in own)))
    return out


def table(rows: Sequence[Tried]) -> list[str]:
    """Return lines of markdown: a row a constant and factor, with the cases whose answer changes, and how."""
    lines = [
        "| constant | what it is | chosen on | times | changes | largest change of probability |",
        "|---|---|---|--:|---|--:|",
    ]
    for c, factor, notes, count, moved in rows:
        told = "; ".join(notes) or f"none of {count}"
        lines.append(f"| `{c.label}` | {c.what} | {c.chosen} | {factor:g} | {told} | {moved:.3f} |")
    return lines


def _before(base: Mapping[str, Answer], truths: Truths) -> list[str]:
    """Return the answers with all constants as they are."""
    lines = ["| campaign | truth | verdict | first hypothesis | probability |", "|---|---|---|---|--:|"]
    for case, a in sorted(base.items()):
        truth = " + ".join(truths[case]) or "none" if case in truths else "outside the library"
        said = f"| {a['verdict']} | {_named(a)} | {a['probability']:.3f} |" if "failed" not in a else "| fails | | |"
        lines.append(f"| {case} | {truth} {said}".replace("_", " "))
    return lines


def _named(answer: Answer) -> str:
    return " + ".join(answer["effects"]) or "none"


def change(before: Answer, after: Answer, truth: Sequence[str] | None) -> str:
    """Return in words what a changed constant does to one case's answer, nothing where it stays; truth: if known."""
    if "failed" in after or "failed" in before:
        return "" if "failed" in before else f"{after['case']}: fails"
    if (before["verdict"], before["effects"]) == (after["verdict"], after["effects"]):
        same = truth is None or (sorted(truth) in before["ambiguity_set"]) == (sorted(truth) in after["ambiguity_set"])
        return "" if same else f"{after['case']}: truth {_inside(truth, after)} the ambiguity set"
    words = f"{after['case']}: {after['verdict']}, {_named(after)} ({after['probability']:.3f})"
    if truth is not None:
        right = (
            "right" if sorted(truth) == after["effects"] else f"wrong, truth {_inside(truth, after)} the ambiguity set"
        )
        words += f", {right}"
    return words.replace("_", " ")


def _inside(truth: Sequence[str] | None, answer: Answer) -> str:
    return "in" if sorted(truth or ()) in answer["ambiguity_set"] else "outside"


def _moved(before: Answer, after: Answer) -> float:
    """Return by how much the first hypothesis' probability moves where it stays the first."""
    if "failed" in before or "failed" in after or before["effects"] != after["effects"]:
        return 0.0 if "failed" in before else 1.0
    return math.fabs(before["probability"] - after["probability"])
