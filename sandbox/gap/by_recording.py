"""Offsets of current sensors that differ between recordings, named as the effect that they are.

They are known before anything else is asked (`unstated.drifting`), so a diagnosis runs without
them; then every set of effects has `current_offset` beside it, as surely as the differences are
more than ordinary.  A constant over whole turns has nothing in common with what turns: squares that
it leaves add to all others, so its share is what the gap loses with it, in any order of adding.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import replace
from operator import add

import numpy as np

from model.confidence import Z95
from model.effects import library
from sandbox.gap.diagnose import Diagnosis, Drift, misstated, sized
from sandbox.gap.evidence.normal import NormalEquations
from sandbox.gap.location.where import LEAST, Finding, percent, sentences
from sandbox.gap.planning.next_recording import Next
from sandbox.gap.posterior.estimates import Estimate, spread
from sandbox.gap.posterior.hypotheses import LISTED, UNKNOWN, Hypothesis
from sandbox.gap.posterior.remainder import remainder
from sandbox.gap.posterior.sets import Set
from sandbox.gap.report.answers import Answers
from sandbox.gap.report.inclusion import summed
from sandbox.gap.report.ranking import Ranking
from sandbox.gap.report.shares import DRAWS, Share, Shares, interval_of
from sandbox.output.sentences import capital


def with_offsets(a: Answers) -> Answers:
    """Return answers in which offsets that differ between recordings are an effect; as they are
    where none do."""
    d, drift = a.diagnosis, a.diagnosis.drift
    if drift is None:
        return a
    named = renamed(d, drift)
    ranked = None if a.ranking is None else included(a.ranking, drift.chance)
    if not named.offsets_named:
        return replace(a, diagnosis=named, ranking=ranked)
    own = share_of(drift.whole.normal, drift.without)
    scaled = [replace(p, share=(1.0 - own.value) * p.share) for p in a.parts]
    parts = [p for p in scaled if p.share >= LEAST]
    said = [
        f for p in parts for f in sentences(p.subsystem, p.share, p.left, of_readings=p.of_readings)
    ]
    if ranked is not None:
        ranked = replace(
            ranked,
            shares=Shares(_shares(ranked.shares.of, own), _waterfall(ranked.shares, own, d, named)),
            rivals={with_offset(k): _shares(of, own) for k, of in ranked.rivals.items()},
            of_best=tuple(e for e in named.best.effects if e != UNKNOWN),
            by_recording=by_recording(named),
        )
    found = sorted([_finding(named, own), *said], key=lambda f: -f.share)
    return replace(
        a,
        diagnosis=named,
        where=tuple(found),
        parts=tuple(parts),
        ranking=ranked,
        following=parting(a.following),
    )


def parting(following: Next | None) -> Next | None:
    """Return a planned recording by the sets that it separates, with the effect; None where they
    differ by it alone."""
    if following is None:
        return None
    sets = tuple(dict.fromkeys(with_offset(s) for s in following.separates))
    return replace(following, separates=sets) if len(sets) > 1 else None


def included(r: Ranking, chance: float) -> Ranking:
    """Return the list in which every set has the effect beside it with a chance."""
    sets: dict[Set, float] = {}
    for s, p in r.inclusion.sets.items():
        sets[with_offset(s)] = sets.get(with_offset(s), 0.0) + chance * p
        sets[s] = sets.get(s, 0.0) + (1.0 - chance) * p
    return replace(r, inclusion=summed(sets, list(r.inclusion.chances)))


def renamed(d: Diagnosis, drift: Drift) -> Diagnosis:
    """Return a diagnosis whose hypotheses hold the effect; where the best one does its gap is that
    of readings as they are."""
    drifts = library.drifting().name
    merged: dict[Set, tuple[Hypothesis, dict[str, Estimate]]] = {}
    for h, own in zip(d.hypotheses, d.parameters, strict=True):
        both = ((with_offset(h.effects), drift.chance), (h.effects, 1.0 - drift.chance))
        for effects, chance in ((h.effects, 1.0),) if drifts in h.effects else both:
            if chance >= LISTED:
                first, parameters = merged.get(effects, (replace(h, probability=0.0), own))
                p = first.probability + chance * h.probability
                merged[effects] = replace(first, effects=effects, probability=p), parameters
    total = sum(h.probability for h, _ in merged.values())
    ranked = sorted(merged.values(), key=lambda x: (-x[0].probability, x[0].effects))
    found = replace(
        d,
        hypotheses=tuple(replace(h, probability=h.probability / total) for h, _ in ranked),
        parameters=tuple(own for _, own in ranked),
    )
    if drifts not in found.best.effects:
        return found
    noise = 0.0 if d.noise is None else misstated(d.noise)
    return replace(
        found,
        nominal=drift.nominal,
        before=drift.before,
        remainder=remainder(drift.whole, d.best.evaluated.fit, noise),
        size=sized(d.campaign, d.start, drift.nominal, drift.before, d.after, d.held_out),
    )


def with_offset(effects: Set) -> Set:
    """Return the effects of a hypothesis with current_offset among them, `unknown` last."""
    own = sorted({*effects, library.drifting().name} - {UNKNOWN})
    return (*own, UNKNOWN) if UNKNOWN in effects else tuple(own)


def share_of(with_it: NormalEquations, without: NormalEquations) -> Share:
    """Return the share of the gap that offsets by recording have, with its interval over
    recordings."""
    (a, n), (b, _) = with_it.by_recording(), without.by_recording()
    pick = np.random.default_rng(1).integers(len(n), size=(DRAWS, len(n)))
    gap = float(a.sum() - n.sum())
    with np.errstate(invalid="ignore", divide="ignore"):
        drawn = (a - b)[pick].sum(1) / (a - n)[pick].sum(1)
    low, high = interval_of(np.minimum(drawn, 1.0)[None])[:, 0] if len(n) > 1 else (math.nan,) * 2
    value = min(1.0, float(a.sum() - b.sum()) / gap)
    return Share(value, float(low), float(high), value)


def by_recording(d: Diagnosis) -> dict[str, dict[str, Estimate]]:
    """Return by recording what each of the three sensors reads too much, the campaign's own and
    what the recording differs by, with intervals; empty where that is no effect."""
    if d.drifting is None or not d.offsets_named:
        return {}
    card, j, out = library.drifting(), d.best.evaluated, dict[str, dict[str, Estimate]]()
    s, values = spread(j), j.fit.point.values
    own = [card.public(1, p.name) for p in card.parameters]  # of sensors a and b
    a, b = (values[name] for name in own)
    deviation = max(s.sd[s.place[name]] for name in own if name in s.place)
    for file in d.drifting.seen:
        width = Z95 * math.hypot(deviation, d.drifting.errors[file])
        total = np.add(d.drifting.offsets[file], (a, b, -a - b)) + values["bench.common_offset"]
        names = [card.public(1, f"offset_{p}") for p in "abc"]
        out[file] = {
            name: Estimate(x, x - width, x + width, "A")
            for name, x in zip(names, total.tolist(), strict=True)
        }
    return out


def _shares(of: Mapping[str, Share], own: Share) -> dict[str, Share]:
    """Return shares of the whole gap, the largest first; of the campaign's own offset with what
    recordings differ by."""
    kept = 1.0 - own.value
    scaled = {e: Share(*(kept * x for x in share)) for e, share in of.items()}
    drifts = library.drifting().name
    apart = scaled.get(drifts)
    scaled[drifts] = own if apart is None else Share(*map(add, own, apart))
    return dict(sorted(scaled.items(), key=lambda x: -x[1].value))


def _waterfall(
    shares: Shares, own: Share, d: Diagnosis, named: Diagnosis
) -> tuple[tuple[str, float], ...]:
    """Return the residual after each effect, the largest share first: squares of what recordings
    differ by stand in all before it."""
    ranked, drifts = _shares(shares.of, own), library.drifting().name
    apart = named.size.before**2 - d.size.before**2
    known = {e: j**2 for e, j in shares.waterfall}
    squares, on, out = d.size.before**2, True, []
    for e in ranked:
        squares, on = known.get(e, squares), on and e != drifts
        if e == drifts or e in known:
            out.append((e, math.sqrt(squares + apart * on)))
    return tuple(out)


def _finding(d: Diagnosis, own: Share) -> Finding:
    assert d.drifting is not None
    text = (
        f"{percent(own.value)} of the gap is what offsets of the current sensors differ by from "
        f"recording to recording: {d.drifting.named} beside their median. This points to the "
        "sensors."
    )
    return Finding("sensor", "currents", "all speeds", 1.0, own.value, capital(text))
