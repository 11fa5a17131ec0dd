"""The steps of a fit by a script: what a step promises and gains is told, what is done next is looked at."""

import dataclasses
from itertools import chain, repeat
from types import SimpleNamespace

import numpy as np
import pytest

from model.effects import library
from sandbox.gap import diagnose
from sandbox.gap.evidence import fit as fitting
from sandbox.gap.evidence import probes, spike_slab
from sandbox.gap.evidence.algebra import Prior
from sandbox.gap.evidence.fit import Descent, Fit, Task, stray
from sandbox.gap.evidence.holdout import worst_share
from sandbox.gap.evidence.normal import Normal, Point
from sandbox.gap.evidence.priors import Coordinate
from sandbox.gap.report import shares as sharing
from sandbox.replay.segments import Segment
from tests.sandbox.gap.conftest import DRIVE
from tests.sandbox.gap.test_values import equations

START = 1000.0  # the objective that a script begins at


class Script:
    """Stands for a campaign: every step gains what the script says; `said` keeps what was asked for."""

    def __init__(self, gains, promised, noise=1.0, leader=np.inf):
        """gains: of the objective, one a step, the last one for ever; promised: likewise, or by every step; noise:
        squared residual over its floor; leader: objective of the best rival."""
        self.noise, self.leader = noise, leader
        told = promised if isinstance(promised, list) else [promised]
        self.gains, self.promised = (chain(x, repeat(x[-1])) for x in (gains, told))
        self.said, self.shares = [], list[float]()

    def __call__(self, monkeypatch, confirm=True):
        """Go down; return where that ends.  Slopes cost ten simulations."""
        point = SimpleNamespace(moved=lambda coordinates, x: point)
        point.resmoothed = lambda: self.said.append("smooth") or point
        n = self.equations(START, 10.0)
        d = Descent(Task(point, (), {}, self.leader, 1), (), point, n, n.simulations)

        def whole(*given, **more):
            """Return equations with slopes where it stands."""
            self.said.append("slopes")
            return self.equations(d.value, 10.0)

        monkeypatch.setattr(fitting, "normal", whole)
        monkeypatch.setattr(fitting, "tried", lambda *given: self.tried(d))
        monkeypatch.setattr(fitting, "objective", lambda n, prior, weights: n.value)
        monkeypatch.setattr(fitting, "_step", lambda n, prior, weights, *how: self.step(*how))
        monkeypatch.setattr(fitting, "fallen", lambda x, to, prior: to)
        monkeypatch.setattr(fitting, "noise_at", lambda n, weights: self.noise)
        d.down(None, confirm)
        return d

    def tried(self, d):
        """Return the objective a step reaches, and the equations there."""
        value = d.value - next(self.gains)
        return value, self.equations(value, 1.0)

    def equations(self, value, cost):
        """Return equations of an objective."""
        return SimpleNamespace(coordinates=(), simulations=cost, value=value, x=None)

    def step(self, damping, share):
        """Return a step's place and what such a share of it promises."""
        self.said.append(damping)
        self.shares.append(share)
        return None, next(self.promised) * share * (2.0 - share)


def test_slopes_serve_four_steps(monkeypatch):
    """All that is promised is gained: four steps on the slopes of one point, and at most eight such points (thirty
    steps in all come first).  The motion is smoothed anew with the first two."""
    script = Script([10.0], 10.0)
    found = script(monkeypatch)
    four = [0.0] * 4
    again = [x for k in range(2, 9) for x in (*(["smooth"] if k <= 3 else []), "slopes", *four)]
    assert script.said == [*four, *again][: len(script.said)]
    assert script.said.count(0.0) == 30
    assert found.taken == 8
    assert found.cost == 8 * 10.0 + 30.0
    assert found.value == START - 300.0


@pytest.mark.parametrize(("gained", "steps"), [(5.2, 4), (4.8, 1)])
def test_slopes_are_taken_anew_where_a_step_gains_less_than_half_of_what_they_promise(monkeypatch, gained, steps):
    script = Script([gained] * 8 + [0.0], 10.0)
    script(monkeypatch)
    assert script.said[: steps + 2] == [*[0.0] * steps, "smooth", "slopes"]


