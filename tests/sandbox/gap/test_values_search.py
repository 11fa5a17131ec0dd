"""Numbers of the search that adds effect after effect: fits are told by a script, what is done then is looked at."""

from types import SimpleNamespace

import numpy as np
import pytest

from sandbox.gap.evidence.probes import Probe
from sandbox.gap.search import forward
from sandbox.gap.search.forward import Forward
from sandbox.gap.search.neighbours import EXCHANGED
from tests.sandbox.gap.test_values_told import fitted_to

COUNT = 800.0  # readings of `fitted_to`


def fit_of(effects, excess, cost=0.0):
    """A fit that leaves so much above noise's squares, and the normalised rms that goes with it."""
    found = fitted_to(effects, COUNT + excess, {})
    found.normal.segments[0].rr = np.array([COUNT + excess])
    found.simulations = cost
    return found


def under_way(*fits, cost=0.0, **more):
    """A search that has fitted these; the first has no effects and is the only parent unless others are given."""
    given = {"parents": [fits[0]], "chosen": [], "share": 0.01, "weights": {}, "workers": 1, "exclude": ()}
    own = given | {"report": lambda _: None, "cost": cost} | more
    return Forward(fits[0], {f.effects: f for f in fits}, **own)


@pytest.mark.parametrize(("left", "budget"), [(2100.0, 1350), (1900.0, 1700)])
def test_a_search_may_take_longer_where_a_fit_leaves_less_than_a_fifth(left, budget):
    assert under_way(fit_of((), 10000.0), fit_of(("inertia",), left)).budget() == budget


@pytest.mark.parametrize(("gain", "sized"), [(4.9, False), (5.1, True)])
def test_a_size_that_was_tried_begins_a_fit_where_it_gains_half_of_the_promise(gain, sized):
    probe = Probe("dead_time", {"a": 1.0}, {"a": 2.0}, gain)
    assert forward.begin(probe, 10.0) == {"a": 2.0 if sized else 1.0}


@pytest.mark.parametrize(("rms", "asked"), [(1.019, 0), (1.021, 1)])
def test_starts_are_looked_for_anew_two_hundredths_above_the_floor(monkeypatch, rms, asked):
    calls = []
    monkeypatch.setattr(forward, "choose", lambda *given: calls.append(1) or ([Probe("inertia", {})], 7.0))
    known = Probe("dead_time", {}, {"a": 2.0}, 9.0)
    s = under_way(fit_of((), 0.0), chosen=[known])
    s.look(fit_of(("viscous_friction",), COUNT * (rms**2 - 1.0)))
    assert len(calls) == asked
    assert [p.effect for p in s.chosen] == (["inertia"] if asked else ["dead_time"])
    assert s.cost == 7.0 * asked
    assert all((p.sized, p.gain) == (None, 0.0) for p in s.chosen)


@pytest.fixture
def growing(monkeypatch):
    """Return a function that lets a search grow at a depth by told fits; it returns whether one grows on."""
    monkeypatch.setattr(forward, "attempted", lambda at, key, *rest, **more: told[key])
    monkeypatch.setattr(forward, "unbent", lambda point: point)
    monkeypatch.setattr(forward, "replace", lambda point, **_: point)
    monkeypatch.setattr(Forward, "look", lambda self, at: None)
    told = {}

    def grow(s, depth, *new, promised=(50.0,)):
        """new: the fits of the candidates, in their order; promised: of each, the last one of all others."""
        told.update({f.effects: f for f in new})
        promises = (*promised, *[promised[-1]] * len(new))
        found = [(f.effects, s.parents[0], {}, p) for f, p in zip(new, promises, strict=False)]
        monkeypatch.setattr(forward, "_candidates", lambda s: (found, 0.0))
        return forward.grown(s, depth)

    return grow


@pytest.mark.parametrize(("depth", "fitted"), [(0, 3), (1, 3), (2, 2)])
def test_three_sets_are_fitted_of_three_effects_two(growing, depth, fitted):
    s = under_way(fit_of((), 1e5))
    growing(s, depth, *(fit_of((e,), 9e4) for e in "abcd"))
    assert len(s.fits) == 1 + fitted


