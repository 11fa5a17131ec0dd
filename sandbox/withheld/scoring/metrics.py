"""Figures of a whole check from its judgements, and what a page shows of them."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from model.effects.library import causes
from sandbox.withheld.scoring.chances import MANY, NAMED, calibration, coverage_worst, of_many
from sandbox.withheld.scoring.judge import SETTLED, UNKNOWN, Judgement
from sandbox.withheld.scoring.limits import Figure, auroc, mean, mean_share, quantile, ratio, share

# of the whole list of effects with chances that hold, then those of single causes and
# recommendations
GOALS = {
    "top1_half": "≥ 0.97",
    "calibration_one": "≤ 0.03",
    "exact_set": "≥ 0.85",
    "included_f1": "≥ 0.90",
    "included_auroc": "≥ 0.97",
    "included_error": "≤ 0.05",
    "closed_many_median": "≥ 0.99",
    "closed_many_p10": "≥ 0.95",
    "coverage": "0.93–0.97",
    "coverage_worst": "≥ 0.88",
    "unknown_auroc": "≥ 0.98",
    "outside_named": "≤ 0.10",
    "outside_listed": "≤ 0.10",
    "leave_out_confident_wrong": "≤ 0.02",
    "leave_out_listed_wrong": "≤ 0.02",
    "false_alarm": "≤ 0.01",
    "cpu_seconds": "≤ 10",
    "cpu_seconds_p99": "≤ 60",
    "mean_probability": "≥ 0.90",
    "set_f1": "≥ 0.90",
    "ambiguity_hit": "≥ 0.99",
    "ambiguity_size": "≤ 1.3",
    "subsystem": "≥ 0.99",
    "resolved": "≥ 0.90",
}
HALF = 0.5  # of the medium size: single effects of this rung and above are to be named first
SETS = ("several", "many")  # kinds of campaigns with more than one effect of the library
DOUBT = 0.05  # of P(unknown): more than this holds the question open
SURE = 0.9  # chance stated to settle an ambiguity from which on a recommended recording is promised
SLOW, COSTLY = 60.0, 2000.0  # s and simulations that a diagnosis should not take
FARTHEST = 4  # doublings of the medium size beyond which sizes are counted together


def figures(
    judged: Sequence[Judgement],
    asked: Mapping[str, float | None] | None = None,
    followed: Sequence[Judgement] = (),
) -> dict[str, Figure]:
    """Return every metric by name; asked: campaigns with a recommended recording and how probably
    it would settle them, as the method says (None: it does not); followed: diagnosed with it.

    A method chooses what it asks for, so `resolved` is one of four: of what was recorded, it
    settled so much;
    `resolved_promised`: as much as it had said; `recommended`: of all ambiguous verdicts, so many
    asked;
    `resolved_of_all`: of these, so many were settled.  `resolved_sure`, `resolved_else`: `resolved`
    of those for which at least SURE was promised, and of the others.
    """
    one = [j for j in judged if j.kind == "one"]
    several = [j for j in judged if j.kind == "several"]
    known = [j for j in judged if j.kind != "outside"]
    outside = [j for j in judged if j.kind == "outside"]
    shrunk = [j.closed for j in judged if j.closed is not None]
    of_list = [j.closed for j in judged if j.closed is not None and len(j.effects) >= MANY]
    times = [j.seconds for j in judged if j.seconds is not None]
    spent = [j.simulations for j in judged if j.simulations is not None]
    return {
        "top1": share([j.hit for j in one]),
        "top1_half": share([j.hit for j in one if rung(j.sizes[0]) >= HALF]),
        "mean_probability": mean_share([j.probability for j in one]),
        "set_f1": mean_share([j.f1 for j in several]),
        "exact_set": share([j.hit for j in several]),
        "exact_two": share([j.hit for j in several if len(j.effects) == 2]),
        "exact_three": share([j.hit for j in several if len(j.effects) == 3]),
        "unknown_auroc": auroc([j.unknown for j in outside], [j.unknown for j in known]),
        "outside_named": share(
            [j.failed or (UNKNOWN in j.top and j.falsely_named) for j in outside]
        ),
        "outside_blamed": share(
            [j.failed or (UNKNOWN not in j.top and j.falsely_named) for j in outside]
        ),
        "outside_listed": share([j.failed or bool(j.listed(NAMED)) for j in outside]),
        "false_alarm": share([j.verdict != "no_gap" for j in judged if j.kind == "none"]),
        "calibration_one": calibration(one),
        **of_many([j for j in judged if j.kind in SETS]),
        "coverage": ratio([j.parts for j in judged]),
        "coverage_worst": coverage_worst(judged),
        "closed_median": quantile(shrunk, 0.5),
        "closed_p10": quantile(shrunk, 0.1),
        "closed_many_median": quantile(of_list, 0.5),
        "closed_many_p10": quantile(of_list, 0.1),
        "ambiguity_hit": share([j.in_set for j in judged]),
        "ambiguity_size": mean([j.set_size for j in one if j.separable and not j.failed]),
        "subsystem": share([bool(j.subsystem) for j in judged if j.subsystem is not None]),
        **resolved(judged, asked or {}, followed),
        "seconds": quantile(times, 0.5),
        "seconds_over_60": share([t > SLOW for t in times]),
        "simulations": quantile(spent, 0.5),
        "simulations_over_2000": share([n > COSTLY for n in spent]),
    }


def resolved(
    judged: Sequence[Judgement],
    asked: Mapping[str, float | None],
    followed: Sequence[Judgement],
) -> dict[str, Figure]:
    """Return what recommended recordings settle, see `figures`."""
    ambiguous = [j.name for j in judged if j.verdict == "ambiguous"]
    settled = {j.name: j.settled for j in followed}
    # the others are not recorded yet
    tried = [n for n in ambiguous if n in settled or n not in asked]
    if asked and not settled:
        # nothing is recorded yet, so nothing is known of what recordings settle
        tried = []
    return {
        "resolved": share([j.settled for j in followed]),
        "resolved_promised": mean_share(
            [p for j in followed if (p := asked.get(j.name)) is not None]
        ),
        "resolved_sure": share([j.settled for j in followed if (asked.get(j.name) or 0.0) >= SURE]),
        "resolved_else": share([j.settled for j in followed if (asked.get(j.name) or 0.0) < SURE]),
        "recommended": share([n in asked for n in ambiguous]),
        "resolved_of_all": share([settled.get(n, False) for n in tried]),
    }


def by_subsystem(
    judged: Sequence[Judgement], known: Sequence[Judgement] = ()
) -> dict[str, dict[str, Figure]]:
    """Return what is said of causes outside the library by the subsystem they lie in.

    found: `unknown` stands in the first hypothesis; named, blamed: as `outside_named` and
    `outside_blamed`; auroc: of P(unknown) against that of campaigns without such a cause, these
    ones' and `known`.
    """
    without = [j.unknown for j in (*judged, *known) if j.outside is None]
    out = {}
    for subsystem in sorted({j.outside for j in judged if j.outside is not None}):
        own = [j for j in judged if j.outside == subsystem]
        out[subsystem] = {
            "found": share([UNKNOWN in j.top for j in own]),
            "named": share([j.failed or (UNKNOWN in j.top and j.falsely_named) for j in own]),
            "blamed": share([j.failed or (UNKNOWN not in j.top and j.falsely_named) for j in own]),
            "auroc": auroc([j.unknown for j in own], without),
        }
    return out


def left_out(judged: Sequence[Judgement]) -> dict[str, Figure]:
    """Return the figures of diagnoses from whose library the true effect was taken.

    verdict_unknown: `unknown` is the verdict; unknown: P(unknown) > 0.05, or it stands in the
    ambiguity set;
    confident_wrong: nearly all the probability on other names, or on none; twin: such on an effect
    that recordings can hardly tell from the missing one (`judge.TWINS`), counted in both;
    listed_wrong: another effect of the list has a chance above SETTLED, whatever `unknown` has;
    subsystem: rightly located.
    """
    held_open = [not j.failed and (j.unknown > DOUBT or j.unknown_in_set) for j in judged]
    return {
        "leave_out_verdict_unknown": share([j.verdict == UNKNOWN for j in judged]),
        "leave_out_unknown": share(held_open),
        "leave_out_twin": share([j.twin and j.confident for j in judged]),
        "leave_out_confident_wrong": share([j.confident and j.unknown <= DOUBT for j in judged]),
        "leave_out_listed_wrong": share([j.failed or bool(j.listed(SETTLED)) for j in judged]),
        "leave_out_subsystem": share(
            [bool(j.subsystem) for j in judged if j.subsystem is not None]
        ),
    }


def rung(size: float) -> float:
    """Return the power of two nearest to a size (a multiple of the medium one), where figures by
    size count it."""
    return float(2.0 ** min(max(round(math.log2(size)), -FARTHEST), FARTHEST))


def by_size(judged: Sequence[Judgement]) -> dict[str, dict[str, Figure]]:
    """Return top-1 and mean probability of single effects by size, to the nearest power of two of
    the medium one."""
    sizes = sorted({rung(j.sizes[0]) for j in judged if j.kind == "one"})
    own = {s: [j for j in judged if j.kind == "one" and rung(j.sizes[0]) == s] for s in sizes}
    return {
        f"{s:g}": {
            "top1": share([j.hit for j in js]),
            "mean_probability": mean_share([j.probability for j in js]),
        }
        for s, js in own.items()
    }


def detection_limit(judged: Sequence[Judgement]) -> dict[str, dict[str, Any]]:
    """Return by effect the smallest size found, the largest missed, and how many campaigns there
    were."""
    out = {}
    for name in causes():
        own = [j for j in judged if j.kind == "one" and j.effects == (name,)]
        if own:
            found, missed = ([j.sizes[0] for j in own if j.hit is hit] for hit in (True, False))
            out[name] = {
                "found": min(found, default=None),
                "missed": max(missed, default=None),
                "n": len(own),
            }
    return out


def confusion(judged: Sequence[Judgement]) -> dict[str, Any]:
    """Return counts of first hypotheses by truth: labels of rows and columns, and the matrix."""
    plain = [j for j in judged if j.kind not in SETS and len(j.effects) < 2]
    cases = [(j.effects[0] if j.effects else "none", j.label) for j in plain]
    order = [*causes(), UNKNOWN, "none", "several", "failed"]
    rows, columns = ([n for n in order if any(c[k] == n for c in cases)] for k in (0, 1))
    counts = Counter(cases)
    return {
        "truth": rows,
        "verdict": columns,
        "counts": [[counts[r, c] for c in columns] for r in rows],
    }


def reliability(judged: Sequence[Judgement], bins: int = 10) -> list[dict[str, Any]]:
    """Return by bin of the first hypothesis' probability: its mean, and the share that was right
    with its limits."""
    out = []
    for k in range(bins):
        own = [
            j for j in judged if not j.failed and min(int(j.top_probability * bins), bins - 1) == k
        ]
        if own:
            stated = float(np.mean([j.top_probability for j in own]))
            out.append({"stated": stated, **share([j.hit for j in own]).as_json()})
    return out
