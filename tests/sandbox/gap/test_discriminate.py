"""The recommended recording: nothing to learn between a hypothesis and itself, much between dead time and none."""

from dataclasses import replace

import numpy as np
import pytest

from model.energy import flux_from_current
from sandbox.campaign import read_campaign
from sandbox.gap.discriminate import expected_evidence, recommend
from sandbox.gap.fit import fit
from sandbox.gap.menu import FULL, menu, recording_of
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
    one = {e.rotor: e for e in menu(campaign.drive)}
    for entry in one.values():
        assert expected_evidence(campaign, entry, pair[0], pair[0], 1.0) == pytest.approx(0.0, abs=1e-6), entry.name
        assert recommend(campaign, [pair[0], pair[0]], 1.0, [entry]) is None


def test_an_eccentric_encoder_is_the_same_for_both(small_folder):
    """A driven rotor's angle is read with the eccentricity that both hypotheses have: nothing to learn from it."""
    at = start(small_folder)
    values = {**at.values, "encoder_eccentricity.amplitude_mech": 0.01, "encoder_eccentricity.phase": 1.0}
    at = replace(at, values=values)
    weights = weights_of(len(at.prepared.recordings))
    chosen = [p for p in probes_at_typical(at) if p.effect == "encoder_eccentricity"]
    own = judge(fit(at, ("encoder_eccentricity",), weights), chosen, ordinary_share(1.0), weights, 1)
    entries = {e.name: e for e in menu(at.prepared.campaign.drive)}
    for entry in (entries["driven_fast_q"], entries["driven_slow_dq"]):  # many turns, and less than one
        told = expected_evidence(at.prepared.campaign, entry, own, own, 1.0)
        assert told == pytest.approx(0.0, abs=1e-3), entry.name


def test_the_link_is_as_tight_as_control_allows(small_folder):
    """Within the limit everywhere, and near it, by the equations of the machine; steps of current ask for less."""
    drive = start(small_folder).prepared.campaign.drive
    motor = drive.motor
    for entry in menu(drive):
        columns = recording_of(read_campaign(small_folder), entry, lambda torque: np.zeros(len(torque))).recordings[0]
        used = np.hypot(columns.u_alpha, columns.u_beta).max() / (entry.link * drive.converter.voltage_limit)
        if entry.name == "driven_tight_link":
            d = flux_from_current(motor.energy, 0.4 * motor.rated_current, 0.0)[0] + motor.magnet_flux
            assert used == pytest.approx(entry.speed.max() * d / (entry.link * drive.converter.voltage_limit), rel=0.02)
            assert used == pytest.approx(FULL, rel=0.02)
        assert used < 0.95, entry.name


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