@pytest.mark.parametrize(("gain", "grows"), [(3.9, False), (4.1, True)])
def test_a_second_effect_gains_two_in_log_evidence(growing, gain, grows):
    """Twice 2 of the objective; a first effect is fitted and grows on whatever it gains."""
    one = fit_of(("a",), 5000.0)
    s = under_way(fit_of((), 10000.0), one, parents=[one])
    assert growing(s, 1, fit_of(("a", "b"), 5000.0 - gain)) == grows
    s = under_way(fit_of((), 10000.0))
    assert growing(s, 0, fit_of(("a",), 10000.0 - gain))


@pytest.mark.parametrize(("second", "parents"), [(990.0, "ab"), (1010.0, "a")])
def test_sets_within_ten_times_the_least_excess_grow_on_two_at_most(growing, second, parents):
    s = under_way(fit_of((), 5000.0))
    assert growing(s, 0, fit_of(("a",), 100.0), fit_of(("b",), second), fit_of(("c",), second))
    assert "".join(p.effects[0] for p in s.parents) == parents


@pytest.mark.parametrize(
    ("left", "promised", "fitted"),
    [
        (990.0, (50.0, 0.0), 1), (1010.0, (50.0, 0.0), 2), (990.0, (1e6, 1e5), 2),
        (990.0, (100.0, 49.0), 1), (990.0, (100.0, 51.0), 2),
    ],
)  # fmt: skip
def test_a_fit_that_leaves_less_than_a_hundredth_ends_the_fitting(growing, left, promised, fitted):
    """But not of a set that promises more than the fit has gained, 49500 of log evidence, nor of one that promises half
    of what this one did: dead time and device drop look alike, and each leaves little of the other."""
    s = under_way(fit_of((), 1e5))
    growing(s, 0, fit_of(("a",), left), fit_of(("b",), 5e4), promised=promised)
    assert len(s.fits) == 1 + fitted


@pytest.mark.parametrize(
    ("cost", "depth", "grows"), [(1340.0, 2, True), (1360.0, 2, False), (1360.0, 1, True), (1360.0, 0, False)]
)
def test_beyond_the_budget_only_a_second_effect_is_tried(growing, cost, depth, grows):
    s = under_way(fit_of((), 1e5), cost=cost)
    assert growing(s, depth, fit_of(tuple("abc"[: depth + 1]), 9e4)) == grows


@pytest.fixture
def weighing(monkeypatch):
    """Return a function that weighs a search's sets; it returns their effects and how many are to be exchanged."""
    asked = []
    monkeypatch.setattr(
        Forward, "judged",
        lambda self, fits: [
            SimpleNamespace(effects=f.effects, fit=f, log_evidence=-f.objective, simulations=0.0) for f in fits
        ],
    )  # fmt: skip
    monkeypatch.setattr(forward, "neighbours", lambda best, fits, known, chosen, most, *_: asked.append(most) or [])
    for name in ("fitted_again", "pointed"):
        monkeypatch.setattr(forward, name, lambda *_: [])
    return lambda s: (["".join(j.effects) for j in forward.weighed(s)], asked)


def test_fits_near_the_leader_are_weighed(weighing):
    """The leader explains 10^5: others may lie 2 x 400 + 0.003 x 10^5 = 1100 of the objective behind it."""
    others = [fit_of((e,), 100.0 + behind) for e, behind in (("a", 0.0), ("b", 1090.0), ("c", 1110.0))]
    assert weighing(under_way(fit_of((), 100.0 + 1e5), *others))[0] == ["a", "b"]


def test_four_fits_at_most_are_weighed(weighing):
    assert weighing(under_way(fit_of((), 1e5), *(fit_of((e,), 100.0) for e in "abcde")))[0] == list("abcd")


@pytest.mark.parametrize(("cost", "exchanged"), [(1490.0, EXCHANGED), (1510.0, 0)])
def test_no_effect_is_exchanged_after_fifteen_hundred_simulations(weighing, cost, exchanged):
    assert weighing(under_way(fit_of((), 1e4), fit_of(("a",), 100.0), cost=cost))[1] == [exchanged] * 2


@pytest.mark.parametrize(("left", "asked"), [(1990.0, 1), (2010.0, 0)])
def test_what_stretches_is_followed_once_most_is_explained(weighing, monkeypatch, left, asked):
    """A fifth of the excess of 10^4."""
    calls = []
    monkeypatch.setattr(forward, "pointed", lambda *_: calls.append(1) or [])
    weighing(under_way(fit_of((), 1e4), fit_of(("a",), left)))
    assert len(calls) == asked
