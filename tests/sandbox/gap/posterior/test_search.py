"""The search for the best set: what it weighs by, and that excerpts only say where it begins.

Numbers come from replays of the points that equations speak of, and from the same search without
excerpts.
"""

import dataclasses

import numpy as np
import pytest

from sandbox.gap.diagnose import in_order
from sandbox.gap.evidence.algebra import prior_of
from sandbox.gap.evidence.fit import (
    BEHIND,
    NEAR,
    TOLERANCE,
    coordinates_of,
    fit,
    objective,
    rms_of,
    variance_at,
)
from sandbox.gap.evidence.normal import ParameterPoint, normal, turns
from sandbox.gap.evidence.priors import CENTER, WIDTH, ordinary
from sandbox.gap.posterior.candidates import Candidate, candidates
from sandbox.gap.posterior.estimates import estimates
from sandbox.gap.posterior.holdout import weights_of
from sandbox.gap.posterior.inference import infer
from sandbox.gap.posterior.linear_model import Linearisation, linear_model
from sandbox.gap.posterior.search import Problem, Search, left_by, log_posterior, towards
from sandbox.gap.settings import USUAL
from sandbox.plant.sets import complete, soft_current
from sandbox.recordings.campaign import read_folder
from sandbox.replay.replay import prepare
from tests.sandbox.gap.conftest import CASES, DRIVE, TURNING, small_campaign, start


def point_of(campaign):
    """Return the nominal point of a campaign, recordings in the diagnosis' order."""
    return ParameterPoint(
        prepare(in_order(campaign)), complete(campaign.drive.motor, campaign.drive.converter)
    )


def segments_of(n):
    """Return the segments of equations, by recording and channel."""
    return [(s.recording, s.channel) for s in n.segments]


def test_what_a_set_leaves_as_its_replay_says(small_folder):
    """Offsets of current sensors add to readings, so equations are exact: the squared residual at
    an offset of phase a that equations give is the one that a replay with this offset leaves (1e-6:
    rounding of slopes over 1e-4)."""
    here = start(small_folder)
    model = linear_model(here, [Candidate("current_offset")], (), Linearisation(0.01), {})
    n = model.normal
    (place,) = (k for k, c in enumerate(n.coordinates) if c.label == "current_offset.offset_a")
    x = n.x.copy()
    x[place] += 0.02
    there = n.at(here.moved(n.coordinates, x))
    variance = dict.fromkeys(segments_of(n), 5.0)
    told = left_by(model, x, variance)
    for before, after in zip(n.segments, there.segments, strict=True):
        size = float(before.n.sum())
        share = (float(after.ssr.sum()) - size) / (float(before.ssr.sum()) - size)
        key = (before.recording, before.channel)
        assert told[key] == pytest.approx(1.0 + 4.0 * min(1.0, max(0.0, share)), rel=1e-6), key
    assert len(set(told.values())) > 1


def test_a_set_finds_its_slopes_among_those_of_all_candidates(small_folder):
    """A capacitance that dead time begins from and that is none there already moves nothing along
    with it: a column is the same with and without.  Against slopes taken for the set alone, over
    other steps: 1e-3 of each column's size."""
    here = start(small_folder)
    wide = linear_model(
        here, [Candidate("dead_time", {"dead_time.capacitance": 0.0})], (), Linearisation(0.01), {}
    ).normal
    own = coordinates_of(here, ("dead_time",))
    known = wide.of(own)
    assert known is not None
    known, taken = known.summed().a, normal(here, own).summed().a
    size = np.sqrt(np.diag(taken))
    assert np.all(np.abs(known - taken) <= 1e-3 * np.outer(size, size))
    on = dataclasses.replace(
        here, values={**here.values, "dead_time.time": 1e-6, "dead_time.capacitance": 1e-10}
    )
    (time,) = (c for c in wide.coordinates if c.names == ("dead_time.time",))
    assert normal(on, [time]).of([dataclasses.replace(time, along=())]) is None


