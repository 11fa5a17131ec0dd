"""Numbers of the regression beside effects, of groups, probes and equations, by hand."""

from types import SimpleNamespace

import numpy as np
import pytest
from scipy.stats import norm

from model.effects import library
from sandbox.gap.evidence import probes
from sandbox.gap.evidence.algebra import Algebra, Prior
from sandbox.gap.evidence.inverter_or_machine import voltages
from sandbox.gap.evidence.regression import RIDGE, scalars
from sandbox.gap.evidence.spike_slab import Table
from sandbox.gap.search import inclusion, stranger
from sandbox.replay.inputs import LEGS
from tests.sandbox.gap.conftest import DRIVE


def offered(i_d=0.0, speed=0.0, theta=0.0):
    """Return the values of the free functions at one operating point, by their kinds."""
    found = [(float(f[0]), kind) for f, kind in scalars(np.array([[i_d, 0.0]]), np.array([speed]), np.array([theta]))]
    return [sorted({round(v, 12) for v, k in found if k == kind}) for kind in range(3)]


def test_functions_of_currents_are_powers_up_to_the_third_and_a_sign():
    """At i_d = 0.1 of rated: 1, 0.1, 0.01, 0.001, and the sign, a tanh of width 0.1 (five times SIGN): tanh(1)."""
    assert offered(i_d=0.1)[0] == pytest.approx([0.0, 1e-3, 1e-2, 0.1, np.tanh(1.0), 1.0])


def test_functions_of_the_angle_are_of_the_first_second_and_sixth_order():
    expected = [0.0, *(f(n * 0.1) for n in (1, 2, 6) for f in (np.cos, np.sin))]
    assert offered(theta=0.1)[1] == pytest.approx(sorted(expected))


def test_functions_of_speed_are_its_square_and_a_sign_of_half_its_top():
    """At 0.5 of the top speed, no current, angle 0: speed and its square, and tanh(0.2 speed / 0.1) = tanh(1)."""
    assert offered(speed=0.5)[2] == pytest.approx([0.0, 0.25, 0.5, np.tanh(1.0)])


def test_ridges_are_decades():
    assert RIDGE.tolist() == pytest.approx([1e-6, 1e-5, 1e-4, 1e-3, 1e-2, 0.1, 1.0, 10.0])


def test_what_an_inverter_may_do_by_hand():
    """Pulses shorter than 4, 8, 16, 32, 64 thousandths of a period: one of 0.01 is lost at the last three only, as a
    share of the width.  The link sags with the current drawn up to 7 periods back (8 signals); a leg's voltage has a
    sign of 2 % of rated current."""
    n = 12
    duty = np.full((n, 3), 0.5)
    duty[:, 0] = 0.01
    duty[1, 1], duty[2, 2] = 0.005, 0.003
    read = np.zeros((n, 3))
    read[0] = (0.02, -0.01, -0.01)
    track = {f"d_{x}": duty[:, k] for k, x in enumerate("abc")}
    r = SimpleNamespace(track=track, mean_duty=lambda: (2.0 / 3.0) * duty @ LEGS)
    found = np.array(list(voltages(r, read)))
    eight, legs, link = found[:8], found[8:17], found[17:25]
    assert np.abs(eight[0])[3:] == pytest.approx(np.full(n - 3, (2.0 / 3.0) * 0.49))
    assert np.abs(legs[0, 0]) == pytest.approx(np.tanh(1.0))
    assert [int(np.flatnonzero(np.abs(v))[0]) for v in link] == list(range(8))
    short = found[25:].reshape(5, 6, n)  # widths; differences of two legs, then legs
    assert np.abs(short[:, 3, 0]) == pytest.approx([0.0, 0.0, 0.01 / 0.016, 0.01 / 0.032, 0.01 / 0.064])
    widths = (0.004, 0.008, 0.016, 0.032, 0.064)
    assert np.abs(short[:, 4, 1]) == pytest.approx([0.0, *(0.005 / w for w in widths[1:])])
    assert np.abs(short[:, 5, 2]) == pytest.approx([0.003 / w for w in widths])
    assert not short[:, :3, 3:].any()  # legs differ by 0.49 or not at all


