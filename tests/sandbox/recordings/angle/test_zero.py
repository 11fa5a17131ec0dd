"""Logs without an encoder: an angle of a speed, of nothing at a locked rotor; its zero."""

import dataclasses
import math
import re

import numpy as np
import pytest

import sandbox
from model.errors import BadInput
from sandbox import Scenario, Segment, read_campaign
from sandbox.recordings.angle.zero import UNSTATED, UNTOLD, with_zero
from sandbox.recordings.campaign import CampaignRecording, Made
from sandbox.recordings.importing import read_recordings
from sandbox.replay.identification.ordinary import fit_ordinary
from tests.sandbox.recordings.made_angles import (
    DRIVE,
    RPM,
    SWING,
    ZERO,
    H,
    N,
    off,
    read,
    turning,
    written,
)


def test_the_angle_of_a_speed_has_the_zero_that_voltages_show(tmp_path):
    columns, theta = turning(SWING)
    found = read(
        tmp_path,
        {**columns, "erpm": np.round(SWING * RPM)},
        '[columns]\nspeed = {column="erpm", unit="rpm"}',
    )
    assert np.abs(off(found["run"].theta, theta)).max() < 1.0
    text = " ".join(f.text for f in found.findings)
    assert "the angle is made from 'erpm'" in text
    assert f"zero, {math.degrees(ZERO):.0f} degrees" in text
    assert "an offset of the angle cannot be told" in text


@pytest.mark.parametrize("share", [0.1, 0.2, 0.3])
def test_a_zero_stays_open_by_what_the_inductance_may_be_off(tmp_path, share):
    """dL_q i_q over the flux, on the voltages of a motor whose L_q is off by so much, with 1 A and
    i_d = 0."""
    m = DRIVE.motor
    columns, theta = turning(SWING)
    mapping = '[columns]\nspeed = {column="erpm", unit="rpm"}\n'
    mapping += f"[uncertainty]\ninductance_q = {share}\n" if share != UNSTATED else ""
    path = written(tmp_path, {**columns, "erpm": SWING * RPM}, mapping)
    left = read_recordings(tmp_path, path)["run"].made.zero
    assert left == pytest.approx(math.hypot(share * m.inductance_q / m.magnet_flux, 0.01), rel=1e-3)
    text, stated = path.read_text(), f"inductance_q = {m.inductance_q}"
    path.write_text(text.replace(stated, f"inductance_q = {(1.0 + share) * m.inductance_q}"))
    moved = np.radians(np.abs(off(read_recordings(tmp_path, path)["run"].theta, theta)).mean())
    assert 0.6 * left < moved < 1.1 * left


@pytest.mark.parametrize(
    ("unit", "scale", "words"),
    [
        ("rpm", RPM / DRIVE.motor.pole_pairs, "erpm is mechanical: map it with mechanical = true"),
        ("rpm", 1.0, 'erpm is in rad/s, not in rpm: map it with unit = "rad/s"'),
        ("rpm", -RPM, "erpm is counted backwards: map it with scale = -1"),
        (
            "rad/s",
            1.0 / math.tau,
            'erpm is in turns a second, not in rad/s: map it with unit = "Hz"',
        ),
    ],
)
def test_a_speed_in_another_unit_is_named(tmp_path, unit, scale, words):
    """The angle made of it turns otherwise than the voltages do."""
    columns, _ = turning(SWING)
    mapping = f'[columns]\nspeed = {{column="erpm", unit="{unit}"}}'
    path = written(tmp_path, {**columns, "erpm": scale * SWING}, mapping, rotor="driven")
    found = sandbox.check(tmp_path, columns=path, effects=False)
    assert words in " ".join(found.mistakes)


def test_a_speed_that_is_a_little_off_is_followed(tmp_path):
    """0.2 % of 150 rad in 0.5 s are 0.3 rad."""
    columns, theta = turning(SWING)
    found = read(
        tmp_path,
        {**columns, "erpm": 1.002 * SWING * RPM},
        '[columns]\nspeed = {column="erpm", unit="rpm"}',
    )
    assert np.abs(off(found["run"].theta, theta)).max() < 1.5
    text = " ".join(f.text for f in found.findings)
    assert "it drifts by -0.3" in text
    # with the drift in: 0.3^2 / 12, 0.75 %
    assert float(re.search(r"\(([\d.e-]+) % stay open\)", text)[1]) < 0.05


@pytest.mark.parametrize("lag", [2e-3, 4e-3])
def test_a_speed_that_lags_is_led(tmp_path, lag):
    """A filter of first order, y += a (x - y), delays a slow swing by (1 - a) / a rows: 60 rad/s in
    2 ms are 0.12 rad (7 degrees) either way; its own start-up is left out."""
    columns, theta = turning(SWING)
    late = np.empty(N)
    late[0] = SWING[0]
    for k in range(1, N):
        late[k] = late[k - 1] + H / lag * (SWING[k] - late[k - 1])
    mapping = '[columns]\nspeed = {column="erpm", unit="rpm"}'
    found = read(tmp_path, {**columns, "erpm": late * RPM}, mapping)
    assert np.abs(off(found["run"].theta, theta))[100:].max() < 1.0
    text = " ".join(f.text for f in found.findings)
    told = float(re.search(r"'erpm' lags by ([\d.]+) ms", text)[1])
    assert told == pytest.approx(1e3 * (lag - H), rel=0.04)


