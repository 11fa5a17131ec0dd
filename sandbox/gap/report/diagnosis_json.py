"""`diagnosis.json`: what scripts rely on (its keys: `sandbox/output/schemas`)."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import asdict
from typing import Any

import numpy as np

from sandbox.gap.diagnose import Diagnosis, verdict
from sandbox.gap.evidence.algebra import algebra, prior_of
from sandbox.gap.evidence.gap_size import rms, share_closed
from sandbox.gap.evidence.noise import Noise
from sandbox.gap.evidence.regression import Remains
from sandbox.gap.location.where import Finding
from sandbox.gap.planning.next_recording import Next, as_json
from sandbox.gap.posterior.holdout import weights_of
from sandbox.gap.posterior.hypotheses import UNKNOWN, Hypothesis
from sandbox.gap.report.distinguishability import Alike
from sandbox.gap.report.position import PositionError
from sandbox.gap.report.ranking import Ranking, advised, parameter, ranking
from sandbox.gap.report.which import badge
from sandbox.recordings.campaign import Excerpts


def document(
    d: Diagnosis,
    where: Sequence[Finding],
    position: PositionError | None,
    following: Next | None = None,
    remains: Remains | None = None,
    alike: Alike | None = None,
    whole: Ranking | None = None,
) -> dict[str, Any]:
    """Return what `diagnosis.json` holds beyond its header.

    whole: the list of all effects; worked out here where it is not given.
    """
    named, r = verdict(d), whole or ranking(d)
    size = d.size
    closed = None if named == "no_gap" else size.closed
    return {
        "campaign": d.campaign.name,
        "verdict": named,
        "badge": badge(d),
        "gap": {
            "raw": size.nominal_nrmse,
            "before": size.before,
            "after": size.after,
            "floor": 1.0,
            "closed": closed,
            "closed_ci95": None if closed is None else size.closed_ci95,
            "recordings": [
                {"file": f, "before": b, "after": a, "held_out": h}
                for f, b, a, h in size.recordings
            ],
            "position_error_deg": None if position is None else position.as_json(),
            "remains": None if remains is None else remains.as_json(),
            "noise": None if d.noise is None else _noise(d.noise),
        },
        "where": [asdict(finding) for finding in where],
        "hypotheses": [
            {
                "effects": list(h.effects),
                "probability": h.probability,
                "closed": closed_by(d, h),
                "shares": r.shares_in(h),
                "parameters": {name: parameter(e) for name, e in own.items()},
            }
            for h, own in zip(d.hypotheses, d.parameters, strict=True)
        ],
        **with_advice(d, r, r.as_json(following)),
        "at_bound": [
            {"name": h.name, **parameter(h.estimate), "deviations": h.deviations}
            for h in d.at_bound
        ],
        "ambiguity_set": [list(h.effects) for h in d.ambiguity_set],
        "alike": None if alike is None else asdict(alike),
        "next_recording": as_json(following),
        "excluded": list(d.excluded),
        "out_of_sight": list(d.out_of_sight),
        "excerpts": excerpts(d.campaign.excerpts),
        "cost": {"simulations": d.simulations, "seconds": d.seconds},
    }


def _noise(own: Noise) -> dict[str, float | None]:
    """Return a current sensor's noise as JSON; of its colour the correlation of neighbours."""
    kept = {k: v for k, v in own._asdict().items() if k != "error"}
    return kept | {"colour": own.colour[0] if own.colour else 0.0}


def with_advice(d: Diagnosis, r: Ranking, listed: dict[str, Any]) -> dict[str, Any]:
    """Return the list of all effects, each that has a size with what to do about it (`do`, else
    null)."""
    said = advised(d, r)
    for effect in listed["effects"]:
        effect["do"] = said.get(effect["name"])
    return listed


def excerpts(found: Excerpts | None) -> dict[str, Any] | None:
    """Return which parts of long recordings were used, None where all of them."""
    if found is None:
        return None
    return {
        "samples_recorded": found.samples_recorded,
        "samples_within_map": found.samples_within_map,
        "samples_used": found.samples_used,
        "parts": [asdict(e) for e in found.parts],
        "unused": found.unused,
    }


def closed_by(d: Diagnosis, h: Hypothesis) -> float | None:
    """Return the share of the reducible gap that a hypothesis closes on recordings held out (or
    all, if none are).

    The best one was fitted without them; for others its parameters without them follow from the
    equations of the fit to all.  None for `unknown` alone, which predicts nothing, and where there
    is no gap.
    """
    if h.effects == (UNKNOWN,) or verdict(d) == "no_gap":
        return None
    if not h.effects:
        return 0.0
    if h.evaluated is d.best.evaluated and d.size.closed is not None:
        return d.size.closed
    before = d.size.before
    closed = share_closed(before, _rms_without(d, h)) if before > 1.0 else math.nan
    return closed if math.isfinite(closed) else None


def _rms_without(d: Diagnosis, h: Hypothesis) -> float:
    """Return a hypothesis' normalised rms on recordings held out, its parameters those of the
    others alone."""
    n = h.evaluated.fit.normal
    count = len(d.start.prepared.recordings)
    if not d.held_out:
        return rms(n, range(count))
    shift = algebra(n, weights_of(count, d.held_out)).most_probable(prior_of(n.coordinates)).x - n.x
    held = algebra(n, weights_of(count, [k for k in range(count) if k not in d.held_out]))
    squares = held.ssr - 2.0 * shift @ held.g + shift @ held.a @ shift
    return float(
        np.sqrt(max(squares, 0.0) / sum(s.n.sum() for s in n.segments if s.recording in d.held_out))
    )