@pytest.mark.parametrize(("gained", "goes_on"), [(0.19, False), (0.21, True)])
def test_a_first_step_that_gains_a_fifth_goes_on(monkeypatch, gained, goes_on):
    script = Script([gained, 0.0], gained)
    found = script(monkeypatch)
    assert (len(script.said) > 1) is goes_on
    assert found.value == pytest.approx(START - gained)


@pytest.mark.parametrize(("gained", "goes_on"), [(19.0, False), (21.0, True)])
def test_ten_floors_from_the_floor_a_step_has_to_gain_a_hundred_times_as_much(monkeypatch, gained, goes_on):
    """There the data counts for a hundredth (`posterior.tempered`), and 19 of the objective decide no more than 0.19
    at the floor."""
    script = Script([gained, 0.0], gained, noise=10.0**2)
    script(monkeypatch)
    assert (len(script.said) > 1) is goes_on
    lost = Script([-1.0], gained, noise=10.0**2)
    lost(monkeypatch)
    assert (len(lost.said) > 1) is goes_on


def test_the_noise_of_a_residual_is_its_square_over_the_floor_and_no_less_than_one():
    """Four samples with squares of 36 in all stand at 3 floors; of two with 1 the floor counts."""
    segments = [
        SimpleNamespace(recording=k, channel="current", rr=np.array([rr]), n=np.array([n]))
        for k, (rr, n) in enumerate([(36.0, 4.0), (1.0, 2.0)])
    ]
    n = SimpleNamespace(segments=segments)
    assert fitting.noise_at(n, {(0, "current"): 1.0}) == pytest.approx(9.0)
    assert fitting.noise_at(n, {(1, "current"): 1.0}) == 1.0


def test_a_step_that_gains_nothing_is_shortened_and_then_damped_harder_and_harder(monkeypatch):
    """Half of it, down to a sixteenth; then all of one damped by 0.05, 0.3, 2 and 10 times its curvature; then the fit
    ends, or where little is promised."""
    script = Script([-1.0], 1000.0)
    assert script(monkeypatch).value == START
    assert script.said == [*[0.0] * 5, 0.05, 0.3, 2.0, 10.0]
    assert script.shares == [1.0, 0.5, 0.25, 0.125, 0.0625, *[1.0] * 4]
    little = Script([-1.0], 0.19)
    little(monkeypatch)
    assert little.said == [0.0]


@pytest.mark.parametrize(
    ("gains", "promised", "again"),
    [
        ([1.8, 0.1, 0.0], [1.8, 0.1], False), ([2.0, 0.1, 0.0], [2.0, 0.1], True),
        ([1.9, -1.0], [1.9, 0.19], False), ([2.1, -1.0], [2.1, 0.19], True),
    ],
)  # fmt: skip
def test_an_end_on_kept_slopes_counts_near_those_that_were_all_taken(monkeypatch, gains, promised, again):
    """Ten times the fifth that changes no decision is 2: where the way since slopes were taken gained 1.9 a step that
    gains little, or loses and promised little, ends the fit; after 2.1 the kept slopes may be wrong, and are taken
    anew.  Nothing is confirmed where that was not asked for."""
    script = Script(gains, promised)
    d = script(monkeypatch)
    assert script.said == [0.0, 0.0, *(["smooth", "slopes", 0.0] if again else [])]
    assert d.way <= 2.0
    other = Script(gains, promised)
    other(monkeypatch, confirm=False)
    assert other.said == [0.0, 0.0]


@pytest.mark.parametrize(("gained", "shares"), [(2.6, [1.0, 1.0]), (2.4, [1.0, 0.5])])
def test_a_step_that_gains_less_than_a_quarter_of_what_it_promises_is_shortened(monkeypatch, gained, shares):
    script = Script([gained], 10.0)
    script(monkeypatch)
    assert script.shares[:2] == shares


@pytest.mark.parametrize(("gained", "kept"), [(-1.0, False), (1.0, True)])
def test_no_step_is_taken_that_loses(monkeypatch, gained, kept):
    """Far from the floor a step may promise a loss, where it brings deviations back to their priors."""
    found = Script([gained, 0.0], -10.0)(monkeypatch)
    assert found.value == (START - gained if kept else START)


