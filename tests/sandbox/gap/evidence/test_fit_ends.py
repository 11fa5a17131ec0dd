"""Where a fit ends, and when a residual is more than noise: on a small campaign of the switched
bench, each fit some tenths of a second.

Every test asks for the other answer too, beside the limit that it guards.
"""

import dataclasses

import numpy as np
import pytest

from sandbox.gap.evidence import fit as fitted
from sandbox.gap.evidence.fit import (
    BEHIND,
    FIRST_SLOPES,
    SCATTER,
    TOLERANCE,
    fit,
    keeps_more,
    normalised,
    rms_of,
    variance_at,
)
from sandbox.gap.evidence.normal import ParameterPoint, normal
from sandbox.gap.posterior.holdout import weights_of
from sandbox.gap.settings import USUAL
from sandbox.plant.sets import complete
from sandbox.replay.replay import prepare
from tests.sandbox.gap.conftest import CASES, small_campaign, start, with_added

ALL = weights_of(len(CASES))


def point_of(campaign):
    """Return the nominal point of a campaign."""
    return ParameterPoint(
        prepare(campaign), complete(campaign.drive.motor, campaign.drive.converter)
    )


@pytest.fixture(scope="module")
def clean():
    """The fit without effects of a bench that has none."""
    return fit(point_of(small_campaign({})), (), ALL)


@pytest.fixture(scope="module")
def missed():
    """The fit without effects where a current of two noise floors is of no library."""
    return fit(point_of(with_added(small_campaign({}), 0.008)), (), ALL)


@pytest.fixture(scope="module")
def late(small_folder):
    """The nominal point of a bench with a dead time, and the fit that names it."""
    here = start(small_folder)
    return here, fit(here, ("dead_time",), ALL)


def left_in(f):
    """Return the squared residual and the number of readings of each recording."""
    squares, counts = np.zeros(len(CASES)), np.zeros(len(CASES))
    for s in f.normal.segments:
        squares[s.recording] += float(s.ssr.sum())
        counts[s.recording] += float(s.n.sum())
    return np.array([squares, counts])


def with_left(f, recording, ratio):
    """Return a fit one of whose recordings keeps this mean square, all its channels alike."""
    square, count = left_in(f)[:, recording]
    own = [
        dataclasses.replace(s, ssr=s.ssr * ratio * count / square)
        if s.recording == recording
        else s
        for s in f.normal.segments
    ]
    return dataclasses.replace(f, normal=dataclasses.replace(f.normal, segments=tuple(own)))


def test_chance_of_one_recording_is_no_more_than_noise(clean):
    """Of four recordings of noise one is above 1, as every second one is; up to SCATTER standard
    deviations of a mean square over n readings, sqrt(2/n), none of it is asked for."""
    square, count = left_in(clean)
    assert np.any(square > count)
    assert not keeps_more(clean, 1.0)
    chance = SCATTER * np.sqrt(2.0 / count[0])
    assert not keeps_more(with_left(clean, 0, 1.0 + 0.9 * chance), 1.0)
    assert keeps_more(with_left(clean, 0, 1.0 + 1.1 * chance), 1.0)


def test_one_recording_that_keeps_more_is_not_hidden_by_the_others(clean):
    """1.25 in both channels of one of four recordings: rms 1.12 there, less over all of them."""
    one = with_left(clean, 2, 1.25)
    assert rms_of(one) < 1.1
    assert keeps_more(one, 1.1)
    assert not keeps_more(one, 1.12)


def test_channels_of_a_recording_count_together(clean):
    """What its angle keeps more than noise, and its currents less, is no more than noise."""
    (angle,) = (s for s in clean.normal.segments if (s.recording, s.channel) == (2, "angle"))
    (current,) = (s for s in clean.normal.segments if (s.recording, s.channel) == (2, "current"))
    more = 0.2 * float(angle.n.sum())
    scaled = {
        id(s): dataclasses.replace(s, ssr=s.ssr * (1.0 + x / float(s.ssr.sum())))
        for s, x in ((angle, more), (current, -more))
    }
    own = tuple(scaled.get(id(s), s) for s in clean.normal.segments)
    f = dataclasses.replace(clean, normal=dataclasses.replace(clean.normal, segments=own))
    chance = 1.0 + SCATTER * np.sqrt(2.0 / float(angle.n.sum()))
    assert float(scaled[id(angle)].ssr.sum() / angle.n.sum()) > chance
    assert not keeps_more(f, 1.0)


