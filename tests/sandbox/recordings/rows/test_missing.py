"""Cells without a number: single ones of a reading are told by the rows beside, none of a
command."""

import dataclasses

import numpy as np
import pyarrow
import pytest
from pyarrow import parquet

from model.errors import BadInput
from sandbox.recordings.campaign import read_folder
from sandbox.recordings.importing import read_recordings
from sandbox.recordings.writing import write_campaign
from tests.data import recordings_folder

COUNT = 2.0 * np.pi / 4096  # rad mechanical, of the bench's encoder


def bench(*files):
    campaign = read_folder(recordings_folder() / "practice" / "p05")
    return dataclasses.replace(
        campaign, recordings=tuple(r for r in campaign.recordings if r.file in files)
    )


def spoiled(campaign, names, share, folder, rng):
    """Write a campaign whose named columns lack a share of their numbers; return its folder."""
    write_campaign(folder, campaign)
    for r in campaign.recordings:
        columns = {n: x.copy() for n, x in r.columns.items()}
        for name in names:
            columns[name][1:-1][rng.random(len(r.t) - 2) < share] = np.nan
        parquet.write_table(pyarrow.table(columns), folder / r.file)
    return folder


def test_two_percent_of_the_readings_are_told_by_the_rows_beside(tmp_path):
    """At speed and under injection: currents within noise on average, the angle within two counts;
    what they miss counts as noise."""
    campaign = bench("run_fast.parquet", "locked_d.parquet")
    rng = np.random.default_rng(5)
    read = read_recordings(spoiled(campaign, ("i_a", "i_c", "theta"), 0.02, tmp_path / "c", rng))
    noise = campaign.drive.converter.current_noise
    for own, whole in zip(read.recordings, campaign.recordings, strict=True):
        off = np.concatenate([own[n] - whole[n] for n in ("i_a", "i_c")])
        assert 0 < np.count_nonzero(off) < 0.03 * off.size
        assert np.sqrt(np.mean(off**2)) < noise
        assert np.max(np.abs(own.theta - whole.theta)) < 2.0 * COUNT * read.drive.motor.pole_pairs
    assert 0.0 < read.unseen < noise
    assert any("is empty" in f.text and "'i_a'" in f.text for f in read.findings)


@pytest.mark.parametrize("name", ["u_alpha", "t"])
def test_no_command_and_no_stamp_is_made_up(name, tmp_path):
    campaign = bench("locked_d.parquet")
    rng = np.random.default_rng(5)
    with pytest.raises(BadInput, match=f"column '{name}' is nan"):
        read_recordings(spoiled(campaign, (name,), 0.001, tmp_path / "c", rng))


def test_many_empty_cells_are_refused(tmp_path):
    campaign = bench("locked_d.parquet")
    rng = np.random.default_rng(5)
    with pytest.raises(BadInput, match="record every sample"):
        read_recordings(spoiled(campaign, ("i_a",), 0.2, tmp_path / "c", rng))
