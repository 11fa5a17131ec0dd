"""What each figure of the check on withheld effects says, in plain words, and how it is printed."""

from __future__ import annotations

from typing import Any, NamedTuple


class Said(NamedTuple):
    """A figure in a few words (for drawings) and in a sentence (for tables); percent: it is a
    share."""

    short: str
    sentence: str
    percent: bool = True


WORDS = {
    "top1": Said("right name first", "One effect was wrong, and the diagnosis named it first."),
    "top1_half": Said(
        "right name first, not small", "The same, of effects of half the medium size and more."
    ),
    "mean_probability": Said(
        "chance of the truth", "The chance that it gave to the true single effect, in the mean."
    ),
    "set_f1": Said(
        "names right (F1)",
        "Of two or three effects: how far the names of the first set agree with the true "
        "ones (F1: 1 where all do).",
        False,
    ),
    "exact_set": Said(
        "exact set", "Two or three effects were wrong, and the first set was exactly these."
    ),
    "exact_two": Said("exact set of two", "The same, of two effects."),
    "exact_three": Said("exact set of three", "The same, of three effects."),
    "unknown_auroc": Said(
        "unknown told apart",
        "How well the chance of *unknown* separates causes outside the library from all others "
        "(area under ROC, 1: perfectly, 0.5: by luck).",
        False,
    ),
    "outside_named": Said(
        "false name beside outside",
        "The cause was outside the library, and the first set held a false name.",
    ),
    "outside_blamed": Said("outside blamed", "The same, without *unknown* beside the name."),
    "outside_listed": Said(
        "false name listed",
        "The cause was outside, and the list gave a false name a chance above one half.",
    ),
    "false_alarm": Said(
        "false alarm", "Nothing was wrong, and the diagnosis named an effect or *unknown*."
    ),
    "calibration_one": Said(
        "error of chances",
        "How far stated chances of single effects and the share that was right are apart.",
        False,
    ),
    "coverage": Said("intervals that hold", "95 % intervals of sizes that held the truth."),
    "coverage_worst": Said(
        "intervals, worst effect", "The same, of the effect with the fewest that did."
    ),
    "closed_median": Said(
        "gap closed, middle", "How much of the gap the named effects close, in the middle case."
    ),
    "closed_p10": Said("gap closed, worst tenth", "The same, in the worst tenth of the cases."),
    "closed_many_median": Said(
        "gap closed, middle", "How much of the gap four to ten effects close, in the middle."
    ),
    "closed_many_p10": Said(
        "gap closed, worst tenth", "The same, in the worst tenth of the cases."
    ),
    "ambiguity_hit": Said(
        "truth in the set", "The truth is among the sets that hold 95 % of the probability."
    ),
    "ambiguity_size": Said(
        "sets offered", "How many such sets there are for a single effect, in the mean.", False
    ),
    "subsystem": Said(
        "right subsystem", "The part of the drive (machine, inverter, sensor, mechanics) is right."
    ),
    "recommended": Said(
        "recording recommended", "Ambiguous answers that came with a recommended recording."
    ),
    "resolved": Said("settled by it", "With the recommended recording, the truth was left alone."),
    "resolved_promised": Said(
        "settled, as promised", "The chance of that which the diagnosis had stated."
    ),
    "resolved_sure": Said(
        "settled, promised 90 %", "The truth was left alone where 90 % and more was promised."
    ),
    "resolved_else": Said("settled, else", "The truth was left alone where less was promised."),
    "resolved_of_all": Said(
        "settled of all", "Of all ambiguous answers, those that a recommended recording settled."
    ),
    "included_f1": Said(
        "names right (F1)",
        "Of four to ten effects: how far names with a chance above one half are right.",
        False,
    ),
    "included_auroc": Said(
        "there told from not there",
        "How well an effect's chance separates what is there from what is not.",
        False,
    ),
    "included_error": Said(
        "error of chances", "How far an effect's stated chance is off, in the mean.", False
    ),
    "seconds": Said("seconds", "Seconds by the clock, in the middle case.", False),
    "seconds_over_60": Said("over 60 s", "Diagnoses that took more than 60 s."),
    "simulations": Said("simulations", "Simulations, in the middle case.", False),
    "simulations_over_2000": Said(
        "over 2000 simulations", "Diagnoses that took more than 2000 simulations."
    ),
    "cpu_seconds": Said("processor seconds", "Processor seconds, in the middle case.", False),
    "cpu_seconds_p99": Said(
        "processor seconds, worst", "Processor seconds of the longest in a hundred.", False
    ),
    "leave_out_verdict_unknown": Said(
        "taken out: unknown", "The true effect was taken out of the library: *unknown*."
    ),
    "leave_out_unknown": Said(
        "taken out: doubt", "The same: *unknown* has at least 5 % or is among the sets offered."
    ),
    "leave_out_twin": Said(
        "taken out: twin", "The same: a look-alike of the missing effect was named."
    ),
    "leave_out_confident_wrong": Said(
        "taken out: sure and wrong", "The same: 95 % of the probability was on something else."
    ),
    "leave_out_listed_wrong": Said(
        "taken out: listed wrong",
        "The same: the list gave more than 95 % to an effect that is not there.",
    ),
    "leave_out_subsystem": Said(
        "taken out: subsystem", "The same: the part of the drive was right."
    ),
}


def value(name: str, x: float | None) -> str:
    """Return a figure's value: shares in percent, others in three digits."""
    if x is None:
        return "–"
    return f"{100.0 * x:.3g}\u00a0%" if name in WORDS and WORDS[name].percent else f"{x:.3g}"


def cell(name: str, figure: Any) -> str:
    """Return a figure with its one-sided 95 % limits and how many cases it is of."""
    if not isinstance(figure, dict) or figure.get("value") is None:
        return "–"
    low, high = (value(name, figure.get(k)) for k in ("low", "high"))
    return f"{value(name, figure['value'])} ({low} to {high}; {figure['n']})"


def meets(figure: Any, goal: str) -> str:
    """Return whether a figure meets a goal such as '≥ 0.90' or '0.93–0.97': ✓ or ✗, nothing without
    either."""
    if not goal or not isinstance(figure, dict) or figure.get("value") is None:
        return ""
    x = figure["value"]
    if goal[0] in "≥≤":
        bound = float(goal[1:])
        return "✓" if (x >= bound if goal[0] == "≥" else x <= bound) else "✗"
    low, high = map(float, goal.split("–"))
    return "✓" if low <= x <= high else "✗"


def goal_said(name: str, goal: str) -> str:
    """Return a goal in the unit of its figure."""
    if not goal or not WORDS[name].percent:
        return goal
    if goal[0] in "≥≤":
        return f"{goal[0]} {100.0 * float(goal[1:]):.3g} %"
    return "–".join(f"{100.0 * float(x):.3g}" for x in goal.split("–")) + " %"
