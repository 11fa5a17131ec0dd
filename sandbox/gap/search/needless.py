"""Effects that a set no longer needs: the set without them is weighed beside it.

An effect is added where it explains most of what the set of that time leaves.  Once more effects stand beside it, it
may explain nothing any more.  The rivals that algebra holds best at the set's point may all lack an effect that is
needed, where a trace seems to stand for it; a set without what does nothing is then not among those that are fitted.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

from sandbox.gap.evidence.fit import Weights, attempted
from sandbox.gap.evidence.priors import of_effect
from sandbox.gap.search.estimates import spread
from sandbox.gap.search.forward import Search
from sandbox.gap.search.judged import Judged, judge
from sandbox.gap.search.parts.adding import level
from sandbox.gap.search.points import towards
from sandbox.gap.search.posterior import ACCURATE

SIZES = ("linear", "reciprocal", "cosine", "sine")  # forms of coordinates that are sizes, no shapes


def with_fewer(
    found: Search, raw: float, weights: Weights, *, workers: int = 1, report: Callable[[str], None] = lambda _: None
) -> Search:
    """Return a search whose best set is weighed without the effects that do nothing in it, too: without all of them,
    and, where that is less probable, without each.  raw: normalised rms of the nominal model."""
    t = 1.0 + raw / ACCURATE
    best = max(found.judged, key=lambda j: level(j, t))
    nothing, more = needless(best), list[Judged]()
    for gone in (nothing, *((e,) for e in nothing)):
        key = tuple(e for e in best.effects if e not in gone)
        if not gone or key in found.fitted or key in {j.effects for j in more}:
            continue
        report(f"fitting without {' + '.join(gone)}")
        new = _fewer(best, key, found, weights, workers)
        more += [] if new is None else [new]
        if new is not None and level(new, t) > level(best, t):
            break
    cost = found.simulations + sum(j.simulations + j.fit.simulations for j in more)
    fitted = found.fitted | {j.effects for j in more}
    return replace(found, judged=(*found.judged, *more), simulations=cost, fitted=fitted)


def needless(j: Judged) -> tuple[str, ...]:
    """Return the effects of a set, of two or more, whose every size may be nothing by its 95 % interval."""
    s, point = spread(j), j.fit.point
    place, drive, out = s.place, point.prepared.campaign.drive, []
    for effect in j.effects if len(j.effects) > 1 else ():
        own = [c for c in of_effect(effect, drive, point.values) if c.form in SIZES and c.label in place]
        ends = [(s.ends[0][place[c.label]], c.mean, s.ends[1][place[c.label]]) for c in own]
        if ends and all(low <= nothing <= high for low, nothing, high in ends):
            out.append(effect)
    return tuple(out)


def _fewer(best: Judged, key: tuple[str, ...], found: Search, weights: Weights, workers: int) -> Judged | None:
    """Return a smaller set, fitted from the best one's values and weighed; None where no drive can have it."""
    at = towards(best.fit, key, found.chosen)
    fit = attempted(at, key, weights, leader=best.fit.objective, workers=workers)
    return None if fit is None else judge(fit, found.chosen, found.share, weights, workers)
