"""Which effect causes the gap: in one sentence, and as the badge at a page's head."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from model.effects import library
from sandbox.gap.diagnose import Diagnosis, verdict
from sandbox.gap.location.where import percent
from sandbox.gap.posterior.hypotheses import UNKNOWN, Hypothesis
from sandbox.gap.unstated.offsets_said import ByRecording, sized
from sandbox.gap.words import likely, listing, names, percent_fine, sizes, tenths, words
from sandbox.output.sentences import capital

HALF = 0.5  # chance of `unknown` below which it is not what most probably is at work
FEW = 3  # effects whose sizes a sentence holds; more stand in the list of effects alone
MANY = 5  # sets, or doubtful effects, that a sentence names; of more it says how many there are
# chance of `unknown` from which it is told beside "no gap": what a list that holds 95 % may leave
# out
OPEN = 0.05
Rivals = Mapping[tuple[str, ...], Mapping[str, float]]  # shares by set, as it is written
SEEN = 0.005  # share of the gap from which the sentence gives it
NEARLY_ALL = 0.99  # share of the gap: what closes so much leaves no room for "not in the library"


def chance_of_unknown(d: Diagnosis) -> float:
    """Return the probability that something outside the library is at work, alone or beside named
    effects."""
    return sum(h.probability for h in d.hypotheses if UNKNOWN in h.effects)


def badge(d: Diagnosis) -> str:
    """Return a key of VERDICTS: the verdict, one word everywhere; what is known beside it stands in
    the sentence."""
    return verdict(d)


def which_text(
    d: Diagnosis,
    shares: Mapping[str, float] | None = None,
    chances: Mapping[str, float] | None = None,
    rivals: Rivals | None = None,
    by_recording: ByRecording | None = None,
) -> str:
    """Return which effect causes it, or that none does, or that it cannot be told; and which were
    no candidates.

    shares: of the gap, by effect of the best hypothesis; chances: of effects, as the list of all of
    them has them; rivals: shares in the other likely sets; by_recording: offsets that differ.
    """
    of_sets = {**(rivals or {}), tuple(_named(d.best)): shares or {}}
    drifts = sized(by_recording) if by_recording else ""
    listed = _which(d, shares or {}, chances or {}, of_sets, drifts) + _hidden(d.out_of_sight)
    return f"{_drifted(d)}{listed}"


def _drifted(d: Diagnosis) -> str:
    """Return that offsets of the current sensors differ between recordings: an effect that drifts,
    where it is named as no effect."""
    named = d.drifting.named if d.drifting is not None and not d.offsets_named else ""
    first = f"Current offset, another in each recording ({named}), was taken off first."
    return f"{first} What else? " if named else ""


def _hidden(hidden: Sequence[str]) -> str:
    """Return which effects were no candidates, and why, with a blank before each sentence."""
    motion = [e for e in hidden if library.load_effect(e).subsystem == "mechanics"]
    angle = [e for e in hidden if e not in motion]
    text = (
        f" No rotor turned freely: {', '.join(map(words, motion))} were no candidates."
        if motion
        else ""
    )
    return text + (
        f" No angle was read: {', '.join(map(words, angle))} were no candidates." if angle else ""
    )


def _which(
    d: Diagnosis,
    shares: Mapping[str, float],
    chances: Mapping[str, float],
    of_sets: Rivals,
    drifts: str,
) -> str:
    best, named = d.best, verdict(d)
    if named == "no_gap":
        others = [h for h in d.ambiguity_set if _named(h) and UNKNOWN not in h.effects]
        text = f"None: ordinary deviations alone are {likely(best.probability)}."
        text += f" Too slight to exclude: {_listed(others, ', ', of_sets)}." if others else ""
        outside = chance_of_unknown(d)
        return (
            f"{text} Something outside the library is {likely(outside)}."
            if outside >= OPEN
            else text
        )
    if named == UNKNOWN and chance_of_unknown(d) >= HALF:
        return _outside(d, shares, of_sets)
    if named in (UNKNOWN, "ambiguous"):
        sure = sorted(set.intersection(*(set(h.effects) for h in d.ambiguity_set)) - {UNKNOWN})
        if len(sure) >= FEW:
            first = f"{len(sure)} effects are in every likely set. {_by_share(sure, shares)}"
            return f"{first} Not sure beside them: {_disputed(d, sure, chances)}."
        if sure and set(_named(best)) == set(sure):
            verb, them = ("is", "it") if len(sure) == 1 else ("are", "them")
            first = f"{capital(_with_shares(sure, shares))} {verb} in every likely set"
            return f"{first}. Not sure beside {them}: {_disputed(d, sure, chances)}."
        listed = _listed(d.ambiguity_set, "; or ", of_sets)
        return f"These recordings cannot tell apart: {listed}."
    if len(best.effects) > FEW:
        return (
            f"{len(best.effects)} effects at once, {likely(best.probability)}. "
            f"{_by_share(best.effects, shares)}"
        )
    known = [sizes(d.parameters[0])] if d.parameters[0] or not drifts else []
    return (
        f"{capital(_with_shares(best.effects, shares))}, {likely(best.probability)}: "
        f"{'; '.join(filter(None, [*known, drifts]))}."
    )


def by_share(effects: Sequence[str], shares: Mapping[str, float]) -> list[str]:
    """Return effects in the order of their share of the gap, the largest first, and `unknown` last;
    without shares as they are."""
    return sorted(effects, key=lambda e: (e == UNKNOWN, -shares.get(e, 0.0)))


def _with_shares(effects: Sequence[str], shares: Mapping[str, float]) -> str:
    """Return a few effects, the largest share of the gap first, each with it where it is known."""
    if not any(shares.get(e, 0.0) for e in effects):
        return names(effects)
    return " + ".join(
        f"{words(e)} ({tenths(shares.get(e, 0.0))} of the gap)" for e in by_share(effects, shares)
    )


def _by_share(effects: Sequence[str], shares: Mapping[str, float]) -> str:
    """Return many effects in one sentence, the largest share of the gap first, and where their
    sizes are."""
    ranked = by_share(effects, shares)
    large = [f"{words(e)} ({tenths(shares[e])})" for e in ranked if abs(shares.get(e, 0.0)) >= SEEN]
    small = [words(e) for e in ranked if not abs(shares.get(e, 0.0)) >= SEEN]
    first = f"By their share of the gap: {', '.join(large)}" if large else ""
    rest = f"{'with hardly any' if large else 'They are'}: {', '.join(small)}" if small else ""
    return f"{'; '.join(x for x in (first, rest) if x)}. Their sizes stand below."


def _disputed(d: Diagnosis, sure: Sequence[str], chance_of: Mapping[str, float]) -> str:
    """Return what only some of the likely hypotheses hold beside effects that all of them do, with
    its chance: the one that was told, or else the sum over hypotheses."""
    held = {e for h in d.ambiguity_set for e in h.effects} - set(sure)
    chances = {
        e: chance_of.get(e, sum(h.probability for h in d.hypotheses if e in h.effects))
        for e in held
    }
    ranked = sorted(held, key=lambda e: (-chances[e], e))
    said = {e: "something outside the library" if e == UNKNOWN else words(e) for e in held}
    listed = [f"{said[e]} ({percent(chances[e])})" for e in ranked[:MANY]]
    if len(ranked) > MANY:
        listed.append(f"{len(ranked) - MANY} more of at most {percent(chances[ranked[MANY]])} each")
    return ", ".join(listed)


def _outside(d: Diagnosis, shares: Mapping[str, float], of_sets: Rivals) -> str:
    """Return the answer where something outside the library is more likely than not."""
    chance, named = likely(chance_of_unknown(d)), _named(d.best)
    if named:
        besides = f"Something outside the library is at work, {chance}"
        return (
            f"{besides}; beside it, and less surely the more there is of it: "
            f"{_with_shares(named, shares)}."
        )
    outside = f"that something outside the library is at work is {chance}"
    if _hardly_open(d):
        closed = percent_fine(d.size.closed or 0.0)
        outside += f", although with {names(d.best.evaluated.effects)} {closed} of the gap closes"
    others = [h for h in d.ambiguity_set if h.effects != (UNKNOWN,)]
    if not others:
        return f"{'None for sure' if _hardly_open(d) else 'None in the library'}: {outside}."
    return f"None for sure: {outside}. Perhaps {_listed(others, '; or ', of_sets)}."


def _hardly_open(d: Diagnosis) -> bool:
    return (d.size.closed or 0.0) >= NEARLY_ALL


def _named(h: Hypothesis) -> list[str]:
    return [e for e in h.effects if e != UNKNOWN]


def _listed(chosen: Sequence[Hypothesis], between: str, of_sets: Rivals) -> str:
    """Return hypotheses with their probabilities, the shares of the gap of each one's effects in
    the order of these, and `unknown` beside effects in words; of more than MANY how many there are.
    """
    texts = [_words(h, of_sets.get(tuple(_named(h)), {})) for h in chosen[:MANY]]
    if rest := chosen[MANY:]:
        texts.append(
            f"{len(rest)} more sets ({percent(sum(h.probability for h in rest))} together)"
        )
    return between.join(texts)


def doubtful(d: Diagnosis) -> list[str]:
    """Return the effects that only some of the likely hypotheses hold, the likeliest first."""
    own = [set(_named(h)) for h in d.ambiguity_set]
    some = set[str]().union(*own) - set[str].intersection(*own)
    chance = {e: sum(h.probability for h in d.hypotheses if e in h.effects) for e in some}
    return sorted(some, key=lambda e: (-chance[e], e))


def _words(h: Hypothesis, shares: Mapping[str, float]) -> str:
    ranked = by_share(_named(h), shares)
    text, chance = names(ranked), percent(h.probability)
    if UNKNOWN in h.effects:
        outside = "something outside the library"
        text = f"{text} with {outside}" if ranked else outside
    known = [tenths(shares[e]) for e in ranked if e in shares]
    return f"{text} ({chance}{f'; of the gap {listing(known)}' if known else ''})"
