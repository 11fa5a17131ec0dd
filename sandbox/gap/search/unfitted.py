"""Effects too small to show: weighed by algebra beside the hypothesis that there is none.

Where ordinary deviations alone explain a campaign, an effect whose trace cannot be told from nothing stays possible,
and so does one that looks like a large but still ordinary deviation.  Near the floor the equations at the point without
effects say how probable each is, and what its parameters would be; a fit would add nothing.
"""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import replace

from sandbox.gap.evidence.fit import Fit
from sandbox.gap.evidence.normal import equations_of
from sandbox.gap.search.judged import Judged

BEHIND = 30.0  # log evidence behind the best at which there is no point in it


def slight(judged: Sequence[Judged], fitted: Collection[tuple[str, ...]]) -> list[Judged]:
    """Return every single effect that is not among those fitted, weighed at the point without effects; none if that has
    no chance itself."""
    none = next((j for j in judged if not j.effects), None)
    if none is None or none.log_evidence < max(j.log_evidence for j in judged) - BEHIND:
        return []
    return [by_algebra(none, (e,)) for e in none.table.members if (e,) not in fitted]


def by_algebra(near: Judged, effects: tuple[str, ...]) -> Judged:
    """Return the hypothesis of a set of effects from the equations at the point of another one."""
    t = near.table
    prior = t.prior(effects, alone=True)
    kept = [k for k, c in enumerate(t.coordinates) if prior.deviation[k] > 0.0 or c.form == "turn"]
    own = [replace(t.coordinates[k], mean=float(prior.mean[k]), deviation=float(prior.deviation[k])) for k in kept]
    n = equations_of(t.normal, kept, own, prior.mean)
    x, _, objective = t.equations.most_probable(prior)
    whole = [k for k in kept if t.coordinates[k].form != "share"]  # a share is there or not, nothing between
    at = t.point.moved([t.coordinates[k] for k in whole], x[whole])
    found = Fit(effects, at, n, objective, 0.0)
    return Judged(found, t, t.prior(effects), t.log_evidence(effects) - 0.5 * near.unmet, near.unmet, 0.0)
