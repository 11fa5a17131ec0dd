"""What no effect of the library explains: an inverter's doing, or a machine's.  Recordings of the
switched bench."""

import numpy as np
import pytest
from scipy.signal import TransferFunction, lsim

from model.drive_files import load_drive
from sandbox.gap.evidence.inverter_or_machine import explained, machines, of_size_one
from sandbox.gap.evidence.normal import ParameterPoint
from sandbox.gap.location.outside import inverters
from sandbox.plant.sets import complete
from sandbox.recordings.campaign import Campaign, CampaignRecording
from sandbox.replay.replay import prepare
from sandbox.switched.advance import replay as switched
from sandbox.switched.bench_numbers import bench, quiet
from sandbox.switched.unlisted import unlisted

DRIVE = load_drive("ipm")
PERIOD, LINK, N = DRIVE.converter.sampling_period, DRIVE.converter.dc_bus_voltage, 1200
K = np.arange(N)
# rad/s, of the link, rad
RUNS = ((150.0, 0.12, 1.9), (-150.0, 0.12, -1.6), (60.0, 0.06, 1.2), (250.0, 0.18, 2.1))


def behind_a_filter(u):
    """Return voltages behind a coil and a capacitor, 1.2 kHz and lightly damped, at the command's
    instants."""
    rate = 2.0 * np.pi * 1200.0
    filtered = TransferFunction([rate**2], [1.0, 0.5 * rate, rate**2])
    t = PERIOD * K
    return (
        lsim(filtered, u.real, t, interp=False)[1] + 1j * lsim(filtered, u.imag, t, interp=False)[1]
    )


def recorded(b, between=lambda u: u):
    """Return a campaign of driven recordings; between: what lies between the command and the
    terminals."""
    rng, recordings = np.random.default_rng(1), []
    for n, (speed, size, ahead) in enumerate(RUNS):
        angle, omega = 0.3 + speed * PERIOD * K, np.full(N, speed)
        turn = np.exp(1j * (0.3 + speed * PERIOD * (K + 0.5)))
        course = (
            size
            * LINK
            * np.exp(1j * (ahead + 0.3 * np.sin(K / 150.0)))
            * (1.0 + 0.5 * np.sin(K / 220.0))
        )
        u = (course + 0.06 * LINK * np.where(K % 8 < 4, 1.0, -1.0)) * turn
        acts = between(u)
        r = switched(
            b,
            "driven",
            acts.real.copy(),
            acts.imag.copy(),
            LINK,
            theta=angle,
            speed=omega / DRIVE.motor.pole_pairs,
        )
        columns = {
            "t": PERIOD * K,
            "u_alpha": u.real,
            "u_beta": u.imag,
            "theta": angle,
            "u_dc": np.full(N, LINK),
        }
        noise = DRIVE.converter.current_noise * rng.standard_normal((3, N))
        columns |= {x: r[x] + e for x, e in zip(("i_a", "i_b", "i_c"), noise, strict=True)}
        recordings.append(CampaignRecording(f"run-{n}.parquet", "driven", "d", columns))
    return Campaign("outside", DRIVE, tuple(recordings), {}, {}, False)


BARE = quiet(bench(DRIVE.motor, DRIVE.converter))
FLUX = DRIVE.motor.inductance_q * DRIVE.motor.rated_current
CASES = {
    "a filter between inverter and motor": (BARE, behind_a_filter, True),
    "devices that lose more one way": (unlisted(BARE, {"one_sided": 0.3}), lambda u: u, True),
    "a knee": (
        unlisted(BARE, {"knee": 40.0 / FLUX**2, "knee_flux": 0.3 * FLUX}),
        lambda u: u,
        False,
    ),
}


@pytest.mark.parametrize("name", CASES)
def test_it_is_told_by_what_predicts_the_recordings(name):
    """One chance in two parts both; before either predicts anything the machine has 0.6
    (`outside.MACHINE`)."""
    b, between, inverter = CASES[name]
    campaign = recorded(b, between)
    point = ParameterPoint(prepare(campaign), complete(DRIVE.motor, DRIVE.converter))
    found = explained(point)
    print(
        f"{name}: inverter predicts {found[0]:.3f}, machine {found[1]:.3f}; chance "
        f"{inverters(*found):.3f}"
    )
    assert (inverters(*found) > 0.5) == inverter


def test_without_excess_nothing_is_told():
    point = ParameterPoint(prepare(recorded(BARE)), complete(DRIVE.motor, DRIVE.converter))
    assert max(explained(point)) < 0.05
    assert inverters(0.0, 0.0) == pytest.approx(0.4)


def test_three_functions_of_each_axis_are_an_inverters():
    assert list(machines(10)) == [0, 1, 5, 6]


def test_responses_are_compared_at_one_size():
    """Vectors of 5 in one recording and of 0 in another as long are of size 5 / sqrt(2); nothing
    stays nothing."""
    one, other = np.zeros((4, 2, 2)), np.zeros((4, 2, 2))
    one[:, :, 0] = [3.0, 4.0]
    first, second = of_size_one([one, other])
    assert first[:, :, 0] == pytest.approx(np.tile([0.6, 0.8], (4, 1)) * np.sqrt(2.0))
    assert not first[:, :, 1].any()
    assert not second.any()
