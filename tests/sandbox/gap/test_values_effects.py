"""Numbers of the list of effects and of what nothing explains, by hand."""

import math
from types import SimpleNamespace

import numpy as np
import pytest

from model.effects import library
from sandbox.gap.evidence import beside as beside_
from sandbox.gap.evidence.algebra import Algebra, Prior
from sandbox.gap.evidence.beside import KINDS, RIDGES, Joint, foretold
from sandbox.gap.evidence.discrepancy import unexplained
from sandbox.gap.evidence.normal import Normal, Segment
from sandbox.gap.pages import listed
from sandbox.gap.planning.next_recording import Next
from sandbox.gap.report import open_part, told_apart
from sandbox.gap.report.ranking import Ranking, ordered, parted_by
from sandbox.gap.report.shares import Share, Shares
from sandbox.gap.search.estimates import Estimate
from sandbox.gap.search.inclusion import summed
from tests.sandbox.gap.test_values_told_where import part


def blocks(*squares, count=1000.0):
    """Equations of one recording whose blocks leave these squares a reading."""
    n = np.full(len(squares), count)
    none = np.zeros((len(squares), 0))
    rr = count * np.array(squares)
    return Normal((), np.zeros(0), (Segment(0, "current", np.zeros(0, int), none[:, :, None], none, rr, n),), 0.0)


def test_what_the_simulator_misses_is_no_unknown_part():
    """A gap of 1 (J^2 = 2) of which 0.2 are left: 0.2 less 0.012 less 3e-5 of the gap.  All blocks are alike, so the
    interval has no width."""
    found = unexplained(blocks(*[2.0] * 40), blocks(*[1.2] * 40), 0.012)
    assert found.value == pytest.approx(0.2 - 0.012 - 3e-5, abs=1e-12)
    assert found.ci95 == pytest.approx((found.value, found.value))


def test_two_sizes_of_noise_are_no_share():
    """J^2 - 1 of 0.008 before and 0.006 after are both less than what the simulator misses: no gap, no share (it was
    0.75); a gap of 0.1 that is closed to 0.006 has nothing unexplained; where more is left than there was, all."""
    assert unexplained(blocks(*[1.008] * 40), blocks(*[1.006] * 40), 0.012) is None
    assert unexplained(blocks(*[1.1] * 40), blocks(*[1.006] * 40), 0.012).value == 0.0
    assert unexplained(blocks(*[1.1] * 40), blocks(*[1.2] * 40), 0.012).value == 1.0


def test_the_interval_of_the_share_is_that_of_its_blocks():
    """400 blocks of a gap of 1, half of them left whole and half closed: the share left is 1/2 with a binomial's
    deviation, 1/2/sqrt(400) = 0.025; a bootstrap of 400 draws tells 1.96 of it to some 6 %, thrice that allowed."""
    after = [2.0, 1.0] * 200
    found = unexplained(blocks(*[2.0] * 400), blocks(*after), 0.012)
    assert found.value == pytest.approx(0.5 - 0.01203)
    assert np.array(found.ci95) - found.value == pytest.approx([-0.049, 0.049], rel=0.2)


def test_a_gap_that_a_few_blocks_make_has_a_share_without_interval():
    """One block of forty makes the gap: a draw misses it with (39/40)^40 = 0.36 > 0.05."""
    found = unexplained(blocks(41.0, *[1.0] * 39), blocks(21.0, *[1.0] * 39), 0.012)
    assert found.value == pytest.approx(0.5 - 0.01203)
    assert found.ci95 is None


def noise(seed, folds=12, q=30, rows=40):
    """The joint equations of a regression of pure noise on noise, no coordinates."""
    rng = np.random.default_rng(seed)
    x, y = rng.normal(size=(folds, rows, q)), rng.normal(size=(folds, rows))
    labels = tuple(("current", "current", k % 3) for k in range(q))
    count = np.full((folds, q), float(rows))
    return Joint(x.transpose(0, 2, 1) @ x, np.einsum("fnq,fn->fq", x, y), count, np.zeros(q), np.zeros(q), labels)


