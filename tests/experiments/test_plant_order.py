"""The table of the plant's order of convergence: what is made of errors, and what neutral effects
do."""

import numpy as np
import pytest

from experiments import plant_order as table
from model.drive_files import load_drive
from sandbox.recordings.campaign import Campaign
from sandbox.replay.replay import prepare


def test_an_order_is_told_from_the_last_two_numbers_of_steps():
    """An error that falls with the square of the steps has order two."""
    found = {n: [1e-6 / n**2, 1e-8 / n**3] for n in table.STEPS}
    # 1e-9 of rated current at 32 steps: below what is resolved
    assert table.order(found, 0) is None
    assert table.order({n: [1e3 * x for x in e] for n, e in found.items()}, 0) == pytest.approx(2.0)
    assert table.order({n: [1e9 * x for x in e] for n, e in found.items()}, 1) == pytest.approx(3.0)


def test_a_row_says_both_errors_and_the_order():
    found = {n: [1e-3 / n**2] * len(table.CASES) for n in table.STEPS}
    text = table.table({"ipm": {"none": found}}, {"ipm": {}})
    assert "on in the lane beside: none." in text
    assert f"| none | {' | '.join(['1e+03, 1: 2.0'] * len(table.CASES))} |" in text
    moved = table.table({"ipm": {"none": found}}, {"ipm": {"current_filter": 1.7e-9}})
    assert "on in the lane beside: current_filter (2e-09 of rated current)." in moved


def test_a_neutral_lane_that_moves_is_named(monkeypatch):
    """Rounding, but for the filter's 1e-12 s (bound: tests/sandbox/plant/test_batch.py).  One moved
    by more is told."""
    drive = load_drive("ipm")
    campaign = Campaign(
        "bench", drive, tuple(r for r, _ in table.recorded(drive, {})), {}, {}, False
    )
    prepared = prepare(campaign, steps=1)
    found = table.moved_by_neutral(drive, prepared)
    assert (
        found.pop("current_filter")
        < 1e-12 * 2.0 / 3.0 * 400.0 / drive.motor.inductance_q / drive.motor.rated_current
    )
    assert max(found.values(), default=0.0) < 32.0 * np.finfo(float).eps
    exact = table.replay

    def off(prepared, sets):
        """Return the readings with one of the first lane moved where dead time is on beside."""
        found = exact(prepared, sets)
        if "dead_time.time" in sets[-1]:
            found.currents[0][-1, 0, 0] += 1e-6 * drive.motor.rated_current
        return found

    monkeypatch.setattr(table, "replay", off)
    assert table.moved_by_neutral(drive, prepared)["dead_time"] == pytest.approx(1e-6)