def test_the_variance_of_a_gain_is_that_of_what_is_left(clean):
    """1 where segments leave noise; where one leaves E beyond noise and two deviations of it, 1 +
    E/d with d independent shapes (`misfit`)."""
    assert variance_at(clean.normal, ALL) == 1.0
    count = left_in(clean)[1, 0]
    one = with_left(clean, 0, 3.0)
    beyond = 2.0 * count - 2.0 * np.sqrt(2.0 * count)
    assert variance_at(one.normal, ALL) == pytest.approx(1.0 + beyond / USUAL.shapes)
    others = {key: x for key, x in ALL.items() if key[0] != 0}
    assert variance_at(one.normal, others) == 1.0  # a recording that does not count


def off_by(f, gain):
    """Return a fit's point with a sensor's offset moved by what costs so much of the objective:
    readings are linear in it."""
    (k,) = (k for k, c in enumerate(f.coordinates) if c.label == "current_offset.offset_a")
    curvature = f.normal.summed(ALL).a[k, k] + 1.0 / f.coordinates[k].deviation ** 2
    x = f.normal.x.copy()
    x[k] += np.sqrt(gain / curvature)
    return f.point.moved(f.coordinates, x)


@pytest.mark.parametrize(("share", "steps"), [(0.5, 1), (2.0, 2)])
def test_a_fit_ends_where_a_step_gains_less_than_half_of_the_variance_of_its_misfit(
    missed, share, steps
):
    """Beside a current of no library gains meet 60 times the variance of noise.  From a point that
    lacks half of what ends a fit, one step on the slopes taken there is the last; from one that
    lacks twice that, a second one shows that there is nothing left.  By the noise's variance alone
    the first would step twice, too."""
    little = TOLERANCE * variance_at(missed.normal, ALL)
    assert little > 10.0 * TOLERANCE
    assert fit(missed.point, (), ALL).objective == pytest.approx(missed.objective, abs=0.1 * little)
    begun = off_by(missed, share * little)
    slopes = normal(begun, missed.coordinates[: -len(CASES)]).simulations  # turns are no replays
    again = fit(begun, (), ALL)
    assert again.objective == pytest.approx(missed.objective, abs=little)
    assert again.simulations == slopes + steps


def test_a_fit_far_behind_its_rival_ends_where_slopes_promise_no_way_to_it(late):
    """A drop of the switches in the place of a dead time: 9000 of the objective behind, where its
    slopes are taken a third time it promises a hundred."""
    here, best = late
    whole, ended = (fit(here, ("device_drop",), ALL, leader=x) for x in (np.inf, best.objective))
    behind = 2.0 * BEHIND * variance_at(whole.normal, ALL)
    assert whole.objective > best.objective + behind
    assert ended.simulations < whole.simulations
    assert ended.objective > best.objective + behind


def test_a_fit_that_is_not_far_behind_goes_on(late):
    """Less behind than a hundred thousandth of the chance: the same to the bit as without a
    rival."""
    here, _ = late
    whole = fit(here, ("device_drop",), ALL)
    near = whole.objective - 0.9 * 2.0 * BEHIND * variance_at(whole.normal, ALL)
    again = fit(here, ("device_drop",), ALL, leader=near)
    assert (again.objective, again.simulations) == (whole.objective, whole.simulations)


def test_a_fit_far_behind_goes_on_where_slopes_promise_the_way(late):
    """A dead time from none at all, beside a rival that is where it ends: it begins millions
    behind, and gets there."""
    here, best = late
    again = fit(here, ("dead_time",), ALL, leader=best.objective)
    assert (again.objective, again.simulations) == (best.objective, best.simulations)


def test_a_first_part_takes_slopes_a_few_times_only(late, monkeypatch):
    """A dead time that begins with a fifty times too large capacitance bends all the way: with the
    sign of a current held, then free, slopes are taken FIRST_SLOPES times at most.  Calls are
    counted, nothing is changed."""
    here, _ = late
    bent = {**here.values, "dead_time.time": 2e-6, "dead_time.capacitance": 5e-9}
    begun, taken = dataclasses.replace(here, values=bent), []
    monkeypatch.setattr(fitted, "normal", lambda *a, **k: taken.append(a) or normal(*a, **k))
    first = fit(begun, ("dead_time",), ALL, rough=0.0)
    assert len(taken) <= 2 * FIRST_SLOPES
    taken.clear()
    whole = fit(begun, ("dead_time",), ALL)
    assert len(taken) > 2 * FIRST_SLOPES
    assert normalised(whole.normal, ALL) < normalised(first.normal, ALL)
