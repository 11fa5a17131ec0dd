"""Offsets of current sensors that differ from recording to recording are measured and taken off
first."""

import dataclasses
from types import SimpleNamespace

import numpy as np
import pytest

from model.drive_files import load_drive
from sandbox.gap.diagnose import diagnosis_of
from sandbox.gap.unstated.drifting import drifting, steadied
from sandbox.gap.unstated.more_than_ordinary import chance_of_effect
from sandbox.recordings.campaign import Campaign, CampaignRecording
from sandbox.replay.replay import Residual
from tests.sandbox.gap.conftest import TURNING, small_campaign

DRIVE = load_drive("ipm_exchanged")
FLOOR = 0.002  # A
USUAL = 0.001  # A, of [background]
N = 4000


def at(offsets, *, along=0.0, even=0.0, turns=20, rotor="free", seed=1):
    """Return a campaign's point and residuals: noise, an offset (A) of sensor a in each recording
    (minus half of it in the others), what moves with the rotor, and its second harmonic
    (floors)."""
    rng, k = np.random.default_rng(seed), np.arange(N)
    # its speed swings
    angle = 2.0 * np.pi * turns * (k / N + 0.2 / (2.0 * np.pi) * np.sin(2.0 * np.pi * k / N))
    phase = angle[:, None] - 2.0 * np.pi / 3.0 * np.arange(3)
    one = np.array([1.0, -0.5, -0.5])
    wave = along * np.cos(phase) + even * np.cos(2.0 * phase)
    read = [rng.standard_normal((N, 3)) + x / FLOOR * one + wave for x in offsets]
    shown = [Residual(f"r{k}", rotor, x[:, :, None], None, None) for k, x in enumerate(read)]
    own = [
        SimpleNamespace(of="", file=r.file, rotor=rotor, motion=SimpleNamespace(angle=angle))
        for r in shown
    ]
    flat = {n: np.zeros(N) for n in ("t", "u_alpha", "u_beta", "theta")} | {
        "u_dc": np.full(N, 400.0)
    }
    recordings = tuple(
        CampaignRecording(
            r.file, rotor, "d", flat | dict(zip(("i_a", "i_b", "i_c"), FLOOR * x.T, strict=True))
        )
        for r, x in zip(shown, read, strict=True)
    )
    campaign = Campaign("two", DRIVE, recordings, {}, {"current_offset": USUAL}, False)
    return SimpleNamespace(
        prepared=SimpleNamespace(campaign=campaign, recordings=own, noise_std=FLOOR)
    ), shown


def test_offsets_of_two_recordings_are_taken_off():
    """Mean of 4000 readings: known to FLOOR / sqrt(4000); the median of two is their mean, which
    stays."""
    point, shown = at((-0.011, 0.013), along=9.0)
    campaign, found = point.prepared.campaign, drifting(point, shown)
    steady = steadied(campaign, found)
    error = FLOOR / np.sqrt(N)
    assert found.offsets["r0"] == pytest.approx((-0.012, 0.006, 0.006), abs=5 * error)
    assert all(x < 4.0 * error for x in found.errors.values())
    for k, r in enumerate(steady.recordings):
        moved = campaign.recordings[k].i_a - r.i_a
        np.testing.assert_allclose(moved, found.offsets[r.file][0], atol=1e-12)
    assert "sensor a reads −12 mA in r0, 12 mA in r1 beside their median" in found.text
    assert "at rest before each recording" in found.text
    assert found.as_json()[1]["i_a"] == pytest.approx(0.012, abs=5 * error)


def test_what_is_ordinary_is_taken_off_as_well():
    """1.5 deviations to either side: no campaign's own offset could be both, and left in the
    readings it is something unknown; whether it is an effect is another question."""
    point, shown = at((-0.0015, 0.0015))
    found = drifting(point, shown)
    assert found.offsets["r1"][0] == pytest.approx(0.0015, abs=5 * FLOOR / np.sqrt(N))
    assert chance_of_effect(found, point.prepared.campaign) < 0.01


