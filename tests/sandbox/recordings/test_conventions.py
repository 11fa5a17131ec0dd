"""What a log does not say is found in it: what the link does, and commands a row off; on a plant of
other structure."""

import dataclasses

import numpy as np
import pytest

from sandbox.recordings.campaign import read_folder
from sandbox.recordings.checks.balance import balance
from sandbox.recordings.checks.shifts import curves, shifted
from sandbox.recordings.conventions import link_exponent, with_link
from sandbox.recordings.importing import read_recordings
from sandbox.recordings.preflight import noticed
from sandbox.recordings.writing import write_campaign
from tests.data import recordings_folder
from tests.sandbox.switched.other_plant import Other
from tests.sandbox.switched.other_recordings import NOMINAL, N, missed, plant, recorded, waves

NOISE = 0.012  # A rms: 0.2 % of the motor's rated current, as the project's drives have it


def noisy(campaign, seed=1):
    """Return a campaign with noise on its currents."""
    rng = np.random.default_rng(seed)
    runs = []
    for r in campaign.recordings:
        more = {n: r[n] + NOISE * rng.standard_normal(len(r.t)) for n in ("i_a", "i_b", "i_c")}
        runs.append(dataclasses.replace(r, columns={**r.columns, **more}))
    return dataclasses.replace(campaign, recordings=tuple(runs))


def seen(link, divide, says=None, read=None):
    """Return a noisy campaign of a link (V) that the drive reads, dividing its commands by
    something."""
    return noisy(recorded(plant(), says or {}, link=link, divide=divide, read=read))


FLAT = np.full(N, NOMINAL)
# true link, what the drive divides by, what u_dc reads: the exponent of the module's text
LINKS = {
    "measured": (waves(), waves(), waves(), 0),
    "against nominal": (waves(), FLAT, waves(), 1),
    "steady, a reading that wanders": (FLAT, waves(), waves(), -1),
}


@pytest.mark.parametrize("name", LINKS)
def test_exponent_of_the_link(name):
    """The exponent is the whole number that the plant was built with, told within its own
    deviation."""
    link, divide, read, exponent = LINKS[name]
    campaign = seen(link, divide, read=read)
    found = link_exponent(campaign.recordings, campaign.drive)
    assert found.whole == exponent
    # 5 %: what the model's stated errors may make
    assert abs(found.value - exponent) < 4.0 * found.deviation + 0.05


def test_noise_of_the_reading_tells_nothing():
    """A link read with 0.04 % of noise, as benches have it, cannot be told, so nothing is changed
    or said."""
    read = NOMINAL * (1.0 + 4e-4 * np.random.default_rng(2).standard_normal(N))
    campaign = seen(FLAT, read, read=read)
    assert with_link(campaign) is campaign


@pytest.mark.parametrize("name", ["measured", "against nominal"])
def test_what_is_found_is_taken_and_said(name, tmp_path):
    """A campaign that is silent is read as its recordings show it; the finding holds the keys to
    write."""
    link, divide, read, _ = LINKS[name]
    campaign = read_recordings(write_campaign(tmp_path / "silent", seen(link, divide, read=read)))
    assert campaign.drive.converter.dc_link == "measured"
    (finding,) = campaign.findings
    assert 'dc_link = "measured"' in finding.text
    assert ('command = "nominal"' in finding.text) == (name == "against nominal")
    assert missed(campaign) < 1.1 * NOISE


def test_what_is_stated_wrongly_is_contradicted():
    """What the engineer states stays, with a finding beside it."""
    campaign = with_link(seen(waves(), waves(), {"dc_link": "steady"}))
    assert campaign.drive.converter.dc_link == "steady"
    assert "contradict" in campaign.findings[0].text
    agreed = with_link(seen(waves(), waves(), {"dc_link": "measured"}))
    assert agreed.findings == ()


def test_duties_become_volts():
    """Duties and commands against nominal become volts that the drive divides by the row's reading:
    written out."""
    campaign = recorded(plant(), {}, link=waves(), divide=waves())
    r, c = campaign.recordings[0], campaign.drive.converter
    by_duty = r.in_volts(dataclasses.replace(c, command="duties"))
    np.testing.assert_allclose(by_duty.u_alpha, r.u_alpha * r.u_dc, rtol=1e-14)
    by_nominal = r.in_volts(dataclasses.replace(c, command="nominal"))
    np.testing.assert_allclose(by_nominal.u_beta, r.u_beta * r.u_dc / 540.0, rtol=1e-14)


