"""Neither names nor order of recordings change a digit of a diagnosis; a name that foretells worse
is not given."""

import dataclasses
from types import SimpleNamespace

import pytest

from sandbox.gap import diagnose as module
from sandbox.gap.diagnose import _foretelling, diagnosis_of
from sandbox.gap.posterior.hypotheses import UNKNOWN, Hypothesis


def test_shuffled_and_renamed_recordings_give_the_same_digits(small_answers):
    first = small_answers.diagnosis
    own = first.campaign.recordings
    names = {r.file: f"z{k}.parquet" for k, r in enumerate(reversed(own))}
    turned = tuple(dataclasses.replace(r, file=names[r.file]) for r in own[::-1])
    again = diagnosis_of(
        dataclasses.replace(first.campaign, recordings=turned), exclude=first.excluded
    )
    assert [(h.effects, h.probability) for h in again.hypotheses] == [
        (h.effects, h.probability) for h in first.hypotheses
    ]
    assert again.size.closed == first.size.closed
    assert again.parameters == first.parameters
    own_rms = {r.file: r for r in again.size.recordings}
    for r in first.size.recordings:
        assert own_rms[names[r.file]] == r._replace(file=names[r.file])


def test_a_name_that_foretells_worse_than_none_is_not_given(monkeypatch):
    """The first set leaves 1.3 on recordings held out where ordinary deviations leave 1.2; the
    second 1.1."""
    rms = {(): 1.2, ("iron_loss",): 1.3, ("dead_time",): 1.1}
    monkeypatch.setattr(
        module,
        "_without",
        lambda whole, start, left, workers: SimpleNamespace(normal=whole.effects),
    )
    monkeypatch.setattr(module, "rms", lambda n, left: rms[n])
    models = {k: SimpleNamespace(effects=k, fit=SimpleNamespace(effects=k)) for k in rms}
    told = [
        Hypothesis(("iron_loss",), 0.5, models["iron_loss",]),
        Hypothesis(("iron_loss", UNKNOWN), 0.2, models["iron_loss",]),
        Hypothesis(("dead_time",), 0.25, models["dead_time",]),
        Hypothesis((), 0.05, models[()]),
    ]
    before = SimpleNamespace(normal=())
    left, after = _foretelling(told, before, None, (0,), 1)
    assert left[0].effects == (UNKNOWN,)
    assert after is before
    assert {h.effects: h.probability for h in left} == pytest.approx(
        {(UNKNOWN,): 0.7, ("dead_time",): 0.25, (): 0.05}
    )
