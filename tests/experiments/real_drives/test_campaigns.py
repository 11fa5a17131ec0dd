"""Real drives say what they can show, and do not pretend to more."""

import numpy as np
import pytest

from experiments.real_drives import laas
from experiments.real_drives.campaigns import real_drives, residual_of_motion
from model.errors import BadInput
from sandbox.recordings.campaign import read_folder
from sandbox.recordings.writing import write_campaign
from tests.data import real_data


@pytest.fixture(scope="module")
def drive():
    real_data()
    return real_drives("laas_bldc")[0]


def test_laas_keeps_what_is_on_file(drive, tmp_path):
    raw = laas.read(real_data() / "laas_bldc" / "rolling_data.txt")
    r = drive.campaign["rolling_data"]
    # interpolation to 1 ms keeps every recorded angle within its neighbours; the first sample is
    # itself
    assert r.theta[0] == pytest.approx(12 * raw.position[0])
    assert np.ptp(r.theta) == pytest.approx(12 * np.ptp(raw.position), rel=1e-3)
    alpha, beta = r.current
    i_q = np.cos(r.theta) * beta - np.sin(r.theta) * alpha
    assert i_q[0] == pytest.approx(raw.current[0])
    again = read_folder(write_campaign(tmp_path / "c", drive.campaign))
    assert len(again.recordings) == 3  # the ramps turn by 13 rad between two rows
    # the mean over a turning millisecond: 1 V, 0.61 rad: sin(0.305) / 0.305 = 0.985
    assert np.median(np.hypot(r.u_alpha, r.u_beta)) == pytest.approx(0.985, abs=0.001)
    assert again.drive.provenance["inductance_d, inductance_q, dc_bus_voltage"].startswith(
        "assumed"
    )


def test_laas_motor_is_what_its_firmware_says(drive):
    motor = drive.campaign.drive.motor
    # 300 rpm/V: 1 V at 31.4 rad/s is 0.0318 V s/rad phase to phase, 0.0184 peak a phase:
    # flux = 0.0184 / 12
    assert motor.magnet_flux == pytest.approx(1.0 / (300 * np.pi / 30) / np.sqrt(3) / 12, rel=0.03)
    assert motor.resistance == pytest.approx(0.70, abs=0.1)  # lstsq of 27 000 rows by hand: 0.703


def test_sentences_name_the_residual_and_its_limits(drive):
    assert drive.residuals == ("motion",)
    assert any("i_d, u_d and the link voltage are not on file" in s for s in drive.cannot)
    assert all("assumed, not recorded" in f.text for f in drive.campaign.findings)
    sweeps = real_drives("moteus_ld")
    assert len(sweeps) == 4
    undecided = [s.name for s in sweeps if "too noisy" in s.can[0]]
    # 0.25 +- 0.52 V in experiments/results/real_dead_time.json
    assert undecided == ["moteus_hoverboard"]
    for sweep in sweeps:
        assert sweep.campaign is None
        assert any("i_q and v_d are not on file" in s for s in sweep.cannot)
    with pytest.raises(BadInput, match="did you mean 'moteus_ld'"):
        real_drives("moteus")


def test_residual_of_motion_sees_a_wrong_inertia(drive):
    """Scaling the inertial current by f leaves (f - 1)^2 of its energy: planted, and found."""
    friction = laas.friction(laas.read(real_data() / "laas_bldc" / "acceleration.txt"))
    good = residual_of_motion(friction)
    assert good < 0.01
    object.__setattr__(friction, "inertial", 2.0 * friction.inertial)
    assert residual_of_motion(friction) > 3.0 * good
