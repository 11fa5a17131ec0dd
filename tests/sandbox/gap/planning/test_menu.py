"""Numbers of the menu of recordings by hand, on a motor without saturation."""

import math
from types import SimpleNamespace

import numpy as np
import pytest

from sandbox.gap.planning.menu import (
    demand,
    menu,
    reached,
    recording_of,
    settings,
    shaft,
    tight,
    usual_seconds,
)
from sandbox.plant.sets import complete
from sandbox.recordings.campaign import Campaign
from tests.sandbox.gap.entries import PERIOD, drive_at, entry_of


@pytest.mark.parametrize(("rate", "seconds"), [(4000.0, 1.0), (8000.0, 1.0), (16000.0, 0.5)])
def test_a_second_or_as_many_samples_as_a_drive_of_8_khz_has_in_one(rate, seconds):
    assert usual_seconds(drive_at(1.0 / rate)) == pytest.approx(seconds)


S = math.sqrt(0.5)
SHAPES = {  # share of the duration: i_d and i_q over rated current, speed over rated speed
    "locked_low_current": {
        1 / 16: (0.15, 0.15 * S, 0),
        1 / 8: (0, 0, 0),
        3 / 16: (-0.15, 0.15 * S, 0),
    },
    "locked_low_current_half_link": {1 / 16: (0.15, 0.15 * S, 0), 3 / 16: (-0.15, 0.15 * S, 0)},
    "locked_circle": {
        0.05: (0.5 * math.cos(0.2 * math.pi), 0.5 * math.sin(0.2 * math.pi), 0),
        1 / 8: (0, 1, 0),
        0.25: (-1, 0, 0),
    },
    "locked_steps": {
        0.05: (0.6, 0.6, 0),
        0.15: (-0.6, -0.6, 0),
        0.22: (0.6, 0.6, 0),
        0.27: (-0.6, 0.6, 0),
        0.3: (-0.6, -0.6, 0),
        0.35: (0.6, -0.6, 0),
        0.9: (0.6, 0.6, 0),
        0.99: (-0.6, -0.6, 0),
    },
    "locked_q_inject_d": {0: (0, -1, 0), 0.1: (0, -0.75, 0), 0.3: (0, -0.5, 0), 0.9: (0, 0.75, 0)},
    "locked_d_inject_q": {0: (-1, 0, 0), 0.1: (-0.75, 0, 0), 0.3: (-0.5, 0, 0), 0.9: (0.75, 0, 0)},
    "driven_fast_q": {
        0.05: (0, 0.5, 0.8),
        0.35: (0, 1, 0.8),
        0.425: (0, 1, 0.4),
        0.9: (0, 1, -0.8),
    },
    "driven_fast_idle": {0.05: (0, 0, 0.8), 0.425: (0, 0, 0.4), 0.9: (0, 0, -0.8)},
    "driven_idle_half_link": {0.05: (0, 0, 0.4), 0.425: (0, 0, 0.2), 0.9: (0, 0, -0.4)},
    "driven_slow_dq": {0.05: (0.175, 0.175, 0.04), 0.9: (0.35, 0.35, 0.04)},
    "free_coast": {
        0: (0, 0, 0),
        0.01: (0, 0.2, 0),
        0.02: (0, 0.4, 0),
        0.25: (0, 0.4, 0),
        0.26: (0, 0.2, 0),
        0.27: (0, 0, 0),
        0.6: (0, 0, 0),
    },
}


@pytest.mark.parametrize("name", SHAPES)
def test_an_experiments_shape_by_hand(name):
    """Two turns of the circle, four swings through zero, six steps (q a fifth of the duration
    later), nine stairs; all begin within 0.1 s."""
    drive = drive_at()
    e = next(e for e in menu(drive, 1.0) if e.name == name)
    assert len(e.i_d) == 1600
    scale = np.array([2.0, 2.0, drive.motor.rated_omega])
    for share, expected in SHAPES[name].items():
        k = round(1600 * share)
        assert np.array([e.i_d[k], e.i_q[k], e.speed[k]]) / scale == pytest.approx(
            expected, abs=1e-9
        ), share
    assert e.link == (0.5 if name.endswith("half_link") else 1.0)
    injection = {"locked_q_inject_d": (5.0, 0.0), "locked_d_inject_q": (0.0, 5.0)}
    assert e.injection == injection.get(name, (0.0, 0.0))