@pytest.mark.parametrize(("unknown", "left"), [(0.49, "abcde"), (0.51, "ab")])
def test_three_rounds_leave_out_what_is_not_believed(monkeypatch, unknown, left):
    """Each round believes all but the last effect: of five, two are left after three rounds, all where `unknown` has
    less than even odds."""
    monkeypatch.setattr(stranger, "replace", lambda x, **_: x)
    monkeypatch.setattr(stranger, "shortened", lambda x: x)
    monkeypatch.setattr(stranger, "beside", lambda *_, **__: SimpleNamespace(equations=None))
    monkeypatch.setattr(stranger, "believed", lambda sets, effects: effects[:-1])
    found = SimpleNamespace(judged=(), judge_also=lambda kept, *_: judged(kept))
    assert stranger.beside_unknown(found, judged(tuple("abcde")), unknown, 1.0, {}, 1).effects == tuple(left)


def judged(effects, objective=0.0):
    """A judged set whose fit has an objective."""
    table, fit = SimpleNamespace(point=None), SimpleNamespace(objective=objective)
    return SimpleNamespace(effects=effects, table=table, prior=None, fit=fit)


@pytest.mark.parametrize(("known", "counts"), [(4.0, 4.0), (6.0, 5.0), (None, 5.0)])
def test_what_stays_is_fitted_from_the_larger_set_though_it_was_judged(monkeypatch, known, counts):
    """The search judged `a` at 4, 6 or not at all; from the values beside `b` it reaches 5: the lower one counts."""
    monkeypatch.setattr(stranger, "replace", lambda x, **_: x)
    monkeypatch.setattr(stranger, "shortened", lambda x: x)
    monkeypatch.setattr(stranger, "beside", lambda *_, **__: SimpleNamespace(equations=None))
    monkeypatch.setattr(stranger, "believed", lambda sets, effects: effects[:1])
    both, asked = judged(("a", "b")), []
    again = lambda kept, weights, workers, near: asked.append(near) or judged(kept, 5.0)  # noqa: E731
    found = SimpleNamespace(judged=() if known is None else (judged(("a",), known),), judge_also=again)
    assert stranger.beside_unknown(found, both, 0.9, 1.0, {}, 1).fit.objective == counts
    assert asked == [both.fit]


@pytest.mark.parametrize(("count", "groups"), [(4, 1), (5, 0)])
def test_a_group_has_at_most_four_effects(count, groups):
    """So many effects, each alone with the same chance, one of them there in 96 of 100 cases."""
    sets = {(e,): 0.96 / count for e in "abcde"[:count]} | {(): 0.04}
    assert len(inclusion.summed(sets, "abcde"[:count]).groups) == groups


def test_one_against_two_together_is_no_group_of_three():
    """Either a, or b and c: b and c do not stand for each other, each of them stands for a."""
    found = inclusion.summed({("a",): 0.5, ("b", "c"): 0.5}, "abc")
    assert found.groups == ((("a", "b"), 1.0), (("c", "a"), 1.0))


def told_by(known, members):
    """What stands for `Subsets`: log posteriors by set, -99 for all others."""

    class Sets:
        def __init__(self, *_):
            self.known = {}

        def weigh(self, effects):
            key = tuple(sorted(effects))
            assert set(key) <= set(members)
            return self.known.setdefault(key, known.get(key, -99.0))

        def climb(self, effects):
            return effects, self.weigh(effects)

    return Sets


def test_what_is_never_claimed_together_has_no_chance_together(monkeypatch):
    """Cross-saturation is a part of saturation: beside it, by algebra as good as without, it is no set at all."""
    members = dict.fromkeys(("saturation", "cross_saturation", "inertia"), ())
    known = {("saturation",): 0.0, ("cross_saturation", "saturation"): 0.0, ("inertia", "saturation"): -2.0}
    monkeypatch.setattr(inclusion, "Subsets", told_by(known, members))
    judged = SimpleNamespace(table=SimpleNamespace(members=members))
    h = SimpleNamespace(effects=("saturation",), probability=1.0, judged=judged)
    found = inclusion.inclusion([h], 1.0)
    assert found.chances["cross_saturation"] == 0.0
    assert found.chances["inertia"] == pytest.approx(np.exp(-2.0) / (1.0 + np.exp(-2.0)))


def test_beside_a_regression_effects_are_exchanged_and_none_is_added(monkeypatch):
    """By algebra a with c is far above the fitted a with b, and so are all three: the first counts as much as what was
    fitted, the second not at all, however much it promises."""
    members = dict.fromkeys("abc", ())
    known = {("a", "b"): 0.0, ("a", "c"): 7.0, ("a", "b", "c"): 50.0, ("a",): -1.0}
    monkeypatch.setattr(inclusion, "Subsets", told_by(known, members))
    found = inclusion.by_algebra(SimpleNamespace(members=members), ("b", "a"), 1.0)
    total = 2.0 + np.exp(-1.0)
    assert found.chances == pytest.approx({"a": 1.0, "b": 1.0 / total, "c": 1.0 / total})
    assert inclusion.by_algebra(SimpleNamespace(members=members), (), 1.0).chances == dict.fromkeys("abc", 0.0)


