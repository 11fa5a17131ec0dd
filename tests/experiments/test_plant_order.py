"""The table of the plant's order of convergence: what is made of errors, and that neutral effects are seen to do
nothing."""

import numpy as np
import pytest

from experiments import plant_order as table
from model.drive_files import load_drive
from sandbox.recordings.campaign import Campaign
from sandbox.replay.replay import prepare


def test_an_order_is_told_from_the_last_two_numbers_of_steps():
    """An error that falls with the square of the steps has order two."""
    found = {n: [1e-6 / n**2, 1e-8 / n**3] for n in table.STEPS}
    assert table.order(found, 0) is None  # 1e-9 of rated current at 32 steps: below what is resolved
    assert table.order({n: [1e3 * x for x in e] for n, e in found.items()}, 0) == pytest.approx(2.0)
    assert table.order({n: [1e9 * x for x in e] for n, e in found.items()}, 1) == pytest.approx(3.0)


def test_a_row_says_both_errors_and_the_order():
    found = {n: [1e-3 / n**2] * len(table.CASES) for n in table.STEPS}
    text = table.table({"ipm": {"none": found}}, {"ipm": []})
    assert "change a bit of the readings: none." in text
    assert f"| none | {' | '.join(['1e+03, 1: 2.0'] * len(table.CASES))} |" in text


def test_an_effect_that_moves_a_bit_at_its_neutral_value_is_named(monkeypatch):
    drive = load_drive("ipm")
    campaign = Campaign("bench", drive, tuple(r for r, _ in table.recorded(drive, {})), {}, {}, False)
    prepared = prepare(campaign, steps=1)
    assert table.moved_by_nothing(drive, prepared) == []
    exact = table.currents

    def off(prepared, effects):
        """Return the readings with the last bit of one changed where dead time is named."""
        found = exact(prepared, effects)
        if "dead_time.time" in effects:
            found[0][0, 0] = np.nextafter(found[0][0, 0], np.inf)
        return found

    monkeypatch.setattr(table, "currents", off)
    assert table.moved_by_nothing(drive, prepared) == ["dead_time"]
