"""Currents beyond the motor's flux map: which rows lie there, what is said of them.

The map is a square of 17 x 17 points, 0.4 A apart, up to 3.2 A; currents are chosen by hand.
"""

import math

import numpy as np
import pytest

from model.drive_files import load_drive
from sandbox.recordings.campaign import CampaignRecording
from sandbox.recordings.checks.map_range import beyond_map, point_spacing, stretches_within, within
from sandbox.recordings.preflight import FURTHER
from tests.model.planted_map import write_square

TEXT = """
[motor]
pole_pairs = 2
resistance = 2.1
inertia = 0.0011
rated_current = 1.2
rated_torque = 1.06
rated_speed_rpm = 1800.0
[flux_map]
file = "mine.csv"
cells = [6, 6]
smooth = 1e-6
"""


@pytest.fixture(scope="module")
def drive(tmp_path_factory):
    folder = tmp_path_factory.mktemp("map")
    write_square(folder / "mine.csv")
    (folder / "mine.toml").write_text(TEXT)
    return load_drive(folder / "mine.toml")


def recording(i_d, i_q):
    """Return a turning recording of such currents in the rotor's frame, A."""
    theta = 0.01 * np.arange(len(i_d))
    turned = (np.asarray(i_d) + 1j * np.asarray(i_q)) * np.exp(1j * theta)
    abc = {f"i_{p}": np.real(turned * np.exp(-2j * math.pi * k / 3)) for k, p in enumerate("abc")}
    zero = np.zeros(len(theta))
    columns = {"t": 1e-4 * np.arange(len(theta)), "u_alpha": zero, "u_beta": zero, **abc}
    return CampaignRecording(
        "run.parquet", "driven", "none", columns | {"theta": theta, "u_dc": zero + 300.0}
    )


def test_half_a_cell_beyond_its_points_a_map_still_tells(drive):
    # a square of 6.4 A by 6.4 A for 289 points
    assert point_spacing(drive.motor) == pytest.approx(6.4 / 17, rel=1e-9)
    x = [0.0, 0.0, 3.1, 3.1, 3.3, 3.3, 3.5, 3.5]
    inside, between = within(drive.motor, recording(x, np.zeros(8)))
    assert inside.tolist() == [True] * 6 + [False] * 2
    assert between.tolist() == [True] * 4 + [False] * 4
    inside, _ = within(drive.motor, recording(np.zeros(8), x))
    assert inside.tolist() == [True] * 6 + [False] * 2


def test_one_reading_beyond_is_a_spike(drive):
    inside, _ = within(drive.motor, recording([0.0, 0.0, 9.0, 0.0, 9.0, 9.0, 0.0], np.zeros(7)))
    assert inside.tolist() == [True] * 4 + [False] * 2 + [True]


def test_stretches_begin_between_the_points_at_an_even_row(drive):
    x = np.zeros(100)
    x[31:43] = 5.0
    x[43:45] = 3.3  # near the map's edge: not far from what it says, but it tells no flux
    own = recording(np.zeros(100), x)
    assert stretches_within(drive.motor, own, 2) == [(0, 31), (46, 100)]
    assert stretches_within(drive.motor, own, 40) == [(46, 100)]
    assert stretches_within(drive.motor, own, 60) == []
    assert stretches_within(load_drive("ipm").motor, own, 60) == [(0, 100)]  # it has no map


def test_what_a_person_reads(drive):
    x = np.zeros(100)
    x[30:40] = 5.0
    (said,) = beyond_map(recording(0.2 * x, x), drive)
    assert said.row == 30
    assert "currents reach i_d = 1 A, i_q = 5 A" in said.text
    assert "(i_d -3.2 to 3.2 A, i_q up to 3.2 A)" in said.text
    assert "leaves out the 10 of 100 rows" in said.text
    assert beyond_map in FURTHER  # `check` says it, too
    assert beyond_map(recording(np.zeros(100), 0.6 * x), drive) == []
