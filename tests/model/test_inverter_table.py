"""Measured inverter tables: from a drive file, from a CSV beside it, both signs of the current,
refusals."""

import numpy as np
import pytest

from model.drive_files import load_drive, motor_file
from model.errors import BadInput
from model.inverter_table import checked, read_points

DRIVE = motor_file("ipm").read_text(encoding="utf-8")
POINTS = ((0.0, 0.0), (0.5, 4.0), (4.5, 5.0))


@pytest.mark.parametrize("stated", ["[[0, 0], [0.5, 4], [4.5, 5]]", '"inverter.csv"'])
def test_a_drive_file_states_points_or_a_file_beside_it(tmp_path, stated):
    (tmp_path / "inverter.csv").write_text("current,error\n0,0\n0.5,4\n4.5,5\n", encoding="utf-8")
    text = DRIVE.replace("[drive]\n", f"[drive]\ninverter_table = {stated}\n")
    (tmp_path / "mine.toml").write_text(text, encoding="utf-8")
    assert load_drive(tmp_path / "mine.toml").converter.inverter_table == POINTS


def test_of_both_signs_the_odd_part_counts(tmp_path):
    """5 tanh(i) plus an offset of the measurement, at currents that differ left and right: straight
    between points."""
    i = np.array([-2.0, -1.0, -0.5, 0.0, 0.5, 1.0, 1.5])
    (tmp_path / "both.csv").write_text(
        "\n".join(f"{x},{5 * np.tanh(x) + 0.3}" for x in i), encoding="utf-8"
    )
    found = np.array(read_points(tmp_path / "both.csv"))
    assert found[:, 0] == pytest.approx([0.0, 0.5, 1.0, 1.5])
    left = np.interp(1.5, [1.0, 2.0], 5 * np.tanh([1.0, 2.0]))
    assert found[:3, 1] == pytest.approx(5 * np.tanh(found[:3, 0]), abs=1e-12)
    assert found[3, 1] == pytest.approx(0.5 * (5 * np.tanh(1.5) + left), abs=1e-12)


@pytest.mark.parametrize(
    ("points", "said"),
    [
        ([[0.0, 0.0]], "2 to 64 pairs"),
        ([[0.1, 0.0], [1.0, 2.0]], "begin it with 0 V at 0 A"),
        ([[0.0, 0.0], [1.0, 2.0], [1.0, 3.0]], "do not rise"),
        ([[0.0, 0.0], [1.0, float("nan")]], "no finite"),
        ([[0.0, 0.0], [1.0]], "no list of pairs"),
        (7.0, "pairs"),
    ],
)
def test_what_is_no_table_is_refused(points, said):
    with pytest.raises(BadInput, match=said):
        checked(points)


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("", "no numbers"),
        ("a,b\n0,0\n1,x\n", "line 3 .*no pair"),
        ("-1,1\n-2,2\n1,1\n", "do not rise"),
    ],
)
def test_a_file_that_holds_none_is_refused_by_its_line(tmp_path, text, said):
    (tmp_path / "bad.csv").write_text(text, encoding="utf-8")
    with pytest.raises(BadInput, match=said):
        read_points(tmp_path / "bad.csv")


def test_a_file_that_is_not_there(tmp_path):
    with pytest.raises(BadInput, match="does not exist; give a CSV file of two columns"):
        read_points(tmp_path / "none.csv")
