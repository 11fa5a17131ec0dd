"""A measured flux map as the nominal model of a campaign: its effect is named beside the map;
`[flux_map]` as in a drive file."""

import pytest

import sandbox
from model.effects.library import effect_names
from sandbox import Scenario, Segment
from tests.data import real_data

SCENE = Scenario(
    "bench",
    (
        Segment(0.05),
        Segment(0.2, load=0.6, ramp=0.05),
        Segment(0.2, load=-0.4, speed=0.2, ramp=0.1),
    ),
    rotor="driven",
    start_up=False,
)
TRUE = 2e-6  # s
LEFT = ("dead_time", "device_drop", "stator_resistance", "inductance")


def test_dead_time_is_found_beside_a_measured_map(tmp_path):
    """On the switched bench, which reads the map by its own code.  Within four of the stated
    standard deviations."""
    real_data()
    folder = tmp_path / "campaign"
    sandbox.simulate(
        "baldor_pmsyrm",
        SCENE,
        "qnull",
        closed_loop=False,
        plant="switched",
        effects={"dead_time.time": TRUE},
        seed=3,
        record=folder,
    )
    found = sandbox.diagnose(
        folder, exclude=[e for e in effect_names() if e not in LEFT], jobs=1
    ).as_json()
    best = found["hypotheses"][0]
    assert best["effects"] == ["dead_time"]
    assert best["probability"] > 0.9
    time = best["parameters"]["dead_time.time"]
    low, high = time["ci95"]
    assert time["value"] == pytest.approx(TRUE, abs=4.0 * (high - low) / 3.92)
    assert found["gap"]["after"] < 1.1 < found["gap"]["before"]
