"""`diagnosis.json`: the contract that scripts rely on (DIAGNOSIS.md)."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import asdict
from typing import Any

from sandbox.gap.diagnose import Diagnosis, verdict
from sandbox.gap.discriminate import Next, as_json
from sandbox.gap.estimates import Estimate
from sandbox.gap.position import PositionError
from sandbox.gap.posterior import UNKNOWN, Hypothesis
from sandbox.gap.size import rms, share_closed
from sandbox.gap.where import Finding


def contract(
    d: Diagnosis, where: Sequence[Finding], position: PositionError | None, following: Next | None = None
) -> dict[str, Any]:
    """Return what `diagnosis.json` holds beyond its header."""
    named = verdict(d)
    size = d.size
    closed = None if named == "no_gap" else size.closed
    return {
        "campaign": d.campaign.name,
        "verdict": named,
        "gap": {
            "raw": size.raw,
            "before": size.before,
            "after": size.after,
            "floor": 1.0,
            "closed": closed,
            "closed_ci95": None if closed is None else size.closed_ci95,
            "recordings": [{"file": f, "before": b, "after": a, "held_out": h} for f, b, a, h in size.recordings],
            "position_error_deg": None if position is None else position.as_json(),
        },
        "where": [asdict(finding) for finding in where],
        "hypotheses": [
            {
                "effects": list(h.effects),
                "probability": h.probability,
                "closed": closed_by(d, h),
                "parameters": {name: parameter(e) for name, e in own.items()},
            }
            for h, own in zip(d.hypotheses, d.parameters, strict=True)
        ],
        "ambiguity_set": [list(h.effects) for h in d.ambiguity_set],
        "next_recording": as_json(following),
        "cost": {"simulations": d.simulations, "seconds": d.seconds},
    }  # fmt: skip


def parameter(e: Estimate) -> dict[str, Any]:
    """Return one parameter as the contract has it."""
    return {"value": e.value, "ci95": [e.low, e.high], "unit": e.unit}


def closed_by(d: Diagnosis, h: Hypothesis) -> float | None:
    """Return the share of the reducible gap that a hypothesis closes on recordings held out (or all, if none are).

    None for `unknown` alone, which predicts nothing, and where no gap stands above the floor.
    """
    if h.effects == (UNKNOWN,):
        return None
    if not h.effects:
        return 0.0
    if h.judged is d.best.judged and d.size.closed is not None:
        return d.size.closed
    chosen = list(d.held_out) or range(len(d.start.prepared.recordings))
    before = d.size.before
    closed = share_closed(before, rms(h.judged.fit.normal, chosen)) if before > 1.0 else math.nan
    return closed if math.isfinite(closed) else None
