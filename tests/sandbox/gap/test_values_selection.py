"""Numbers of the search over many effects at once, by a script: fits are told, what is done with them is looked at."""

from types import SimpleNamespace

import pytest

from model.errors import BadInput
from sandbox.gap.evidence.probes import Probe
from sandbox.gap.search import selection
from sandbox.gap.search.forward import Search
from sandbox.gap.search.selection import Selection
from tests.sandbox.gap.test_values_search import COUNT, fit_of


def at_rms(rms, effects=("a",)):
    """A fit with that normalised rms."""
    return fit_of(effects, COUNT * (rms**2 - 1.0))


def selecting(best, raw=0.0, **more):
    """A search that stands at a fit; raw: normalised rms of the nominal model."""
    return Selection(best, more.pop("chosen", []), 0.01, {}, 1, raw, **more)


def test_the_temperature_is_what_is_left_or_one_plus_a_tenth_of_the_raw_gap():
    assert selecting(at_rms(3.0), raw=40.0).temperature() == pytest.approx(9.0)
    assert selecting(at_rms(2.0), raw=40.0).temperature() == pytest.approx(5.0)


@pytest.mark.parametrize(("rms", "asked"), [(4.62, False), (4.54, True), (1.0255, True), (1.0245, False)])
def test_starts_are_looked_for_where_half_the_residual_beyond_noise_is_gone(monkeypatch, rms, asked):
    """From 9 floors, 80 squares beyond noise: at sqrt(1 + 80/4) = 4.58; never where no more is left than a simulator
    may leave: 0.008 and the deviation of 800 readings' squares, 0.05, in quadrature, sqrt(1.05064) = 1.02501."""
    monkeypatch.setattr(selection, "choose", lambda *_: ([Probe("b", {})], 7.0))
    s = selecting(at_rms(rms), looked=9.0)
    assert s.look() == asked
    assert ([p.effect for p in s.chosen], s.cost) == ((["b"], 7.0) if asked else ([], 0.0))


@pytest.mark.parametrize(("gained", "worth"), [(9.9, False), (10.1, True)])
def test_an_effect_more_costs_five_in_log_evidence(gained, worth):
    s = selecting(fit_of(("a",), 0.0))
    assert selection.better(s, fit_of(("a", "b"), -gained)) == worth
    apart = selection.told(s, fit_of(("a", "b"), -gained)) - selection.told(s, s.best)
    assert apart == pytest.approx(0.5 * gained - 5.0)


@pytest.mark.parametrize(("cost", "rounds"), [(0.0, 7), (200.0, 5)])
def test_seven_points_are_looked_at_or_nine_hundred_simulations(monkeypatch, cost, rounds):
    """Each round fits one more effect, better than the set before; at 200 simulations a round the fifth is the last
    that begins within 900."""
    seen = []
    s = selecting(fit_of((), 0.0))

    def fitted(self, key):
        seen.append(key)
        self.cost += cost
        return fit_of(key, -100.0 * len(key))

    monkeypatch.setattr(Selection, "fitted", fitted)
    monkeypatch.setattr(Selection, "table", lambda self: None)
    monkeypatch.setattr(Selection, "look", lambda self: False)
    monkeypatch.setattr(selection, "proposals", lambda s, at: ["abcdefghijkl"[: len(s.best.effects) + 1]])
    selection.select(s, None)
    assert len(seen) == rounds


@pytest.mark.parametrize(("left", "rounds"), [(0.79, 7), (0.81, 6)])
def test_the_simulations_are_counted_anew_where_a_fifth_of_the_residual_beyond_noise_is_gone(monkeypatch, left, rounds):
    """At 300 simulations a round, from an excess of 1e9: at 0.79 a round every round begins a new 900; at 0.81 the
    second one does, no more falls after it, and the sixth is the last that begins within 900 of it."""
    seen = []
    s = selecting(fit_of((), 1e9))

    def fitted(self, key):
        seen.append(key)
        self.cost += 300.0
        return fit_of(key, 1e9 * (left ** len(key) if left < 0.8 or len(key) < 3 else left**2))

    monkeypatch.setattr(Selection, "fitted", fitted)
    monkeypatch.setattr(selection, "better", lambda s, f: True)
    monkeypatch.setattr(Selection, "table", lambda self: None)
    monkeypatch.setattr(Selection, "look", lambda self: False)
    monkeypatch.setattr(selection, "proposals", lambda s, at: ["abcdefghijkl"[: len(s.best.effects) + 1]])
    selection.select(s, None)
    assert len(seen) == rounds


