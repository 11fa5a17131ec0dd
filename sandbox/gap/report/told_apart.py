"""What an effect is confused with on these recordings: other effects, and ordinary deviations.

An effect of a set, at its size there, leaves r'r beside all else that the set has (ordinary
deviations, traces of other effects), and less where a rival steps in.  The cosine says which share
of it that is (`distinguishability`); half of what is left with the rival is the log evidence by
which the recordings still prefer the effect to it.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from sandbox.gap.evidence.algebra import Prior
from sandbox.gap.posterior.evaluated import EvaluatedModel
from sandbox.gap.report.distinguishability import left_by

ALIKE = math.sqrt(0.5)  # cosine: a rival takes up half of what the effect does
KINDS = {"turn": "encoder_counts", "map": "flux_map"}  # names of coordinates that are no parameters
SURE = math.log(0.95 / 0.05)  # log evidence that makes even odds 95 %


@dataclass(frozen=True)
class Confused:
    """A rival: its name, "effect" or "ordinary" (deviation), the cosine, the log evidence for the
    effect over it."""

    name: str
    kind: str
    cosine: float
    log_evidence: float


@dataclass(frozen=True)
class Telling:
    """Whether an effect can be told from all others here, and the rivals that take up half of what
    it does or more, the most alike first."""

    tellable: bool
    confused_with: tuple[Confused, ...]

    def as_json(self) -> dict[str, Any]:
        """Return `tellable` and `confused_with` of an effect in `diagnosis.json`."""
        return {"tellable": self.tellable, "confused_with": [asdict(x) for x in self.confused_with]}


def telling(j: EvaluatedModel, effect: str) -> Telling | None:
    """Return what an effect of a set is confused with; None where it has no size there."""
    t, equations = j.model, j.equations
    rest = tuple(e for e in j.effects if e != effect)
    without, wide = t.prior(rest), t.prior(j.effects)
    places = np.array(
        [k for k in t.members[effect] if without.deviation[k] < wide.deviation[k]], dtype=np.int64
    )
    move = equations.most_probable(wide).x[places] - wide.mean[places]
    if not np.any(move):
        return None
    level = left_by(equations, places, move, without)
    found: list[Confused] = []
    for name, kind, lacking, having in _rivals(j, effect, places):
        less = left_by(equations, places, move, having)
        more = level if lacking is None else left_by(equations, places, move, lacking)
        found.append(
            Confused(
                name, kind, math.sqrt(min(1.0, max(0.0, 1.0 - less / more))), 0.5 * max(0.0, less)
            )
        )
    alike = tuple(sorted((x for x in found if x.cosine >= ALIKE), key=lambda x: -x.cosine))
    return Telling(0.5 * level >= SURE and all(x.log_evidence >= SURE for x in alike), alike)


def _rivals(
    j: EvaluatedModel, effect: str, places: NDArray[np.int64]
) -> Iterator[tuple[str, str, Prior | None, Prior]]:
    """Yield name and kind of each rival, the prior without it (None: of the set without the effect)
    and with it."""
    t, rest = j.model, tuple(e for e in j.effects if e != effect)
    own = set(places.tolist())
    for rival, members in t.members.items():
        if rival != effect and not own & set(members):
            others = tuple(e for e in rest if e != rival)
            yield (
                rival,
                "effect",
                t.prior(others) if rival in rest else None,
                t.prior((*others, rival)),
            )
    usual = t.prior(rest)
    groups: dict[str, list[int]] = {}
    taken = {k for e in rest for k in t.members[e]}
    for k, c in enumerate(t.coordinates):
        if not t.of_effects[k] and k not in own and k not in taken and usual.deviation[k] > 0.0:
            groups.setdefault(KINDS.get(c.form, c.label.partition(" ")[0]), []).append(k)
    for name, held in groups.items():
        deviation = usual.deviation.copy()
        deviation[held] = 0.0
        yield name, "ordinary", usual.with_deviation(deviation), usual
