"""What a simple method answers, in the form of `diagnosis.json`."""

from __future__ import annotations

import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from model.effects.library import load_effect
from sandbox.recordings.campaign import Campaign

REMAINS = 1.05  # times the floor: more than this is left unexplained


@dataclass(frozen=True)
class Answer:
    """A diagnosis in the form of `diagnosis.json`."""

    json: dict[str, Any]


def answer(
    campaign: Campaign,
    ranked: Sequence[tuple[tuple[str, ...], float, Mapping[str, Any]]],
    gaps: tuple[float, float, float],
    started: float,
    simulations: int,
) -> Answer:
    """Return hypotheses (effects, weight, parameters) as a diagnosis; gaps: J raw, before, after.

    What remains of the reducible gap is the probability of `unknown`.
    """
    raw, before, after = gaps
    left = 0.0
    if after > REMAINS:
        left = min(1.0, (after**2 - 1.0) / (max(before, after) ** 2 - 1.0))
    total = sum(w for _, w, _ in ranked)
    hypotheses: list[dict[str, Any]] = [
        {"effects": list(e), "probability": (1.0 - left) * w / total, "parameters": dict(p)}
        for e, w, p in ranked
    ]
    if left > 0.0:
        hypotheses.append({"effects": ["unknown"], "probability": left, "parameters": {}})
    hypotheses.sort(key=lambda h: -h["probability"])
    members: list[list[str]] = []
    sum_ = 0.0
    for h in hypotheses:
        members.append(h["effects"])
        sum_ += h["probability"]
        if sum_ >= 0.95:
            break
    top = hypotheses[0]["effects"]
    named = "ambiguous" if len(members) > 1 else "unknown" if "unknown" in top else "explained"
    named = named if top else "no_gap"
    closed = None
    if top and before > REMAINS:
        closed = (before**2 - after**2) / (before**2 - 1.0)
    systems = [
        load_effect(e).subsystem for h in hypotheses for e in h["effects"] if e != "unknown"
    ] or ["machine"]
    return Answer(
        {
            "schema": 1,
            "campaign": campaign.name,
            "verdict": named,
            "gap": {"raw": raw, "before": before, "after": after, "floor": 1.0, "closed": closed},
            "where": [
                {
                    "subsystem": systems[0],
                    "channel": "",
                    "region": "",
                    "order": None,
                    "share": 1.0,
                    "text": "",
                }
            ],
            "hypotheses": hypotheses,
            "ambiguity_set": members,
            "next_recording": None,
            "cost": {"simulations": simulations, "seconds": time.perf_counter() - started},
        }
    )
