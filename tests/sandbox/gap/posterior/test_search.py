"""The search for the best set: what it weighs by, and that excerpts only say where it begins.

Numbers come from replays of the points that equations speak of, and from the same search without excerpts.
"""

import dataclasses

import pytest

from sandbox.gap.diagnose import in_order
from sandbox.gap.evidence.fit import fit
from sandbox.gap.evidence.normal import Point
from sandbox.gap.posterior.candidates import Candidate
from sandbox.gap.posterior.estimates import estimates
from sandbox.gap.posterior.holdout import weights_of
from sandbox.gap.posterior.inference import Problem, infer, left_by, log_posterior
from sandbox.gap.posterior.linear_model import linear_model, no_weights
from sandbox.gap.posterior.set_prior import log_prior
from sandbox.gap.posterior.settings import USUAL
from sandbox.plant.sets import complete
from sandbox.recordings.campaign import read_campaign
from sandbox.replay.replay import prepare
from tests.sandbox.gap.conftest import start


def point_of(campaign):
    """Return the nominal point of a campaign, recordings in the diagnosis' order."""
    return Point(prepare(in_order(campaign)), complete(campaign.drive.motor, campaign.drive.converter))


def test_what_a_set_leaves_as_its_replay_says(small_folder):
    """Offsets of current sensors add to readings, so equations are exact: the squared residual at an offset of phase a
    that equations give is the one that a replay with this offset leaves (1e-6: rounding of slopes over 1e-4)."""
    here = start(small_folder)
    model = linear_model(here, [Candidate("current_offset")], (), 0.01, {})
    n = model.normal
    (place,) = (k for k, c in enumerate(n.coordinates) if c.label == "current_offset.offset_a")
    x = n.x.copy()
    x[place] += 0.02
    there = n.at(here.moved(n.coordinates, x))
    variance = dict.fromkeys(no_weights(n), 5.0)
    told = left_by(model, x, variance)
    for before, after in zip(n.segments, there.segments, strict=True):
        size = float(before.n.sum())
        share = (float(after.rr.sum()) - size) / (float(before.rr.sum()) - size)
        key = (before.recording, before.channel)
        assert told[key] == pytest.approx(1.0 + 4.0 * min(1.0, max(0.0, share)), rel=1e-6), key
    assert len(set(told.values())) > 1


def test_nothing_moved_leaves_what_there_is_and_noise_counts_whole(small_folder):
    model = linear_model(start(small_folder), [Candidate("current_offset")], (), 0.01, {})
    variance = dict.fromkeys(no_weights(model.normal), 3.0)
    assert left_by(model, model.normal.x, variance) == pytest.approx(variance)


def test_the_density_of_a_fitted_set_by_hand(small_folder):
    """Half of the weighed squares of residuals and of deviations over their priors, and the set's prior."""
    own = start(small_folder)
    weights = weights_of(len(own.prepared.recordings))
    f = fit(own, ("dead_time",), weights, rough=True)
    met = dict.fromkeys(no_weights(f.normal), 0.25)
    squares = 0.25 * sum(float(s.rr.sum()) for s in f.normal.segments)
    away = sum(
        ((x - c.mean) / c.deviation) ** 2
        for x, c in zip(f.normal.x, f.normal.coordinates, strict=True)
        if c.deviation > 0.0
    )
    want = log_prior(("dead_time",), USUAL) - 0.5 * (squares + away)
    assert log_posterior(f, met, USUAL) == pytest.approx(want)


def test_excerpts_only_say_where_the_search_begins(small_folder):
    """Half of the recordings as excerpts: the set, its chance and its size come out as without them.

    Both fits end where a step gains less than 0.2 of the objective, 0.45 standard deviations away at most: they are
    apart by 0.46 halves of 95 %."""
    campaign = read_campaign(small_folder)
    whole, part = point_of(campaign), point_of(dataclasses.replace(campaign, recordings=campaign.recordings[::2]))
    told: list[str] = []
    problem = Problem(whole, weights_of(len(campaign.recordings)), ("device_drop",), report=told.append)
    first = infer(problem)
    told.clear()
    second = infer(dataclasses.replace(problem, excerpts=part))
    assert told.index("fitting dead_time") < told.index("weighing all sets of effects")
    assert second.best.effects == first.best.effects == ("dead_time",)
    assert second.sets["dead_time",] == pytest.approx(first.sets["dead_time",], abs=0.01)
    one, two = (estimates(x.best)["dead_time.time"] for x in (first, second))
    assert two.value == pytest.approx(one.value, abs=0.46 * 0.5 * (one.high - one.low))
