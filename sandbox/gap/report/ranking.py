"""The whole list: every effect of the library with its chance, size and share, and what it cannot be told from."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import asdict, dataclass, field, replace
from typing import Any

from model.effects import library
from sandbox.gap.diagnose import Diagnosis
from sandbox.gap.evidence.beside import Beside, beside
from sandbox.gap.report.position_moved import Moved, moved
from sandbox.gap.report.shares import Shares, shares
from sandbox.gap.search.estimates import Estimate, estimates_beside
from sandbox.gap.search.inclusion import Inclusion, by_algebra, inclusion
from sandbox.gap.search.posterior import UNKNOWN
from sandbox.gap.shortened import shortened

SLIGHT = 0.05  # chance of `unknown` below which no regression is fitted beside the effects
LIKELY = 0.5  # chance from which an effect counts as there


@dataclass(frozen=True)
class Ranking:
    """Chances of all effects, shares and waterfall of the best hypothesis', parameters of each effect where it is in a
    hypothesis, chance of `unknown`, the share of the gap that nothing in the library explains, and what a free
    regression beside the effects says (None where `unknown` is unlikely, or the regression predicts nothing).  moved:
    by effect and estimator, what it does to the position error."""

    inclusion: Inclusion
    shares: Shares
    parameters: dict[str, dict[str, Estimate]]
    unknown: float
    unexplained: float
    open_part: OpenPart | None = None
    moved: Mapping[str, Mapping[str, Moved]] = field(default_factory=dict)

    def as_json(self) -> dict[str, Any]:
        """Return `effects`, `groups`, `unknown` and `waterfall` of `diagnosis.json`."""
        return {
            "effects": [self._effect(e, p) for e, p in self.inclusion.chances.items()],
            "groups": [
                {"effects": list(g), "probability": p, "parted_by": {e: library.load_effect(e).separated_by for e in g}}
                for g, p in self.inclusion.groups
            ],
            "unknown": {
                "probability": self.unknown,
                "share": {"value": self.unexplained},
                "beside": None if self.open_part is None else self.open_part.as_json(),
            },
            "waterfall": [{"added": e, "J": j if math.isfinite(j) else None} for e, j in self.shares.waterfall],
        }

    def _effect(self, name: str, chance: float) -> dict[str, Any]:
        share = self.shares.of.get(name)
        group = self.inclusion.group_of(name)
        return {
            "name": name,
            "probability": chance,
            "share": None
            if share is None
            else {
                "value": share.value,
                "ci95": [share.low, share.high],
                "alone": share.alone,
            },
            "parameters": {k: parameter(e) for k, e in self.parameters.get(name, {}).items()},
            "group": None if group is None else list(group),
            "position": {k: m.as_json() for k, m in self.moved.get(name, {}).items()},
            "beside_unknown": None if self.open_part is None else self.open_part.of_effect(name),
        }


@dataclass(frozen=True)
class OpenPart:
    """What nothing in the library explains, as a free regression fitted beside the effects: what it closes and consists
    of, every effect's chance and the best hypothesis' parameters with it."""

    beside: Beside
    chances: Mapping[str, float]
    parameters: dict[str, Estimate]

    def as_json(self) -> dict[str, Any]:
        """Return `unknown.beside` of `diagnosis.json`."""
        return {"worth": self.beside.worth, "consists_of": [asdict(x) for x in self.beside.described]}

    def of_effect(self, name: str) -> dict[str, Any]:
        """Return an effect's chance and parameters beside the regression."""
        own = {k: parameter(e) for k, e in self.parameters.items() if k.startswith(f"{name}.")}
        return {"probability": self.chances[name], "parameters": own}


def parameter(e: Estimate) -> dict[str, Any]:
    """Return one parameter as the contract has it."""
    return {"value": e.value, "ci95": [e.low, e.high], "unit": e.unit} | ({"at_bound": True} if e.at_bound else {})


def ranking(d: Diagnosis, workers: int = 1, *, position: bool = True) -> Ranking:
    """Return the whole list of a diagnosis.  Where `unknown` is likely, an effect's chance is that beside a free
    regression, as often as `unknown` is.  position: whether closed loops say what effects do to it."""
    own: dict[str, dict[str, Estimate]] = {}
    for h, parameters in zip(d.hypotheses, d.parameters, strict=True):
        for e in h.effects:
            if e != UNKNOWN and e not in own:
                own[e] = {k: v for k, v in parameters.items() if k.startswith(f"{e}.")}
    chance = sum(h.probability for h in d.hypotheses if UNKNOWN in h.effects)
    left = 0.0 if d.remainder.before <= 0.0 else min(1.0, max(0.0, d.remainder.after / d.remainder.before))
    found = inclusion(d.hypotheses, d.temperature)
    open_part = _open_part(d, workers) if chance >= SLIGHT else None
    if open_part is not None:
        mixed = {e: (1.0 - chance) * p + chance * open_part.chances[e] for e, p in found.chances.items()}
        found = replace(found, chances=dict(sorted(mixed.items(), key=lambda x: -x[1])))
    there = [e for e in own if found.chances[e] >= LIKELY]
    values = {e: {k: x.value for k, x in own[e].items()} for e in there}
    return Ranking(found, shares(d), own, chance, left, open_part, moved(d.campaign.drive, values) if position else {})


def _open_part(d: Diagnosis, workers: int) -> OpenPart | None:
    j = d.best.judged
    found = beside(replace(j.table, point=shortened(j.table.point)), j.prior, workers=workers)
    if found is None:
        return None
    freed = replace(j.table, equations=found.equations)
    return OpenPart(found, by_algebra(freed, j.effects, d.temperature).chances, estimates_beside(j, found.equations))
