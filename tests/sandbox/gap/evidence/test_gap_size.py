"""How large a gap is: the share closed and its interval, against planted scatter of blocks."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from sandbox.gap.diagnose import _without
from sandbox.gap.evidence.algebra import prior_of
from sandbox.gap.evidence.fit import NEAR, TOLERANCE, fit, normalised, objective, variance_at
from sandbox.gap.evidence.gap_size import Size, size_of
from sandbox.gap.evidence.normal import ParameterPoint
from sandbox.gap.posterior.holdout import weights_of
from sandbox.gap.report.answers import far_text
from sandbox.plant.sets import complete
from sandbox.recordings.campaign import read_folder
from sandbox.replay.replay import prepare
from tests.sandbox.gap.sizes import BLOCKS, SCATTER, fit_with, size_at


@pytest.mark.parametrize("deviations", [1.0, 1.4, 1.55, 1.65])
def test_near_the_floor_there_is_no_interval(deviations):
    """A normal mean 1 (1.4, 1.55) deviations above the floor falls below in 16 % (8, 6 %) of draws;
    at 1.65 in 5 %, with the draws that meet the floor exactly (blocks have two sizes) in 6.5 %."""
    s = size_at(deviations)
    assert s.closed == pytest.approx(0.5)
    assert s.closed_ci95 is None


@pytest.mark.parametrize("deviations", [1.8, 2.2, 100.0])
def test_farther_off_the_interval_holds_the_share(deviations):
    """At 1.8 (2.2) deviations 3.6 % (1.4 %) of draws fall below; what closes is drawn with the gap,
    excess e': (e/2)/e'.  So a draw z deviations off gives 1/2 / (1 + z/deviations), far off 1/2
    (1 -+ 1.96/deviations).
    """
    s = size_at(deviations)
    low, high = s.closed_ci95
    assert low < 0.5 < high
    if deviations > 10.0:
        assert (low, high) == pytest.approx((0.5 / 1.0196, 0.5 / 0.9804), rel=0.003)


def twice(one):
    """Return a fit whose second channel was read at the same times and scatters as the first."""
    return replace(one, normal=replace(one.normal, segments=one.normal.segments * 2))


def test_channels_of_one_time_are_no_more_blocks():
    """A channel that repeats another tells nothing new: the share and its interval are those of one
    channel."""
    scatter = 1.0 + SCATTER * np.random.default_rng(1).standard_normal(BLOCKS)
    before, after = fit_with(1.0 + scatter), fit_with(1.0 + 0.3 * scatter**2, ("x",))
    one, two = (
        size_of(b.normal, b, a, [0], ["a"])
        for b, a in ((before, after), (twice(before), twice(after)))
    )
    assert two == one
    assert one.closed_ci95 is not None


@pytest.mark.parametrize("blocks", [7, 8])
def test_few_blocks_of_time_have_no_interval(blocks):
    """Of one recording with two channels; a bootstrap over b values is sqrt((b-1)/b) 1.96 / t(b-1)
    as wide as it should be: over 7 0.74, over 8 0.78."""
    scatter = np.linspace(0.9, 1.1, blocks)
    before, after = twice(fit_with(2.0 * scatter)), twice(fit_with(1.1 * scatter, ("x",)))
    s = size_of(before.normal, before, after, [0], ["a"])
    assert s.closed == pytest.approx(0.9)
    assert (s.closed_ci95 is None) == (blocks < 8)


def test_a_missing_interval_is_said():
    near, short = Size(2.0, 1.01, 1.0, 0.9, None, ()), Size(9.0, 9.0, 1.0, 0.9, None, (), 6)
    texts = [
        far_text(
            SimpleNamespace(
                diagnosis=SimpleNamespace(size=s, held_out=(0,)), verdict="explained", position=None
            )
        )
        for s in (near, short)
    ]
    assert all("90.0 % of the reducible gap closes" in text for text in texts)
    assert "(no interval: the gap is too near the noise floor)" in texts[0]
    assert "(no interval: the recordings are too short, 6 blocks of time where it" in texts[1]


def test_a_recording_held_out_leaves_nothing_in_the_fit_to_the_others(small_folder):
    """One recording's currents are a fifth too large, so the fit to all is wrong.  From there the
    fit to the others ends where it does from the nominal model: a step that gains less than
    TOLERANCE ends either."""
    own, effects = read_folder(small_folder), ("dead_time",)
    first, others = own.recordings[0], weights_of(len(own.recordings), (0,))
    wrong = {k: (1.2 * x if k in ("i_a", "i_b", "i_c") else x) for k, x in first.columns.items()}
    spoilt = replace(own, recordings=(replace(first, columns=wrong), *own.recordings[1:]))
    start = ParameterPoint(prepare(spoilt), complete(own.drive.motor, own.drive.converter))
    whole, honest = (
        fit(start, effects, weights_of(len(own.recordings))),
        fit(start, effects, others),
    )
    found = _without(whole, start, (0,), 1)
    assert normalised(found.normal, others) < NEAR  # one fit, from the end of the whole one
    little = 2.0 * TOLERANCE * variance_at(honest.normal, others)
    assert found.objective == pytest.approx(honest.objective, abs=little)
    seen = objective(whole.normal, prior_of(whole.coordinates), others)
    assert seen > honest.objective + 100.0 * little  # where it began


@pytest.fixture
def at_nominal(small_folder):
    """The nominal point of a campaign and the whole fit of a wrong effect, far from the floor."""
    own = read_folder(small_folder)
    start = ParameterPoint(prepare(own), complete(own.drive.motor, own.drive.converter))
    return start, fit(start, ("inductance",), weights_of(len(own.recordings)))


def ended_at(whole, **values):
    """Return a fit that ended at other values."""
    moved = {name.replace("__", "."): x for name, x in values.items()}
    return replace(whole, point=replace(whole.point, values={**whole.point.values, **moved}))


def test_a_fit_to_the_others_that_no_drive_can_begin_is_left(at_nominal):
    """The whole fit ended beyond what a motor can have, in a deviation that its effect does not
    claim: the one from the nominal model stands alone, as where both are made it is the better of
    the two."""
    start, whole = at_nominal
    spoilt = ended_at(whole, stator_resistance__resistance=-1.0)
    found = _without(spoilt, start, (0,), 1)
    others = weights_of(len(start.prepared.recordings), (0,))
    assert found is not spoilt
    assert found.objective == pytest.approx(
        fit(start, ("inductance",), others).objective, rel=0.001
    )


def test_where_no_fit_to_the_others_can_be_made_the_whole_one_stands(at_nominal):
    """The effect's own value is none that a motor can have: neither beginning is one."""
    start, whole = at_nominal
    spoilt = ended_at(whole, inductance__scale_q=9.0)
    assert _without(spoilt, start, (0,), 1) is spoilt
