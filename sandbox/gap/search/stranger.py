"""Which named effects stay where something outside the library is likely to be at work.

A cause that nobody listed is imitated by effects that are not there: each takes a little of what it leaves.  Beside a
free regression (`evidence.beside`) that may take it up just as well, an effect has to be worth its place; those that
are not are left out one by one, the least worth first, and the rest is fitted anew.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from sandbox.gap.evidence.beside import beside
from sandbox.gap.evidence.fit import Weights
from sandbox.gap.search.forward import Search
from sandbox.gap.search.judged import Judged
from sandbox.gap.search.subsets import Subsets
from sandbox.gap.shortened import shortened

ROUNDS = 3  # fits without what is not believed, each at a point of its own
LIKELY = 0.5  # chance of `unknown` from which on effects have to stand beside a regression


def believed(sets: Subsets, effects: Sequence[str]) -> tuple[str, ...]:
    """Return the effects that are left when leaving out one more would make the set less probable."""
    here = tuple(effects)
    while here:
        rest = [tuple(e for e in here if e != gone) for gone in here]
        new = max(rest, key=sets.weigh)
        if sets.weigh(new) < sets.weigh(here):
            break
        here = new
    return here


def beside_unknown(
    found: Search, best: Judged, unknown: float, temperature: float, weights: Weights, workers: int
) -> Judged:
    """Return the hypothesis that stands beside `unknown`: the best one, or what of it is believed, fitted and weighed.

    unknown: probability that something outside the library is at work, temperature: for how much less the data counts.
    """
    here = best
    for _ in range(ROUNDS):
        if not here.effects or unknown < LIKELY:
            break
        freed = beside(replace(here.table, point=shortened(here.table.point)), here.prior, workers=workers)
        if freed is None:
            break
        sets = Subsets(replace(here.table, equations=freed.equations), temperature)
        kept = believed(sets, here.effects)
        if kept == here.effects:
            break
        known = [j for j in found.judged if j.effects == kept]
        # What was judged may stand in another minimum; ordinary deviations alone have only one.
        again = found.judge_also(kept, weights, workers, here.fit) if kept or not known else None
        both = [*known, *([] if again is None else [again])]
        if not both:
            break
        here = min(both, key=lambda j: j.fit.objective)
    return here
