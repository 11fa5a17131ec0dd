"""A load of the wrong sign or unit, and pole pairs counted as poles, are named; no campaign of the
bench is doubted."""

import dataclasses
import functools

import numpy as np
import pytest

from sandbox.gap.motion.checked import shaft_contradicted
from sandbox.gap.motion.load_side import load_contradicted
from sandbox.recordings.campaign import read_folder
from sandbox.recordings.motion_log import MotionCampaign, MotionRecording
from tests.data import recordings_folder

INERTIA, FRICTION, DRY = 2e-4, 1e-4, 0.01


@functools.cache
def bench(name):
    return read_folder(recordings_folder() / "practice" / name)


def of_load(factor, name="p06", **motor):
    """What is said where the load is read so many times too large."""
    c = bench(name)
    held = [
        dataclasses.replace(r, columns={**r.columns, "load_torque": factor * r["load_torque"]})
        for r in c.recordings
        if r.rotor == "free"
    ]
    own = dataclasses.replace(c.drive, motor=dataclasses.replace(c.drive.motor, **motor))
    return " ".join(
        f.text
        for f in shaft_contradicted(dataclasses.replace(c, recordings=tuple(held), drive=own))
    )


@pytest.mark.parametrize("name", [f"p{k:02d}" for k in range(1, 13)])
def test_no_shaft_of_the_bench_is_doubted(name):
    assert shaft_contradicted(bench(name)) == []


@pytest.mark.parametrize("rows", [20, 24, 30])
def test_a_short_recording_says_nothing_of_the_shaft(rows):
    """As few windows as these rows hold, or none: alone it is not judged, beside others it changes
    nothing."""
    c = bench("p06")
    short = []
    for r in c.recordings:
        if r.rotor == "free":
            # of no encoder, so that no noise hides what it seems to say
            theta = np.linspace(0.0, 1.0, rows) ** 2
            columns = {n: x[:rows] for n, x in r.columns.items()}
            short.append(dataclasses.replace(r, columns={**columns, "theta": theta}))
    assert short
    assert shaft_contradicted(dataclasses.replace(c, recordings=tuple(short))) == []
    assert shaft_contradicted(dataclasses.replace(c, recordings=(*c.recordings, *short))) == []


def test_sign_unit_and_pole_pairs():
    pairs = bench("p06").drive.motor.pole_pairs
    assert "counts the other way" in of_load(-1.0)
    assert "is in mN m" in of_load(1e3)
    assert "is in cN m" in of_load(1e2)
    assert "pole_pairs counts poles (halve it in [motor])" in of_load(1.0, pole_pairs=2 * pairs)
    assert "pole_pairs is half of what it is (double it in [motor])" in of_load(
        1.0, pole_pairs=pairs // 2
    )
    assert "inertia is in kg cm^2" in of_load(1.0, inertia=1e4 * bench("p06").drive.motor.inertia)


def motion(load, read, stated=None):
    """A motion whose torque is what the shaft's equation asks for: closed form."""
    t = np.arange(4000) * 1e-3
    angle, speed = 300.0 * t + 8.0 * np.sin(2.0 * t), 300.0 + 16.0 * np.cos(2.0 * t)
    torque = INERTIA * -32.0 * np.sin(2.0 * t) + load + FRICTION * speed + DRY
    torque += 1e-3 * np.random.default_rng(1).standard_normal(len(t))
    r = MotionRecording(
        "r.csv", t, angle, torque, read * np.ones(len(t)), source={"load_torque": "brake"}
    )
    return MotionCampaign("m", 0.04, INERTIA, 0.0, {}, None, 0.0, (r,), (), "why", stated or {})


@pytest.mark.parametrize(("noise", "told"), [(1e-3, True), (0.3, False)])
def test_a_load_that_changes_little_tells_its_factor_where_the_rest_is_clean(noise, told):
    """By a twentieth of its size: half of it read is two pairs for one.  Of 4000 rows each half of
    the load's steps has a mean to 1e-3/sqrt(2000) = 2e-5 N m, a thousandth of the change of
    0.02 N m; with noise of 0.3 N m it is a third of it, and nothing is told."""
    t = np.arange(4000) * 1e-3
    load = 0.4 + 0.02 * np.sign(np.sin(7.0 * t))
    campaign = motion(load, 0.5 * load)
    (r,) = campaign.recordings
    torque = r.torque + noise * np.random.default_rng(2).standard_normal(len(t))
    found = load_contradicted(
        dataclasses.replace(campaign, recordings=(dataclasses.replace(r, torque=torque),))
    )
    assert ["pole_pairs counts poles" in f.text for f in found] == [True] * told


def test_a_load_that_never_changes():
    """Its sign and unit are told by size; a factor of two may as well be friction."""
    assert load_contradicted(motion(0.4, 0.4)) == []
    (found,) = load_contradicted(motion(0.4, -0.4))
    assert "column 'brake' is -0.4 N m" in found.text
    assert "'brake' counts the other way" in found.text
    (found,) = load_contradicted(motion(0.4, 400.0))
    assert 'map it with unit = "mNm"' in found.text
    assert load_contradicted(motion(0.4, 0.2)) == []


def test_a_friction_is_no_wrong_load():
    """A small load beside much friction says nothing of its sign."""
    assert load_contradicted(motion(0.001, -0.001)) == []
