"""Readings that a slower sensor repeats are told with their age; those that move by counts, and
commands that really stand still, are not."""

import math

import numpy as np
import pytest

from model.errors import BadInput
from sandbox import check, read_campaign
from sandbox.recordings.rows.held import held_over
from tests.sandbox.recordings.made_angles import SWING, turning, written

CURRENTS = ("i_a", "i_b", "i_c")


def held(x, rows):
    """Readings (n,) of a sensor that is as many times slower than the rows."""
    return x[np.arange(len(x)) // rows * rows]


def log(names=(), rows=1):
    columns, theta = turning(SWING)
    columns = {**columns, "theta": theta}
    return columns | {n: held(columns[n], rows) for n in names}


def said(folder, columns):
    found = check(folder, columns=written(folder, columns), effects=False)
    return [text for text in found.mistakes if "rows only" in text], found


@pytest.mark.parametrize("rows", [2, 3, 4, 8])
@pytest.mark.parametrize("names", [("theta",), CURRENTS], ids=["angle", "currents"])
def test_readings_that_are_held_are_told_with_their_age(tmp_path, names, rows):
    """300 rad/s and rows of 250 us: 4.3 degrees a row; what they contradict is not told beside."""
    (text,), found = said(tmp_path, log(names, rows))
    listed = ", ".join(f"'{n}'" for n in names)
    assert f"column{'s' * (len(names) > 1)} {listed} change" in text
    assert f"every {rows} rows only: a reading is up to {rows - 1} row" in text
    assert f"keep one row of {rows}, in which it is fresh, with sampling_period" in text
    assert len(found.mistakes) == 1
    if names == ("theta",):
        behind = math.degrees(np.max(np.abs(np.diff(log(names, rows)["theta"]))))
        assert f"and {behind:.2g} degrees behind" in text


def test_one_phase_alone_is_refused(tmp_path):
    """Phases of other rows have no sum, and no vector."""
    columns = log(("i_a",), 4)
    (text,), found = said(tmp_path, columns)
    assert not found.ok
    with pytest.raises(BadInput, match="'i_a' changes every 4 rows only"):
        read_campaign(tmp_path, columns=written(tmp_path, columns))
    assert "the three currents" not in " ".join(found.mistakes)
    assert "fresh" in text


def test_commands_that_the_voltage_followed_are_not_told(tmp_path):
    """A control four times slower than the log: the current follows the steps.  Where the logger
    repeats commands, it does not."""
    (text,), _ = said(tmp_path, log(("u_alpha", "u_beta"), 4))
    assert text.endswith("log the command of each row")
    columns = log()
    for n, other in (("u_alpha", "i_a"), ("u_beta", "i_b")):
        assert held_over(columns[n]) == held_over(columns[other]) == 1


@pytest.mark.parametrize("speed", [0.1, 0.31, 1.7, 5.3])
def test_counts_are_no_repeats(speed):
    """Counts of an encoder at a steady speed, some rows each: they move by one or two."""
    place = np.floor(speed * np.arange(4000.0) + 1e-9)
    assert held_over(0.01 * place) == 1


@pytest.mark.parametrize("rows", [2, 3, 5])
def test_counts_that_are_repeated_are_told(rows):
    place = np.floor(40.0 * np.sin(np.arange(4000.0) / 100.0))
    assert held_over(0.01 * held(7.0 * place + np.floor(np.arange(4000.0) * 3.3), rows)) == rows


def test_levels_and_noise_are_no_repeats():
    rng = np.random.default_rng(0)
    levels = np.repeat(rng.standard_normal(40), rng.integers(20, 300, 40))
    assert held_over(levels) == 1
    assert held_over(0.01 * np.round(100.0 * 0.005 * rng.standard_normal(4000))) == 1
    assert held_over(rng.standard_normal(4000)) == 1
