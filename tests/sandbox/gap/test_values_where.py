"""Numbers of where a gap lies and of how large it is, by hand: bounds of regions, turns, lines,
draws."""

import math
from types import SimpleNamespace

import numpy as np
import pytest

from sandbox.gap.evidence import spectrum
from sandbox.gap.location import decompose, outside
from sandbox.gap.location.decompose import BINS, CURRENT_NAMES, SPEED_NAMES
from sandbox.replay.inputs import LEGS
from sandbox.replay.replay import Residual
from tests.sandbox.gap.sizes import size_at


@pytest.mark.parametrize(
    ("bounds", "names", "at"),
    [
        (decompose.SPEEDS, SPEED_NAMES, (0.019, 0.021, 0.29, 0.31, 0.64, 0.66)),
        (decompose.CURRENTS, CURRENT_NAMES, (0.14, 0.16, 0.49, 0.51, 0.84, 0.86)),
    ],
)
def test_regions_by_hand(bounds, names, at):
    """One sample on either side of each bound, an excess of 1 each: shares 1, 2, 2 and 1 of 6."""
    parts = {"a": {"motion": np.full(6, 2.0)}}
    found = decompose._bins(None, parts, [np.array(at)], bounds, names, 6.0)
    assert found == pytest.approx(dict(zip(names, (1 / 6, 1 / 3, 1 / 3, 1 / 6), strict=True)))


@pytest.mark.parametrize(("size", "along"), [(0.019, 0.0), (0.021, 1.0)])
def test_a_current_below_two_hundredths_has_no_direction(monkeypatch, size, along):
    n = 17
    read = np.column_stack([np.full(n, size), np.zeros(n)]) @ LEGS.T  # along alpha, rated current 1
    r = SimpleNamespace(
        read=read, samples=n, motion=SimpleNamespace(angle=np.zeros(n), speed=np.zeros(n))
    )
    r.mean_duty = lambda: np.ones((n, 2))
    drive = SimpleNamespace(motor=SimpleNamespace(rated_current=1.0))
    prepared = SimpleNamespace(recordings=[r], campaign=SimpleNamespace(drive=drive))
    monkeypatch.setattr(
        decompose, "voltage_residual", lambda *_: np.column_stack([np.ones(n - 1), np.zeros(n - 1)])
    )
    point, shown = (
        SimpleNamespace(prepared=prepared, values={}),
        SimpleNamespace(current=np.zeros((n, 3, 1))),
    )
    found = decompose._projected(point, 0, shown, np.random.default_rng(0))[0]
    assert found[:, 0] == pytest.approx(np.full(2, along))  # the voltage points along alpha, too


def test_directions_are_shares_of_the_recordings_that_miss_voltage(monkeypatch):
    """Two recordings, half the weight each, of which one misses none: the other's 4 : 1 along and
    across stays."""
    missing = np.zeros((1, len(decompose.DIRECTIONS)))
    missing[0, :2] = 2.0, 1.0
    blocks = [
        (missing, 0.0 * missing, np.zeros(1), np.zeros(1)),
        (0.0 * missing, 0.0 * missing, np.zeros(1), np.zeros(1)),
    ]
    monkeypatch.setattr(decompose, "_projected", lambda point, k, x, rng: blocks[k])
    recordings = [SimpleNamespace(file="a"), SimpleNamespace(file="b")]
    point = SimpleNamespace(prepared=SimpleNamespace(recordings=recordings))
    shares = decompose._directions(point, [None, None], {"a": 0.5, "b": 0.5})[0]
    assert list(shares.values())[:2] == pytest.approx([0.8, 0.2])


def turned(per_turn, turns, order):
    """Return a turning recording, and a space vector of amplitude 1 with an order of the rotor's
    frame."""
    angle = (np.arange(round(per_turn * turns)) + 0.5) * math.tau / per_turn
    r = SimpleNamespace(rotor="driven", motion=SimpleNamespace(angle=angle), pole_pairs=1)
    return r, np.exp(1j * order * angle)


