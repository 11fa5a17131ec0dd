"""Which recordings begin under current, by their first readings alone."""

import dataclasses

import numpy as np
import pytest

from sandbox.gap.excerpts import begins_at_rest
from sandbox.recordings.campaign import Campaign, CampaignRecording
from sandbox.replay.inputs import stated_noise_std
from tests.sandbox.replay.benches import DRIVE

OFFSET = np.array([0.02, 0.01, -0.03])  # A, of 1.2 A rated: 2 % of it at most
NOISE = stated_noise_std(DRIVE.converter)


def begun(first, file="r.parquet"):
    """Return a recording of two rows with these first readings (3,) in A."""
    columns = {"t": np.array([0.0, DRIVE.converter.sampling_period]), "theta": np.zeros(2)}
    columns |= {name: np.zeros(2) for name in ("u_alpha", "u_beta")} | {"u_dc": np.full(2, 400.0)}
    columns |= {f"i_{x}": np.array([i, 0.0]) for x, i in zip("abc", first, strict=True)}
    return CampaignRecording(file, "locked", "none", columns)


def told(*firsts):
    """Return of recordings with these first readings whether each begins at rest."""
    own = Campaign("starts", DRIVE, tuple(begun(x) for x in firsts), {}, {}, False)
    return [begins_at_rest(own, r) for r in own.recordings]


def test_what_sensors_read_at_rest_is_what_most_recordings_begin_with():
    """An offset, with two deviations of noise, is no current; 10 noise floors beside it are one,
    however small a share of rated current: 4 % of it read as none left 11 noise floors in the
    50 ms after (`stand_q_on_d` of another bench)."""
    rest = [OFFSET + 2.0 * NOISE * np.array([k % 2, -(k % 2), 0.0]) for k in range(4)]
    under = OFFSET + 10.0 * NOISE * np.array([1.0, -0.5, -0.5])
    assert told(*rest, under) == [True] * 4 + [False]


@pytest.mark.parametrize("count", [1, 2])
def test_of_one_or_two_recordings_only_noise_is_rest(count):
    """Nothing tells their offset from a current: they settle, which costs rows only."""
    assert told(*[20.0 * NOISE * np.array([1.0, -1.0, 0.0])] * count) == [False] * count
    assert told(*[2.0 * NOISE * np.array([1.0, -1.0, 0.0])] * count) == [True] * count


def test_many_that_begin_under_rated_current_make_it_no_rest():
    rated = DRIVE.motor.rated_current * np.array([1.0, -0.5, -0.5])
    assert told(rated, rated, rated, rated) == [False] * 4


def test_the_rows_in_which_states_settle_are_the_beginning():
    own = begun(DRIVE.motor.rated_current * np.array([1.0, -1.0, 0.0]))
    rest = {k: np.zeros(2) for k in own.columns} | {"t": own.columns["t"]}
    settled = dataclasses.replace(
        own, settling=rest, starts_at=2.0 * DRIVE.converter.sampling_period
    )
    assert begins_at_rest(Campaign("starts", DRIVE, (settled,), {}, {}, False), settled)
