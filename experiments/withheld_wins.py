"""Where a simple method does better than the project's diagnosis, and where worse, campaign by
campaign."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

from sandbox.withheld.scoring.chances import MANY, NAMED
from sandbox.withheld.scoring.judge import UNKNOWN, Judgement


class Split(NamedTuple):
    """Campaigns that two methods answered: where the first did better, where the second did, in how
    many neither.

    chance: that methods of equal worth are split as unevenly or more (exact sign test on the
    campaigns that differ: McNemar, Psychometrika 12 (1947) 153); 1 where none differs.
    """

    own: tuple[str, ...]
    other: tuple[str, ...]
    alike: int
    chance: float


def worth(j: Judgement) -> float:
    """Return what an answer counts: 1 if its first hypothesis is right, else 0; of MANY effects and
    more F1 of those named (chance above NAMED)."""
    true = {*j.effects} - {UNKNOWN}
    if len(true) < MANY:
        return float(j.hit)
    named = {e for e, chance in j.chances.items() if chance > NAMED}
    return 2.0 * len(named & true) / (len(named) + len(true))


def split(own: Sequence[Judgement], other: Sequence[Judgement]) -> Split:
    """Return where one of two methods does better, on the campaigns that both have answered."""
    from scipy.stats import binomtest

    theirs = {j.name: worth(j) for j in other}
    differences = {j.name: worth(j) - theirs[j.name] for j in own if j.name in theirs}
    better = tuple(n for n, d in differences.items() if d > 0.0)
    worse = tuple(n for n, d in differences.items() if d < 0.0)
    differ = len(better) + len(worse)
    chance = float(binomtest(len(worse), differ).pvalue) if differ else 1.0
    return Split(better, worse, len(differences) - differ, chance)