@pytest.mark.parametrize(("per_turn", "seen"), [(27, False), (29, True)])
def test_a_turn_needs_twice_as_many_samples_as_orders(per_turn, seen):
    """13 orders either way and one more: 28 samples a turn."""
    r, z = turned(per_turn, 4.5, 2)
    assert (decompose._orders([r], [z], 1.0)[2] > 0.0) == seen


def test_electrical_orders_by_hand():
    """An amplitude of 3 at order 2, two stretches of two turns with m samples each: 1.5 x 9 m - 2 a
    stretch, noise's own variance taken off; orders from -13 to 13 and of slots."""
    r, z = turned(100, 4.5, 2)
    found = decompose._orders([r], [3.0 * z], 1.0)
    assert found[2] == pytest.approx(2 * (1.5 * 9.0 * 200 - 2.0))
    assert max(v for n, v in found.items() if n != 2) == 0.0
    assert sorted(found) == [-36, -30, -24, -18, *range(-13, 14), 18, 24, 30, 36]


def test_mechanical_orders_by_hand():
    """A cos(5 theta), two turns of n samples each: 2 ((A n/2)^2/n - 1) a turn, nothing at the 47
    other orders; a turn needs 96 samples."""
    r, _ = turned(200, 2.5, 0)
    x = Residual(
        "a",
        "free",
        np.zeros((len(r.motion.angle), 3, 1)),
        3.0 * np.cos(5 * r.motion.angle)[:, None],
        None,
    )
    found = decompose._mechanical([r], [x], 1.0)
    assert list(found) == list(range(1, 49))
    assert found[5] == pytest.approx(2 * 2.0 * (9.0 * 200 / 4.0 - 1.0))
    assert max(v for n, v in found.items() if n != 5) == 0.0
    few, _ = turned(90, 2.5, 0)
    assert not any(decompose._mechanical([few], [x], 1.0).values())


@pytest.mark.parametrize("count", [29, 30])
def test_an_amplitude_needs_thirty_blocks(count):
    none = np.zeros(count)
    found = decompose._amplitudes(np.full(count, 3.0), none, none, np.ones(count))[0, 1]
    assert found == pytest.approx(3.0 if count == 30 else math.nan, nan_ok=True)
    beside = decompose._amplitudes(np.full(count, 5.0), np.full(count, 3.0), none, np.ones(count))[
        0, 1
    ]
    # noise's squares taken off
    assert beside == pytest.approx(4.0 if count == 30 else math.nan, nan_ok=True)


@pytest.mark.parametrize(("times", "told"), [(25.0, False), (40.0, True)])
def test_a_line_stands_thirty_times_above_its_neighbourhood(times, told):
    """A pulse in the window's middle has a flat spectrum, 1 at each frequency of either sign; a
    turning vector in phase with it stands on one bin: ((1 + w)^2 + 1) / 2 times the neighbourhood,
    w its amplitude times
    the window's sum."""
    window, k, n = np.hanning(BINS), 300, np.arange(BINS)
    amplitude = (math.sqrt(2.0 * times - 1.0) - 1.0) / np.sum(window)
    middle = BINS // 2
    z = amplitude * np.exp(2j * np.pi * k * (n - middle) / BINS)
    z[middle] += 1.0 / window[middle]
    drive = SimpleNamespace(
        converter=SimpleNamespace(sampling_period=1e-4), injection=SimpleNamespace(frequency=1000.0)
    )
    prepared = SimpleNamespace(
        recordings=[SimpleNamespace(rotor="locked")], campaign=SimpleNamespace(drive=drive)
    )
    found = decompose._line(SimpleNamespace(prepared=prepared), [z], 1.0)
    assert (found is not None) == told
    if told:
        assert found[0] == pytest.approx(k / (BINS * 1e-4))


