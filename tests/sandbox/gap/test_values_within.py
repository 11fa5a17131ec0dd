"""Numbers of what a bench may run of the menu, by hand: shrunk into limits of current, speed and
voltage."""

import dataclasses
import math

import numpy as np
import pytest

from model.errors import PhysicsError
from model.parameters import Limits
from sandbox.gap.planning import within as limiting
from sandbox.gap.planning.within import Peaks, largest_current, within
from sandbox.recordings.campaign import NO_LIMITS
from tests.sandbox.gap.entries import drive_at, entry_of


def looked_at(monkeypatch, *peaks):
    """An experiment has these peaks (current; or current, speed, voltage) when looked at again and
    again."""
    found = iter([Peaks(*x) if isinstance(x, tuple) else Peaks(x, 0.0, 0.0) for x in peaks])
    monkeypatch.setattr(limiting, "_peaks", lambda entry, drive: next(found))


@pytest.mark.parametrize(
    ("peaks", "share"),
    [
        ([0.9], 1.0),
        ([1.2, 0.9], 1.0 / 1.2),  # inside; a fifth too much
        ([2.0, 1.1, 0.9], 0.45),  # half, and 0.99 / 1.1 of that
        # near, too far, not possible
        ([19.0, 0.9], 1.0 / 19.0),
        ([21.0, 0.9], 0.5),
        ([math.inf, 0.9], 0.5),
        # 0.0501 and 0.0492 of its currents
        ([19.0, 1.04, 0.9], 0.99 / 19.0 / 1.04),
        ([19.0, 1.06, 0.9], None),
        # looked at twelve times
        ([1.01] * 11 + [0.9], (0.99 / 1.01) ** 10 / 1.01),
        ([1.01] * 12 + [0.9], None),
    ],
)
def test_currents_shrink_into_a_limit_by_hand(monkeypatch, peaks, share):
    """Of 1 A: the first proportion, then 0.99 of it; what the link and the speed are is not
    touched."""
    looked_at(monkeypatch, *peaks)
    found = within(entry_of(i_d=2.0, i_q=-3.0, speed=50.0), drive_at(), Limits(current=1.0))
    if share is None:
        assert found is None
        return
    assert (found.i_d[0], found.i_q[0]) == pytest.approx((2.0 * share, -3.0 * share))
    assert (found.speed[0], found.link) == (50.0, 1.0)


@pytest.mark.parametrize(("volts", "turning"), [(90.0, 1.0), (110.0, 0.5)])
def test_an_imposed_speed_is_shrunk_where_the_voltage_does_not_suffice(monkeypatch, volts, turning):
    """Twice the current a bench may have; 0.95 of 100 V is what it may use."""
    looked_at(monkeypatch, (2.0, 0.0, volts), (0.9, 0.0, 0.0))
    drive = drive_at()
    found = within(
        entry_of(i_q=1.0, speed=50.0),
        drive,
        Limits(current=1.0, voltage=drive.converter.dc_bus_voltage),
    )
    assert (found.i_q[0], found.speed[0]) == pytest.approx((0.5, 50.0 * turning))


@pytest.mark.parametrize(("limit", "link"), [(0.5, 0.4), (1.5, 0.8)])
def test_the_link_is_that_of_the_bench(monkeypatch, limit, link):
    looked_at(monkeypatch, 0.0)
    drive = drive_at()
    found = within(
        entry_of(i_q=1.0, link=0.8), drive, Limits(voltage=limit * drive.converter.dc_bus_voltage)
    )
    assert found.link == pytest.approx(link)


@pytest.mark.parametrize(("speed", "left"), [(-200.0, -100.0), (80.0, 80.0)])
def test_a_speed_is_that_of_the_bench(monkeypatch, speed, left):
    """1500 / pi rpm of two pole pairs are 100 rad/s electrical."""
    looked_at(monkeypatch, 0.0)
    entry = entry_of(speed=np.append(np.zeros(199), speed))
    found = within(entry, drive_at(), Limits(speed_rpm=1500.0 / math.pi))
    assert found.speed[-1] == pytest.approx(left)


def test_a_room_by_hand():
    """A free rotor reaches 1.2 of 80 pi rad/s; 0.95 of half of 100 V with half the link."""
    drive = drive_at()
    free, driven = entry_of("free", link=0.5), entry_of(link=0.5)
    held = Limits(current=3.0, speed_rpm=1500.0 / math.pi, voltage=drive.converter.dc_bus_voltage)
    assert dataclasses.astuple(limiting._room(free, drive, NO_LIMITS)) == pytest.approx(
        (math.inf, 96.0 * math.pi, math.inf)
    )
    assert dataclasses.astuple(limiting._room(driven, drive, NO_LIMITS)) == (math.inf,) * 3
    for entry in (free, driven):
        assert dataclasses.astuple(limiting._room(entry, drive, held)) == pytest.approx(
            (3.0, 100.0, 47.5)
        )


@pytest.mark.parametrize("worst", [0, 1, 2])
def test_the_worst_of_three_counts(worst):
    peaks = [x * (3.0 if k == worst else 1.0) for k, x in enumerate((1.0, 10.0, 100.0))]
    assert Peaks(*peaks).over(Peaks(2.0, 20.0, 200.0)) == pytest.approx(1.5)


def test_peaks_are_looked_for_every_millisecond(monkeypatch):
    """At 4 kHz every fourth sample: a speed at the second one is not seen, one at the fifth is, and
    what the motor needs for it: 100 rad/s times 0.16 Wb; below 1 kHz every one.  A motor
    that cannot have such currents is far beyond every limit."""
    drive = drive_at(0.25e-3)
    monkeypatch.setattr(limiting, "complete", lambda *_: {})
    monkeypatch.setattr(limiting, "shaft", lambda values, slow: slow.converter.sampling_period)
    for at, period, seen in (
        (1, 0.25e-3, 0.0),
        (2, 0.25e-3, 0.0),
        (4, 0.25e-3, 100.0),
        (1, 2e-3, 100.0),
    ):
        speed = np.zeros(9)
        speed[at] = -100.0
        found = limiting._peaks(entry_of(speed=speed, n=9), drive_at(period))
        assert dataclasses.astuple(found) == pytest.approx((0.0, seen, 0.16 * seen))
    periods = []
    monkeypatch.setattr(
        limiting,
        "demand",
        lambda thin, slow, motion: (
            periods.append((slow.converter.sampling_period, motion)) or 1 / 0
        ),
    )
    with pytest.raises(ZeroDivisionError):
        limiting._peaks(entry_of(n=9), drive)
    assert periods == [(pytest.approx(1e-3), pytest.approx(1e-3))]

    def impossible(*_):
        raise PhysicsError("no such currents")

    monkeypatch.setattr(limiting, "demand", impossible)
    assert dataclasses.astuple(limiting._peaks(entry_of(n=9), drive)) == (math.inf,) * 3


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
