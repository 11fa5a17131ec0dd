"""What users met in practice: each folder of `SENSORLESS_CASES` with what is right about it, by its
README.

Skipped where the folder is absent; the kinds themselves have tests of their own that need no data.
"""

import json

import numpy as np
import pytest

from model.drive_files import load_drive
from model.effects.library import parameters as library_parameters
from model.map_points import read_points
from model.mapped import map_quality
from model.ratings import cautions
from sandbox import check, diagnose, replay
from tests.data import cases_folder
from tests.schemas import misfits


def told(case, file, preset=None):
    """Return what `check` says of a case's map, as level and text."""
    folder = cases_folder() / case
    found = check(folder, columns=folder / file, preset=preset, effects=False)
    return [(n.level, n.finding.text) for n in found.noticed]


def refused(case, file, preset=None):
    return " ".join(text for level, text in told(case, file, preset) if level == "refused")


def doubted(case, file, preset=None):
    return " ".join(text for level, text in told(case, file, preset) if level == "suspicious")


def test_01_the_sum_of_three_currents_is_a_gain():
    assert not refused("01_three_currents_sum", "map.toml")
    assert "current_gain" in doubted("01_three_currents_sum", "map.toml")


def test_02_the_same_recording_twice_is_counted_once():
    said = doubted("02_same_recording_twice", "map.toml")
    assert "b.csv: all rows are those of a.csv" in said
    assert "left out" in said


@pytest.mark.parametrize("file", ["phases.toml", "index.toml", "raw.toml"])
def test_04_brackets_that_are_no_units_belong_to_the_name(file):
    assert not refused("04_header_brackets", file)


def test_06_an_angle_that_turns_too_far_follows_the_speed():
    """Truth: inertia 3.0e-4 kg m^2, dry friction 0.05 N m, viscous 2.0e-4: inside 95 % intervals
    (the inertia's 2 % wide at most).  Whether a nominal value 14 % off is an effect no motion
    tells, and that is said."""
    folder = cases_folder() / "06_aliased_angle"
    found = diagnose(folder, columns=folder / "map.toml", preset="vesc").as_json()
    told = {**found["motion"], **found["hypotheses"][0]["parameters"]}
    for name, true in (
        ("inertia", 3.0e-4),
        ("coulomb_friction.torque", 0.05),
        ("viscous_friction.coefficient", 2.0e-4),
    ):
        low, high = told[name]["ci95"]
        assert low < true < high < 1.05 * low, name
    low, high = found["motion"]["inertia"]["ci95"]
    assert high < 1.02 * low
    assert "−14 % from the stated value" in found["motion"]["undecided"]["inertia"]
    inside_bounds(found)


def inside_bounds(found):
    """No size of any hypothesis lies outside its effect's bounds."""
    known = library_parameters()
    for h in found["hypotheses"]:
        for name, p in h["parameters"].items():
            assert known[name].low <= p["value"] <= known[name].high, (name, p)
    json.dumps(found, allow_nan=False)


def test_07_an_angle_that_never_moves_is_said_and_the_speed_stands_in():
    said = doubted("07_angle_never_moves", "map.toml", "vesc")
    assert "'encoder_position' never changes" in said
    assert "erpm" in said


@pytest.mark.parametrize(
    ("file", "words"),
    [
        ("off120.toml", ("120 degrees", "offset = -2.09")),
        ("off60.toml", ("60 degrees", "offset = -1.047")),
        (
            "swapped_both.toml",
            ("if phases a and b are swapped in currents and voltages or, which",),
        ),
        ("turned_both.toml", ("order b, c, a in currents and voltages",)),
        ("turned_voltages.toml", ("voltages' phases", "b, c, a")),
    ],
)
def test_09_any_zero_of_the_angle_and_any_order_of_phases(file, words):
    found = told("09_angle_off_by_120_or_phases_turned", file)
    said = [text for level, text in found if level == "refused"]
    assert len(said) == 1
    assert all(w in said[0] for w in words), said
    # a consequence is not told beside its cause
    assert not any("injection" in text for _, text in found)


def test_10_one_of_two_sensors_counts_the_other_way():
    assert "map i_b with scale = -1" in refused("10_two_sensors_one_sign", "map.toml")


def test_11_values_between_terminals_and_flux_per_mechanical_speed():
    assert "between two terminals" in doubted("11_line_values_in_motor", "line.toml")
    assert "divide magnet_flux by pole_pairs = 6 in [motor]" in refused(
        "11_line_values_in_motor", "ke.toml"
    )


