"""Sets near the best one, fitted before it is believed: an effect left out, exchanged, or added where an ordinary
deviation points to it; rivals once more from other starts."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from contextlib import suppress

from model.errors import BadInput
from sandbox.gap.evidence.fit import Fit, Weights, fit, stray
from sandbox.gap.evidence.probes import Probe
from sandbox.gap.search.judged import Judged
from sandbox.gap.search.points import starting, towards, unbent

MOST = 3  # effects of a set
LITTLE = 150.0  # log evidence: an effect whose loss costs less may be none
CLOSE, EXCHANGED = 60.0, 2  # log evidence within which another effect may stand in one's place; most of them tried
BETTER = 1.0  # of the objective: a fit from another start that is better by less is the same
POINTS = 3.3  # standard deviations (one in a thousand) beyond which an ordinary deviation points to its effect
Key = tuple[str, ...]
Fits = Mapping[Key, Fit]


def neighbours(
    best: Judged,
    fits: Fits,
    known: set[tuple[str, ...]],
    chosen: Sequence[Probe],
    exchange: int,
    weights: Weights,
    workers: int,
) -> list[Fit]:
    """Return fits of the best set with one effect left out, or exchanged for another, where algebra says that little
    is lost."""
    out = []
    for effect in best.effects:
        rest = tuple(e for e in best.effects if e != effect)
        keys = [rest]
        if best.table.log_evidence(rest) < best.log_evidence - LITTLE:
            others = [tuple(sorted((*rest, e))) for e in best.table.members if e not in best.effects]
            told = {k: best.table.log_evidence(k) for k in others}
            keys = [k for k in sorted(told, key=lambda k: -told[k]) if told[k] > best.log_evidence - CLOSE][:exchange]
        for key in keys:
            if key not in known:
                with suppress(BadInput):  # none a drive can have
                    at, leader = towards(best.fit, key, chosen), best.fit.objective
                    out.append(fits.get(key) or fit(at, key, weights, leader=leader, workers=workers))
    return out


def fitted_again(
    best: Judged, fits: Fits, null: Fit, chosen: Sequence[Probe], tried: set[tuple[Key, Key]], weights: Weights,
    workers: int,
) -> list[Fit]:  # fmt: skip
    """Return better fits of sets that were fitted and lack one effect of the best: from its point, and from ordinary
    deviations alone.  A rival that is left out is not dismissed for the minimum that its first fit ended in.

    tried: the best sets with such rivals of earlier calls, which are not fitted once more; those of this one are added.
    """
    out = []
    for effect in best.effects if len(best.effects) > 1 else ():
        rest = tuple(e for e in best.effects if e != effect)
        old = fits.get(rest)
        if old is None or (best.effects, rest) in tried:
            continue
        tried.add((best.effects, rest))
        for start in (towards(best.fit, rest, chosen), starting(unbent(null.point), rest, chosen)):
            with suppress(BadInput):  # none a drive can have
                found = fit(start, rest, weights, leader=best.fit.objective, workers=workers)
                if found.objective < old.objective - BETTER:
                    old = found
        if old is not fits[rest]:
            out.append(old)
    return out


def pointed(
    best: Judged,
    fits: Fits,
    known: set[tuple[str, ...]],
    chosen: Sequence[Probe],
    weights: Weights,
    workers: int,
) -> list[Fit]:
    """Return a fit of the best set with the effect of an ordinary deviation beyond POINTS, added or in
    another's place, as algebra says: such a deviation is what is left to a cause that is not in the set."""
    far = {c.effect for c, z in stray(best.fit).values() if abs(z) > POINTS}
    told: dict[tuple[str, ...], float] = {}
    for effect in sorted(far & set(best.table.members) - set(best.effects)):
        keys = [tuple(sorted({*best.effects, effect} - {e})) for e in best.effects]
        keys += [tuple(sorted((*best.effects, effect)))] if len(best.effects) < MOST else []
        told |= {k: best.table.log_evidence(k) for k in keys if k not in known}
    if not told:
        return []
    key = max(told, key=lambda k: told[k])
    try:
        at, leader = towards(best.fit, key, chosen), best.fit.objective
        return [fits.get(key) or fit(at, key, weights, leader=leader, workers=workers)]
    except BadInput:  # none a drive can have
        return []
