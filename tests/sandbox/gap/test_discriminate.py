"""The recommended recording: nothing to learn between a hypothesis and itself, much between dead time and none."""

import math
from dataclasses import replace

import numpy as np
import pytest
from scipy.stats import multivariate_normal, norm

from model.energy import flux_from_current
from sandbox.campaign import read_campaign
from sandbox.gap.discriminate import LEANS, Tried, expected_evidence, power, recommend, surprise
from sandbox.gap.fit import fit
from sandbox.gap.menu import FULL, menu, recording_of, usual_seconds
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
        told, _ = expected_evidence(campaign, entry, pair[0], pair[:1], 1.0)
        assert told == pytest.approx(0.0, abs=1e-6), entry.name
        assert recommend(campaign, [(0.5, pair[0]), (0.5, pair[0])], 1.0, [entry]) is None


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
        told, _ = expected_evidence(at.prepared.campaign, entry, own, [own], 1.0)
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
    rivals = [(0.6, pair[0]), (0.4, pair[1])]
    best = recommend(campaign, rivals, 1.0, entries)
    assert best is not None
    assert best.seconds == usual_seconds(campaign.drive)
    assert best.separates == (("dead_time",), ("device_drop",))
    entry = next(e for e in entries if e.name == best.entry)
    both = [expected_evidence(campaign, entry, a, [b], 1.0)[0][0] for a, b in (pair, pair[::-1])]
    assert best.gain == pytest.approx(min(both))
    assert best.power > 0.95
    assert recommend(campaign, rivals[:1], 1.0, entries) is None


def test_surprise_is_minus_the_log_density_of_what_was_foretold():
    """Readings r = J x + noise, x about 0 with covariance C: a Gaussian of covariance 1 + J C J' (SciPy's density)."""
    rng = np.random.default_rng(3)
    j, c, r = rng.normal(size=(9, 3)), np.diag([0.5, 2.0, 0.1]), 2.0 * rng.normal(size=9)
    told = surprise(j.T @ j, j.T @ r, float(r @ r), np.linalg.inv(c))
    expected = multivariate_normal(np.zeros(9), np.eye(9) + j @ c @ j.T).logpdf(r)
    assert told == pytest.approx(-expected - 4.5 * math.log(math.tau), rel=1e-9)


def test_power_is_the_chance_that_the_truth_comes_to_stand_alone():
    """Two rivals: log odds are normal about what is expected, its variance twice that and what the simulator misses."""
    rivals = [(0.6, None), (0.3, None)]
    told = np.array([[np.inf, 5.0], [8.0, np.inf]])
    for missed in (0.0, 30.0):
        more = 1.0 + 2.0 * LEANS**2 * missed
        needs = [math.log(19.0) - math.log(2.0), math.log(19.0) + math.log(2.0)]
        each = [norm.sf(n, e, math.sqrt(2.0 * e * more)) for n, e in zip(needs, (5.0, 8.0), strict=True)]
        expected = (0.6 * each[0] + 0.3 * each[1]) / 0.9
        assert power(rivals, Tried(None, told, np.array([missed, missed]))) == pytest.approx(expected)
    nothing = Tried(None, np.where(np.isinf(told), np.inf, 0.0), np.zeros(2))
    assert power([(0.5, None), (0.5, None)], nothing) == pytest.approx(0.0)


def test_a_longer_menu_holds_the_same_experiments_slower(small_folder):
    drive = start(small_folder).prepared.campaign.drive
    usual = usual_seconds(drive)
    for once, twice in zip(menu(drive), menu(drive, 2.0 * usual), strict=True):
        assert (once.name, twice.seconds) == (twice.name, 2.0 * once.seconds)
        assert len(twice.i_q) == pytest.approx(2 * len(once.i_q), abs=1)
        assert np.max(np.abs(twice.speed)) == pytest.approx(np.max(np.abs(once.speed)), rel=1e-3)
    fast = replace(drive, converter=replace(drive.converter, sampling_period=1.0 / 16000.0, pwm_frequency=None))
    assert usual_seconds(fast) == pytest.approx(0.5)