def test_of_damped_steps_any_gain_is_taken(monkeypatch):
    """Five of no damping gain nothing; the first damped one gains a tenth of its promise."""
    script = Script([-1.0] * 5 + [100.0, 0.0], 1000.0)
    assert script(monkeypatch).value == START - 100.0


def test_a_shorter_step_is_as_long_as_a_bend_allows():
    """2 P a - P a^2 - M a^4 is largest where P (1 - a) = 2 M a^3: for a promise that is small beside what was missed
    near (P / 2 M)^(1/3); never more than a half of the step before, nor less than a tenth."""
    promised, missed = 100.0, 20_000.0
    a = np.linspace(0.0, 1.0, 100_001)
    best = a[np.argmax(2.0 * promised * a - promised * a**2 - missed * a**4)]
    assert fitting.shorter(1.0, promised, missed) == pytest.approx(best, rel=0.05)
    assert fitting.shorter(0.4, promised, 100.5) == 0.2
    assert fitting.shorter(0.4, promised, np.inf) == pytest.approx(0.04)


def test_after_a_short_step_the_next_is_twice_as_long(monkeypatch):
    """Never longer than a whole one."""
    script = Script([-60.0, 5.0, 6.0, 9.0, 0.0], 10.0)
    script(monkeypatch)
    short = (5.0 / 70.0) ** (1.0 / 3.0)
    assert script.shares[:4] == pytest.approx([1.0, short, 2.0 * short, 1.0])


class Place(SimpleNamespace):
    """Stands for a point of a campaign: numbers x, and how steep its valley is."""

    def moved(self, coordinates, x):
        """Return the point at x."""
        return Place(x=x, steep=self.steep)

    def resmoothed(self):
        """Return the same: nothing turns."""
        return self


def of(point, r, slopes):
    """Return equations of residuals r at a point, with slopes (n, p)."""
    own = Segment(
        0, "current", np.arange(len(point.x)), (slopes.T @ slopes)[None], (slopes.T @ r)[None], np.array([r @ r]),
        np.array([float(len(r))]),
    )  # fmt: skip
    return Normal((), point.x, (own,), 3.0, (slopes,))


def valley(point, slopes=None):
    """Return equations of predictions steep x e^y and 10 y of what is read as steep and 0: only the product of x and
    e^y is told well, as of a skin effect's resistance and time constant where that is short."""
    (x, y), steep = point.x, point.steep
    own = np.array([[steep * np.exp(y), steep * x * np.exp(y)], [0.0, 10.0]])
    return of(point, np.array([steep * (1.0 - x * np.exp(y)), -10.0 * y]), own if slopes is None else slopes)


def bent(point, slopes=None):
    """Return equations of predictions 10 x and 5 x^2 of what is read as 10 and 0."""
    x = point.x[0]
    own = np.array([[10.0], [10.0 * x]])
    return of(point, np.array([10.0 - 10.0 * x, -5.0 * x**2]), own if slopes is None else slopes)


def descended(monkeypatch, begun, made, prior, *, confirm=True):
    """Go down from a place; made: equations there, with the slopes of a place before where these are given."""
    monkeypatch.setattr(fitting, "normal", lambda point, *given, **more: made(point))
    monkeypatch.setattr(Normal, "at", lambda n, point, *, workers=1: made(point, n.rows[0]))
    n = made(begun)
    d = Descent(Task(begun, (), {(0, "current"): 1.0}, np.inf, 1), (), begun, n, n.simulations)
    d.down(prior, confirm)
    return d


@pytest.mark.parametrize(("steep", "least"), [(100.0, -np.inf), (1000.0, 0.0)])
def test_a_bent_valley_is_followed(monkeypatch, steep, least):
    """From x = e, y = -1 to 1, 0: nearly all of the 100 is gained.  Steps that were damped and never shortened left 21
    and 99.6 of them.  Shorter steps follow a mild bend; where x cannot be negative it falls in proportion."""
    wide = Prior(np.zeros(2), np.full(2, 1e6), np.array([least, -np.inf]), np.full(2, np.inf))
    begun = Place(x=np.array([np.e, -1.0]), steep=steep)
    assert descended(monkeypatch, begun, valley, wide).value < 0.2


