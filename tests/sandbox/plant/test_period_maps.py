"""Motors with a flux map: the replay against the switched bench and the reference; both ways of
reading a map."""

import dataclasses

import numpy as np
import pytest

from experiments.plant_against_bench import apart as bench_apart
from experiments.plant_against_bench import recorded
from model.drive_files import load_drive
from model.spline import currents
from sandbox.plant.batch import blank
from sandbox.plant.electrical import mapped
from sandbox.recordings.campaign import Campaign
from sandbox.replay.replay import prepare, replay
from tests.data import real_data
from tests.sandbox.plant.stated_duties import apart, duties, finer, from_duties, reference, turning

EXACT = 2e-5  # of rated current


@pytest.fixture(scope="module", params=["brusa_hsm1", "baldor_pmsyrm"])
def drive(request):
    """A motor with a measured map, its encoder fine enough not to show."""
    real_data()
    found = load_drive(request.param)
    return dataclasses.replace(
        found, converter=dataclasses.replace(found.converter, encoder_counts=1 << 20)
    )


@pytest.mark.parametrize(
    "effects", [{}, {"dead_time.time": 1e-6}, {"iron_loss.core_resistance": 100.0}], ids=str
)
def test_the_replay_of_a_map_is_the_switched_bench(drive, effects):
    """Four steps: a map's step is of second order (no third derivative of it is taken)."""
    pairs = recorded(drive, effects)
    campaign = Campaign("bench", drive, tuple(r for r, _ in pairs), {}, {}, False)
    found = bench_apart(drive, pairs, prepare(campaign, effects, steps=4), effects)
    print(drive.motor.name, effects, [f"{x * 1e6:.2f}" for x in found])
    assert max(found) < EXACT


def test_a_map_is_that_of_the_reference(drive):
    """NumPy's polynomials of each cell, inside the map's box: the same currents to the steps'
    error."""
    period = drive.converter.sampling_period
    speed, size = 0.002 / period, 0.004
    duty = duties(16, speed, size, drive)
    readings, _ = reference(drive, {}, duty, speed)
    prepared = from_duties(drive, duty, *turning(16, speed, drive))
    coarse, fine = (
        apart(drive, replay(finer(prepared, n), [{}]).currents[0][:, :, 0], readings)
        for n in (8, 32)
    )
    print(drive.motor.name, np.abs(readings).max() / drive.motor.rated_current, coarse, fine)
    assert fine < 2e-6
    assert coarse > 6.0 * fine or coarse < 1e-7


def test_lanes_in_one_cell_and_in_several_read_the_same_currents(drive):
    """Sixteen lanes in one cell take a vector loop, in several each its own way: equal to the last
    bit but a few."""
    m, rng = drive.motor.energy, np.random.default_rng(0)
    w = blank(16)
    for cell in ((3, 4), (m.cells.shape[0] - 1, 0)):
        for spread in (0.9, 3.0, 200.0):  # in one cell, in several, some beyond the box
            place = 0.05 + rng.uniform(0.0, spread, (2, 16))
            w["z_d"][:] = m.low_d + (cell[0] + place[0]) / m.per_d
            w["z_q"][:] = m.low_q + (cell[1] + place[1]) / m.per_q
            mapped(w, m)
            one = np.array([currents(m, d, q) for d, q in zip(w["z_d"], w["z_q"], strict=True)]).T
            scale = np.abs(one).max()
            assert np.abs(np.stack([w["i_d"], w["i_q"]]) - one).max() < 1e-13 * scale
