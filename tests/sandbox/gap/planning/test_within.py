"""Numbers of what a bench may run of the menu, by hand: shrunk into limits of current, speed and
voltage."""

import dataclasses
import math

import numpy as np
import pytest

from model.parameters import Limits
from sandbox.gap.planning import within as limiting
from sandbox.gap.planning.within import Peaks, largest_current, within
from sandbox.recordings.campaign import NO_LIMITS
from tests.sandbox.gap.entries import drive_at, entry_of


@pytest.mark.parametrize(("limit", "link"), [(0.5, 0.4), (1.5, 0.8)])
def test_the_link_is_that_of_the_bench(limit, link):
    drive = drive_at()
    found = within(
        entry_of(i_q=0.1, link=0.8), drive, Limits(voltage=limit * drive.converter.dc_bus_voltage)
    )
    assert found.link == pytest.approx(link)


@pytest.mark.parametrize(("speed", "left"), [(-200.0, -100.0), (80.0, 80.0)])
def test_a_speed_is_that_of_the_bench(speed, left):
    """1500 / pi rpm of two pole pairs are 100 rad/s electrical."""
    entry = entry_of(speed=np.append(np.zeros(199), speed))
    found = within(entry, drive_at(), Limits(speed_rpm=1500.0 / math.pi))
    assert found.speed[-1] == pytest.approx(left)


def test_a_room_by_hand():
    """A free rotor reaches 1.2 of 80 pi rad/s; 0.95 of half of 100 V with half the link."""
    drive = drive_at()
    free, driven = entry_of("free", link=0.5), entry_of(link=0.5)
    held = Limits(current=3.0, speed_rpm=1500.0 / math.pi, voltage=drive.converter.dc_bus_voltage)
    assert dataclasses.astuple(limiting.room_for(free, drive, NO_LIMITS)) == pytest.approx(
        (math.inf, 96.0 * math.pi, math.inf)
    )
    assert dataclasses.astuple(limiting.room_for(driven, drive, NO_LIMITS)) == (math.inf,) * 3
    for entry in (free, driven):
        assert dataclasses.astuple(limiting.room_for(entry, drive, held)) == pytest.approx(
            (3.0, 100.0, 47.5)
        )


@pytest.mark.parametrize("worst", [0, 1, 2])
def test_the_worst_of_three_counts(worst):
    peaks = [x * (3.0 if k == worst else 1.0) for k, x in enumerate((1.0, 10.0, 100.0))]
    assert Peaks(*peaks).over(Peaks(2.0, 20.0, 200.0)) == pytest.approx(1.5)


@pytest.mark.parametrize(
    ("currents", "injection", "expected"),
    [
        ((0.5, 0.0), (4.0, 0.0), 0.7),
        ((-0.5, 0.0), (4.0, 0.0), 0.7),
        ((0.0, 0.5), (0.0, 4.0), 0.6),
        ((0.0, -0.5), (0.0, 4.0), 0.6),
        ((0.3, 0.4), (0.0, 0.0), 0.5),
        ((0.3, 0.4), (4.0, 8.0), math.hypot(0.5, 0.6)),
    ],
)
def test_an_injections_ripple_by_hand(currents, injection, expected):
    """4 V over half a wave, four samples of 1/1600 s, are 0.01 Wb: 0.2 A in 0.05 H and 0.1 A in 0.1
    H, either way."""
    entry = entry_of("locked", *(np.array([0.0, x]) for x in currents), n=2, injection=injection)
    assert largest_current(entry, drive_at()) == pytest.approx(expected)