def test_a_point_beside_which_no_drive_can_be_is_gone_back_from(monkeypatch):
    """The third set is the best fit, and has no equations of all effects."""

    def table(self):
        """Refuse the third set."""
        if len(self.best.effects) == 3:
            raise BadInput("no flux of this motor gives the first reading")

    s = selecting(fit_of(("a",), 0.0))
    monkeypatch.setattr(Selection, "fitted", lambda self, key: fit_of(key, -100.0 * len(key)))
    monkeypatch.setattr(Selection, "table", table)
    monkeypatch.setattr(Selection, "look", lambda self: False)
    monkeypatch.setattr(selection, "proposals", lambda s, at: ["abcdefghijkl"[: len(s.best.effects) + 1]])
    selection.select(s, None)
    assert "".join(s.best.effects) == "ab"


class Sets:
    """Sets whose log posteriors are told; those near the best one are known from the start."""

    told: dict[str, float]

    def __init__(self, table, temperature, *, alone=False):
        self.known = {tuple(k): x for k, x in self.told.items()}

    def weigh(self, effects):
        return self.known.setdefault(tuple(effects), -99.0)

    def climb(self, effects):
        return max(self.known, key=lambda k: self.known[k]), 0.0


@pytest.mark.parametrize(
    ("told", "expected"),
    [
        ({"ac": -4.9, "cd": -5.1}, ["ac"]),  # any set: 5 behind
        ({"a": -29.0, "b": -31.0}, ["a"]),  # one effect left out: 30 behind
        ({"abc": 1.9, "abd": 2.1}, ["abd"]),  # one more has to be worth 2
    ],
)
def test_rivals_are_near_the_best_set(monkeypatch, told, expected):
    monkeypatch.setattr(Sets, "told", {"ab": 0.0, **told}, raising=False)
    monkeypatch.setattr(selection, "Subsets", Sets)
    monkeypatch.setattr(selection, "log_prior", lambda effects: 0.0)
    s, best = selecting(fit_of(("a", "b"), 0.0)), SimpleNamespace(effects=("a", "b"), table=None)
    found = selection.rivals(s, best)
    assert ["".join(k) for k in found] == expected
    assert [found[tuple(k)] for k in expected] == [-told[k] for k in expected]


def test_two_sets_that_algebra_prefers_are_proposed(monkeypatch):
    monkeypatch.setattr(Sets, "told", {"a": 0.0, "ab": 1.0, "ac": 2.0, "ad": 3.0, "e": -1.0}, raising=False)
    monkeypatch.setattr(selection, "Subsets", Sets)
    s = selecting(fit_of(("a",), 0.0))
    assert ["".join(k) for k in selection.proposals(s, None)] == ["ad", "ac"]


@pytest.mark.parametrize(("effects", "expected"), [("ab", 1.0), ("abc", 2.0)])
def test_a_rival_of_two_effects_with_a_shape_is_fitted_alone_too(monkeypatch, effects, expected):
    """One effect less than the best set; the second fit leaves 1, the first 2."""
    s = selecting(fit_of((*effects, "z"), 0.0), chosen=[Probe("a", {"a.frequency": 90.0})])
    monkeypatch.setattr(Selection, "fitted", lambda self, key: self.fits.setdefault(key, fit_of(key, 2.0)))
    monkeypatch.setattr(selection, "starting", lambda *_: None)
    monkeypatch.setattr(selection, "unbent", lambda point: point)

    def fit(start, key, weights, *, leader, workers):
        """Return a fit that knows the best set's objective."""
        assert leader == s.best.objective
        return fit_of(key, 1.0)

    monkeypatch.setattr(selection, "fit", fit)
    found = selection.from_starts(s, tuple(effects), SimpleNamespace(point=None))
    assert found.objective - COUNT == expected


class Widening:
    """A search of few effects that goes on to a set of more: what each leaves and how likely `unknown` is, told."""

    def __init__(self, monkeypatch, few, many, unknown=0.5, promising=False):
        """few, many: (effects, excess); promising: what algebra says of more effects beside the few."""
        self.asked = []
        self.fits = {tuple(e): fit_of(tuple(e), x) for e, x in (few, many)}
        self.few, self.many = self.fits.values()
        self.rivals = {}
        monkeypatch.setattr(selection, "select", lambda s, *_: setattr(s, "best", self.many))
        monkeypatch.setattr(selection, "judged_of", lambda s, fit: self.judged(fit))
        monkeypatch.setattr(selection, "rivals", lambda s, top: self.rivals)
        monkeypatch.setattr(selection, "from_starts", lambda s, key, null: self.asked.append(key) or self.fits[key])
        monkeypatch.setattr(selection, "log_prior", lambda effects: 0.0)
        monkeypatch.setattr(selection, "promising", lambda s, here, fitted: promising)
        monkeypatch.setattr(Search, "remainder", lambda found, fit: SimpleNamespace(unknown=unknown))

    @staticmethod
    def judged(fit):
        """A fit weighed: by its objective alone."""
        told = lambda t: -0.5 * fit.objective / t  # noqa: E731
        return SimpleNamespace(effects=fit.effects, fit=fit, table=None, log_evidence=told(1.0), tempered=told)

    def __call__(self):
        """Return the sets that are judged in the end."""
        found = Search(None, (self.judged(self.few),), 0.0, frozenset(), (), 0.01, looked=1.0)
        return ["".join(j.effects) for j in selection.widened(found, 0.0, {}).judged]