def test_a_choice_among_twelve_foretells_nothing_of_noise():
    """The best of twelve choices on the folds that chose it gains of noise by luck; on folds that the choice has not
    seen a regression of noise only loses: every coefficient adds its error and takes nothing away."""
    free = np.arange(0)
    lucky, honest = [], []
    for seed in range(12):
        joint = noise(seed)
        choices = [joint.predicted(joint.of(free, k), r) for k in range(1, len(KINDS) + 1) for r in RIDGES]
        lucky.append(max(0.0, *choices))
        honest.append(foretold(joint.merged(6), free))
    assert max(lucky) > 0.0
    assert np.mean(honest) <= 0.0 < np.mean(lucky)


def test_what_is_foretold_is_what_explicit_nested_folds_say():
    """Six folds of a weak signal: each fold predicted by the choice that predicts the five others in turn best, worked
    out with ridge regressions of stacked rows."""
    rng = np.random.default_rng(3)
    x = rng.normal(size=(6, 20, 6))
    y = 0.15 * x[:, :, 0] + 0.1 * x[:, :, 4] + rng.normal(size=(6, 20))
    kinds = np.array([0, 0, 1, 1, 2, 2])
    labels = tuple(("current", "current", int(k)) for k in kinds)
    joint = Joint(
        x.transpose(0, 2, 1) @ x, np.einsum("fnq,fn->fq", x, y), np.full((6, 6), 20.0), np.zeros(6), np.zeros(6), labels
    )

    def gain(option, fit, judged):
        if option is None:
            return 0.0
        most, ridge = option
        own = kinds < most
        a = np.concatenate([x[f][:, own] for f in fit])
        held = np.sqrt(ridge * len(a)) * np.eye(own.sum())
        z = np.linalg.lstsq(np.vstack([a, held]), np.r_[np.concatenate([y[f] for f in fit]), np.zeros(own.sum())])[0]
        return float(np.sum(y[judged] ** 2 - (y[judged] - x[judged][:, own] @ z) ** 2))

    total, options = 0.0, [None, *((k, r) for k in range(1, 4) for r in RIDGES)]
    for i in range(6):
        others = [f for f in range(6) if f != i]
        inner = [sum(gain(o, [f for f in others if f != j], j) for j in others) for o in options]
        total += gain(options[int(np.argmax(inner))], others, i)
    assert foretold(joint, np.arange(0)) == pytest.approx(total, rel=1e-9)
    assert foretold(joint.merged(2), np.arange(0)) is None


def test_folds_are_merged_by_turns():
    """Seven folds to three: 0, 3, 6 | 1, 4 | 2, 5."""
    own = noise(0, folds=7, q=2)
    assert own.merged(3).v == pytest.approx(np.array([own.v[k::3].sum(0) for k in range(3)]))


def test_a_channel_of_one_recording_alone_is_left_out_where_that_is():
    own = noise(0, folds=3, q=2)
    m, v, rows = own.m.copy(), own.v.copy(), own.rows.copy()
    m[1:, 1], m[1:, :, 1], v[1:, 1], rows[1:, 1] = 0.0, 0.0, 0.0, 0.0
    z = beside_.Joint(m, v, rows, own.held, own.pull, own.labels).without([0], np.arange(2), 1e-6)
    assert z[1] == 0.0
    assert z[0] == pytest.approx((v[1, 0] + v[2, 0]) / (m[1, 0, 0] + m[2, 0, 0]), rel=1e-4)


def test_groups_follow_from_mixed_chances():
    """Without the regression a is there surely; beside it a or b, never both.  At a chance of 0.8 of `unknown` it is a
    or b with certainty, a with 0.2 + 0.8/2 = 0.6, and they form a group."""
    sure, open_ = summed({("a",): 1.0}, "ab"), summed({("a",): 1.0, ("b",): 1.0}, "ab")
    assert sure.groups == ()
    found = sure.mixed(open_, 0.8)
    assert found.chances == pytest.approx({"a": 0.6, "b": 0.4})
    assert found.groups == ((("a", "b"), pytest.approx(1.0)),)
    assert found.most_probable("b") == ("b",)
    assert found.most_probable("c") is None


