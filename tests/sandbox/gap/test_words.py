"""One word for a verdict, whichever it is, on the page, in the terminal, in JSON and in the
documentation."""

import dataclasses
from pathlib import Path

import pytest

from sandbox.gap.pages.page import page_body, print_answers
from sandbox.gap.posterior.estimates import estimates
from sandbox.gap.posterior.evaluated import by_algebra
from sandbox.gap.posterior.hypotheses import Hypothesis
from sandbox.gap.report.answers import which_text
from sandbox.gap.report.diagnosis_json import document
from sandbox.gap.report.ranking import ranking
from sandbox.gap.report.shares import of_set
from sandbox.gap.words import likely, tenths, words
from sandbox.output.schema import json_schema
from sandbox.output.sentences import VERDICTS

OTHER = "device_drop"
ROOT = Path(__file__).resolve().parents[3]


@pytest.mark.parametrize("word", VERDICTS)
def test_one_verdict_word_on_page_terminal_and_json(small_answers, word, capsys):
    """Every verdict that there is, made from one diagnosis by the hypotheses that mean it; the
    documentation's list and the schema hold the same words."""
    d = small_answers.diagnosis
    (own,), j = d.best.effects, d.best.evaluated
    kinds = {
        "no_gap": (((), 0.97), ((own,), 0.03)),
        "explained": (((own,), 0.97), ((), 0.03)),
        "ambiguous": (((own,), 0.6), ((), 0.4)),
        "unknown": (((own, "unknown"), 0.97), ((), 0.03)),
    }
    found = tuple(Hypothesis(effects, p, j) for effects, p in kinds[word])
    of = tuple(d.parameters[0] if h.effects else {} for h in found)
    other = dataclasses.replace(d, hypotheses=found, parameters=of)
    a = dataclasses.replace(small_answers, diagnosis=other)
    print_answers(a)
    assert f": {VERDICTS[word].lower()}\n" in capsys.readouterr().out
    assert f'<span class="badge {word}">{VERDICTS[word]}</span>' in next(page_body(a, "x"))
    told = document(other, a.where, None, whole=a.ranking)
    assert told["verdict"] == told["badge"] == a.verdict == word
    schema = json_schema("diagnosis")["properties"]
    assert sorted(schema["verdict"]["enum"]) == sorted(schema["badge"]["enum"]) == sorted(VERDICTS)
    page = (ROOT / "docs" / "explanation" / "diagnosis.md").read_text()
    assert f"| `{word}` |" in page


def test_sets_that_cannot_be_told_apart_have_shares_each(small_answers):
    """Dead time, or a device's drop by the equations at its point: each set's shares are its own,
    in the sentence and in JSON."""
    d = small_answers.diagnosis
    j = by_algebra(d.best.evaluated, (OTHER,))
    found = (Hypothesis(d.best.effects, 0.6, d.best.evaluated), Hypothesis((OTHER,), 0.4, j))
    both = dataclasses.replace(d, hypotheses=found, parameters=(d.parameters[0], estimates(j)))
    r = ranking(both, position=False)
    assert set(r.rivals) == {(OTHER,)}
    assert r.rivals[(OTHER,)][OTHER].value == pytest.approx(of_set(j)[OTHER].value)
    (first,), second = (tenths(x) for x in r.shares_in(found[0]).values()), r.shares_in(found[1])
    said = which_text(dataclasses.replace(small_answers, diagnosis=both, ranking=r))
    assert said.startswith(
        f"These recordings cannot tell apart: {words(d.best.effects[0])} (60 %; of the gap "
        f"{first}); or device drop (40 %; of the gap {tenths(second[OTHER])})."
    )
    told = document(both, small_answers.where, None, whole=r)
    assert [h["shares"] for h in told["hypotheses"]] == [r.shares_in(h) for h in found]
    assert set(second) == {OTHER}


def test_a_probability_is_rounded_but_never_to_certainty():
    assert [likely(p) for p in (1.0, 0.999, 0.99, 0.5, 0.03, 0.004, 0.0)] == [
        "more than 99 % probable",
        "more than 99 % probable",
        "99 % probable",
        "50 % probable",
        "3 % probable",
        "less than 1 % probable",
        "less than 1 % probable",
    ]
