"""An angle that turns at another pace than the voltage: a gear, other pole pairs, a speed without
its sign."""

import dataclasses
import functools
import re

import numpy as np
import pytest

from model.errors import BadInput
from sandbox.recordings.campaign import read_folder
from sandbox.recordings.checks.factors import conventions_off
from sandbox.recordings.checks.mistakes import contradictions
from sandbox.recordings.checks.pace import off_pace
from tests.data import recordings_folder
from tests.sandbox.recordings.made_angles import read, turning


@functools.cache
def bench(file):
    campaign = read_folder(recordings_folder() / "practice" / "p01")
    return campaign[file], campaign.drive


def told(file, factor, **motor):
    """What is said of a log whose angle is so many times itself."""
    r, drive = bench(file)
    r = dataclasses.replace(
        r, columns={**r.columns, "theta": factor * r.theta}, source={"theta": "Pos"}
    )
    drive = dataclasses.replace(drive, motor=dataclasses.replace(drive.motor, **motor))
    try:
        found = [*contradictions([r], drive), *conventions_off([r], drive)]
    except BadInput as error:
        return str(error)
    return " ".join(f.text for f in found)


@pytest.mark.parametrize("gear", [5.0, -5.0, 1.0 / 3.0])
def test_a_gear_between_motor_and_encoder(gear):
    text = told("run_fast", 1.0 / gear)
    ratio = f"{abs(gear):g} : 1" if abs(gear) > 1.0 else f"1 : {1.0 / abs(gear):g}"
    assert f"a gear of {ratio})" in text
    assert ("counted backwards" in text) == (gear < 0.0)
    assert f"map it with scale = {gear:.6g}" in text


@pytest.mark.parametrize("gear", [-5.0, 3.7, -3.7])
def test_a_gear_where_injection_hides_how_fast_the_voltage_turns(gear):
    """No stretch turns far enough to compare paces; every pace is tried.  30 pole pairs are beyond
    those tried one by one, and 3.7 times 6 are none."""
    text = told("run_slow", 1.0 / gear)
    assert ("counted backwards" in text) == (gear < 0.0)
    assert float(text.rpartition("scale = ")[2]) == pytest.approx(gear, rel=1e-3)


def test_a_gear_of_no_whole_number():
    text = told("run_fast", 1.0 / 3.71)
    assert "(a gear of 3.71 : 1)" in text
    assert float(text.rpartition("scale = ")[2]) == pytest.approx(3.71, rel=1e-3)


def test_the_pairs_that_a_pace_asks_for():
    """An angle read with 3 of 6 pairs turns half as fast as the voltage."""
    r, drive = bench("run_fast")
    r = dataclasses.replace(r, columns={**r.columns, "theta": 0.5 * r.theta})
    drive = dataclasses.replace(drive, motor=dataclasses.replace(drive.motor, pole_pairs=3))
    (found,) = off_pace([r], drive)
    ratio, stated, asked = (
        float(x)
        for x in re.search(r"([\d.]+) times .* = (\d+) .* be ([\d.]+)", found.text).groups()
    )
    assert ratio == pytest.approx(2.0, abs=0.1)
    assert stated == 3.0
    assert asked == pytest.approx(6.0, abs=0.3)


@pytest.mark.parametrize("file", ["run_fast", "driven_grid", "run_slow"])
@pytest.mark.parametrize("pairs", [4, 7])
def test_wrong_pole_pairs_at_any_speed_and_load(file, pairs):
    """The motor has 6; at low speed under load less than a third of the voltage shows it."""
    text = told(file, pairs / 6.0, pole_pairs=pairs)
    assert "(6 pole pairs, or a gear of" in text
    assert f"correct pole_pairs = {pairs} to 6" in text


def test_a_speed_without_its_sign(tmp_path):
    """The rotor turns round; the log's speed is its size."""
    speed = 300.0 * np.cos(np.pi * np.arange(2000) / 2000)
    own, _ = turning(speed)
    erpm = '[columns]\nspeed = {column = "erpm", unit = "rad/s"}\n'
    with pytest.raises(
        BadInput, match=r"'erpm'.*turns both ways, the speed never changes its sign"
    ):
        read(tmp_path, {**own, "erpm": np.abs(speed)}, erpm)
    assert read(tmp_path, {**own, "erpm": speed}, erpm)["run"].made