def test_a_fitted_set_whose_effects_the_best_point_does_not_know_keeps_its_chance(monkeypatch):
    """A shaft can be begun at one point and no longer at another (its load would be lighter than it may be)."""
    members = {"a": ()}
    monkeypatch.setattr(inclusion, "Subsets", told_by({("a",): 0.0}, members))
    judged = SimpleNamespace(table=SimpleNamespace(members=members))
    told = [(("a",), 0.8), (("shaft_compliance",), 0.2)]
    found = inclusion.inclusion([SimpleNamespace(effects=e, probability=p, judged=judged) for e, p in told], 1.0)
    assert found.chances == pytest.approx({"a": 0.8, "shaft_compliance": 0.2})


@pytest.mark.parametrize("of_b", [0.0, 0.1])
def test_where_something_outside_is_certain_to_the_last_digit_nothing_has_a_chance(monkeypatch, of_b):
    """1 - P(unknown) rounds to nothing: no set is left to share out, or one that is not the best of them."""
    members = {"a": (), "b": ()}
    monkeypatch.setattr(inclusion, "Subsets", told_by({("a",): 0.0, ("a", "b"): 0.0}, members))
    judged = SimpleNamespace(table=SimpleNamespace(members=members))
    told = [(("unknown",), 1.0 - of_b), (("a",), 0.0), (("b",), of_b)]
    h = [SimpleNamespace(effects=e, probability=p, judged=judged) for e, p in told]
    found = inclusion.inclusion(h, 1.0)
    assert found.chances == {"a": 0.0, "b": float(of_b > 0.0)}
    assert found.groups == ()
    assert found.mixed(inclusion.Inclusion({}, (), {(): 1.0}), 1.0).chances == {"a": 0.0, "b": 0.0}


def test_a_set_that_fell_behind_when_it_was_fitted_has_no_chance(monkeypatch):
    """By algebra b is as good as a; it was fitted, and is no hypothesis."""
    members = {"a": (), "b": ()}
    monkeypatch.setattr(inclusion, "Subsets", told_by({("a",): 0.0, ("a", "b"): 0.0}, members))
    judged = SimpleNamespace(table=SimpleNamespace(members=members))
    h = [SimpleNamespace(effects=("a",), probability=1.0, judged=judged)]
    assert inclusion.inclusion(h, 1.0).chances == pytest.approx({"a": 1.0, "b": 0.5})
    assert inclusion.inclusion(h, 1.0, frozenset({("a", "b")})).chances == pytest.approx({"a": 1.0, "b": 0.0})


def test_a_set_between_two_fitted_ones_is_no_more_than_either_lets_it(monkeypatch):
    """By algebra a is 3 above none, and a with b 3 above b; the fit of a found nothing, so it does not beside b."""
    members = {"a": (), "b": ()}
    known = {(): 0.0, ("a",): 3.0, ("b",): -2.0, ("a", "b"): 1.0}
    monkeypatch.setattr(inclusion, "Subsets", told_by(known, members))
    judged = SimpleNamespace(table=SimpleNamespace(members=members))
    told = [((), 0.89), (("b",), 0.1), (("a",), 0.01)]
    h = [SimpleNamespace(effects=e, probability=p, judged=judged) for e, p in told]
    monkeypatch.setattr(inclusion.Subsets, "climb", lambda self, own: self.weigh(("a", "b")))
    both = 0.01 * np.exp(1.0 - 3.0)
    assert inclusion.inclusion(h, 1.0).chances["a"] == pytest.approx((0.01 + both) / (1.0 + both))