def test_a_drive_without_injection_is_offered_seven_hundredths_of_its_link():
    drive = SimpleNamespace(**{f: getattr(drive_at(), f) for f in ("motor", "converter")})
    drive.injection = SimpleNamespace(amplitude=0.0)
    offered = np.array([e.injection for e in menu(drive, 1.0) if any(e.injection)])
    assert offered == pytest.approx(7.0 * math.sqrt(3.0) * np.eye(2))


def test_a_free_rotor_swings_from_5_to_80_hz():
    """Turns of the wave up to t: 5 t + 37.5 t^2, of which each half one turns the torque of half
    the rated current."""
    e = next(e for e in menu(drive_at(), 1.0) if e.name == "free_swing")
    assert set(e.i_q.tolist()) == {1.0, -1.0}  # A: rated are 2
    turns = np.flatnonzero(np.diff(e.i_q)) / 1600.0
    # 0.875, 11.9 and just less than 42.5 turns
    assert [int((turns < t).sum()) for t in (0.1, 0.5, 1.0)] == [1, 23, 84]


@pytest.mark.parametrize(
    ("omega", "link", "top"),
    [
        (268.75, 0.5, 215.0),  # 0.8 x 268.75 x 0.2 Wb is half of 86 V
        (100.0, 0.25, 107.5),  # 16 of 86 V are less than a quarter
        (50.0, 0.25, 60.0),  # 107.5 rad/s would be faster than 1.2 of rated speed
        (1000.0, 1.0, 430.0),  # 160 V are more than there are
    ],
)
def test_what_uses_up_the_link_by_hand(omega, link, top):
    """0.4 of 2 A times 0.05 H and 0.16 Wb are 0.2 Wb; 0.86 of 100 V are 86 V."""
    drive = drive_at(omega=omega)
    assert tight(drive) == pytest.approx((link, top, 0.4))
    e = next(e for e in menu(drive, 1.0) if e.name == "driven_tight_link")
    at = [round(1600 * x) for x in (0.0, 0.05, 0.35, 0.45, 0.55, 0.65, 0.825)]
    assert e.speed[at] / top == pytest.approx([0.8, 0.8 + 0.2 / 7.0, 1.0, 1.0, 0.1, -0.8, -0.9])
    assert e.i_d[at] == pytest.approx([0.0, 0.4, *[0.8] * 5])
    assert e.link == pytest.approx(link)
    assert not e.i_q.any()


def test_control_follows_within_five_milliseconds():
    """A lag of 5 ms reaches 1 - 1/e of a step in 5 ms: 8 samples."""
    assert reached(np.ones(8), PERIOD)[-1] == pytest.approx(1.0 - math.exp(-1.0))


def test_settings_in_words():
    """15 and -30 rad/s electrical of two pole pairs: 7.5 / (2 pi) x 60 = 71.6 rpm."""
    e = entry_of(
        i_d=np.array([-0.5, 1.5]),
        speed=np.array([-30.0, 15.0]),
        n=2,
        link=0.5,
        injection=(5.0, 0.0),
    )
    found = "-143 to 72 rpm, i_d -0.5 to 1.5 A, 5 V square wave on d, DC link 86.6 V"
    assert settings(e, drive_at()) == found


def test_voltages_of_a_steady_motor_by_hand():
    """1 A and 2 A at 100 rad/s: u_d = 1 - 100 x 0.1 x 2, u_q = 2 + 100 (0.05 + 0.16); 5 V come and
    go every four samples; the angle starts at 0.3 rad."""
    e = entry_of(i_d=1.0, i_q=2.0, speed=100.0, injection=(5.0, 3.0))
    theta, speed, u_d, u_q = demand(e, drive_at(), None)
    assert theta == pytest.approx(0.3 + 100.0 * PERIOD * np.arange(200))
    assert speed is e.speed
    wave = np.array([1.0, 1.0, 1.0, 1.0, -1.0, -1.0, -1.0, -1.0])
    assert u_d[-16:] == pytest.approx(-19.0 + 5.0 * np.tile(wave, 2))  # 25 lags after the step
    assert u_q[-8:] == pytest.approx(23.0 + 3.0 * wave)


