"""Scenario files and their checks."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from model.drive_files import load_drive
from model.errors import BadInput, PhysicsError
from sandbox.drive.design import design
from sandbox.drive.feasible import check_feasible
from sandbox.drive.scenario import Scenario, Segment, load_scenario, scenario_names
from sandbox.drive.simulate import profile_of, torque_at_load

GOOD = """
[scenario]
rotor = "free"
reference = "speed"
[[segment]]
duration = 1.0
[[segment]]
duration = 0.5
load = 1.0
speed = 0.05
ramp = 0.2
"""


def scenario_file(tmp_path, text):
    path = tmp_path / "mine.toml"
    path.write_text(text)
    return path


@pytest.mark.parametrize("name", scenario_names())
def test_built_in_scenarios(name):
    scenario = load_scenario(name)
    assert scenario.description
    drive = load_drive("ipm_exchanged")
    check_feasible(drive, scenario, design(drive))
    assert max(s.load for s in scenario.segments) <= 1.8


def test_user_scenario_and_profile(tmp_path):
    scenario = load_scenario(scenario_file(tmp_path, GOOD))
    drive = load_drive("ipm_exchanged")
    profile = profile_of(drive, scenario)
    assert (profile["time"][0], profile["time"][-1]) == (0.0, 1.5)
    assert profile["load"][-1] == 1.0
    assert profile["torque"][-1] == pytest.approx(torque_at_load(drive, 1.0))
    assert profile["omega"][-1] == pytest.approx(0.05 * drive.motor.rated_omega)
    assert (np.diff(profile["time"]) >= 0.0).all()


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ("duration = 0.5|duration = 0", ("duration = 0", "[0.001, 3600] s")),
        ("duration = 0.5|duration = nan", ("nan", "s")),
        ("ramp = 0.2|ramp = 2.0", ("ramp = 2 s", "longer than its duration")),
        ("load = 1.0|lod = 1.0", ("lod", "did you mean 'load'")),
        ("load = 1.0|load = '1'", ("not a number",)),
        ("load = 1.0|settle = 0.7", ("settle = 0.7", "[0, duration")),
        ("load = 1.0|settle = 'x'", ("settle",)),
        ("load = 1.0|score = 3", ("score", "true nor false")),
        ('rotor = "free"|rotor = "fre"', ("mean 'free'",)),
        ('rotor = "free"|rotor = "locked"', ("rotor = 'free'",)),
        ("[scenario]|[scenary]", ("scenary", "did you mean 'scenario'")),
        ("speed = 0.05|speed = 50", ("speed = 50", "2] of rated speed")),
    ],
)
def test_wrong_scenario_is_told_what_and_how(tmp_path, change, words):
    old, new = change.split("|")
    with pytest.raises(BadInput) as error:
        load_scenario(scenario_file(tmp_path, GOOD.replace(old, new)))
    for word in ("mine.toml", *words):
        assert word in str(error.value)


def test_empty_and_unknown():
    with pytest.raises(BadInput, match=r"no \[\[segment\]\]"):
        Scenario("x", ())
    with pytest.raises(BadInput, match="did you mean 'staircase'"):
        load_scenario("staircas")


def test_cut():
    scenario = load_scenario("staircase")
    assert scenario.cut(1.0).duration == pytest.approx(1.0)
    assert scenario.cut(0.05).segments[0].duration == pytest.approx(0.05)
    for bad in (0.0, -1.0, float("nan"), 1e9):
        with pytest.raises(BadInput, match="duration"):
            scenario.cut(bad)


def test_voltage_too_low_for_the_load():
    import dataclasses

    drive = load_drive("ipm_exchanged")
    low = dataclasses.replace(
        drive, converter=dataclasses.replace(drive.converter, dc_bus_voltage=90.0)
    )
    with pytest.raises(
        PhysicsError,
        match=r"needs .* V, but the link of 90 V leaves 21\.96 V.*raise dc_bus",
    ):
        check_feasible(low, load_scenario("staircase"), design(low))


def test_what_nobody_stated_is_not_quoted_as_if_somebody_had(tmp_path):
    """A file without [drive] and [injection]: 4 x 126 rad/s x 0.5 Wb = 251 V, 400 V / sqrt 3 = 231
    V (model.drive_files)."""
    own = tmp_path / "own.toml"
    own.write_text(
        "[motor]\npole_pairs = 4\nresistance = 0.5\ninductance_d = 1e-3\ninductance_q = 2e-3\n"
        "magnet_flux = 0.5\ninertia = 1e-3\nrated_current = 10.0\nrated_torque = 30.0\n"
        "rated_speed_rpm = 3000.0\nviscous_friction = 0.0\n"
    )
    drive = load_drive(own)
    turning = Scenario("s", (Segment(0.2, 0.0, 0.4),), rotor="driven", start_up=False)
    usual = r"400 V \(a usual value, \[drive\] states none\) leaves .* V beside an injection of "
    with pytest.raises(PhysicsError, match=usual + r".* V \(a usual value, \[injection\]"):
        check_feasible(drive, turning, design(drive, start_up=False))


def test_load_outside_the_valid_domain_is_refused():
    with pytest.raises(PhysicsError, match="convex"):
        check_feasible(load_drive("spm"), load_scenario("staircase"), design(load_drive("spm")))


def test_the_printed_surface_motor_is_refused_with_what_to_take_instead():
    spm, still = load_drive("spm"), load_scenario("staircase").cut(0.1)
    with pytest.raises(
        PhysicsError,
        match=r"convex at i_d = -0\.78\d+ A; use 'spm_exchanged'.*or set start_up = false",
    ):
        check_feasible(spm, still, design(spm))
    lone = dataclasses.replace(spm, motor=dataclasses.replace(spm.motor, name="mine"))
    with pytest.raises(PhysicsError, match=r"use another parameter set"):
        check_feasible(lone, still, design(lone))


def test_a_duration_that_is_no_number_is_refused():
    with pytest.raises(BadInput, match="duration = '1 s' is no number; give s"):
        load_scenario("staircase").cut("1 s")


VALUES = st.one_of(st.floats(), st.integers(-5, 5), st.text(max_size=3), st.booleans(), st.none())


@settings(max_examples=150, deadline=None)
@given(
    st.dictionaries(
        st.sampled_from(["duration", "load", "speed", "ramp", "settle", "score", "x"]), VALUES
    )
)
def test_any_segment_is_taken_or_refused(values):
    from model.parameters import build

    try:
        segment = build(Segment, dict(values), "segment")
    except BadInput as error:
        assert str(error)
    else:
        assert segment.duration > 0


def test_a_file_may_change_one_of_ours(tmp_path):
    """Its keys in their place; its segments instead of all; an unknown name is told."""
    path = tmp_path / "mine.toml"
    path.write_text('[scenario]\nlike = "staircase"\nstart_up = false\n')
    ours, mine = load_scenario("staircase"), load_scenario(path)
    changed = dataclasses.replace(ours, name="mine", start_up=False)
    assert mine == changed
    path.write_text(path.read_text() + "[[segment]]\nduration = 0.5\n")
    assert load_scenario(path).duration == 0.5
    path.write_text('[scenario]\nlike = "stairs"\n')
    with pytest.raises(BadInput, match="unknown scenario in like 'stairs'; did you mean"):
        load_scenario(path)