def test_an_ordinary_value_is_weighed_once(small_folder):
    """Dead time of two and a half ordinary deviations, of which the slope and a finite change both
    stand among the candidates: the change is a trace beside the ordinary column, and none at the
    point.  Without effects the prior holds 2.5^2 against the point, however small traces are (the
    error that this test is for: the same once more for the trace's deviation, 24 000)."""
    here = start(small_folder)
    (usual,) = (c for c in ordinary(here.prepared.campaign) if c.label == "dead_time.time")
    at = dataclasses.replace(here, values={**here.values, "dead_time.time": 2.5 * usual.deviation})
    own = [Candidate("dead_time", {"dead_time.capacitance": 0.0}, chord) for chord in (0.0, 4e-6)]
    model = linear_model(at, own, (), Linearisation(0.01), {})
    assert sum(c.names == ("dead_time.time",) for c in model.coordinates) == 2
    prior = model.prior(())
    away = (model.normal.x - prior.mean) / np.where(prior.deviation > 0.0, prior.deviation, 1.0)
    assert float(away @ away) == pytest.approx(2.5**2, rel=1e-9)


def test_orders_that_a_further_part_may_have_are_columns_of_their_own(small_folder):
    """Two orders of a second part beside the first: each candidate has two columns, alike to none
    of the others'; harmonics of other orders are nearly orthogonal where the rotor turns."""
    here = start(small_folder)
    here = dataclasses.replace(here, values={**here.values, "flux_harmonics.psi_d6": 1e-4})
    first = Candidate("flux_harmonics")
    more = [Candidate("flux_harmonics", {"flux_harmonics.2.order": x}, part=2) for x in (12, 18)]
    model = linear_model(here, [first, *more], ("flux_harmonics",), Linearisation(0.01), {})
    own = [set(places) for places in model.places[1:]]
    assert not own[0] & own[1]
    a = model.normal.summed().a
    k, m = (next(iter(sorted(x))) for x in own)
    assert abs(a[k, m]) < 0.2 * np.sqrt(a[k, k] * a[m, m])


def test_other_forms_are_candidates_where_a_size_is_to_be_told(small_folder):
    """Far from the floor dead time is a candidate in both of its forms; a shaft, which is nothing
    but shapes, in its first one alone: a fit tries the other, with a backlash."""
    found = candidates(start(small_folder), left=2.0 * NEAR)
    assert {c.start["dead_time.capacitance"] > 0.0 for c in found if c.effect == "dead_time"} == {
        False,
        True,
    }
    assert {c.start["shaft_compliance.backlash"] for c in found if c.effect == "shaft_compliance"}
    assert not any(c.start.get("shaft_compliance.backlash") for c in found)


def test_nothing_moved_leaves_what_there_is_and_noise_counts_whole(small_folder):
    model = linear_model(
        start(small_folder), [Candidate("current_offset")], (), Linearisation(0.01), {}
    )
    variance = dict.fromkeys(segments_of(model.normal), 3.0)
    assert left_by(model, model.normal.x, variance) == pytest.approx(variance)


def test_a_fit_that_is_not_at_its_best_point_is_less_probable_by_its_own_objective(small_folder):
    """An offset of a current sensor moves no slope, so nothing but the objective changes: half of
    it, weighed."""
    own = start(small_folder)
    weights = weights_of(len(own.prepared.recordings))
    f = fit(own, ("current_offset",), weights, rough=0.0)
    n = normal(f.point, f.coordinates[: -len(turns(f.point.prepared))])
    (place,) = (k for k, c in enumerate(n.coordinates) if c.label == "current_offset.offset_a")
    x = n.x.copy()
    x[place] += 0.05
    point = f.point.moved(n.coordinates, x)
    met, prior = dict.fromkeys(segments_of(n), 0.25), prior_of(n.coordinates)
    one, two = (
        dataclasses.replace(f, point=p, normal=m) for p, m in ((f.point, n), (point, n.at(point)))
    )
    fallen = log_posterior(one, met, USUAL) - log_posterior(two, met, USUAL)
    assert fallen == pytest.approx(
        0.5 * (objective(two.normal, prior, met) - objective(n, prior, met)), rel=1e-6
    )
    assert fallen > 1.0


class Fits:
    """A run whose fits are given: the residual that each set leaves, all in one recording, and what
    was fitted."""

    def __init__(self, run, left):
        self.run, self.left, self.asked = run, left, []
        run.fit_of = self.fit_of

    def fit_of(self, key, near, known, sets=None, best=()):
        """Return the fit here with the residual scaled to what the set leaves."""
        self.asked.append(key)
        if key not in self.left:
            return None
        whole = sum(float(s.ssr.sum()) for s in near.normal.segments)
        scaled = [
            dataclasses.replace(s, ssr=s.ssr * self.left[key] / whole) for s in near.normal.segments
        ]
        return dataclasses.replace(
            near, effects=key, normal=dataclasses.replace(near.normal, segments=tuple(scaled))
        )


