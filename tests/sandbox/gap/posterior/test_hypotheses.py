"""Which sets of effects become hypotheses: all that were fitted, the likeliest of the others."""

from itertools import combinations
from types import SimpleNamespace

from sandbox.gap.posterior import hypotheses
from sandbox.gap.posterior.hypotheses import LISTED, models_of


def test_a_recording_that_tells_little_takes_no_more_memory_than_others(small_answers, monkeypatch):
    """A map's staircase, alone, had thousands of sets above LISTED: 16 GB. Probabilities here are
    chosen; the models are those of a real campaign."""
    best = small_answers.diagnosis.best.evaluated
    found = SimpleNamespace(evaluated={best.effects: best}, best=best)
    others = [e for e in best.model.members if e not in best.effects]
    sets = [(), best.effects, *combinations(others, 1), *combinations(others, 2)]
    entries = [(s, 0.5**k) for k, s in enumerate(reversed(sets))]
    monkeypatch.setattr(hypotheses, "MOST_LISTED", 3)
    models = models_of(found, entries)
    likeliest = [s for s, _ in entries[:3]]
    assert set(models) == {(), best.effects, *likeliest}
    assert models[best.effects] is best
    rare = [(s, 0.5 * LISTED) for s in likeliest]
    assert set(models_of(found, rare)) == {best.effects}