def test_log_shifted_by_a_sample():
    """A voltage that acts a sample after its row is named with the direction; one half a sample
    late is not."""
    late = noisy(recorded(plant(delay=250e-6), {}))
    (finding,) = shifted(late.recordings, late.drive)
    assert "one sample later" in finding.text
    assert "down by one row" in finding.text
    for fine in (
        plant(),
        plant(delay=125e-6),
        Other(3.6, 0.036, 0.051, 0.545, 250e-6, dead_time=3e-6, soft=0.09),
    ):
        campaign = noisy(recorded(fine, {}))
        assert shifted(campaign.recordings, campaign.drive) == []


def test_log_shifted_by_three_rows():
    """A logger's buffer: the commands stand three rows above those in which they act."""
    campaign = noisy(recorded(plant(), {}))
    (r,) = campaign.recordings[:1]
    moved = {
        n: (np.roll(x, -3) if n in ("u_alpha", "u_beta") else x)[:-3] for n, x in r.columns.items()
    }
    (finding,) = shifted([dataclasses.replace(r, columns=moved)], campaign.drive)
    assert "3 samples later" in finding.text
    assert "down by 3 rows" in finding.text


@pytest.mark.parametrize(
    ("names", "rows"), [(("i_a", "i_b", "i_c"), 2), (("i_a", "i_b", "i_c"), -3), (("theta",), 4)]
)
def test_currents_or_the_angle_alone_shifted(names, rows):
    """Columns of another buffer, written so many rows late: they are told, and not the commands."""
    campaign = noisy(recorded(plant(), {}))
    (r,) = campaign.recordings[:1]
    moved = {n: (np.roll(x, rows) if n in names else x)[8:-8] for n, x in r.columns.items()}
    found = shifted([dataclasses.replace(r, columns=moved)], campaign.drive)
    (text,) = (f.text for f in found)
    assert f"move {', '.join(names)} {'up' if rows > 0 else 'down'} by {abs(rows)} rows" in text


@pytest.mark.parametrize("names", [("u_alpha", "u_beta"), ("i_a", "i_b", "i_c"), ("theta",)])
@pytest.mark.parametrize("rows", [-3, 0, 7, 50])
def test_the_energy_of_every_shift_is_that_of_the_balance(names, rows):
    """Correlations against the balance of columns that were moved, row by row."""
    campaign = noisy(recorded(plant(), {}))
    r = campaign.recordings[0]
    curve = curves(r, campaign.drive)[names]
    most = len(curve) // 2
    inner = slice(most, len(r.t) - most)
    columns = {n: r[n][inner] for n in ("theta", "i_a", "i_b", "i_c", "u_alpha", "u_beta")}
    columns |= {n: r[n][inner.start - rows : inner.stop - rows] for n in names}
    b = balance(columns, campaign.drive, 1)
    assert curve[most + rows] == pytest.approx(max(b.share - b.noise, 0.0), rel=1e-9)


@pytest.mark.parametrize(
    ("names", "rows"),
    [
        (("u_alpha", "u_beta"), -200),
        (("u_alpha", "u_beta"), 12),
        (("i_a", "i_b", "i_c"), -30),
        (("i_a", "i_b", "i_c"), 90),
        (("theta",), 5),
        (("theta",), -30),
    ],
)
def test_columns_that_stand_many_rows_off_are_named(names, rows):
    """Further than any drive is late; told before any other cause, with the direction."""
    campaign = read_folder(recordings_folder() / "practice" / "p06")
    few = [campaign[n] for n in ("run_slow", "run_fast", "coast_down")]
    pad = abs(rows) + 1
    wrong = []
    for r in few:
        moved = {n: (np.roll(x, rows) if n in names else x)[pad:-pad] for n, x in r.columns.items()}
        wrong.append(dataclasses.replace(r, columns=moved))
    found = noticed(dataclasses.replace(campaign, recordings=tuple(wrong)))
    text = " ".join(n.finding.text for n in found)
    assert len(found) == 1
    assert f"move {', '.join(names)} {'up' if rows > 0 else 'down'} by {abs(rows)} rows" in text


def test_log_shifted_the_other_way():
    """Commands written a row late act before their row."""
    campaign = noisy(recorded(plant(), {}))
    r = campaign.recordings[0]
    moved = {n: np.append(0.0, r[n][:-1]) for n in ("u_alpha", "u_beta")}
    wrong = dataclasses.replace(r, columns={**r.columns, **moved})
    (finding,) = shifted([wrong], campaign.drive)
    assert "one sample before" in finding.text
