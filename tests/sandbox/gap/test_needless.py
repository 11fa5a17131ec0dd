"""A set is weighed without the effects that do nothing in it."""

from sandbox.gap.evidence.fit import fit
from sandbox.gap.evidence.holdout import weights_of
from sandbox.gap.evidence.normal import Point
from sandbox.gap.evidence.probes import Probe
from sandbox.gap.search.forward import Search
from sandbox.gap.search.judged import judge
from sandbox.gap.search.needless import needless, with_fewer
from sandbox.plant.sets import complete
from sandbox.replay.replay import prepare
from tests.sandbox.gap.conftest import CASES, DRIVE, small_campaign

PLANTED = {"dead_time.time": 1.0e-6}


def searched(key, fitted=()):
    """Return a search whose only set was fitted to a bench with a dead time; and the weights."""
    prepared = prepare(small_campaign(PLANTED, CASES[:2]))
    weights = weights_of(len(prepared.recordings))
    chosen = tuple(Probe(e, {}) for e in ("current_gain", "dead_time", "stator_resistance"))
    there = fit(Point(prepared, complete(DRIVE.motor, DRIVE.converter)), key, weights)
    named = judge(there, chosen, 0.01, weights, 1)
    return Search(there, (named,), 0.0, frozenset({key, *fitted}), chosen, 0.01), weights


def test_two_effects_that_do_nothing_are_left_out_together():
    """The bench has a dead time alone: the set of three is weighed without the other two, and is more probable so."""
    found, weights = searched(("current_gain", "dead_time", "stator_resistance"))
    assert needless(found.judged[0]) == ("current_gain", "stator_resistance")
    new = with_fewer(found, 5.0, weights)
    assert [j.effects for j in new.judged] == [found.judged[0].effects, ("dead_time",)]
    assert new.judged[1].log_evidence > new.judged[0].log_evidence
    assert ("dead_time",) in new.fitted
    assert new.simulations > 0.0


def test_what_was_fitted_is_not_fitted_again():
    found, weights = searched(("dead_time", "stator_resistance"), fitted=[("dead_time",)])
    assert needless(found.judged[0]) == ("stator_resistance",)
    assert with_fewer(found, 5.0, weights) == found


def test_an_effect_that_is_there_stays():
    """And a set of one effect is not weighed without it: ordinary deviations alone always are."""
    found, weights = searched(("dead_time",))
    assert needless(found.judged[0]) == ()
    assert with_fewer(found, 5.0, weights) == found
