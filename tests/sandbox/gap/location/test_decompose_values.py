"""Numbers of where a gap lies and of how large it is, by hand: bounds of regions, turns, lines,
draws."""

import math
from types import SimpleNamespace

import numpy as np
import pytest

from sandbox.gap.location import decompose
from sandbox.gap.location.decompose import BINS, CURRENT_NAMES, FEWEST, PER_TURN, SPEED_NAMES
from sandbox.replay.replay import Residual
from tests.sandbox.gap.sizes import size_at


@pytest.mark.parametrize(
    ("bounds", "names"), [(decompose.SPEEDS, SPEED_NAMES), (decompose.CURRENTS, CURRENT_NAMES)]
)
def test_regions_by_hand(bounds, names):
    """One sample on either side of each bound, an excess of 1 each: shares 1, 2, 2 and 1 of 6."""
    parts = {"a": {"motion": np.full(6, 2.0)}}
    at = np.array([share * bound for bound in bounds for share in (0.99, 1.01)])
    found = decompose.bins_of(parts, [at], bounds, names, 6.0)
    assert found == pytest.approx(dict(zip(names, (1 / 6, 1 / 3, 1 / 3, 1 / 6), strict=True)))


def turned(per_turn, turns, order):
    """Return a turning recording, and a space vector of amplitude 1 with an order of the rotor's
    frame."""
    angle = (np.arange(round(per_turn * turns)) + 0.5) * math.tau / per_turn
    r = SimpleNamespace(rotor="driven", motion=SimpleNamespace(angle=angle), pole_pairs=1)
    return r, np.exp(1j * order * angle)


@pytest.mark.parametrize(("per_turn", "seen"), [(PER_TURN - 1, False), (PER_TURN + 1, True)])
def test_a_turn_needs_twice_as_many_samples_as_orders(per_turn, seen):
    r, z = turned(per_turn, 4.5, 2)
    assert (decompose.electrical_orders([r], [z], 1.0)[2] > 0.0) == seen


def test_electrical_orders_by_hand():
    """An amplitude of 3 at order 2, two stretches of two turns with m samples each: 1.5 x 9 m - 2 a
    stretch, noise's own variance taken off; orders from -13 to 13 and of slots."""
    r, z = turned(100, 4.5, 2)
    found = decompose.electrical_orders([r], [3.0 * z], 1.0)
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
    found = decompose.mechanical_orders([r], [x], 1.0)
    assert list(found) == list(range(1, 49))
    assert found[5] == pytest.approx(2 * 2.0 * (9.0 * 200 / 4.0 - 1.0))
    assert max(v for n, v in found.items() if n != 5) == 0.0
    few, _ = turned(90, 2.5, 0)
    assert not any(decompose.mechanical_orders([few], [x], 1.0).values())


@pytest.mark.parametrize("count", [FEWEST - 1, FEWEST])
def test_an_amplitude_needs_enough_blocks(count):
    none = np.zeros(count)
    found = decompose.amplitudes(np.full(count, 3.0), none, none, np.ones(count))[0, 1]
    assert found == pytest.approx(3.0 if count == FEWEST else math.nan, nan_ok=True)
    beside = decompose.amplitudes(np.full(count, 5.0), np.full(count, 3.0), none, np.ones(count))[
        0, 1
    ]
    # noise's squares taken off
    assert beside == pytest.approx(4.0 if count == FEWEST else math.nan, nan_ok=True)


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
    found = decompose.clearest_line([z], 1e-4, (k - beside) * rate, 1.0)
    assert found is None or found[0] == pytest.approx(k * rate)
    assert (found is not None) == told


def test_an_interval_needs_a_gap_in_nineteen_of_twenty_draws():
    """1.58 deviations above the floor a normal mean falls below in 5.7 % of draws."""
    assert size_at(1.58).closed_ci95 is None
