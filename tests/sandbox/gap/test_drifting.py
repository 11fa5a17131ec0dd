"""Offsets of current sensors that differ from recording to recording."""

from types import SimpleNamespace

import numpy as np
import pytest

from model.drive_files import load_drive
from sandbox.gap.location.drifting import drifting
from sandbox.plant.sets import complete
from sandbox.replay.replay import Residual

DRIVE = load_drive("ipm_exchanged")
FLOOR = 0.002  # A
N = 4000


def at(offsets, *, along=0.0, turns=20, rotor="free", seed=1):
    """Return a point and residuals: noise, an offset (floors) of sensor a in each recording (minus half of it in the
    others), and what moves with the rotor."""
    rng, angle = np.random.default_rng(seed), np.linspace(0.0, 2.0 * np.pi * turns, N)
    star = np.cos(angle[:, None] - 2.0 * np.pi / 3.0 * np.arange(3))
    one = np.array([1.0, -0.5, -0.5])
    read = [rng.standard_normal((N, 3)) + x * one + along * star for x in offsets]
    shown = [Residual(f"r{k}", rotor, x[:, :, None], None, None) for k, x in enumerate(read)]
    own = [SimpleNamespace(file=r.file, rotor=rotor, motion=SimpleNamespace(angle=angle)) for r in shown]
    values = complete(DRIVE.motor, DRIVE.converter, {"current_offset.offset_a": 1e-3})
    campaign = SimpleNamespace(drive=DRIVE)
    return SimpleNamespace(
        prepared=SimpleNamespace(recordings=own, floor=FLOOR, campaign=campaign), values=values
    ), shown


def test_offsets_of_two_recordings_are_told():
    found = drifting(*at((-6.0, 6.0)))
    assert found.sensor == 0
    assert found.offsets == pytest.approx({"r0": -0.011, "r1": 0.013}, abs=5 * FLOOR / np.sqrt(N))
    assert found.share > 0.99
    assert "sensor a reads −11 mA in r0, 13 mA in r1" in found.text
    assert "at rest before each recording" in found.text


@pytest.mark.parametrize(
    ("offsets", "more"),
    [
        ((6.0, 6.0), {}),  # one offset for both is an effect
        ((6.0,), {}),
        ((-6.0, 6.0), {"turns": 2}),
        ((-6.0, 6.0), {"rotor": "locked"}),  # all that is missed there stands still
        ((-2.0, 2.0), {"along": 9.0}),
        ((0.0, 0.0), {}),
    ],
)
def test_what_is_no_drift_is_not_told(offsets, more):
    assert drifting(*at(offsets, **more)) is None


def test_noise_alone_says_nothing():
    assert not any(drifting(*at((0.0, 0.0, 0.0), seed=k)) for k in range(100))