def test_wrong_kept_slopes_do_not_end_a_fit(monkeypatch):
    """By the slope at 0, (10, 0), the fit ends at x = 1, where the residual (0, -5) stands across it: 25 are left.  The
    slope there, (10, 10), leads on to where 2 (1 - x) = x^3, x = 0.770917, with 14.079 left (bisection)."""
    wide = Prior(np.zeros(1), np.full(1, 1e6), np.full(1, -np.inf), np.full(1, np.inf))
    monkeypatch.setattr(fitting, "noise_at", lambda n, weights: 1.0)
    begun = Place(x=np.zeros(1), steep=0.0)
    first, last = (descended(monkeypatch, begun, bent, wide, confirm=confirm) for confirm in (False, True))
    assert (first.taken, first.value) == (1, pytest.approx(25.0))
    assert last.taken > 1
    assert last.value == pytest.approx(14.079, abs=fitting.TOLERANCE)
    assert last.way <= fitting.HERE * fitting.TOLERANCE


@pytest.mark.parametrize(("gained", "goes_on"), [(0.45, False), (0.55, True)])
@pytest.mark.parametrize("leader", [0.0, START])
def test_far_behind_a_rival_a_step_has_to_gain_some_of_what_is_lacking(monkeypatch, gained, goes_on, leader):
    """It lacks 1000 to a rival of 0, so a half is little; beside one that is no better a fifth is."""
    script = Script([gained, 0.0], gained, leader=leader)
    script(monkeypatch)
    assert (len(script.said) > 1) is (goes_on or leader == START)


def test_sizes_fall_in_proportion():
    """3 - 3 ends at 3/e; what grows, may be negative or is none yet goes by difference."""
    prior = Prior(np.zeros(5), np.ones(5), np.array([0.0, 0.0, -np.inf, 0.0, -1.0]), np.full(5, np.inf))
    x, to = np.array([3.0, 3.0, 3.0, 0.0, 3.0]), np.array([0.0, 4.0, 0.0, 0.5, 0.0])
    assert fitting.fallen(x, to, prior) == pytest.approx([3.0 / np.e, 4.0, 0.0, 0.5, 0.0])


def test_at_most_eight_points_of_slopes(monkeypatch):
    """A step gains 0.3 of what is promised: slopes are taken anew after each, eight times in all."""
    script = Script([3.0], 10.0)
    script(monkeypatch)
    assert script.said.count("slopes") == 7  # beside those that it begins with
    assert script.said.count("smooth") == 2
    assert script.said[-2:] == ["slopes", 0.0]


@pytest.mark.parametrize(("smoother", "again"), [(2.9, 0), (3.1, 4)])
def test_motion_is_smoothed_again_where_that_gains_three(monkeypatch, smoother, again):
    """Four times at the most, as long as each gains more than a fifth."""
    asked = []

    def within(task, at):
        """Return a fit that is better by one each time."""
        asked.append(at)
        return Fit((), at, None, START - len(asked), 5.0), smoother

    point = SimpleNamespace(values={})
    point.resmoothed = lambda: point
    monkeypatch.setattr(fitting, "_within_bounds", within)
    found = fitting.fit(point, (), {})
    assert len(asked) == 1 + again
    assert (found.objective, found.simulations) == (START - 1 - again, 5.0 * (1 + again))


def test_what_strays(monkeypatch):
    """An ordinary deviation in its standard deviations; none that an effect widened, none that is held."""
    usual = [Coordinate(n, 1.0, sd, "linear", (n,)) for n, sd in (("a", 0.5), ("b", 0.5), ("c", 0.0))]
    monkeypatch.setattr(fitting, "ordinary", lambda campaign: usual)
    own = (
        usual[0],
        dataclasses.replace(usual[1], deviation=2.0),
        usual[2],
        Coordinate("d", 0.0, 1.0, "linear", ("d",)),
    )
    point = SimpleNamespace(prepared=SimpleNamespace(campaign=None))
    found = stray(
        SimpleNamespace(point=point, coordinates=own, normal=SimpleNamespace(x=np.array([2.5, 9.0, 9.0, 9.0])))
    )
    assert found == {"a": (usual[0], 3.0)}


