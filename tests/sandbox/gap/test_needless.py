"""A set is weighed without the effects that do nothing in it."""

from dataclasses import replace
from types import SimpleNamespace

from sandbox.gap.evidence.fit import fit
from sandbox.gap.evidence.holdout import weights_of
from sandbox.gap.evidence.normal import Point
from sandbox.gap.evidence.probes import Probe
from sandbox.gap.search import needless as needless_
from sandbox.gap.search.forward import Search
from sandbox.gap.search.judged import judge
from sandbox.gap.search.needless import doubted, needless, with_fewer
from sandbox.gap.search.points import towards
from sandbox.plant.sets import complete
from sandbox.replay.replay import prepare
from tests.sandbox.gap.conftest import CASES, DRIVE, small_campaign

PLANTED = {"dead_time.time": 1.0e-6}


def searched(key):
    """Return a search whose only set was fitted to a bench with a dead time; and the weights."""
    prepared = prepare(small_campaign(PLANTED, CASES[:2]))
    weights = weights_of(len(prepared.recordings))
    chosen = tuple(Probe(e, {}) for e in ("current_gain", "dead_time", "stator_resistance"))
    there = fit(Point(prepared, complete(DRIVE.motor, DRIVE.converter)), key, weights)
    named = judge(there, chosen, 0.01, weights, 1)
    return Search(there, (named,), 0.0, frozenset({key}), chosen, 0.01), weights


def test_two_effects_that_do_nothing_are_left_out_together():
    """The bench has a dead time alone: the set of three is weighed without the other two, and is more probable so."""
    found, weights = searched(("current_gain", "dead_time", "stator_resistance"))
    assert needless(found.judged[0]) == ("current_gain", "stator_resistance")
    new = with_fewer(found, 5.0, weights)
    assert [j.effects for j in new.judged] == [found.judged[0].effects, ("dead_time",)]
    assert new.judged[1].log_evidence > new.judged[0].log_evidence
    assert ("dead_time",) in new.fitted
    assert new.simulations > 0.0


def test_needless_effects_are_taken_out_one_by_one_where_all_are_too_many(monkeypatch):
    """Without both the set is told to be less probable, without either more.  The better of the two is gone on from,
    where one effect may be nothing again; the set without it was weighed before."""
    told = {"abc": 0.0, "a": -5.0, "ab": 1.0, "ac": 2.0}
    nothing = {"abc": ("b", "c"), "ac": ("c",)}
    asked = []

    def set_of(key):
        """A weighed set by its effects."""
        return SimpleNamespace(effects=tuple(key), fit=SimpleNamespace(simulations=1.0), simulations=2.0)

    monkeypatch.setattr(needless_, "level", lambda j, t: told["".join(j.effects)])
    monkeypatch.setattr(needless_, "needless", lambda j: nothing["".join(j.effects)])
    monkeypatch.setattr(needless_, "doubted", lambda j, t: ())
    monkeypatch.setattr(Search, "remainder", lambda self, fit: SimpleNamespace(unknown=0.0))
    monkeypatch.setattr(needless_, "_fewer", lambda best, key, *_: asked.append("".join(key)) or set_of(key))
    found = with_fewer(Search(None, (set_of("abc"),), 0.0, frozenset(), (), 0.01), 5.0, {})
    assert asked == ["a", "ac", "ab"]
    assert ["".join(j.effects) for j in found.judged] == ["abc", "a", "ac", "ab"]
    assert found.simulations == 9.0


def test_a_set_without_a_saturation_has_none():
    """A motor with no alphas: they are no ordinary deviations, and have no coordinate where no effect claims them."""
    motor = replace(DRIVE.motor, alpha_12=0.0, alpha_22=0.0, alpha_30=0.0, alpha_40=0.0, alpha_04=0.0)
    drive = replace(DRIVE, motor=motor)
    prepared = SimpleNamespace(campaign=replace(small_campaign({}, CASES[:1]), drive=drive))
    values = complete(motor, drive.converter, {"saturation.alpha_12": 7.0, "dead_time.time": 1e-6})
    at = SimpleNamespace(effects=("dead_time", "saturation"), point=Point(prepared, values))
    without = towards(at, ("dead_time",), ()).values
    assert without["saturation.alpha_12"] == without["cross_saturation.alpha_12"] == 0.0
    assert without["dead_time.time"] == 1e-6
    still = towards(at, ("cross_saturation", "dead_time"), ()).values
    assert still["saturation.alpha_12"] == still["cross_saturation.alpha_12"] == 7.0


def test_an_effect_that_is_there_stays():
    """And a set of one effect is not weighed without it: ordinary deviations alone always are."""
    found, weights = searched(("dead_time",))
    assert needless(found.judged[0]) == ()
    assert with_fewer(found, 5.0, weights) == found


def test_an_effect_in_doubt_is_one_that_the_equations_hardly_need():
    """The bench has a dead time alone: the other two of three are in doubt, the dead time is not."""
    found, _ = searched(("current_gain", "dead_time", "stator_resistance"))
    assert doubted(found.judged[0], 1.5) == ("current_gain", "stator_resistance")
    alone, _ = searched(("dead_time",))
    assert doubted(alone.judged[0], 1.5) == ()


def test_an_effect_that_was_needed_is_not_asked_for_again(monkeypatch):
    """All three are in doubt by algebra.  Without "a" the set is far worse, without "b" better: "a" is not asked for
    beside "c" alone, as it was needed beside more."""
    told = {"abc": 0.0, "bc": -100.0, "ac": 1.0, "ab": -1.0, "a": 0.5, "c": -100.0}
    asked = []

    def set_of(key):
        """A weighed set by its effects."""
        return SimpleNamespace(effects=tuple(key), fit=SimpleNamespace(simulations=1.0), simulations=2.0)

    monkeypatch.setattr(needless_, "level", lambda j, t: told["".join(j.effects)])
    monkeypatch.setattr(needless_, "needless", lambda j: ())
    monkeypatch.setattr(needless_, "doubted", lambda j, t: j.effects)
    monkeypatch.setattr(needless_, "_fewer", lambda best, key, *_: asked.append("".join(key)) or set_of(key))
    monkeypatch.setattr(Search, "remainder", lambda self, fit: SimpleNamespace(unknown=0.0))
    with_fewer(Search(None, (set_of("abc"),), 0.0, frozenset(), (), 0.01), 5.0, {})
    assert asked == ["bc", "ac", "ab", "a"]


def test_no_effect_is_doubted_beside_something_outside_the_library(monkeypatch):
    """Where the set leaves what only something outside the library explains, `stranger` says what stands beside it."""
    found, weights = searched(("current_gain", "dead_time", "stator_resistance"))
    monkeypatch.setattr(needless_, "needless", lambda j: ())
    monkeypatch.setattr(Search, "remainder", lambda self, fit: SimpleNamespace(unknown=0.95))
    assert with_fewer(found, 5.0, weights).judged == found.judged
