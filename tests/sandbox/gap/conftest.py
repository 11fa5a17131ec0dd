"""A small campaign of the switched bench with dead time, written as a folder and diagnosed once for
all tests here."""

import dataclasses

import numpy as np
import pytest

from model.drive_files import load_drive
from sandbox.gap.evidence.normal import ParameterPoint
from sandbox.gap.report.answers import answer
from sandbox.plant.sets import complete
from sandbox.recordings.campaign import Campaign, CampaignRecording, read_folder
from sandbox.recordings.writing import write_campaign
from sandbox.replay.replay import prepare
from sandbox.switched.advance import replay as switched
from sandbox.switched.bench_numbers import bench, quiet
from sandbox.switched.unlisted import unlisted

DRIVE = load_drive("ipm_exchanged")
DRIVE = dataclasses.replace(
    DRIVE,
    converter=dataclasses.replace(DRIVE.converter, encoder_counts=1 << 14, current_noise=0.004),
)
DEAD_TIME = 2e-6
CASES = (
    ("locked_slow", "locked", 0.0, 25.0),
    ("locked_fast", "locked", 0.0, 15.0),
    ("driven_slow", "driven", 10.0, 20.0),
    ("driven_fast", "driven", 60.0, 25.0),
)

FLUX = DRIVE.motor.magnet_flux
SIXTH = {"flux_harmonics.psi_d6": 0.01 * FLUX, "flux_harmonics.psi_q6": 0.006 * FLUX}
FURTHER = {
    "flux_harmonics.2.order": 18.0,
    "flux_harmonics.2.psi_d": 0.004 * FLUX,
    "flux_harmonics.2.psi_q": -0.003 * FLUX,
}
TURNING = (("slow", "driven", 40.0, 20.0), ("fast", "driven", 110.0, 20.0))


def record(name, rotor, speed, size, effects, rng, n=1200, outside=None, drive=DRIVE, counts=None):
    """Return one recording: a turning or swinging voltage, injection along d, counts and noise as
    the drive states;
    outside: what the bench has that no library holds (`switched.unlisted`); counts: what it rounds
    duties to, of half a PWM period."""
    c, pairs = drive.converter, drive.motor.pole_pairs
    period, k = c.sampling_period, np.arange(n)
    theta, middle = (0.3 + pairs * speed * period * (k + x) for x in (0.0, 0.5))
    swing = np.sin(2 * np.pi * k / 700 + size) + 0.6 * np.sin(2 * np.pi * k / 270)
    back = 1j * pairs * speed * drive.motor.magnet_flux
    u = (size * swing * np.exp(1j * k / 160) + back) * np.exp(1j * middle)
    u += drive.injection.amplitude * np.where(k % 8 < 4, 1, -1) * np.exp(1j * middle)
    more = {"theta": theta, "speed": speed} if rotor == "driven" else {"theta": 0.3, "speed": 0.0}
    own = unlisted(quiet(bench(drive.motor, c, effects)), outside or {})
    given = u if counts is None else rounded(u, c.dc_bus_voltage, counts)
    r = switched(own, rotor, given.real, given.imag, c.dc_bus_voltage, **more)
    count = 2 * np.pi * pairs / c.encoder_counts
    columns = {
        "t": k * period,
        "u_alpha": u.real,
        "u_beta": u.imag,
        "u_dc": np.full(n, c.dc_bus_voltage),
    }
    columns["theta"] = count * np.floor(r["theta"] / count + 0.5)
    for phase in ("i_a", "i_b", "i_c"):
        read = r[phase] + c.current_noise * rng.standard_normal(n)
        columns[phase] = (
            c.current_resolution * np.round(read / c.current_resolution)
            if c.current_resolution
            else read
        )
    return CampaignRecording(f"{name}.parquet", rotor, "d", columns)


def rounded(u, link, counts):
    """Return voltages (n,) as legs give them whose duties are whole counts: centred by the largest
    and the smallest."""
    turn = np.exp(2j * np.pi * np.arange(3) / 3)
    legs = (u[:, None] * turn.conj()).real / link
    duty = 0.5 + legs - 0.5 * (legs.max(axis=1) + legs.min(axis=1))[:, None]
    return 2.0 / 3.0 * link * np.round(counts * duty) / counts @ turn


def small_campaign(effects, cases=CASES, seed=5, outside=None, drive=DRIVE, counts=None):
    """Return a campaign of the switched bench with noise."""
    rng = np.random.default_rng(seed)
    recordings = tuple(
        record(*case, effects, rng, outside=outside, drive=drive, counts=counts) for case in cases
    )
    return Campaign("small", drive, recordings, {}, {}, False)


@pytest.fixture(scope="session")
def small_folder(tmp_path_factory):
    """The campaign with dead time as a folder."""
    return write_campaign(
        tmp_path_factory.mktemp("gap") / "small", small_campaign({"dead_time.time": DEAD_TIME})
    )


@pytest.fixture(scope="session")
def small_answers(small_folder):
    """Its diagnosis; delays, which so little data cannot tell from each other, left out: words and
    files are tested."""
    return answer(
        read_folder(small_folder), exclude=("pwm_delay", "current_sampling", "current_filter")
    )


@pytest.fixture(scope="session")
def quiet_folder(tmp_path_factory):
    """A campaign of one turning recording without any effect."""
    campaign = small_campaign({}, CASES[-1:])
    return write_campaign(tmp_path_factory.mktemp("gap") / "quiet", campaign)


@pytest.fixture(scope="session")
def quiet_answers(quiet_folder):
    """Its diagnosis."""
    return answer(read_folder(quiet_folder))


def with_added(campaign, size=0.05):
    """Return a campaign to whose readings a current is added that turns with twice the rotor's
    angle, by default 0.05 A (twelve noise floors): no effect of the library."""
    recordings = []
    for r in campaign.recordings:
        theta = r.columns["theta"]
        added = size * np.exp(1j * theta) * np.cos(2.0 * theta)
        phases = {
            f"i_{x}": r.columns[f"i_{x}"] + (added * np.exp(-2j * np.pi * k / 3)).real
            for k, x in enumerate("abc")
        }
        recordings.append(dataclasses.replace(r, columns={**r.columns, **phases}))
    return dataclasses.replace(campaign, recordings=tuple(recordings))


@pytest.fixture(scope="session")
def with_a_stranger(small_answers):
    """The campaign with dead time and a current that nobody listed; the diagnosis' table at its own
    point."""
    j = small_answers.diagnosis.best.evaluated
    prepared = prepare(with_added(small_answers.diagnosis.campaign))
    return j, dataclasses.replace(
        j.model, point=ParameterPoint(prepared, j.model.point.values, j.model.point.turns)
    )


def start(folder):
    """Return a campaign's nominal point, not fitted."""
    campaign = read_folder(folder)
    return ParameterPoint(
        prepare(campaign), complete(campaign.drive.motor, campaign.drive.converter)
    )
