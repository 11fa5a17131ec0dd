"""The whole list: every effect of the library with its chance, size and share, and what it cannot be told from."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

from model.effects import library
from sandbox.gap.diagnose import Diagnosis
from sandbox.gap.report.shares import Shares, shares
from sandbox.gap.search.estimates import Estimate
from sandbox.gap.search.inclusion import Inclusion, inclusion
from sandbox.gap.search.posterior import UNKNOWN

LIKELY = 0.5  # chance from which an effect counts as there


@dataclass(frozen=True)
class Ranking:
    """Chances of all effects, shares and waterfall of the best hypothesis', parameters of each effect where it is in a
    hypothesis, chance of `unknown`, the share of the gap that nothing in the library explains."""

    inclusion: Inclusion
    shares: Shares
    parameters: dict[str, dict[str, Estimate]]
    unknown: float
    unexplained: float

    def as_json(self) -> dict[str, Any]:
        """Return `effects`, `groups`, `unknown` and `waterfall` of `diagnosis.json`."""
        return {
            "effects": [self._effect(e, p) for e, p in self.inclusion.chances.items()],
            "groups": [
                {"effects": list(g), "probability": p, "parted_by": {e: library.load_effect(e).separated_by for e in g}}
                for g, p in self.inclusion.groups
            ],
            "unknown": {"probability": self.unknown, "share": {"value": self.unexplained}},
            "waterfall": [{"added": e, "J": j if math.isfinite(j) else None} for e, j in self.shares.waterfall],
        }

    def _effect(self, name: str, chance: float) -> dict[str, Any]:
        share = self.shares.of.get(name)
        group = self.inclusion.group_of(name)
        return {
            "name": name,
            "probability": chance,
            "share": None if share is None else {"value": share[0], "ci95": [share[1], share[2]]},
            "parameters": {
                k: {"value": e.value, "ci95": [e.low, e.high], "unit": e.unit}
                for k, e in self.parameters.get(name, {}).items()
            },
            "group": None if group is None else list(group),
        }


def ranking(d: Diagnosis) -> Ranking:
    """Return the whole list of a diagnosis."""
    own: dict[str, dict[str, Estimate]] = {}
    for h, parameters in zip(d.hypotheses, d.parameters, strict=True):
        for e in h.effects:
            if e != UNKNOWN and e not in own:
                own[e] = {k: v for k, v in parameters.items() if k.startswith(f"{e}.")}
    chance = sum(h.probability for h in d.hypotheses if UNKNOWN in h.effects)
    left = 0.0 if d.remainder.before <= 0.0 else min(1.0, max(0.0, d.remainder.after / d.remainder.before))
    return Ranking(inclusion(d.hypotheses, d.temperature), shares(d), own, chance, left)
