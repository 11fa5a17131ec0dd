"""The whole list on the page: effects with their chances and shares, the waterfall, groups that cannot be parted."""

from __future__ import annotations

import math
from collections.abc import Iterator

from model.effects import library
from sandbox.gap.report.answers import Answers
from sandbox.gap.report.ranking import Ranking
from sandbox.gap.report.words import capital, names, quantity, words

POSITION_NOTE = (
    "Mean position error under rated load, in electrical degrees, that each effect alone adds in the closed loop: low "
    "speed with injection (qnull, ekf), half of rated speed (active_flux). All believe the nominal model."
)
MOST = 2  # parameters that stand in the list itself
HIDES = 0.02  # negative share from which an effect is said to hide others
SHOWN = 0.01  # chance below which an effect is not listed


def rows(r: Ranking) -> list[list[str]]:
    """Return rows of effect, chance, share of the gap, size, for effects that may be there."""
    out = []
    for effect, chance in r.inclusion.chances.items():
        if chance >= SHOWN:
            share = r.shares.of.get(effect)
            told = "–" if share is None else f"{percent(share.value)} [{percent(share.low)}, {percent(share.high)}]"
            own = r.parameters.get(effect, {})
            size = ", ".join(f"{library.title(k)} {quantity(e)}" for k, e in own.items())
            size = size if len(own) <= MOST else f"{len(own)} numbers, below"
            out.append([words(effect), f"{100.0 * chance:.1f} %", told, size or "–"])
    if r.unknown >= SHOWN:
        out.append(["something outside the library", f"{100.0 * r.unknown:.1f} %", percent(r.unexplained), "–"])
    return out


def position_rows(r: Ranking) -> tuple[list[str], list[list[str]]]:
    """Return heads and rows of how far each effect alone moves the position error of each estimator."""
    estimators = list(dict.fromkeys(name for own in r.moved.values() for name in own))
    out = []
    for effect, own in r.moved.items():
        cells = []
        for name in estimators:
            m = own.get(name)
            cells.append("–" if m is None else f"{m.mean_deg:+.2f}°" if math.isfinite(m.mean_deg) else "lost")
        out.append([words(effect), *cells])
    return ["effect", *estimators], out if estimators else []


def percent(x: float) -> str:
    """Return a share as a number of percent."""
    return "–" if not math.isfinite(x) else f"{100.0 * x:.1f} %"


def hidden_sentence(r: Ranking) -> str:
    """Return which effects hide others, so that the gap would be larger without them; '' where none does."""
    own = [e for e, share in r.shares.of.items() if share.value < -HIDES]
    if not own:
        return ""
    told, verb, them = names(own).replace(" + ", " and "), *(("hides", "it") if len(own) == 1 else ("hide", "them"))
    return (
        f"{capital(told)} {verb} a part of what other effects do: without {them} the gap would be larger, so the share "
        "is negative."
    )


def group_sentences(r: Ranking) -> Iterator[str]:
    """Yield which effects cannot be parted here, and the recording that parts them."""
    for group, chance in r.inclusion.groups:
        how = "; ".join(f"for {words(e)}: {library.load_effect(e).separated_by}" for e in group)
        yield f"One of {names(group).replace(' + ', ' or ')} is there ({100.0 * chance:.0f} %). To part them, {how}."


def waterfall(a: Answers) -> tuple[list[str], list[float]]:
    """Return labels and normalised rms on the recordings held out: before, after each effect, and noise."""
    r, size = a.ranking, a.diagnosis.size
    if r is None or not r.shares.waterfall:
        return [], []
    steps = [(f"+ {words(e)}", j) for e, j in r.shares.waterfall if math.isfinite(j)]
    return ["before", *(s for s, _ in steps), "noise"], [size.before, *(j for _, j in steps), 1.0]