@pytest.mark.parametrize(
    ("k", "beside", "told"),
    [(300, 2.5, False), (300, 4.5, True), (6, -100.5, False), (10, -100.5, True)],
)
def test_a_line_stands_apart_from_an_injections_harmonics_and_from_slow_changes(k, beside, told):
    """A vector on bin k in the noise of readings; of a voltage injected so many bins below, what is
    within four bins of a harmonic is its own; what is slower than eight bins is a change of the
    state."""
    n, rng = np.arange(8 * BINS), np.random.default_rng(1)
    z = 0.5 * np.exp(2j * np.pi * k * n / BINS) + 0.1 * (
        rng.standard_normal(n.size) + 1j * rng.standard_normal(n.size)
    )
    rate = 1.0 / (BINS * 1e-4)
    injection = SimpleNamespace(frequency=(k - beside) * rate)
    drive = SimpleNamespace(converter=SimpleNamespace(sampling_period=1e-4), injection=injection)
    prepared = SimpleNamespace(
        recordings=[SimpleNamespace(rotor="locked")], campaign=SimpleNamespace(drive=drive)
    )
    found = decompose._line(SimpleNamespace(prepared=prepared), [z], 1.0)
    assert found is None or found[0] == pytest.approx(k * rate)
    assert (found is not None) == told


def test_an_interval_needs_a_gap_in_nineteen_of_twenty_draws():
    """1.58 deviations above the floor a normal mean falls below in 5.7 % of draws."""
    assert size_at(1.58).closed_ci95 is None


def test_three_values_are_looked_at(monkeypatch):
    """Of five orders that would gain 1 to 25, the three that gain most, the best first."""
    g = np.repeat([1.0, 3.0, 5.0, 2.0, 4.0], 2) / math.sqrt(2.0)
    found = SimpleNamespace(summed=lambda: (np.eye(10), g, 0.0))
    monkeypatch.setattr(spectrum, "normal", lambda point, coordinates: found)
    monkeypatch.setattr(spectrum, "replace", lambda prepared, **_: prepared)
    prepared = SimpleNamespace(recordings=[SimpleNamespace(rotor="free")], samples=1)
    pair = ("cogging_torque.a", "cogging_torque.b")
    point = SimpleNamespace(prepared=prepared, values={})
    assert spectrum.best_values(point, pair, "cogging_torque.order_mech", [1, 2, 3, 4, 5]) == [
        3.0,
        5.0,
        2.0,
    ]


@pytest.mark.parametrize(("chance", "asked"), [(0.04, 0), (0.06, 1)])
def test_no_regression_where_nothing_outside_is_likely(monkeypatch, chance, asked):
    """A chance below 0.05 has no weight that a page shows."""
    calls = []
    monkeypatch.setattr(outside, "explained", lambda point: calls.append(1) or (0.0, 0.0))
    monkeypatch.setattr(outside, "residuals", lambda *_: [])
    monkeypatch.setattr(outside, "replay", lambda *_: None)
    monkeypatch.setattr(
        outside, "excesses", lambda shown: dict.fromkeys(("current", "sum", "motion", "angle"), 0.0)
    )
    outside.outside(SimpleNamespace(turned=lambda: None, values={}), {}, chance)
    assert len(calls) == asked


def test_where_nothing_was_asked_neither_side_predicts(monkeypatch):
    """Of currents that no regression was made of the machine has six tenths, and of what effects
    could take up four."""
    monkeypatch.setattr(outside, "residuals", lambda *_: [])
    monkeypatch.setattr(outside, "replay", lambda *_: None)
    own = {"current": 10.0, "sum": 0.0, "motion": 0.0, "angle": 0.0}
    monkeypatch.setattr(outside, "excesses", lambda shown: own)
    spans = {"machine": 0.0, "inverter": 1.0, "sensor": 0.0, "mechanics": 0.0}
    point = SimpleNamespace(turned=lambda: None, values={})
    expected = {"machine": 0.6, "inverter": 0.4, "sensor": 0.0, "mechanics": 0.0}
    assert outside.outside(point, spans, 0.04) == pytest.approx(expected)
    monkeypatch.setattr(outside, "explained", lambda point: (0.0, 1.0))
    assert outside.outside(point, spans)["machine"] > 0.99
