"""The recommended recording: nothing to learn between a hypothesis and itself, much between dead time and none."""

import pytest

from sandbox.gap.discriminate import expected_evidence, recommend
from sandbox.gap.fit import fit
from sandbox.gap.menu import menu
from sandbox.gap.probes import probes_at_typical
from sandbox.gap.search import judge
from sandbox.gap.split import weights_of
from sandbox.gap.table import ordinary_share
from tests.sandbox.gap.test_evidence import start


@pytest.fixture(scope="module")
def pair(small_folder):
    at = start(small_folder)
    weights = weights_of(len(at.prepared.recordings))
    chosen = [p for p in probes_at_typical(at) if p.effect in ("dead_time", "device_drop", "encoder_offset")]
    return [
        judge(fit(at, effects, weights), chosen, ordinary_share(1.0), weights, 1)
        for effects in (("dead_time",), ("device_drop",))
    ]


def test_nothing_tells_a_hypothesis_from_itself(pair):
    """Not even a free rotor, whose wanted motion is not the one that predicted currents give."""
    campaign = pair[0].fit.point.prepared.campaign
    for entry in menu(campaign.drive):
        assert expected_evidence(campaign, entry, pair[0], pair[0], 1.0) == pytest.approx(0.0, abs=1e-6), entry.name
        assert recommend(campaign, [pair[0], pair[0]], 1.0, [entry]) is None


def test_an_experiment_is_recommended_that_the_wrong_hypothesis_cannot_follow(pair):
    """The cards' own advice: a second link voltage, or zero crossings, part dead time from a device's drop."""
    campaign = pair[0].fit.point.prepared.campaign
    entries = menu(campaign.drive)[:4]
    best = recommend(campaign, pair, 1.0, entries)
    assert best is not None
    both = [min(expected_evidence(campaign, e, *p, 1.0) for p in (pair, pair[::-1])) for e in entries]
    assert best.gain == pytest.approx(max(both))
    assert best.gain > 0.0
    assert recommend(campaign, pair[:1], 1.0, entries) is None