@pytest.mark.parametrize(
    ("none", "fitted_none", "b"),
    [(-0.5, 0.3, 0.3 * np.exp(-0.5)), (4.0, 0.0, 0.0), (-9.0, 0.3, 0.7)],
    ids=["by the set without", "algebra misjudges the set without", "never above the best"],
)
def test_what_was_not_fitted_stands_to_what_was(monkeypatch, none, fitted_none, b):
    """0.5 for a, 0.2 for a beside `unknown`, which are one set, and what fits gave for none.  By algebra (log) a is at
    0, b at -1, none at `none`: b differs from none by one effect, from a by two, and follows none's fit."""
    table = SimpleNamespace(members={"a": (), "b": ()})

    class Sets:
        def __init__(self, *_):
            self.known = {}

        def weigh(self, effects):
            by_algebra = {("a",): 0.0, ("b",): -1.0, (): none}
            return self.known.setdefault(tuple(sorted(effects)), by_algebra.get(tuple(effects), -99.0))

        def climb(self, effects):
            return effects, self.weigh(("b",))

    monkeypatch.setattr(inclusion, "Subsets", Sets)
    told = [(("a",), 0.5), (("a", "unknown"), 0.2), ((), fitted_none)]
    found = inclusion.inclusion(
        [SimpleNamespace(effects=e, probability=p, judged=SimpleNamespace(table=table)) for e, p in told], 1.0
    )
    total = 0.7 + fitted_none + b
    assert found.chances == pytest.approx({"a": 0.7 / total, "b": b / total}, abs=1e-12)


def test_scans_reach_their_last_value(monkeypatch):
    """Cogging is looked for at every whole order of a turn from 1 to 72, then at multiples of twelve poles up to 252:
    two parts each, in the third of the samples in which the rotor is free.  Of what is found no size has been tried."""
    seen = {}
    others = [e for e in library.effect_names() if e != "cogging_torque"]
    monkeypatch.setattr(probes, "best_values", lambda point, pair, name, values: seen.setdefault(name, values)[:1])
    own = [SimpleNamespace(rotor="free", samples=100), SimpleNamespace(rotor="locked", samples=200)]
    prepared = SimpleNamespace(campaign=SimpleNamespace(drive=DRIVE), recordings=own, samples=300)
    found, cost = probes.probes(SimpleNamespace(prepared=prepared, values=library.neutral(DRIVE.motor)), others)
    assert cost == pytest.approx(2 * (72 + 15) / 3.0)
    assert [(p.effect, p.sized, p.gain) for p in found] == [("cogging_torque", None, 0.0)]
    assert seen == {"cogging_torque.order_mech": pytest.approx([*range(1, 73), *range(84, 253, 12)])}


def test_damping_adds_to_the_diagonal():
    own = Algebra(np.array([[4.0, 1.0], [1.0, 2.0]]), np.zeros(2), 0.0, np.zeros(2))
    assert own.damped(0.5).a == pytest.approx(np.array([[6.0, 1.0], [1.0, 3.0]]))


def test_a_tail_beside_a_free_value_by_hand():
    """A = [[2, 1], [1, 3]], both prior deviations 1/2 (4 on the diagonal), means 1 and 0; the first is held at 0.5 from
    below, so its prior pulls back by 4 (1 - 0.5) = 2 and the data by -10 and what the free one leaves.

    The free one is at 2/7; the held one's slope is -10 - 2 x 0.5 - 2/7 + 2 = -65/7 with curve 2 + 4 - 1/7 = 41/7: its
    posterior is the tail of a Gaussian, of which 5 % lie beyond the answer."""
    own = Algebra(np.array([[2.0, 1.0], [1.0, 3.0]]), np.array([-10.0, 2.5]), 0.0, np.zeros(2))
    prior = Prior(np.array([1.0, 0.0]), np.full(2, 0.5), np.array([0.5, -9.0]), np.full(2, np.inf))
    found = own.tails(prior)
    slope, curve = 65.0 / 7.0, 41.0 / 7.0
    beyond = slope / np.sqrt(curve)
    expected = (norm.isf(0.05 * norm.sf(beyond)) - beyond) / np.sqrt(curve)
    assert found == pytest.approx([expected, 0.0], rel=1e-9)


def test_a_whole_share_leaves_the_wide_deviation():
    """An effect's size is averaged over shares of its wide deviation; the whole one is that deviation itself, smaller
    ones stand on top of the ordinary one: hypot(0.1, 2/4)."""
    one, wide = np.zeros(1), np.full(1, np.inf)
    narrow = Prior(one, np.full(1, 0.1), -wide, wide)
    table = Table(None, None, None, narrow, narrow.with_deviation(np.full(1, 2.0)), {"a": (0,)}, np.ones(1, dtype=bool))
    assert table._sized("a", np.full(1, 2.0), 1.0) == pytest.approx([2.0])
    assert table._sized("a", np.full(1, 2.0), 0.25) == pytest.approx([np.hypot(0.1, 0.5)])
