"""A free rotor whose recording begins while its shaft still swings."""

import dataclasses

import numpy as np
import pytest

from sandbox.recordings.campaign import Campaign
from sandbox.replay import walking
from sandbox.replay.replay import prepare, replay, residuals
from tests.sandbox.replay.benches import DRIVE, record

# 80 Hz and a ratio of 0.02: a swing is down to a hundredth after 0.46 s, longer than the recording
SHAFT = {
    "shaft_compliance.stiffness": 70.0,
    "shaft_compliance.load_inertia": 0.4 * DRIVE.motor.inertia,
    "shaft_compliance.damping_ratio": 0.02,
}
STEP = 300  # row at which the load sets in, `record`


def motion_left(r):
    """Rms of the innovations of the true set."""
    prepared = prepare(Campaign("own", DRIVE, (r,), {}, {}, False), steps=1)
    (left,) = residuals(prepared, replay(prepared, [SHAFT]))
    return float(np.sqrt(np.mean(left.motion**2)))


def cut(r, first):
    """The recording from a row on."""
    columns = {k: x[first:] for k, x in r.columns.items()}
    return dataclasses.replace(r, columns={**columns, "t": columns["t"] - columns["t"][0]})


@pytest.fixture(scope="module")
def swinging():
    return record(SHAFT, "free", n=1000)


def test_a_start_in_the_middle_of_a_swing_is_no_misfit(swinging, monkeypatch):
    """Readings that are rounded to counts and without noise leave far less than 1; a tenth is what
    no decision meets.  The whole recording begins at rest, which is known; cut 60 rows after the
    load's step, with the start taken for the load's twist, it leaves 7."""
    whole, later = motion_left(swinging), cut(swinging, STEP + 60)
    assert whole < 0.1
    assert motion_left(later) < 0.1
    monkeypatch.setattr(walking, "without_start", lambda *_: None)
    assert motion_left(swinging) == whole
    assert motion_left(later) > 1.0
