"""Low currents whose voltage the inverter's legs lose for the most part: a gap, and no unit."""

import dataclasses

import numpy as np
import pytest

from model.errors import BadInput
from sandbox.recordings.campaign import read_folder
from sandbox.recordings.checks.balance import PHASES, balance
from sandbox.recordings.checks.legs import left_by_legs
from sandbox.recordings.checks.mistakes import contradictions
from tests.data import recordings_folder


def low_currents(more):
    """Return a recording of low currents with so much more voltage (V) lost by each leg."""
    campaign = read_folder(recordings_folder() / "practice" / "p02")
    r = campaign["locked_low_current"]
    star = (2.0 / 3.0) * np.exp(2j * np.pi / 3.0 * np.arange(3))
    lost = more * sum(s * np.sign(r[n]) for s, n in zip(star, PHASES, strict=True))
    columns = {**r.columns, "u_alpha": r.u_alpha + lost.real, "u_beta": r.u_beta + lost.imag}
    return dataclasses.replace(r, columns=columns), campaign.drive


@pytest.mark.parametrize("more", [1.0, 3.0, 6.0])
def test_a_voltage_that_legs_lose_is_no_unit(more):
    r, drive = low_currents(more)
    share = balance(r.columns, drive).share
    assert share > 0.5
    assert left_by_legs(r, drive) < 0.06 * share
    assert not any("if voltages are" in f.text for f in contradictions([r], drive))


def test_a_unit_is_no_voltage_that_legs_lose():
    """Commands in counts of a tenth: a tenth of the voltage moves the currents."""
    r, drive = low_currents(0.0)
    columns = {**r.columns, "u_alpha": 10.0 * r.u_alpha, "u_beta": 10.0 * r.u_beta}
    r = dataclasses.replace(r, columns=columns)
    assert left_by_legs(r, drive) > 0.07
    with pytest.raises(BadInput, match=r"if (voltages are counts|currents are per unit) of"):
        contradictions([r], drive)