def test_one_recording_that_is_off_leaves_the_others():
    found = drifting(*at((0.0, 0.0, 0.012)))
    assert found.offsets["r0"][0] == pytest.approx(0.0, abs=5 * FLOOR / np.sqrt(N))
    assert found.offsets["r2"][0] == pytest.approx(0.012, abs=5 * FLOOR / np.sqrt(N))


@pytest.mark.parametrize(
    ("offsets", "more"),
    [
        ((0.012, 0.012), {}),  # one offset for both is an effect
        ((0.012,), {}),
        ((-0.012, 0.012), {"turns": 2}),
        ((-0.012, 0.012), {"rotor": "locked"}),  # all that is missed there stands still
        # 16 floors^2 beside (6 floors)^2: a sensor that cuts half waves
        ((-0.012, 0.012), {"even": 4.0}),
        ((0.0, 0.0), {"along": 90.0}),
    ],
)
def test_what_is_no_drift_stays(offsets, more):
    assert drifting(*at(offsets, **more)) is None


def test_a_half_wave_has_a_fifth_of_even_harmonics():
    """max(cos, 0) = 1/pi + cos/2 + 2/(3 pi) cos 2x - ...: half of (2/3)^2 of the offset's squares
    are the second's."""
    x = np.linspace(0.0, 2.0 * np.pi, 10001)[:-1]
    wave = np.maximum(np.cos(x), 0.0)
    second = 2.0 * np.mean(wave * np.cos(2.0 * x))
    assert 0.5 * second**2 / np.mean(wave) ** 2 == pytest.approx(2.0 / 9.0, rel=1e-3)


@pytest.mark.parametrize("files", [1, 2])
def test_a_sum_of_three_readings_is_taken_off_every_recording(files):
    """Sensor a alone reads 30 mA more: a third of it is in all three, the rest is the effect's
    (20, -10, -10 mA), which stays."""
    point, shown = at((0.02,) * files)
    off = [dataclasses.replace(x, current=x.current + 0.01 / FLOOR) for x in shown]
    still = dataclasses.replace(point.prepared.campaign.recordings[0], file="still", rotor="locked")
    campaign = dataclasses.replace(
        point.prepared.campaign, recordings=(*point.prepared.campaign.recordings, still)
    )
    point.prepared.campaign = campaign
    found = drifting(point, off)
    assert found.common == pytest.approx(0.01, abs=5 * FLOOR / np.sqrt(N))
    assert set(found.offsets) == {"still", *(x.file for x in shown)}
    assert all(x == (found.common,) * 3 for x in found.offsets.values())
    assert found.text.startswith("The three current readings have a mean sum of 30 mA")
    assert "differ" not in found.text
    again = [dataclasses.replace(x, current=x.current - found.common / FLOOR) for x in off]
    assert drifting(point, again) is None


def test_noise_alone_says_nothing():
    assert not any(drifting(*at((0.0, 0.0, 0.0), seed=k)) for k in range(50))


# which so little data cannot tell from each other
DELAYS = ("pwm_delay", "current_sampling", "current_filter")


def test_an_effect_beside_them_is_named_alone():
    """Dead time on the switched bench; sensor a reads 12 mA less in one turning recording, 12 mA
    more in the other."""
    cases = (("locked", "locked", 0.0, 25.0), *TURNING)
    plain = small_campaign({"dead_time.time": 2e-6}, cases)
    off = {"slow.parquet": -0.012, "fast.parquet": 0.012}
    moved = tuple(
        dataclasses.replace(r, columns={**r.columns, "i_a": r.i_a + off.get(r.file, 0.0)})
        for r in plain.recordings
    )
    found = diagnosis_of(dataclasses.replace(plain, recordings=moved), exclude=DELAYS)
    assert found.best.effects == ("dead_time",)
    assert found.best.probability > 0.9
    for file, x in off.items():
        error = found.drifting.errors[file]
        assert found.drifting.offsets[file] == pytest.approx((x, 0.0, 0.0), abs=4.0 * error)
        assert error < 5e-4


def test_without_them_nothing_is_taken_off(small_answers):
    """The same effect, two of its recordings turning."""
    assert small_answers.diagnosis.drifting is None
    assert small_answers.diagnosis.best.effects == ("dead_time",)