@pytest.fixture
def far(small_folder):
    """A run of the search, its first fit, and the posterior there; far from the floor, as dead time
    is missing."""
    own = start(small_folder)
    run = Search(Problem(own, weights_of(len(own.prepared.recordings))))
    run.found = candidates(run.null.point)
    sets = run.linearised(run.null, run.found)
    assert rms_of(run.null) > NEAR
    return run, sets


def test_far_from_the_floor_a_set_whose_fit_is_worse_is_not_taken(far):
    """All sets leave more than there is, but for one of those that are tried: it is taken, each set
    is tried once."""
    run, sets = far
    own = max((k for k in sets.known if not sets.parts(k)), key=sets.known.__getitem__)
    near = sorted(
        (k for k, v in sets.known.items() if v >= sets.known[own] - USUAL.near),
        key=lambda k: -sets.known[k],
    )
    keys = list(dict.fromkeys(sets.names(k) for k in near if k))
    count, whole = float(sum(s.n.sum() for s in run.null.normal.segments)), rms_of(run.null) ** 2
    left = dict.fromkeys(keys, 1.5 * whole * count)
    fits = Fits(run, left)
    seen, tried = {()}, set()
    assert run.better(run.null, None, sets, seen, tried) is None
    assert fits.asked == keys[: USUAL.tries]
    assert tried == {tuple((e, 1) for e in k) for k in fits.asked}
    tried.clear()
    last = keys[: USUAL.tries][-1]
    left[last], fits.asked = count, []
    taken = run.better(run.null, None, sets, seen, tried)
    assert taken.effects == fits.asked[-1] == last
    assert not tried
    assert tuple((e, 1) for e in last) in seen


@pytest.mark.parametrize(("more", "taken"), [(1.5, False), (0.5, True)])
def test_near_the_floor_too_a_set_is_taken_where_its_own_fit_proves_better(far, more, taken):
    """Twice the noise here, every reading counting whole, with the posterior of the far point: the
    most probable set alone is tried, and what its fit leaves decides, half as much again or half of
    it (thousands of nats either way), whatever slopes promise."""
    run, sets = far
    run.met = {(s.recording, s.channel): 1.0 for s in run.null.normal.segments}
    count = float(sum(s.n.sum() for s in run.null.normal.segments))
    here = Fits(run, {(): 4.0 * count}).fit_of((), run.null, None)
    assert rms_of(here) == pytest.approx(2.0)
    best = sets.names(sets.best())
    fits, seen, tried = Fits(run, {best: 4.0 * more * count}), {()}, set()
    assert (run.better(here, None, sets, seen, tried) is not None) is taken
    assert fits.asked == [best]
    assert tuple((e, 1) for e in best) in (seen if taken else tried)


def test_a_set_that_excerpts_name_near_the_floor_is_fitted_whole(small_folder):
    """Before all candidates are linearised at its point, once: a whole fit from there gains less
    than a step's end."""
    campaign = read_folder(small_folder)
    whole, part = (
        point_of(campaign),
        point_of(dataclasses.replace(campaign, recordings=campaign.recordings[::2])),
    )
    run = Search(
        Problem(
            whole, weights_of(len(campaign.recordings)), ("device_drop",), excerpts=lambda: part
        )
    )
    here, rough = run.begun()
    assert here.effects == ("dead_time",)
    assert rms_of(here) <= NEAR
    assert not rough
    again = fit(here.point, here.effects, run.problem.fitted)
    assert here.objective - again.objective < TOLERANCE  # at the floor
    points, linearised = [], run.linearised
    run.linearised = lambda at, *rest: points.append(at) or linearised(at, *rest)
    found, known = run.grown(here, rough)
    assert points == [here]
    assert found is here
    assert known is not None