def test_holding_out_counts_what_was_known_before():
    """Deviation 0.1, so 100 before any reading; A = 1000 and 100.  Without the first the fit keeps 200/1200."""
    own = [Coordinate("x", 0.0, 0.1, "linear", ("bench.x",))]
    n = equations(own, (0, [[1000.0]], [0.0]), (1, [[100.0]], [0.0]))
    assert worst_share(n, (0,), [["x"]]) == pytest.approx(200.0 / 1200.0)


def test_an_inverse_below_one():
    c = Coordinate("x", 0.0, 1.0, "reciprocal", ("bench.x",))
    assert c.changes({"bench.x": 3.0}, 0.5) == {"bench.x": 2.0}


def test_where_probes_start():
    """A parameter known by its logarithm starts at each of its multiples of the typical size; others add no start."""
    others = [e for e in library.effect_names() if e not in ("iron_loss", "dead_time")]
    campaign = SimpleNamespace(drive=DRIVE)
    point = SimpleNamespace(prepared=SimpleNamespace(campaign=campaign), values=library.neutral(DRIVE.motor))
    found, cost = probes.probes(point, others)
    own = [p for p in library.load_effect("iron_loss").parameters if p.fit == "log"]
    assert len(own) == 1
    size = own[0].typical_for(DRIVE.motor, DRIVE.converter)
    starts = [{f"iron_loss.{own[0].name}": s * size} for s in own[0].starts]
    assert [p.start for p in found if p.effect == "iron_loss"] == starts
    assert [p.start for p in found if p.effect == "dead_time"] == [{}]
    assert cost == 0.0


def test_a_trace_of_what_all_currents_share_is_smaller(monkeypatch):
    """Beside others an effect is ordinary up to a share of its wide deviation, three tenths of that for sampling."""
    wide = Coordinate("x", 0.0, 2.0, "linear", ("x",))
    monkeypatch.setattr(spike_slab, "ordinary", lambda campaign: [])
    monkeypatch.setattr(
        spike_slab, "probe_coordinates", lambda point, probe, label: [dataclasses.replace(wide, label=probe.effect)]
    )
    monkeypatch.setattr(
        spike_slab, "normal", lambda point, coordinates, workers: SimpleNamespace(coordinates=coordinates)
    )
    monkeypatch.setattr(spike_slab, "algebra", lambda n, weights: None)
    monkeypatch.setattr(spike_slab, "prior_of", lambda coordinates: [c.deviation for c in coordinates])
    chosen = [probes.Probe(e, {}) for e in ("dead_time", "current_sampling")]
    point = SimpleNamespace(prepared=SimpleNamespace(campaign=SimpleNamespace(drive=DRIVE)), values={})
    t = spike_slab.table(point, chosen, (), 0.05, {}, 1)
    assert t.narrow == pytest.approx([0.05 * 2.0, 0.05 * 0.3 * 2.0])
    assert t.wide == [2.0, 2.0]


def test_shares_of_two_effects_by_hand(monkeypatch):
    """Two recordings alike, so that drawing recordings draws the same: `a` takes 30, `b` 60 off 100 squares of each,
    10 are left; 0.81 explained is scaled to what all of it is.  The larger share comes first."""
    left = {("a", "b"): 200.0, ("a",): 140.0, ("b",): 170.0}  # by what is missing; 100 of them are noise
    monkeypatch.setattr(sharing, "_replayed", lambda j, gone: np.full(2, left[tuple(sorted(gone))]))
    monkeypatch.setattr(sharing, "_waterfall", lambda d, ranked: [(e, 1.0) for e in ranked])
    segments = [SimpleNamespace(recording=k, rr=np.array([110.0]), n=np.array([100.0])) for k in range(2)]
    judged = SimpleNamespace(effects=("a", "b"), fit=SimpleNamespace(normal=SimpleNamespace(segments=segments)))
    d = SimpleNamespace(
        best=SimpleNamespace(effects=("a", "b"), judged=judged), remainder=SimpleNamespace(explained=0.81)
    )
    found = sharing.shares(d)
    assert list(found.of) == ["b", "a"]
    assert found.of["b"] == pytest.approx((0.54, 0.54, 0.54, 0.54))  # 0.81 x 60/90
    assert found.of["a"] == pytest.approx((0.27, 0.27, 0.27, 0.27))
    assert [e for e, _ in found.waterfall] == ["b", "a"]


