"""What to do about the effects of the likely hypotheses: a sentence each, the largest share of the
gap first."""

from __future__ import annotations

from sandbox.gap.diagnose import Diagnosis
from sandbox.gap.posterior.hypotheses import UNKNOWN
from sandbox.gap.report.ranking import Ranking, advised, ordered
from sandbox.gap.report.which import FEW, HALF, chance_of_unknown, doubtful
from sandbox.gap.words import words
from sandbox.output.sentences import capital, stopped

FIRST = "Find first what is outside the library: it may bend these sizes. Then, "


def todo(d: Diagnosis, r: Ranking | None) -> list[str]:
    """Return what to do about each effect of the likely hypotheses. Behind an "if" where not all of
    them hold it: the FEW likeliest, none where what is at work is most probably outside the
    library, which comes first. Nothing where no effect is named."""
    if r is None or not d.best.effects:
        return []
    own = [set(h.effects) - {UNKNOWN} for h in d.ambiguity_set]
    said, sure = advised(d, r), set.intersection(*own)
    outside = chance_of_unknown(d) >= HALF
    named = sure | set([] if outside else doubtful(d)[:FEW])
    out = []
    for e in ordered(r.inclusion.chances, r.shares.of):
        if e in named and said.get(e):
            head = words(e) if e in sure else f"if it is {words(e)}"
            out.append(stopped(f"{head}: {said[e]}"))
    first = FIRST if outside else ""
    return [
        (first + t if first else capital(t)) if not k else capital(t) for k, t in enumerate(out)
    ]