def test_a_speed_that_does_not_lag_is_left_as_it_is(tmp_path):
    columns, _ = turning(SWING)
    mapping = '[columns]\nspeed = {column="erpm", unit="rpm"}'
    found = read(tmp_path, {**columns, "erpm": np.round(SWING * RPM)}, mapping)
    assert not any("lags" in f.text or "leads" in f.text for f in found.findings)


def test_rows_without_stamps_are_counted_by_the_sampling_period(tmp_path):
    columns, theta = turning(SWING)
    own = {n: x for n, x in columns.items() if n != "t"} | {"erpm": SWING * RPM}
    found = read(tmp_path, own, '[columns]\nspeed = {column="erpm", unit="rpm"}', rotor="driven")
    assert np.abs(off(found["run"].theta, theta)).max() < 1.0


def test_a_speed_of_zero_throughout_is_a_locked_rotor(tmp_path):
    columns, _ = turning(np.zeros(N))
    mapping = '[columns]\nspeed = {column="erpm", unit="rpm"}'
    with pytest.raises(
        BadInput,
        match="'erpm' is zero throughout, so the rotor stands still; give it rotor = \"locked",
    ):
        read(tmp_path, {**columns, "erpm": np.zeros(N)}, mapping, rotor="driven")


LOCKED = Scenario(
    "step",
    (Segment(0.02), Segment(0.1, load=0.5), Segment(0.1, load=-0.3, current_d=0.3)),
    rotor="locked",
    start_up=False,
    reference="current",
)


SPIN = Scenario(
    "spin",
    (
        Segment(0.05),
        Segment(0.2, load=0.4, speed=0.3, ramp=0.1),
        Segment(0.2, load=-0.3, speed=0.5, ramp=0.1),
    ),
    rotor="driven",
    start_up=False,
)


def simulated(folder, scenario, effects=None):
    sandbox.simulate(
        DRIVE, scenario, "qnull", closed_loop=False, effects=effects, record=folder, seed=2
    )
    return read_campaign(folder).recordings[0]


def test_a_locked_rotor_without_an_angle_shows_its_axis(tmp_path):
    r = simulated(tmp_path / "record", LOCKED)
    own = {n: x for n, x in r.columns.items() if n not in ("theta", "load_torque")}
    found = read(tmp_path, own, rotor="locked")["run"]
    away = math.remainder(float(found.theta[0] - r.theta[0]), math.pi)  # an ellipse has two ends
    assert abs(math.degrees(away)) < 3.0
    assert np.ptp(found.theta) == 0.0


def test_resistance_and_flux_are_identified_without_an_encoder(tmp_path):
    """R 20 % and flux 10 % off, by a log that holds erpm in whole revolutions a minute."""
    m = DRIVE.motor
    planted = {"resistance": 1.2 * m.resistance, "magnet_flux": 0.9 * m.magnet_flux}
    r = simulated(
        tmp_path / "record",
        SPIN,
        {
            "stator_resistance.resistance": planted["resistance"],
            "magnet_flux.magnet_flux": planted["magnet_flux"],
        },
    )
    own = {n: x for n, x in r.columns.items() if n not in ("theta", "load_torque")}
    own["erpm"] = np.round(np.gradient(r.theta, r.t) * RPM)
    mapping = '[columns]\nspeed = {column = "erpm", unit = "rpm"}'
    alphas = {
        n: getattr(m, n) for n in ("alpha_30", "alpha_12", "alpha_40", "alpha_22", "alpha_04")
    }
    campaign = read(tmp_path, own, mapping, rotor="driven")
    motor = dataclasses.replace(campaign.drive.motor, **alphas)
    found = fit_ordinary(
        dataclasses.replace(campaign, drive=dataclasses.replace(campaign.drive, motor=motor))
    )
    for name, value in planted.items():
        assert found.values[name] == pytest.approx(
            value, abs=max(4.0 * found.deviations[name], 0.01 * value)
        )


def test_each_angle_that_was_made_has_a_zero_of_its_own(tmp_path):
    """One recording read, two made with zeros 0.06 rad and -0.04 rad off."""
    simulated(tmp_path / "record", SPIN)
    campaign = read_campaign(tmp_path / "record")
    r = campaign.recordings[0]
    more = [
        dataclasses.replace(
            r, file=f, columns={**r.columns, "theta": r.theta + z}, made=Made("erpm", 0.0, 0.1)
        )
        for f, z in (("second", 0.06), ("third", -0.04))
    ]
    found = fit_ordinary(dataclasses.replace(campaign, recordings=(r, *more)))
    zeros = {n: v for n, v in found.nuisance.items() if n.startswith("angles.")}
    assert zeros == {
        "angles.second": pytest.approx(0.06, abs=0.006),
        "angles.third": pytest.approx(-0.04, abs=0.006),
    }
    assert found.values["magnet_flux"] == pytest.approx(DRIVE.motor.magnet_flux, rel=0.01)


def test_a_zero_that_no_voltage_shows_stays_as_it_is():
    """At standstill under a constant current all is R i."""
    columns, _ = turning(np.zeros(200))
    r = CampaignRecording(
        "run.csv", "locked", "none", {**columns, "theta": np.zeros(200)}, made=Made("", 0.0)
    )
    same, told = with_zero(r, DRIVE, 0.1)
    assert "makes no difference" in told.text
    np.testing.assert_array_equal(same.theta, r.theta)
    assert same.made.zero == UNTOLD