def test_likely_effects_are_ranked_by_share_and_all_others_by_chance():
    of = {e: Share(x, x, x, x) for e, x in {"a": 0.1, "b": 0.6, "c": 0.3, "d": 0.9}.items()}
    chances = {"a": 0.99, "b": 0.7, "c": 0.51, "d": 0.5, "e": 0.52, "f": 0.2}
    assert list(ordered(chances, of)) == ["b", "c", "a", "e", "d", "f"]
    assert ordered(chances, of) == chances


def planned(*separates):
    return Next("fast_ramp", "a ramp to top speed", 2.0, separates, 5.0, 0.97)


def test_the_planned_recording_parts_what_it_separates():
    """It separates dead time from a device drop; the third of the group it says nothing of: there the card does."""
    group = ("dead_time", "device_drop", "current_offset")
    found = parted_by(group, planned(("dead_time", "inertia"), ("device_drop", "inertia")))
    assert "fast_ramp" in found["dead_time"]
    assert found["dead_time"] == found["device_drop"]
    assert found["current_offset"] == library.load_effect("current_offset").separated_by


@pytest.mark.parametrize("sets", [((), ("dead_time",)), (("dead_time", "device_drop"), ("dead_time",))])
def test_a_recording_that_parts_an_effect_from_nothing_parts_no_group(sets):
    """Without another of the group in its place, a planned recording says whether the effect is there, not which."""
    group = ("dead_time", "device_drop")
    assert parted_by(group, planned(*sets)) == {e: library.load_effect(e).separated_by for e in group}
    assert parted_by(group, None) == {e: library.load_effect(e).separated_by for e in group}


def test_regions_have_ends_in_amperes_and_rpm():
    """Rated current 10 A: bounds at 1.5, 5 and 8.5 A.  Top speed 1000 rad/s electrical with 5 pole pairs, bounds
    at 0.02, 0.3 and 0.65 of it.  Both signs of an order count together; below a tenth nothing is told of."""
    motor = SimpleNamespace(rated_current=10.0, pole_pairs=5)
    r = SimpleNamespace(motion=SimpleNamespace(speed=np.array([-1000.0, 3.0])))
    campaign = SimpleNamespace(drive=SimpleNamespace(motor=motor))
    point = SimpleNamespace(prepared=SimpleNamespace(campaign=campaign, recordings=(r,)))
    own = part(electrical={0: 0.5, 6: 0.06, -6: 0.05, 2: 0.09}, mechanical={5: 0.2}, line=(173.0, 0.11))
    found = open_part.regions(own, point)
    assert [(x.low, x.high) for x in found.current] == [(0.0, 1.5), (1.5, 5.0), (5.0, 8.5), (8.5, None)]
    top = 1000.0 * 60.0 / (2.0 * math.pi) / 5.0
    assert [x.low for x in found.speed] == pytest.approx([0.0, 0.02 * top, 0.3 * top, 0.65 * top])
    assert [x.share for x in found.speed] == [0.25] * 4
    assert [(o.order, o.of, o.share) for o in found.angle] == [(5, "mechanical", 0.2), (6, "electrical", 0.11)]
    assert found.as_json()["frequency"] == {"hz": 173.0, "share": 0.11}
    told = found.told()
    assert "11.0 % of electrical order 6" in told
    assert "173 Hz" in told
    assert "rpm" not in told  # no speed holds half of it
    mostly = open_part.regions(part(speeds={**own.speeds, "at high speed": 0.6}), point)
    assert "60.0 % at high speed (from 1.24e+03 rpm on)" in mostly.told()


def table(a, x=(1.0, 0.0, 0.0)):
    """A set {"a"} of two effects and an ordinary deviation, all wide 1; effects not claimed are held at zero."""
    places = {"a": (0,), "b": (1,)}
    far = np.full(3, np.inf)

    def prior(effects):
        wide = np.array(["a" in effects, "b" in effects, True], dtype=float)
        return Prior(np.zeros(3), 1e3 * wide, -far, far)

    equations = Algebra(np.array(a), np.array(a) @ np.array(x), 0.0, np.zeros(3))
    of_effects = np.array([True, True, False])
    coordinates = [SimpleNamespace(label=x, form="linear") for x in ("a.x", "b.x", "bench.zone current")]
    t = SimpleNamespace(members=places, prior=prior, of_effects=of_effects, coordinates=coordinates)
    return SimpleNamespace(table=t, equations=equations, effects=("a",))