@pytest.mark.parametrize(("unknown", "expected"), [(0.19, ["a"]), (0.21, ["a", "ab"])])
def test_a_search_goes_on_from_a_fifth_of_unknown(monkeypatch, unknown, expected):
    assert Widening(monkeypatch, ("a", 1000.0), ("ab", 10.0), unknown)() == expected


def test_a_search_goes_on_where_more_effects_promise_more(monkeypatch):
    """Also where nothing outside the library is likely."""
    assert Widening(monkeypatch, ("a", 10.0), ("ab", -20.0), unknown=0.0, promising=True)() == ["a", "ab"]


def test_a_best_set_that_cannot_be_weighed_is_left(monkeypatch):
    """Also where the few cannot be weighed with new starts: what was judged before stays."""

    def refused(s, fit):
        """Refuse every point."""
        raise BadInput("no flux of this motor gives the first reading")

    widening = Widening(monkeypatch, ("a", 1000.0), ("ab", 10.0))
    monkeypatch.setattr(selection, "judged_of", refused)
    monkeypatch.setattr(Selection, "look", lambda self: True)
    assert widening() == ["a"]


def test_the_few_are_weighed_anew_where_starts_were_looked_for(monkeypatch):
    """Before anything is promised: with the equations of the new starts."""
    widening, weighed = Widening(monkeypatch, ("a", 1000.0), ("ab", 10.0)), []
    monkeypatch.setattr(selection, "judged_of", lambda s, fit: weighed.append(fit.effects) or widening.judged(fit))
    monkeypatch.setattr(Selection, "look", lambda self: True)
    assert widening() == ["a", "ab"]
    assert weighed == [("a",), ("a", "b")]


@pytest.mark.parametrize(
    ("told", "fitted", "expected"),
    [
        ({"ab": 0.2}, "", False),  # less than a step upwards
        ({"ab": 0.4}, "", True),
        ({"ab": 0.4}, "ab", False),  # fitted before, and no better
        ({"bc": 9.0}, "", False),  # not beside the few
    ],
)
def test_more_effects_beside_the_few_promise_more(monkeypatch, told, fitted, expected):
    monkeypatch.setattr(Sets, "told", {"a": 0.0, **told}, raising=False)
    monkeypatch.setattr(selection, "Subsets", Sets)
    assert selection.promising(selecting(fit_of(("a",), 0.0)), None, {tuple(fitted)}) == expected


def test_without_an_effect_nothing_goes_on(monkeypatch):
    assert Widening(monkeypatch, ("", 1000.0), ("ab", 10.0))() == [""]


@pytest.mark.parametrize(
    ("few", "left", "goes_on"), [("a", 0.51, False), ("a", 0.49, True), ("abc", 0.81, False), ("abc", 0.79, True)]
)
def test_more_effects_close_half_of_what_few_leave(monkeypatch, few, left, goes_on):
    """A fifth where the few were as many as a search of few takes."""
    wide = Widening(monkeypatch, (few, 1000.0), (few + "z", 1000.0 * left))
    assert wide() == [few, few + "z"][: 1 + goes_on]


def test_three_rivals_are_fitted_at_a_time(monkeypatch):
    wide = Widening(monkeypatch, ("a", 1000.0), ("ab", 0.0))
    wide.rivals = {(e,): 9.0 for e in "cdef"}
    wide.fits |= {k: fit_of(k, 2.0) for k in wide.rivals}
    wide()
    assert wide.asked == [("c",), ("d",), ("e",)]


@pytest.mark.parametrize(
    ("behind", "algebra", "judged"), [(14.9, 9.0, True), (15.1, 9.0, False), (15.1, 5.1, False), (15.1, 4.9, True)]
)
def test_a_fit_fifteen_behind_is_not_weighed(monkeypatch, behind, algebra, judged):
    """Unless algebra, which knows traces of all other effects, holds its set no more than five behind.  Two effects
    each, so that their price is the same; both are nearer to the floor than 1, where nothing is tempered."""
    wide = Widening(monkeypatch, ("a", 1000.0), ("ab", -40.0))
    wide.rivals = {("c", "d"): algebra}
    wide.fits |= {("c", "d"): fit_of(("c", "d"), -40.0 + 2.0 * behind)}
    assert ("cd" in wide()) == judged


def test_rivals_are_looked_for_twice(monkeypatch):
    """Each round finds a better one, from which the next round looks."""
    wide = Widening(monkeypatch, ("a", 1000.0), ("ab", 0.0))
    monkeypatch.setattr(selection, "rivals", lambda s, top: {("c" * (len(wide.asked) + 1),): 9.0})
    wide.fits |= {("c" * n,): fit_of(("c" * n,), -10.0 * n) for n in range(1, 5)}
    wide()
    assert len(wide.asked) == 2
