"""Files that a user gives: what a TOML file with a decimal comma is told."""

import pytest

from model.errors import BadInput
from model.given import read_toml


@pytest.mark.parametrize(
    ("line", "right"),
    [
        ("resistance = 0,5", "resistance = 0.5"),
        ("inductance_d = 4,5e-3  # H", "inductance_d = 4.5e-3"),
        ("offset = -1,25", "offset = -1.25"),
    ],
)
def test_a_decimal_comma_is_named_with_its_line(tmp_path, line, right):
    path = tmp_path / "motor.toml"
    path.write_text(f"[motor]\npole_pairs = 4\n{line}\n")
    with pytest.raises(
        BadInput, match="line 3 holds a decimal comma: write " + right.replace(".", r"\.")
    ):
        read_toml(path)


@pytest.mark.parametrize(
    ("line", "unit"),
    [("inductance_d = 45.8mH", "mH"), ("resistance = 0.5 Ω  # phase", "Ω"), ("t = 2e-6 s", "s")],
)
def test_a_unit_behind_a_number_is_named_with_its_line(tmp_path, line, unit):
    path = tmp_path / "motor.toml"
    path.write_text(f"[motor]\n{line}\n")
    with pytest.raises(
        BadInput, match=f"line 2 holds a unit, {unit}: write {line.split()[0]} = the number alone"
    ):
        read_toml(path)


@pytest.mark.parametrize("number", ["1e-3", "1.5E6", "0x1F", "-2e3  # of 5 A"])
def test_a_number_alone_is_not_named_for_what_stands_below(tmp_path, number):
    path = tmp_path / "motor.toml"
    path.write_text(f"[motor]\na = {number}\nb = = 3\n")
    with pytest.raises(BadInput) as found:
        read_toml(path)
    assert "line 2" not in str(found.value)


@pytest.mark.parametrize("line", ["a = 1,2,3", "a = [1,2", "a = x,5"])
def test_what_is_no_decimal_comma_is_not_called_one(tmp_path, line):
    path = tmp_path / "motor.toml"
    path.write_text(f"{line}\n")
    with pytest.raises(BadInput, match="mend that place"):
        read_toml(path)