def test_effects_that_hide_each_other_share_as_their_sizes_say():
    """Effects at their sizes move readings by vectors, r their sum: alone u takes |r|^2 - |r - u|^2, last |u|^2 where
    nothing else is left; the mean is u.r, Shapley's value of |r|^2.  Here v hides a part of u, and v.r is negative."""
    parts = np.random.default_rng(5).standard_normal((3, 300))
    parts[1] = -0.8 * parts[0] + 0.1 * parts[1]
    r = parts.sum(0)
    alone = np.array([r @ r - (r - x) @ (r - x) for x in parts])
    last = np.array([x @ x for x in parts])
    assert sharing.shared_out(alone, last, r @ r) == pytest.approx(parts @ r, rel=1e-12)
    assert parts[1] @ r < 0.0


def test_what_three_at_once_add_is_shared_out():
    """Together 10, in places 6, 3 and -1 (sum 8): the 2 that are left over go as 0.6, 0.3 and 0.1."""
    found = sharing.shared_out(np.array([5.0, 3.0, -2.0]), np.array([7.0, 3.0, 0.0]), np.array(10.0))
    assert found == pytest.approx([7.2, 3.6, -0.8])


def test_only_ordinary_deviations_follow_where_effects_are_missing(monkeypatch):
    """`u` is gone and held at neutral (0), `v` at its best value, what is ordinary (the third) stays free.  `w` is an
    ordinary deviation, too: at its best value 7 it deviates as about its mean of 1, by 0.2 and at most by 0.8."""
    none, wide = np.array([0.0, 0.0, 0.0, 1.0]), np.full(4, np.inf)
    held = Prior(none, np.array([0.0, 3.0, 0.1, 2.0]), -wide, wide)
    monkeypatch.setattr(sharing, "held_at_neutral", lambda j, gone: held)
    narrow = Prior(none, np.array([0.01, 0.03, 0.1, 0.2]), none - 0.8, none + 0.8)
    members, of_effects = {"u": (0,), "v": (1,), "w": (3,)}, np.array([True, True, False, False])
    table = SimpleNamespace(members=members, narrow=narrow, of_effects=of_effects)
    prior = sharing.only_ordinary(
        SimpleNamespace(effects=("u", "v", "w"), table=table), ["u"], np.array([5, -2, 0.3, 7])
    )
    assert prior.mean.tolist() == [0.0, -2.0, 0.0, 7.0]
    assert prior.deviation.tolist() == [0.0, 0.0, 0.1, 0.2]
    assert (prior.low[3], prior.high[3]) == pytest.approx((6.2, 7.8))


@pytest.mark.parametrize("rotor", ["driven", "free"])
@pytest.mark.parametrize(
    ("left", "parts"),
    [([2.9], ["held", "free"]), ([3.1, 3.1], ["held", "held sure"]), ([3.1, 2.9], ["held", "held sure", "free"])],
)
def test_the_sign_of_currents_is_freed_within_three_floors(monkeypatch, left, parts, rotor):
    """Held where it is until then, at first on slopes that nothing confirms; above three floors these are confirmed,
    which may bring it below.  Slopes are taken anew before the sign is freed.  Each part takes 7 simulations, all
    slopes 20; a free rotor's motion, smoothed again, would gain 4 and takes one more."""
    wide = [Coordinate(n, 0.5, sd, "linear", (n,)) for n, sd in (("a", 0.1), ("b", 3.0), (fitting.SIGN[0], 1.0))]
    told, floors, freed = [], chain(left, repeat(left[-1])), parts[-1] == "free"
    point = SimpleNamespace(prepared=SimpleNamespace(campaign=None, recordings=[SimpleNamespace(rotor=rotor)]))
    point.resmoothed = lambda: point
    n = SimpleNamespace(coordinates=tuple(wide), x=np.array([1.0, 2.0, 3.0]), simulations=20.0, segments=())
    n.bare = lambda: n

    def down(d, prior, confirm):
        """Note the part, which takes one step."""
        held = prior.deviation[2] == 0.0
        told.append(("held sure" if confirm else "held") if held else "free" if confirm else "")
        assert prior.mean.tolist() == [0.5, 0.5, 3.0 if held else 0.5]
        assert prior.deviation[:2].tolist() == [0.1, 3.0]
        d.cost, d.value, d.steps = d.cost + 7.0, 98.0, 1

    monkeypatch.setattr(fitting, "coordinates_of", lambda *given: wide)
    monkeypatch.setattr(fitting, "normal", lambda *given, **more: n)
    monkeypatch.setattr(fitting, "normalised", lambda n, weights: next(floors))
    monkeypatch.setattr(fitting, "objective", lambda n, prior, weights: prior.deviation.tolist())
    monkeypatch.setattr(fitting, "tried", lambda *given: (94.0, None))
    monkeypatch.setattr(Descent, "down", down)
    found, smoother = fitting._within_bounds(Task(point, ("b",), {}, np.inf, 1), point)
    assert told == parts
    assert found.objective == [0.1, 3.0, 1.0]  # of what is free to every fit, so that fits compare
    assert [c.label for c in found.coordinates] == ["a", "b", *fitting.SIGN[:freed]]  # a held sign is nobody's to move
    once_more = rotor == "free"
    assert smoother == (4.0 if once_more else 0.0)
    assert found.simulations == 20.0 * (1 + freed) + 7.0 * len(parts) + once_more


