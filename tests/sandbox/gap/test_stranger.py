"""Which effects stay beside something outside the library: by value on planned chances, and with a planted stranger."""

from dataclasses import replace
from types import SimpleNamespace

import pytest

from sandbox.gap import diagnose
from sandbox.gap.evidence.beside import beside
from sandbox.gap.evidence.discrepancy import Remainder
from sandbox.gap.evidence.fit import fit
from sandbox.gap.evidence.holdout import weights_of
from sandbox.gap.evidence.normal import Point
from sandbox.gap.evidence.probes import Probe
from sandbox.gap.search import stranger
from sandbox.gap.search.forward import Search
from sandbox.gap.search.posterior import with_unknown
from sandbox.gap.search.stranger import believed, beside_unknown
from sandbox.gap.search.subsets import Subsets
from sandbox.plant.sets import complete
from sandbox.replay.replay import prepare
from tests.sandbox.gap.conftest import CASES, DRIVE, small_campaign


def planned(worth):
    """Return sets whose log posterior is the sum of what their effects are worth."""
    return SimpleNamespace(weigh=lambda effects: sum(worth[e] for e in effects))


def test_effects_worth_less_than_nothing_are_left_out():
    """Sums by hand: leaving out b and d gains 1 and 2; a and c stay; with none worth anything nothing stays."""
    worth = {"a": 5.0, "b": -1.0, "c": 0.5, "d": -2.0}
    assert believed(planned(worth), ("a", "b", "c", "d")) == ("a", "c")
    assert believed(planned({"a": -0.1, "b": -1.0}), ("a", "b")) == ()
    assert believed(planned({}), ()) == ()


def test_what_stands_beside_unknown_is_what_is_told():
    """Odds by hand: 0.6 of `unknown` 0.5 go beside the set that stays, 0.4 alone; the best set keeps its own half."""
    best, kept = (SimpleNamespace(effects=e) for e in (("a", "b"), ("a",)))
    told = {h.effects: h.probability for h in with_unknown([(1.0, best)], 0.5, 0.6, kept)}
    assert told == pytest.approx({("a", "b"): 0.5, ("a", "unknown"): 0.3, ("unknown",): 0.2})


def test_nothing_is_doubted_where_unknown_is_unlikely(small_answers):
    best = small_answers.diagnosis.best.judged
    assert beside_unknown(None, best, 0.49, 1.0, {}, 1) is best


def test_dead_time_stays_beside_a_stranger(with_a_stranger, monkeypatch):
    """Dead time explains most; the stranger, a current that hangs on the angle, is no reason to doubt it.  An effect
    that was put beside it for nothing goes: what is left is asked for by its name, and judged."""
    j, table = with_a_stranger
    asked = []
    search = SimpleNamespace(judged=(), judge_also=lambda *x: asked.append(x[0]))
    own = replace(j, table=table)
    assert beside_unknown(search, own, 0.9, 1.0, {}, 1) is own
    freed = Subsets(replace(table, equations=beside(table, j.prior).equations), 1.0)
    idle = next(e for e in table.members if freed.weigh(("dead_time", e)) < freed.weigh(("dead_time",)))
    assert believed(freed, ("dead_time", idle)) == ("dead_time",)
    monkeypatch.setattr(stranger, "believed", lambda sets, effects: ())
    beside_unknown(search, own, 0.9, 1.0, {}, 1)
    assert asked == [()]


def test_what_stays_is_not_dismissed_for_the_minimum_it_ends_in_alone():
    """Voltages logged one period before they act.  From no delay at all slopes do not lead to so long a one; from the
    delay of a fit that has a needless effect, too, they stay at it."""
    campaign, period = small_campaign({}, CASES[::3]), DRIVE.converter.sampling_period
    early = tuple(replace(r, columns=logged_early(r.columns)) for r in campaign.recordings)
    start = Point(prepare(replace(campaign, recordings=early)), complete(DRIVE.motor, DRIVE.converter))
    weights, both, delay = weights_of(2), ("dead_time", "pwm_delay"), "pwm_delay.delay"
    near = fit(replace(start, values={**start.values, delay: 2.0 * period}), both, weights)
    search = Search(fit(start, (), weights), (), 0.0, frozenset(), tuple(Probe(e, {}) for e in both), 0.01)
    alone, stays = (search.judge_also(("pwm_delay",), weights, 1, x) for x in (None, near))
    assert alone.fit.point.values[delay] < 0.1 * period
    assert stays.fit.point.values[delay] == pytest.approx(period, rel=0.05)
    assert stays.fit.objective < 0.1 * alone.fit.objective


def logged_early(columns):
    """Return columns of a recording whose voltages stand one row earlier."""
    return {k: x[1:] if k in ("u_alpha", "u_beta") else x[:-1] for k, x in columns.items()}


@pytest.mark.parametrize(("worth", "first", "left"), [(9.0, ("a",), 0.0), (-9.0, ("unknown",), 0.9)])
def test_what_proves_the_best_is_asked_anew_what_it_leaves(monkeypatch, worth, first, left):
    """A set of two leaves much, so that `unknown` has 0.9; of it one effect is believed, fitted again.  Where that fit
    is by far the most probable set, the first had ended in a poor minimum: nothing is left then, and `unknown` has
    nothing.  Else `unknown` keeps what the better fit says, though the other leaves more."""

    def judged(effects, level):
        own = SimpleNamespace(effects=effects)
        return SimpleNamespace(effects=effects, fit=own, level=level, log_evidence=level, tempered=lambda t: level)

    two, alone = judged(("a", "b"), 0.0), judged(("a",), worth)
    unknown = {("a", "b"): 0.9, ("a",): 0.0 if worth > 0.0 else 0.99}
    monkeypatch.setattr(Search, "remainder", lambda found, fit: Remainder(9.0, 0.0, 0.2, unknown[fit.effects]))
    monkeypatch.setattr(diagnose, "level", lambda j, temperature: j.level)
    monkeypatch.setattr(
        diagnose, "_ranked",
        lambda found, *_: (found.judged, [(1.0, max(found.judged, key=lambda j: j.level))], 1.0),
    )  # fmt: skip
    monkeypatch.setattr(diagnose, "beside_unknown", lambda found, best, unknown, *_: alone if unknown > 0.5 else best)
    found = Search(None, (two,), 0.0, frozenset(), (), 0.01)
    all_judged, hypotheses, _, rest = diagnose._weighed(found, 1.0, {}, 1)
    assert hypotheses[0].effects == first
    assert rest.unknown == left
    assert (alone in all_judged) == (worth > 0.0)
