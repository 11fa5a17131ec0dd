"""Current readings disturbed in some rows: found among good ones, and mended from those beside."""

import dataclasses

import numpy as np
import pytest

from model.errors import BadInput
from sandbox.recordings.campaign import read_folder
from sandbox.recordings.findings import Doubt
from sandbox.recordings.rows.disturbed import without_disturbed
from tests.data import recordings_folder


def bench(name="p05"):
    return read_folder(recordings_folder() / "practice" / name)


def spoiled(campaign, share, names=("i_a",), source=None, seed=0):
    """Return a campaign with a share of readings 0.2 to 2 rated currents off, and which rows."""
    rng, rated = np.random.default_rng(seed), campaign.drive.motor.rated_current
    recordings, rows = [], []
    for r in campaign.recordings:
        own, at = dict(r.columns), rng.random(len(r.t)) < share
        for name in names:
            off = rng.uniform(0.2, 2.0, len(at)) * rng.choice([-1.0, 1.0], len(at)) * rated
            own[name] = np.where(at, own[name] + off, own[name])
        if source and "i_c" not in source:
            own["i_c"] = -own["i_a"] - own["i_b"]
        recordings.append(dataclasses.replace(r, columns=own, source=source or {}))
        rows.append(at)
    return dataclasses.replace(campaign, recordings=tuple(recordings)), rows


@pytest.mark.parametrize("name", ["p01", "p06", "p10"])
def test_good_readings_are_left_as_they_are(name):
    """Steps of the voltage, injection, noise of one count: nothing goes forth and back."""
    campaign = bench(name)
    assert without_disturbed(campaign) is campaign


@pytest.mark.parametrize("name", ["p02", "p11"])
def test_parts_of_good_recordings_are_left_as_they_are(name):
    """Each alone, cut anywhere: at speed the current bends at the last row, and what counts as much
    is that recording's own currents."""
    campaign = bench(name)
    for r in campaign.recordings:
        for first in range(0, len(r.t) - 1000, 3500):
            part = {n: x[first : first + 4000] for n, x in r.columns.items()}
            own = (dataclasses.replace(r, columns=part),)
            alone = dataclasses.replace(campaign, recordings=own)
            assert without_disturbed(alone) is alone, (r.file, first)


@pytest.mark.parametrize("name", ["p01", "p02"])
@pytest.mark.parametrize("rows", [1, 2, 4])
def test_currents_that_stand_late_are_not_disturbed(name, rows):
    """A command's step is answered rows later: forth, without the current, and back."""
    campaign = bench(name)
    (r,) = (r for r in campaign.recordings if r.file == "locked_steps.parquet")
    late = {n: x[:-rows] if n.startswith("i_") else x[rows:] for n, x in r.columns.items()}
    one = dataclasses.replace(campaign, recordings=(dataclasses.replace(r, columns=late),))
    assert without_disturbed(one) is one


@pytest.mark.parametrize("end", [0, -1])
def test_the_first_and_the_last_reading_are_mended_beside_others(end):
    """Within a dozen of its noise of 2 mA: at the ends the rows on one side alone tell."""
    campaign = bench("p02")
    (r,) = (r for r in campaign.recordings if r.file == "run_fast.parquet")
    x = r.i_a[:4000].copy()
    x[[1000, 2000, 3000]] += 1.0
    x[end] -= 0.5
    own = {n: y[:4000] for n, y in r.columns.items()} | {"i_a": x}
    spoilt = dataclasses.replace(
        campaign, recordings=(dataclasses.replace(r, columns=own, source={}),)
    )
    (told,) = without_disturbed(spoilt).recordings
    assert abs(told.i_a[end] - r.i_a[:4000][end]) < 0.024


@pytest.mark.parametrize("share", [0.001, 0.01, 0.05])
def test_disturbed_readings_are_mended_and_what_is_missed_is_noise(share):
    campaign = bench()
    told = without_disturbed(spoiled(campaign, share)[0])
    assert all(isinstance(f, Doubt) for f in told.findings)
    assert "of column 'i_a'" in told.findings[0].text
    off = np.concatenate(
        [x.i_a - y.i_a for x, y in zip(told.recordings, campaign.recordings, strict=True)]
    )
    rms = float(np.sqrt(np.mean(off**2)))
    # in one phase of three
    assert 0.3 * rms < told.unseen < rms
    assert told.unseen < 0.005 * campaign.drive.motor.rated_current


def test_a_third_current_that_was_made_is_made_again():
    campaign = bench()
    source = {n: n for n in ("t", "i_a", "i_b", "u_alpha", "u_beta", "theta")}
    told = without_disturbed(spoiled(campaign, 0.01, source=source)[0])
    r = told.recordings[0]
    np.testing.assert_allclose(r.i_a + r.i_b + r.i_c, 0.0, atol=1e-12)
    assert not any("'i_c'" in f.text for f in told.findings)


def test_too_many_are_refused_with_the_bound():
    with pytest.raises(BadInput, match=r"column 'i_a'.*6% at most can be mended.*record again"):
        without_disturbed(spoiled(bench(), 0.1)[0])