def test_a_first_part_without_a_step_is_not_done_twice(monkeypatch):
    """Its slopes are of the point itself: nothing is left to confirm, and 20 simulations were all."""
    wide = [Coordinate(fitting.SIGN[0], 0.5, 1.0, "linear", (fitting.SIGN[0],))]
    point = SimpleNamespace(prepared=SimpleNamespace(campaign=None, recordings=()))
    n = SimpleNamespace(coordinates=tuple(wide), x=np.array([3.0]), simulations=20.0, segments=())
    n.bare, told = (lambda: n), []
    monkeypatch.setattr(fitting, "coordinates_of", lambda *given: wide)
    monkeypatch.setattr(fitting, "normal", lambda *given, **more: n)
    monkeypatch.setattr(fitting, "normalised", lambda n, weights: 3.1)
    monkeypatch.setattr(fitting, "objective", lambda *given: 1.0)
    monkeypatch.setattr(Descent, "down", lambda d, prior, confirm: told.append(confirm))
    assert fitting._within_bounds(Task(point, (), {}, np.inf, 1), point)[0].simulations == 20.0
    assert told == [False]


@pytest.mark.parametrize(("level", "other", "best"), [(2.9, None, "near"), (3.1, 4.0, "other"), (3.1, 6.0, "near")])
def test_a_fit_without_held_out_recordings_counts_all_others(monkeypatch, level, other, best):
    """Three recordings, the second held out: all but its channels count; with none held out nothing is fitted again.
    Beyond three floors a fit from the nominal model, the effect's values alone kept, counts where its objective is
    below that of the first (5), of which it knows: far behind that it ends soon."""
    asked, leaders = [], []

    def told(name, size):
        def fitted(*given, **more):
            asked.append(given)
            leaders.append(more.get("leader"))
            return SimpleNamespace(name=name, objective=size, normal=None)

        return fitted

    monkeypatch.setattr(diagnose, "fit", told("near", 5.0))
    monkeypatch.setattr(diagnose, "attempted", told("other", other))
    monkeypatch.setattr(diagnose, "normalised", lambda n, weights: level)
    recordings = SimpleNamespace(recordings=("a", "b", "c"))
    end = Point(recordings, {"resistance": 1.5, "dead_time.time": 2e-6})
    nominal = Point(recordings, {"resistance": 1.0, "dead_time.time": 0.0})
    whole = SimpleNamespace(point=end, effects=("dead_time",))
    assert diagnose._without(whole, nominal, (), 1) is whole
    assert asked == []
    assert diagnose._without(whole, nominal, (1,), 1).name == best
    assert asked[0][0] is end
    assert leaders == [None, 5.0][: len(asked)]
    assert [(given[0].values) for given in asked[1:]] == [{"resistance": 1.0, "dead_time.time": 2e-6}] * (level > 3.0)
    for _, effects, weights in asked:
        assert effects == ("dead_time",)
        assert weights == {(k, c): 1.0 for k in (0, 2) for c in ("current", "motion", "angle")}