def test_voltages_of_growing_currents_by_hand():
    """Currents grow by 100 and 50 A/s, behind by a/(1 - a) samples, a = e^-1/8; flux by 5 Wb/s on
    either axis.  Speed grows by 160 rad/s in 0.1 s: half of it on the way."""
    t = PERIOD * np.arange(161)
    e = entry_of("driven", 100.0 * t, 50.0 * t, 1600.0 * t, n=161)
    theta, speed, u_d, u_q = demand(e, drive_at(), None)
    behind = PERIOD / (math.exp(1.0 / 8.0) - 1.0)
    i_d, i_q = 100.0 * (0.1 - behind), 50.0 * (0.1 - behind)
    assert theta[-1] == pytest.approx(0.3 + 8.0)
    assert speed[-1] == pytest.approx(160.0)
    assert u_d[-1] == pytest.approx(i_d + 5.0 - 160.0 * 0.1 * i_q, abs=1e-6)
    assert u_q[-1] == pytest.approx(i_q + 5.0 + 160.0 * (0.05 * i_d + 0.16), abs=1e-6)


def test_a_free_rotors_torque_and_speed_by_hand():
    """1.5 x 2 x ((0.05 + 0.16) x 2 - 0.2 x 1) = 0.66 N m; a tenth of a radian each sample are 160
    rad/s."""
    torques = []

    def turned(torque):
        torques.append(torque)
        return 0.1 * np.arange(200)

    speed = demand(entry_of("free", 1.0, 2.0), drive_at(), turned)[1]
    assert torques[0][-1] == pytest.approx(0.66)
    assert speed == pytest.approx(160.0)


CAMPAIGN = Campaign("x", drive_at(), (), {}, {}, False)


@pytest.mark.parametrize(("i_q", "speed", "size"), [(2.0, 0.0, 2.0), (0.0, 1000.0, 47.5)])
def test_a_recordings_voltages_by_hand(i_q, speed, size):
    """Half a period further than the angle, in front of the magnet by a quarter; 160 V at half of
    100 V are cut to 0.95 of what there is."""
    (r,) = recording_of(CAMPAIGN, entry_of("driven", 0.0, i_q, speed, link=0.5), None).recordings
    k = np.arange(200)
    angle = 0.3 + (k + 0.5) * speed * PERIOD + 0.5 * math.pi
    expected = size * np.exp(1j * angle)
    assert (r.u_alpha + 1j * r.u_beta)[-9:] == pytest.approx(expected[-9:])
    assert r.t == pytest.approx(k * PERIOD)
    assert r.theta == pytest.approx(0.3 + k * speed * PERIOD)
    assert r.u_dc == pytest.approx(50.0 * math.sqrt(3.0))
    assert r.dc_bus_voltage == pytest.approx(50.0 * math.sqrt(3.0))
    assert not r.i_a.any()


def test_the_whole_link_is_nothing_to_be_said():
    assert recording_of(CAMPAIGN, entry_of(), None).recordings[0].dc_bus_voltage is None


def test_a_planned_shaft_carries_no_load():
    """Whatever load a simulated bench has: without torque a rotor stays, with torque it moves as
    without that load."""
    drive, torque = drive_at(), np.full(50, 0.5)
    loads = {"bench.load_torque_gain": 0.5, "bench.load_torque_offset": 0.3}
    free, loaded = (
        shaft(complete(drive.motor, drive.converter, more), drive) for more in ({}, loads)
    )
    assert loaded(0.0 * torque) == pytest.approx(np.zeros(50))
    assert loaded(torque).tolist() == free(torque).tolist()
    assert free(torque)[-1] > 0.1
