"""Neither names nor order of recordings change a digit of a diagnosis; a name that foretells worse
is not given."""

import dataclasses
from types import SimpleNamespace

import numpy as np
import pytest

from sandbox.gap.diagnose import diagnosis_of, passing_holdout
from sandbox.gap.posterior.hypotheses import UNKNOWN, Hypothesis
from tests.sandbox.gap.sizes import fit_with


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


def test_a_name_that_foretells_worse_than_none_is_not_given():
    """The first set leaves 1.3 on recordings held out where ordinary deviations leave 1.2; the
    second 1.1."""
    rms = {(): 1.2, ("iron_loss",): 1.3, ("dead_time",): 1.1}
    without = {k: fit_with(np.full(4, x * x), k) for k, x in rms.items()}
    of = {k: SimpleNamespace(effects=k, fit=k) for k in rms}
    told = [
        Hypothesis(("iron_loss",), 0.5, of["iron_loss",]),
        Hypothesis(("iron_loss", UNKNOWN), 0.2, of["iron_loss",]),
        Hypothesis(("dead_time",), 0.25, of["dead_time",]),
        Hypothesis((), 0.05, of[()]),
    ]
    left, after = passing_holdout(told, without[()], without.__getitem__, (0,))
    assert left[0].effects == (UNKNOWN,)
    assert after is without[()]
    assert {h.effects: h.probability for h in left} == pytest.approx(
        {(UNKNOWN,): 0.7, ("dead_time",): 0.25, (): 0.05}
    )
