"""Numbers by which a set's rivals are looked for: left out, exchanged, fitted again, pointed at; sizes tried."""

from types import SimpleNamespace

import pytest

from model.effects import library
from sandbox.gap.evidence.probes import Probe
from sandbox.gap.search import neighbours
from sandbox.gap.search.multistart import trials
from tests.sandbox.gap.conftest import DRIVE

LEADS = 70.0  # objective of the best set


@pytest.fixture
def fitted(monkeypatch):
    """Fits stand for themselves: a point is the set that it is for, a fit's objective is told by its set.  Each of them
    knows the best set's objective, so that it may end sooner far behind it."""
    told = {}
    monkeypatch.setattr(neighbours, "towards", lambda best, key, chosen: ("near", key))
    monkeypatch.setattr(neighbours, "starting", lambda point, key, chosen: ("alone", key))
    monkeypatch.setattr(neighbours, "unbent", lambda point: point)

    def fit(start, key, weights, *, leader, workers):
        assert leader == LEADS
        return SimpleNamespace(effects=key, objective=told.get(start[0], 0.0))

    monkeypatch.setattr(neighbours, "fit", fit)
    return told


def best_of(effects, told):
    """A judged set of log evidence 0; the table tells that of others, -500 where nothing is told."""
    table = SimpleNamespace(members=dict.fromkeys("abcdef"), log_evidence=lambda key: told.get("".join(key), -500.0))
    return SimpleNamespace(effects=tuple(effects), table=table, log_evidence=0.0, fit=SimpleNamespace(objective=LEADS))


@pytest.mark.parametrize(
    ("told", "expected"),
    [
        ({"": -149.0}, [""]),  # little is lost without it
        ({"": -151.0}, []),  # much is, and nothing is as good in its place
        ({"": -151.0, "b": -59.0, "c": -61.0}, ["b"]),
        ({"": -151.0, "b": -30.0, "c": -10.0, "d": -20.0}, ["c", "d"]),  # two at most
    ],
)
def test_an_effect_is_left_out_or_exchanged(fitted, told, expected):
    found = neighbours.neighbours(best_of("a", told), {}, set(), [], neighbours.EXCHANGED, {}, 1)
    assert ["".join(f.effects) for f in found] == expected


@pytest.mark.parametrize(("near", "alone", "better"), [(99.1, 99.1, None), (98.9, 99.1, 98.9), (98.9, 97.8, 97.8)])
def test_a_fit_from_another_start_is_better_by_one_of_the_objective(fitted, near, alone, better):
    """One effect of two is left out; the set that is left was fitted to 100 before."""
    fitted |= {"near": near, "alone": alone}
    old = SimpleNamespace(effects=("b",), objective=100.0)
    tried = set()
    given = best_of("ab", {}), {("b",): old}, SimpleNamespace(point=None), [], tried, {}, 1
    assert [f.objective for f in neighbours.fitted_again(*given)] == ([] if better is None else [better])
    assert tried == {(("a", "b"), ("b",))}
    assert neighbours.fitted_again(*given) == []  # it would end where it did


@pytest.mark.parametrize(("far", "expected"), [(3.2, []), (-3.4, ["ab"])])
def test_a_deviation_beyond_one_in_a_thousand_points_to_its_effect(fitted, monkeypatch, far, expected):
    monkeypatch.setattr(neighbours, "stray", lambda fit: {"x": (SimpleNamespace(effect="b"), far)})
    found = neighbours.pointed(best_of("a", {"ab": -1.0, "b": -2.0}), {}, set(), [], {}, 1)
    assert ["".join(f.effects) for f in found] == expected


def test_a_set_of_three_takes_another_effect_in_place_of_one_only(fitted, monkeypatch):
    monkeypatch.setattr(neighbours, "stray", lambda fit: {"x": (SimpleNamespace(effect="d"), 9.0)})
    told = {"abcd": 9.0, "abd": -2.0, "acd": -3.0, "bcd": -4.0}
    assert ["".join(f.effects) for f in neighbours.pointed(best_of("abc", told), {}, set(), [], {}, 1)] == ["abd"]
    two = {"abd": 9.0, "ad": -3.0, "bd": -4.0}
    assert ["".join(f.effects) for f in neighbours.pointed(best_of("ab", two), {}, set(), [], {}, 1)] == ["abd"]


def sizes_of(effect):
    """Return the sizes tried of an effect of one parameter, over the typical one, and all that is tried."""
    prepared = SimpleNamespace(campaign=SimpleNamespace(drive=DRIVE))
    point = SimpleNamespace(prepared=prepared, values=library.neutral(DRIVE.motor))
    found = trials(point, Probe(effect, {}))
    name, typical = next(iter(library.typical(effect, DRIVE.motor, DRIVE.converter).items()))
    neutral = point.values[name]
    return [(t.get(name, neutral) - neutral) / (typical - neutral) for t in found]


def test_sizes_of_twice_and_four_times_the_typical_one_are_tried():
    """Of either sign where a drive can have both: pulses can only be late, never early.  Of two sizes either is tried;
    three gains are many small ones, for which slopes do."""
    assert sorted(sizes_of("magnet_flux")) == pytest.approx([-4.0, -2.0, 2.0, 4.0])
    assert sizes_of("pwm_delay") == pytest.approx([2.0, 4.0])
    assert sizes_of("flux_harmonics") == pytest.approx([-4.0, -2.0, 2.0, 4.0, *[0.0] * 4])
    assert sizes_of("current_gain") == []