@pytest.mark.parametrize(
    ("file", "words"),
    [
        ("milliamps.toml", ("'q_current' is in mA", 'unit = "mA"')),
        ("counts.toml", ("'position' is in counts",)),
        ("reversed.toml", ("scale = -1", "negative inertia")),
    ],
)
def test_13_a_motion_is_checked_as_any_log(file, words):
    said = refused("13_motion_without_checks", file, "moteus")
    assert all(w in said for w in words), said


def test_13_a_motion_as_it_is():
    """Truth: inertia 2.0e-4 kg m^2, dry friction 0.02 N m, viscous 1.0e-4."""
    assert {level for level, _ in told("13_motion_without_checks", "plain.toml", "moteus")} == {
        "note"
    }
    folder = cases_folder() / "13_motion_without_checks"
    found = diagnose(folder, columns=folder / "plain.toml", preset="moteus").as_json()
    low, high = found["motion"]["inertia"]["ci95"]
    assert low < 2.0e-4 < high < 1.02 * low
    inside_bounds(found)


def map_of(case, file):
    return load_drive(cases_folder() / case / file).motor


def test_14_the_error_is_that_of_the_fit_in_use():
    """As in the table's own cells: far worse, and cautioned."""
    cells, auto = (
        map_of("14_map_error_of_another_fit", f).origin for f in ("cells.toml", "auto.toml")
    )
    errors = [map_quality(m.table, m.path.parent) for m in (cells, auto)]
    assert errors[0] != errors[1]
    assert "cells" in " ".join(cells.notes)


def test_15_a_map_is_read_as_programs_write_it():
    """The five files hold one map: the same currents and fluxes, to the digits that are written."""
    folder = cases_folder() / "15_map_as_text"
    one, *others = (
        read_points(folder / f"{name}.csv")
        for name in ("comment", "mathworks", "semicolon", "tab", "units")
    )
    for other in others:
        for own, expected in zip(other.points(), one.points(), strict=True):
            np.testing.assert_allclose(own, expected, atol=1e-3 * np.max(np.abs(expected)))


def test_16_a_map_that_contradicts_its_torque():
    assert "rms" in " ".join(map_of("16_map_contradicts_its_torque", "motor.toml").origin.notes)


def test_19_an_inductance_in_millihenry():
    said = " ".join(cautions(load_drive(cases_folder() / "19_inductance_in_mH" / "motor.toml")))
    assert "inductance_d and inductance_q in mH" in said


def test_03_a_size_that_needs_a_rated_speed_is_not_said_without_one():
    folder = cases_folder() / "03_iron_loss_without_rated_speed"
    found = check(folder, columns=folder / "no_ratings.toml")
    said = {e["name"]: e for e in found.as_json()["effects"]}
    assert said["iron_loss"] == {
        "name": "iron_loss",
        "deviations": None,
        "visible": "cannot say, rated_speed_rpm is missing",
    }
    stated = check(folder, columns=folder / "ratings.toml")
    assert stated.cannot == {}


def test_20_offsets_that_differ_are_an_effect(tmp_path):
    """Put in: -12 mA of sensor a in one recording, +12 mA in the other, and nothing else."""
    result = diagnose(cases_folder() / "20_offset_differs_between_recordings")
    found = result.as_json()
    assert misfits("diagnosis", result.save(tmp_path) / "diagnosis.json") == []
    assert found["verdict"] == "explained"
    assert found["hypotheses"][0]["effects"] == ["current_offset"]
    own = found["effects"][0]
    assert own["name"] == "current_offset"
    assert own["probability"] > 0.999
    for r, true in zip(own["by_recording"], (-0.012, 0.012), strict=True):
        low, high = r["parameters"]["current_offset.offset_a"]["ci95"]
        assert low < true < high
    ready = replay(
        cases_folder() / "20_offset_differs_between_recordings", tmp_path / "effects.toml"
    )
    for r in found["simulator"]["residual"]:  # motor.toml holds ordinary deviations beside
        assert ready.rms[r["file"]] == pytest.approx(r["rms"], abs=0.1)
    assert [r["file"] for r in found["recording_offsets"]] == ["rs1.parquet", "rs2.parquet"]
    for r, true in zip(found["recording_offsets"], (-0.012, 0.012), strict=True):
        assert abs(r["i_a"] - true) < 4.0 * r["standard_error"]


def test_21_a_log_that_begins_under_current_has_no_effect():
    """Truth: none; a start from one noisy reading was explained as two delays."""
    found = diagnose(cases_folder() / "21_start_in_the_middle").as_json()
    assert found["verdict"] == "no_gap"
    assert found["hypotheses"][0]["effects"] == []
