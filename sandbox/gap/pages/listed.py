"""The whole list on the page: effects with their chances and shares, the waterfall, groups that
cannot be parted."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence

from model.effects import library
from sandbox.gap.planning.next_recording import Next
from sandbox.gap.posterior.estimates import Estimate
from sandbox.gap.posterior.hypotheses import UNKNOWN, Hypothesis
from sandbox.gap.report.answers import Answers
from sandbox.gap.report.position_moved import Moved
from sandbox.gap.report.ranking import Ranking, ordered, parted_by
from sandbox.gap.report.told_apart import SURE, Confused
from sandbox.gap.report.which import FEW, by_share
from sandbox.gap.unstated.offsets_said import sized
from sandbox.gap.words import interval, listing, names, quantity, tenths, words
from sandbox.output.sentences import capital

POSITION_NOTE = (
    "Mean position error under rated load, in electrical degrees, that each effect alone adds in "
    "the closed loop: low speed with injection, half of rated speed (active_flux). In brackets: "
    "by how much its ripple (standard deviation) grows. All three use the nominal motor values. "
    "qnull: null of an injected ripple; ekf: Kalman filter with a motor model; active_flux: flux "
    "behind the voltages."
)
LIST_NOTE = (
    "Probabilities here also count sets of effects that were only estimated, so they can differ "
    "from those of the hypotheses. The interval of a share says how much it differs from "
    "recording to recording; how uncertain the size is does not widen it."
)
FREE_REGRESSION = (
    "Sizes are those beside a free regression, so that what is outside the library does not bend "
    "them. What they are without it stands below, and as `parameters` in diagnosis.json."
)
MAX_PARAMETERS = 2  # parameters that stand in the list itself
# chance by which an effect has to be less probable than the set it is in, for a sentence about it
LESS = 0.1
HIDES = 0.02  # negative share from which an effect is said to cancel others
SHOWN = 0.01  # chance below which an effect is not listed
# chance from which it is said what an effect is confused with; rivals that are named
LISTED, NAMED = 0.5, 3


def rows(r: Ranking) -> list[list[str]]:
    """Return rows of effect, chance, share of the gap, size, for effects that may be there."""
    out = []
    for effect, chance in ordered(r.inclusion.chances, r.shares.of).items():
        if chance >= SHOWN:
            share = r.shares.of.get(effect)
            closing = "–" if share is None else _between(share.value, share.ci95)
            own = [f"{library.title(k)} {quantity(e)}" for k, e in r.sizes(effect).items()]
            size = ", ".join(own) if len(own) <= MAX_PARAMETERS else f"{own[0]}, ..., see below"
            if effect == library.drifting().name and r.by_recording:
                size = sized(r.by_recording)
            out.append([words(effect), f"{100.0 * chance:.1f} %", closing, size or "–"])
    if r.unknown >= SHOWN:
        out.append(
            ["something outside the library", f"{100.0 * r.unknown:.1f} %", _unexplained(r), "–"]
        )
    return out


def _unexplained(r: Ranking) -> str:
    if r.unexplained is None:
        return "–"
    return _between(r.unexplained.value, r.unexplained.ci95)


def _between(share: float, ends: Sequence[float] | None) -> str:
    """Return a share with its interval, alone where there is none."""
    return tenths(share) if ends is None else interval(share, *ends)


def confused_sentences(r: Ranking, neutral: Mapping[str, float]) -> Iterator[str]:
    """Yield which likely effects cannot be told from which others on these recordings; neutral:
    values of no effect."""
    for effect, telling in r.tellings.items():
        if telling is None or telling.tellable or r.inclusion.chances[effect] < LISTED:
            continue
        alike = [x for x in telling.confused_with if x.log_evidence < SURE][:NAMED]
        rivals = ", ".join(f"{_rival(x)} (cosine {x.cosine:.3f})" for x in alike)
        if not rivals and _has_size(effect, r.sizes(effect), neutral):
            yield (
                f"{capital(words(effect))} may be no effect at all: the simulator's own "
                "error could imitate it."
            )
        else:
            yield (
                f"{capital(words(effect))} cannot be told here from "
                f"{rivals or 'no effect at all: it is too small'}."
            )


def _has_size(effect: str, own: Mapping[str, Estimate], neutral: Mapping[str, float]) -> bool:
    """Return whether the interval of one of the sizes that switch an effect on excludes that it is
    off.

    It can exclude that where evidence does not: evidence counts the simulator's own error,
    intervals do not.
    """
    sizes = {name for part in library.load_effect(effect).switched_by for name in part}
    return any(not e.low <= neutral.get(k, 0.0) <= e.high for k, e in own.items() if k in sizes)


def _rival(x: Confused) -> str:
    return (
        words(x.name) if x.kind == "effect" else f"an ordinary deviation ({library.title(x.name)})"
    )


def position_rows(r: Ranking) -> tuple[list[str], list[list[str]]]:
    """Return heads and rows of how far each effect alone moves the position error of each
    estimator."""
    estimators = list(dict.fromkeys(name for own in r.moved.values() for name in own))
    out = []
    for effect in ordered(r.inclusion.chances, r.shares.of):  # as the list of effects has them
        cells, own = [], r.moved.get(effect)
        if own is None:
            continue
        for name in estimators:
            m = own.get(name)
            cells.append("–" if m is None else moved_text(m))
        out.append([words(effect), *cells])
    return ["effect", *estimators], out if estimators else []


def moved_text(m: Moved) -> str:
    """Return a move of the mean error, and of its ripple in brackets."""
    if m.not_run:
        return "not run"
    mean, ripple = (round(x, 2) + 0.0 for x in (m.mean_deg, m.ripple_deg))  # nothing is +0.00
    return f"{mean:+.2f}° ({ripple:+.2f}°)" if math.isfinite(mean) else "lost"


def not_run_sentences(r: Ranking) -> Iterator[str]:
    """Yield which estimators were not run, once for each reason; with which effects, where they ran
    with others."""
    differing: dict[tuple[str, tuple[str, ...]], list[str]] = {}
    for name in dict.fromkeys(n for own in r.moved.values() for n in own):
        reasons: dict[str, list[str]] = {}
        for effect, own in r.moved.items():
            if name in own and own[name].not_run:
                reasons.setdefault(own[name].not_run, []).append(words(effect))
        ran = sum(name in own for own in r.moved.values())
        for why, effects in reasons.items():
            differing.setdefault((why, tuple(effects) if len(effects) < ran else ()), []).append(
                f"`{name}`"
            )
    for (why, those), estimators in differing.items():
        with_ = f" with {listing(those)}" if those else ""
        yield (
            f"{listing(estimators)} {'was' if len(estimators) == 1 else 'were'} not "
            f"run{with_}: {why.rstrip('.')}."
        )


def less_sure_sentence(a: Answers) -> str:
    """Return which effects of the most probable set are less probable than it, and why; '' where
    none is."""
    r, best = a.ranking, a.diagnosis.best
    chances = {} if r is None else r.inclusion.chances
    own = [e for e in best.effects if chances.get(e, 1.0) < best.probability - LESS]
    if not own:
        return ""
    likely = ", ".join(f"{words(e)} ({100.0 * chances[e]:.0f} %)" for e in own)
    if r is not None and r.open_part is not None:
        return (
            "Beside a free regression of what no effect explains, these effects of that set "
            f"are less sure: {likely}."
        )
    return (
        "This list also counts sets that were not fitted, of which the equations say "
        "that they explain nearly as much. "
        f"So these effects of the most probable set are less sure than the set itself: {likely}."
    )


def hidden_sentence(r: Ranking) -> str:
    """Return which effects partly cancel others, so that the gap would be larger without them; ''
    where none does."""
    own = [e for e, share in r.shares.of.items() if share.value < -HIDES]
    if not own:
        return ""
    one = len(own) == 1
    verb, them, theirs = (
        ("cancels", "it", "its share is") if one else ("cancel", "them", "their shares are")
    )
    return (
        f"{capital(listing([words(e) for e in own]))} partly {verb} other effects: without {them} "
        f"the gap would be larger, so {theirs} negative."
    )


def short(h: Hypothesis, all_of_them: Sequence[Hypothesis]) -> str:
    """Return a hypothesis in a sentence below the table of all: many effects as their number and,
    where several have many, the row."""
    named = [e for e in h.effects if e != UNKNOWN]
    if len(named) <= FEW:
        return names(h.effects)
    many = [k for k, x in enumerate(all_of_them, 1) if len(x.effects) > FEW]
    row = f" of row {all_of_them.index(h) + 1}" if len(many) > 1 else ""
    return f"the {len(named)} effects{row} above{' + unknown' if UNKNOWN in h.effects else ''}"


def against_first(
    h: Hypothesis, first: Hypothesis, shares: Mapping[str, float] | None = None
) -> str:
    """Return a hypothesis for the table of all, the largest share of the gap first: one of many
    effects by what it has more and fewer than the first."""
    more, fewer = (
        [e for e in x.effects if e not in y.effects] for x, y in ((h, first), (first, h))
    )
    if (
        not more + fewer
        or len(more + fewer) > FEW
        or min(len(h.effects), len(first.effects)) <= FEW
    ):
        return names(by_share(h.effects, shares or {}))
    texts = [
        f"{word} {listing([words(e) for e in own])}"
        for word, own in (("with", more), ("without", fewer))
        if own
    ]
    return f"as row 1, {', '.join(texts)}"


def group_sentences(r: Ranking, following: Next | None = None) -> Iterator[str]:
    """Yield which effects cannot be parted here, and the recording that parts them: a planned one,
    where it does."""
    for group, chance in r.inclusion.groups:
        parted: dict[str, list[str]] = {}
        for effect, by in parted_by(group, following).items():
            parted.setdefault(by, []).append(words(effect))
        how = "; ".join(f"for {' and '.join(effects)}: {by}" for by, effects in parted.items())
        yield (
            f"One of {names(group).replace(' + ', ' or ')} is there ({100.0 * chance:.0f} "
            f"%). To part them, {how}."
        )


def waterfall(a: Answers) -> tuple[list[str], list[float]]:
    """Return labels and normalised rms on the recordings held out (or all): before, after each
    effect, and noise."""
    r, size = a.ranking, a.diagnosis.size
    if r is None or not r.shares.waterfall:
        return [], []
    steps = [(f"+ {words(e)}", j) for e, j in r.shares.waterfall if math.isfinite(j)]
    return ["before", *(s for s, _ in steps), "noise"], [size.before, *(j for _, j in steps), 1.0]


def waterfall_caption(a: Answers) -> str:
    """Return what the waterfall shows, and on which recordings."""
    on = "the recordings held out" if a.diagnosis.held_out else "all recordings"
    return (
        f"Residual on {on} as effects are added one after the other, the largest first. 1 is noise "
        "alone. A step may go up where effects partly cancel each other. The scale is logarithmic."
    )
