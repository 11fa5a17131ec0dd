"""The kept ranking of effects covers the library, and the sentences quoted from it are still
true."""

import json
from pathlib import Path

import pytest

from model.effects.library import causes

RESULTS = Path(__file__).resolve().parents[2] / "experiments" / "results"


@pytest.fixture(scope="module")
def kept():
    return json.loads((RESULTS / "effects_on_position.json").read_text())


def change(kept, name, estimator, key):
    return kept["effects"][name][estimator][key] - kept["idle"][estimator][key]


def test_every_effect_and_estimator_is_there(kept):
    assert set(kept["effects"]) == set(causes())
    for row in kept["effects"].values():
        assert set(row) == {"qnull", "inversion", "ekf"}
    assert (RESULTS / "effects_on_position.svg").stat().st_size > 10_000
    table = (RESULTS / "effects_on_position.md").read_text()
    assert all(f"`{name}`" in table for name in causes())


def test_voltage_errors_hurt_the_filter_and_not_the_injection_methods(kept):
    for name in ("dead_time", "stator_resistance", "device_drop"):
        assert abs(change(kept, name, "ekf", "mean_deg")) > 1.5
        assert max(abs(change(kept, name, e, "mean_deg")) for e in ("qnull", "inversion")) < 0.1


def test_both_plants_say_the_same(kept):
    for row in kept["effects"].values():
        for found in row.values():
            assert found["mean_deg"] == pytest.approx(found["switched"]["mean_deg"], abs=0.05)
            assert found["ripple_deg"] == pytest.approx(found["switched"]["ripple_deg"], abs=0.05)
