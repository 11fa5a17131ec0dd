"""The badge and the answer to "which": what `unknown` is called, and that both and the next step agree."""

from types import SimpleNamespace

import pytest

from sandbox.gap.diagnose import Diagnosis
from sandbox.gap.report import answers
from sandbox.gap.report.which import BADGES, badge, which_text


def diagnosis(*told, closed=0.5):
    """A diagnosis of these (effects, probability)."""
    hypotheses = [SimpleNamespace(effects=e, probability=p, judged=SimpleNamespace(effects=A)) for e, p in told]
    own = SimpleNamespace(
        hypotheses=hypotheses, best=hypotheses[0], size=SimpleNamespace(closed=closed), out_of_sight=(),
        parameters=[{}], judged=(), campaign=SimpleNamespace(limits=None),
    )  # fmt: skip
    own.ambiguity_set = Diagnosis.ambiguity_set.fget(own)
    return own


U, A, AU = ("unknown",), ("dead_time",), ("dead_time", "unknown")


@pytest.mark.parametrize(
    ("told", "closed", "expected"),
    [
        ([(U, 0.97)], None, "unknown"),
        ([(U, 0.51), (A, 0.49)], 0.5, "unknown"),
        ([(U, 0.45), (A, 0.30), ((), 0.25)], 0.5, "ambiguous"),  # less than half: not "not in the library"
        ([(U, 0.40), (AU, 0.15), (A, 0.45)], 0.5, "ambiguous"),  # the most probable is A alone
        ([(U, 0.46), (AU, 0.10), (A, 0.44)], 0.98, "unknown"),  # 0.56 in all
        ([(U, 0.97)], 0.991, "ambiguous"),  # hardly anything is left
        ([(U, 0.97)], 0.989, "unknown"),
        ([(AU, 0.9), (A, 0.1)], 0.999, "explained_in_part"),
        ([(AU, 0.45), (A, 0.40), ((), 0.15)], 0.9, "ambiguous"),
        ([(A, 0.97)], 0.999, "explained"),
        ([((), 0.97)], None, "no_gap"),
    ],
)
def test_not_in_the_library_is_said_only_where_it_is(told, closed, expected):
    told.sort(key=lambda x: -x[1])
    d = diagnosis(*told, closed=closed)
    assert badge(d) == expected
    assert expected in BADGES
    if expected != "unknown":
        assert "None in the library" not in which_text(d)


def test_the_answer_agrees_with_what_is_recommended():
    """Kept row of a blind check: `unknown` alone, or beside a ripple of the link and dead time."""
    d = diagnosis((U, 0.88), (("dc_link_ripple", "dead_time", "unknown"), 0.10), closed=0.4)
    said = which_text(d)
    assert said.startswith("None for sure: that something outside the library is at work is 98 % probable.")
    assert said.endswith("Perhaps DC link ripple + dead time with something outside the library (10 %).")
    a = SimpleNamespace(diagnosis=d, following=None, verdict="unknown")
    assert answers.next_text(a).startswith("Recordings that show more, for DC link ripple:")
    alone = diagnosis((U, 0.98))
    assert which_text(alone).startswith("None in the library")
    assert answers.next_text(SimpleNamespace(diagnosis=alone, following=None, verdict="unknown")) == (
        "No effect is known that a recording could confirm."
    )


def test_what_closes_nearly_all_is_told():
    assert which_text(diagnosis((U, 0.97), closed=0.991)) == (
        "None for sure: that something outside the library is at work is 97 % probable, although with dead time 99.1 % "
        "of the gap closes."
    )


def test_less_than_half_is_told_as_an_ambiguity():
    said = which_text(diagnosis((U, 0.40), (A, 0.35), ((), 0.25)))
    assert said == (
        "These recordings cannot tell apart: something outside the library (40 %); or dead time (35 %); or no effect "
        "(25 %)."
    )
