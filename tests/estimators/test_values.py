"""The watch of `monitor` by hand: which of its 24 hypotheses takes over, and when."""

import math
from types import SimpleNamespace

import numpy as np
import pytest

from estimators import monitor

# the ripple's variance is 1
TUNING = SimpleNamespace(period=8, current_variance=2.0, amplitude=1.0, power=2.0)
# 4 % of the saliency: 2, squared 4
BELIEF = SimpleNamespace(energy=SimpleNamespace(gamma_d=100.0, gamma_q=50.0))


def jumps(monkeypatch, distances, sweeps, seen=None):
    """Return the jump (degrees) at the end of each sweep; distances: of the 24 hypotheses, seen:
    those at first."""
    found = lambda state, a, b, c, d, e, belief, tuning: distances[round(e * 24 / math.tau) % 24]  # noqa: E731
    monkeypatch.setattr(monitor, "distance", found)
    state = np.zeros(monitor.FREE + monitor.OWN)
    state[monitor.WAITED], state[monitor.SEEN + 2] = 4 * TUNING.period, 1.0
    state[monitor.DISTANCE : monitor.DISTANCE + 24] = distances if seen is None else seen
    steps = [
        monitor.watch.py_func(state, 0.0, 0.0, 1.0, 0.0, BELIEF, TUNING) for _ in range(24 * sweeps)
    ]
    assert not any(s for k, s in enumerate(steps) if k % 24 != 23)  # a sweep has to be whole
    return [round(math.degrees(s)) for s in steps[23::24]]


def case(near, at, own=1000.0):
    """Return distances: `own` all over, `near` at one hypothesis."""
    return [near if k == at else own for k in range(24)]


@pytest.mark.parametrize(
    ("at", "jump"), [(1, 0), (3, 0), (4, 60), (12, 180), (20, 300), (21, 0), (23, 0)]
)
def test_hypotheses_within_45_degrees_are_the_loops_own(monkeypatch, at, jump):
    """15 degrees apart: the first that takes over is 60 degrees away; a nearer one explains the
    ripple, no doubt."""
    assert jumps(monkeypatch, case(1.0, at), 6)[-1] == jump
    both = case(1.0, 12)
    # beside a better one at 180 degrees: a near one says the loop follows
    both[at] = min(both[at], 2.0)
    assert jumps(monkeypatch, both, 6)[-1] == (0 if jump == 0 else 180)


def test_a_doubt_has_to_last_six_sweeps(monkeypatch):
    assert jumps(monkeypatch, case(1.0, 12), 6) == [0, 0, 0, 0, 0, 180]


@pytest.mark.parametrize(("near", "jump"), [(240.0, 180), (260.0, 0)])
def test_it_has_to_be_four_times_nearer(monkeypatch, near, jump):
    assert jumps(monkeypatch, case(near, 12), 6)[-1] == jump


@pytest.mark.parametrize(("own", "jump"), [(26.0, 180), (24.0, 0)])
def test_the_present_one_has_to_be_25_variances_away(monkeypatch, own, jump):
    assert jumps(monkeypatch, case(0.1, 12, own), 6)[-1] == jump


@pytest.mark.parametrize(("own", "jump"), [(4.1, 180), (3.9, 0)])
def test_and_four_percent_of_the_saliency(monkeypatch, own, jump):
    """Without noise: (0.04 (100 - 50))^2 = 4."""
    monkeypatch.setattr(monitor, "NOISE", 0.0)
    assert jumps(monkeypatch, case(0.01, 12, own), 6)[-1] == jump


def test_a_distance_keeps_seven_tenths_from_sweep_to_sweep(monkeypatch):
    """From 1000 towards 0: 700, 490, 343, 240 after the fourth, below a quarter; six more make it
    the ninth."""
    found = jumps(monkeypatch, case(0.0, 12), 9, seen=[1000.0] * 24)
    assert found == [0] * 8 + [180]


def test_no_number_of_the_watch_lies_on_another():
    """Sweep, doubts, waited, two times four sums, 24 distances: one after the other behind the
    other numbers."""
    m = monitor
    rows = [m.SWEEP, m.DOUBTS, m.WAITED, *range(m.SUM, m.SUM + 4), *range(m.SEEN, m.SEEN + 4)]
    assert [*rows, *range(m.DISTANCE, m.DISTANCE + m.HYPOTHESES)] == list(
        range(m.FREE, m.FREE + m.OWN)
    )


def test_it_waits_for_four_periods_of_the_injection(monkeypatch):
    """Then the window holds tracking alone: of 8 samples each, the first 32 are not summed."""
    monkeypatch.setattr(monitor, "distance", lambda *given: 1000.0)
    state = np.zeros(monitor.FREE + monitor.OWN)
    for _ in range(32):
        monitor.watch.py_func(state, 0.0, 0.0, 1.0, 0.0, BELIEF, TUNING)
        assert not state[monitor.SUM : monitor.SUM + 4].any()
    monitor.watch.py_func(state, 0.0, 0.0, 1.0, 0.0, BELIEF, TUNING)
    assert state[monitor.SUM + 2] == pytest.approx(1.0 / 24.0)
