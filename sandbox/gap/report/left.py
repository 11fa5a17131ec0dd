"""What a diagnosis leaves, in words: its size, its structure, what a free regression beside the
effects takes up."""

from __future__ import annotations

import math

from sandbox.gap.posterior.hypotheses import UNKNOWN
from sandbox.gap.report import which
from sandbox.gap.report.answers import Answers
from sandbox.gap.words import likely, names, percent_fine, times, words
from sandbox.output.sentences import capital

HARDLY = 5e-4  # of what remains: less is nothing
MIN_SHARE = 0.15  # share of a regression below which a kind of functions is not spoken of
ACTING = {
    "current": "a current",
    "voltage": "a voltage",
    "torque": "a torque",
    "encoder": "an error of the encoder",
}
HANGS = {"currents": "the currents", "angle": "the angle", "speed": "the speed"}
ALIKE = 2.0  # variance of sums over that of white noise: less is not spoken of


def remains_text(a: Answers) -> str:
    """Return what the best hypothesis leaves, whether it has structure, and how much of it could
    still be closed."""
    r = a.diagnosis.remainder
    before, after = (math.sqrt(max(0.0, 1.0 + x)) for x in (r.before, r.after))
    best = a.diagnosis.best
    named = best.evaluated.effects or tuple(e for e in best.effects if e != UNKNOWN)
    these = (
        names(named)
        if best.effects == (UNKNOWN,)
        else f"th{'is effect' if len(named) == 1 else 'ese effects'}"
    )
    size = (
        f"With {these} residuals are {times(after)} the noise floor over all recordings "
        f"({before:.3g} before)"
    )
    if not named:
        size = f"Residuals are {times(before)} the noise floor over all recordings"
    chance = which.chance_of_unknown(a.diagnosis)
    said = (
        f"{size}; that something outside the library is at work is {likely(chance)}.",
        taken_up_text(a),
        regression_text(a),
        alike_text(a),
    )
    return " ".join(text for text in said if text)


def regression_text(a: Answers) -> str:
    """Return how much of what remains a free regression explains, and whether that is more than
    noise lets it."""
    r = a.remains
    if r is None:
        return (
            "How much a general fit could still find was not measured: no recording was held out."
        )
    on = "on the recordings held out, a general fit by currents, speed and angle"
    if not r.structure or r.closable is None or r.closable < HARDLY:
        return f"{capital(on)} finds nothing more."
    of_gap = (
        ""
        if r.of_gap is None or not a.diagnosis.best.effects
        else f", {percent_fine(r.of_gap)} of the gap before"
    )
    share = percent_fine(min(r.closable, 1.0))
    return (
        f"{capital(on)} explains {share} of what remains{of_gap}: structure that no effect took up."
    )


def taken_up_text(a: Answers) -> str:
    """Return what a free regression beside the effects takes up, and which effects it changes its
    mind about."""
    own = None if a.ranking is None else a.ranking.open_part
    if own is None:
        return ""
    described = [x for x in own.regression.described if x.share >= MIN_SHARE][:2]
    acts = " and ".join(
        f"{ACTING[x.acts_as]} that depends on {HANGS[x.hangs_on]}" for x in described
    )
    worth = own.regression.worth
    sentence = (
        "stands"
        if worth is None
        else f"predicts {percent_fine(worth)} of it on recordings left out"
    )
    text = f"A free regression fitted beside the effects {sentence}" + (
        f", mostly as {acts}." if acts else "."
    )
    named = [e for e in a.diagnosis.best.effects if e != UNKNOWN]
    gone = [e for e in named if own.chances[e] < 0.5]
    new = [e for e, p in own.chances.items() if p >= 0.5 and e not in named]
    text += (
        f" Beside it these are no longer needed: {', '.join(words(e) for e in gone)}."
        if gone
        else ""
    )
    return text + (f" Beside it these come in: {', '.join(words(e) for e in new)}." if new else "")


def alike_text(a: Answers) -> str:
    """Return that residuals resemble their neighbours, where they do."""
    r = a.remains
    if r is None or r.alike < ALIKE:
        return ""
    return (
        f"Over 50 ms residuals are alike (sums vary {times(r.alike)} as much as those of "
        "white noise)."
    )