def test_excerpts_only_say_where_the_search_begins(small_folder):
    """Half of the recordings as excerpts: the set, its chance and its size come out as without
    them.

    Both fits end where a step gains less than TOLERANCE of the objective, sqrt(0.5) = 0.71 standard
    deviations away at most: they are apart by 2 x 0.71 / 1.96 = 0.72 halves of 95 %."""
    campaign = read_folder(small_folder)
    whole, part = (
        point_of(campaign),
        point_of(dataclasses.replace(campaign, recordings=campaign.recordings[::2])),
    )
    told: list[str] = []
    problem = Problem(
        whole, weights_of(len(campaign.recordings)), ("device_drop",), report=told.append
    )
    first = infer(problem)
    told.clear()
    second = infer(dataclasses.replace(problem, excerpts=lambda: part))
    assert told.index("fitting dead_time") < told.index("weighing all sets of effects")
    assert second.best.effects == first.best.effects == ("dead_time",)
    assert second.sets["dead_time",] == pytest.approx(first.sets["dead_time",], abs=0.01)
    one, two = (estimates(x.best)["dead_time.time"] for x in (first, second))
    assert two.value == pytest.approx(one.value, abs=0.72 * 0.5 * (one.high - one.low))


def test_a_form_that_is_ordinary_stays_where_its_effect_is_left_out(small_folder):
    """80 ns in all, of 50 ns that are a deviation, keep their capacitance, of which a drive has
    one, too; 800 ns are none that a drive has by itself: all of them go."""
    here = start(small_folder)
    small = {"dead_time.time": 6e-8, "dead_time.capacitance": 1e-10, "dead_time.residual": 2e-8}
    large = small | {"dead_time.time": 8e-7}
    for put_in, left in ((small, small), (large, dict.fromkeys(large, 0.0))):
        at = dataclasses.replace(here, values={**here.values, **put_in})
        own = fit(at, ("dead_time",), weights_of(len(at.prepared.recordings)), rough=0.0)
        own = dataclasses.replace(own, point=at)
        begun = towards(own, (), ()).values
        assert {name: begun[name] for name in left} == left
        names = {c.names[0] for c in coordinates_of(towards(own, (), ()), ())}
        assert ("dead_time.capacitance" in names) == (left is small)


def test_a_rival_that_is_asked_for_is_fitted_whole_however_far_behind(small_folder):
    """A drop of the switches is 9000 of the objective behind the dead time that is there, and its
    slopes promise no way to it: a rival of the search's own would end on the way.  From where it
    ends another fit gains less than what ends one."""
    here = start(small_folder)
    weights = weights_of(len(here.prepared.recordings))
    found = infer(Problem(here, weights, rivals=[("device_drop",)]))
    assert found.best.effects == ("dead_time",)
    own = found.evaluated["device_drop",].fit
    little = TOLERANCE * variance_at(own.normal, weights)
    assert own.objective > found.best.fit.objective + 2.0 * BEHIND * little / TOLERANCE
    assert own.objective - fit(own.point, own.effects, weights).objective < little


def test_a_sign_whose_zone_lies_on_the_wrong_side_of_zero_is_tried_on_the_other():
    """Late edges above zero current only (a zone beside zero, as one bench has it).  A fit that
    ends with the zone below zero is made again from the other side; one that is right stays."""
    zone = {"zone_width": 3.0 * soft_current(DRIVE.motor), "zone_center": 1.0}
    put_in = {"dead_time.time": 2e-7} | {f"dead_time.{name}": x for name, x in zone.items()}
    here = point_of(small_campaign(put_in, CASES + TURNING))
    weights = weights_of(len(here.prepared.recordings))
    begun = {"dead_time.time": 2e-7, WIDTH: zone["zone_width"], CENTER: 1.0}
    at = dataclasses.replace(here, values={**here.values, **begun})
    right = fit(at, ("dead_time",), weights)
    run = Search(Problem(here, weights))
    assert right.point.values[CENTER] > 0.9
    assert run.mirrored(right) is right
    wrong = dataclasses.replace(right.point, values={**right.point.values, CENTER: -1.0})
    n = normal(wrong, coordinates_of(wrong, ("dead_time",)))
    value = objective(n, prior_of(n.coordinates), weights)
    ended = dataclasses.replace(right, point=wrong, normal=n, objective=value)
    assert 1.01 < rms_of(ended) < NEAR
    found = run.mirrored(ended)
    assert found.point.values[CENTER] > 0.9
    assert found.objective == pytest.approx(right.objective, abs=TOLERANCE)