def test_an_effect_is_confused_with_what_looks_like_it():
    """Slopes of squared length 100 each; cosine 0.96 between a and b, 0 with the deviation.  b takes up 0.96^2 of 100:
    7.84 are left, half of it log evidence, 3.92 > ln 19 = 2.94: it can be told; of data that counts half as much 1.96
    are left, and it cannot.  Priors are wide, so they count for nothing (1e-6)."""
    a = 100.0 * np.array([[1.0, 0.96, 0.0], [0.96, 1.0, 0.0], [0.0, 0.0, 1.0]])
    found = told_apart.telling(table(a), "a", 1.0)
    assert [(x.name, x.kind) for x in found.confused_with] == [("b", "effect")]
    assert found.confused_with[0].cosine == pytest.approx(0.96, rel=1e-4)
    assert found.confused_with[0].log_evidence == pytest.approx(3.92, rel=1e-4)
    assert found.tellable
    assert not told_apart.telling(table(a), "a", 2.0).tellable


def test_an_ordinary_deviation_is_a_rival_and_one_that_is_not_alike_is_none():
    a = 100.0 * np.array([[1.0, 0.7, 0.8], [0.7, 1.0, 0.56], [0.8, 0.56, 1.0]])
    found = told_apart.telling(table(a), "a", 1.0)
    assert [(x.name, x.kind) for x in found.confused_with] == [("bench.zone", "ordinary")]
    assert found.confused_with[0].cosine == pytest.approx(0.8, rel=1e-4)


def test_an_effect_that_is_too_small_is_told_from_nothing():
    """Squares of 4 are a log evidence of 2; an effect without a size has no answer."""
    a = np.diag([4.0, 4.0, 4.0])
    found = told_apart.telling(table(a), "a", 1.0)
    assert (found.tellable, found.confused_with) == (False, ())
    assert told_apart.telling(table(a, (0.0, 0.0, 0.0)), "a", 1.0) is None


def listing(unknown, part_=None, **more):
    """A ranking of one likely effect whose size is 1, beside a regression 2."""
    own = {"inertia": {"inertia.x": Estimate(1.0, 0.9, 1.1, "")}}
    return Ranking(summed({("inertia",): 1.0}, ("inertia",)), Shares({}, ()), own, unknown, None, part_, **more)


@pytest.mark.parametrize(("unknown", "size"), [(0.49, "1.0"), (0.51, "2.0")])
def test_sizes_on_the_page_are_not_bent_where_something_unknown_is_likely(unknown, size):
    freed = {"inertia": {"inertia.x": Estimate(2.0, 1.5, 2.5, "")}}
    r = listing(unknown, SimpleNamespace(parameters=freed))
    assert f"x {size}" in listed.rows(r)[0][3]
    assert r.beside_unknown == (unknown > 0.5)


def test_rivals_are_said_of_likely_effects_only():
    one, other = ("iron_loss", "effect", 0.99, 1.0), ("pwm_delay", "effect", 0.8, 9.0)
    rivals = (told_apart.Confused(*one), told_apart.Confused(*other))
    told = {"inertia": told_apart.Telling(False, rivals)}
    assert list(listed.confused_sentences(listing(0.0, told=told), {})) == [
        "Inertia cannot be told here from iron loss (cosine 0.990)."
    ]
    assert not list(listed.confused_sentences(listing(0.0, told={"inertia": told_apart.Telling(True, rivals)}), {}))


@pytest.mark.parametrize(
    ("low", "neutral", "said"),
    [
        (0.9, 0.5, "Inertia may be no effect at all: the simulator's own error could imitate it."),
        (0.9, 1.0, "Inertia cannot be told here from no effect at all: it is too small."),
    ],
)
def test_an_effect_whose_interval_excludes_none_is_not_called_too_small(low, neutral, said):
    own = {"inertia": {"inertia.inertia": Estimate(1.0, low, 1.1, "kg m^2")}}
    told = {"inertia": told_apart.Telling(False, ())}
    r = Ranking(summed({("inertia",): 1.0}, ("inertia",)), Shares({}, ()), own, 0.0, None, told=told)
    assert list(listed.confused_sentences(r, {"inertia.inertia": neutral})) == [said]
