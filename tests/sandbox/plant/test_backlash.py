"""A shaft's swing across a gap: against SciPy piece by piece, its energy, its order in the step,
and as the swing without a gap where there is none."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from sandbox.plant import additions as add
from sandbox.plant.backlash import swing_across
from sandbox.plant.batch import blank
from sandbox.plant.mechanics import swing


def integrated(x, v, push, half, rate, ratio, h):
    """Return twist and slip h (s) on by SciPy, stopped at every edge that is crossed."""
    t, y = 0.0, np.array([x, v])
    while t < h:
        side = math.copysign(1.0, y[0])
        deep, away = side * y[0] - half, (side * y[1], side * push)
        inside = deep < 0.0 or (deep == 0.0 and away < (0.0, 0.0))

        def slopes(_, y, edge=side * half, spring=0.0 if inside else 1.0):
            back = rate * rate * (y[0] - edge) + 2.0 * ratio * rate * y[1]
            return [y[1], push - spring * back]

        def upper(_, y):
            return y[0] - half

        def lower(_, y):
            return y[0] + half

        upper.terminal = lower.terminal = True
        upper.direction, lower.direction = (1.0, -1.0) if inside else (-1.0, 1.0)
        events = [upper, lower] if inside else [upper if side > 0.0 else lower]
        found = solve_ivp(
            slopes,
            (t, h),
            y,
            events=events,
            method="DOP853",
            rtol=1e-11,
            atol=1e-14,
            max_step=0.01,  # a stay beyond an edge between two of its steps is not seen
        )
        t, y = found.t[-1], found.y[:, -1].copy()
        if found.status == 1:
            y[0] = math.copysign(half, y[0])
    return y


def test_a_step_is_that_of_an_independent_integrator():
    """States and steps of any size against SciPy with events, whose tolerance of 1e-11 a step adds
    up to some 1e-10 (seen: 2e-11); up to a whole half swing in one step, which no drive exceeds."""
    rng = np.random.default_rng(0)
    for _ in range(120):
        half, size = 10.0 ** rng.uniform(-2.0, 1.0), 10.0 ** rng.uniform(-2.0, 1.0, 2)
        x, h = half * rng.uniform(-2.0, 2.0), rng.uniform(0.01, 3.1)
        v, push = rng.normal(size=2) * size * [1.0, rng.random() > 0.2]
        case = x, v, push, half, 1.0, rng.choice([0.0, 0.01, 0.3, 0.9]), h
        scale = abs(x) + abs(v) + abs(push) * h
        assert swing_across(*case) == pytest.approx(integrated(*case), abs=1e-9 * scale), case


def test_energy_is_kept_without_damping():
    """v^2/2 + (rate times the twist beyond the gap)^2/2 - push x of 20000 steps that cross an edge
    about every fifth: each step is exact, so rounding (1e-16 of the energy a step) and the
    crossings' instants (1e-13 of a step) are all that is lost."""
    half, rate, h, push = 0.3, 2.0, 0.37, 0.05
    x, v = 0.0, 1.0

    def energy():
        beyond = max(abs(x) - half, 0.0)
        return 0.5 * v * v + 0.5 * (rate * beyond) ** 2 - push * x

    begun, crossings = energy(), 0
    for _ in range(20000):
        before = abs(x) > half
        x, v = swing_across(x, v, push, half, rate, 0.0, h)
        crossings += before != (abs(x) > half)
    assert crossings > 4000
    assert energy() == pytest.approx(begun, rel=20000 * 1e-14)


def test_the_error_falls_with_the_square_of_the_step():
    """A torque that changes is taken as constant over a step, its middle one: second order, and
    crossings do not spoil it: a quarter of the step leaves a sixteenth.  The mean of several
    lengths, as a single one's error changes sign."""

    def twisted(steps, end):
        x, v, h = 0.0, 0.0, end / steps
        for k in range(steps):
            x, v = swing_across(x, v, math.sin(1.3 * (k + 0.5) * h), 0.2, 1.0, 0.02, h)
        return x

    errors = []
    for end in np.linspace(15.0, 20.0, 11):
        fine = twisted(64000, end)
        errors.append([abs(twisted(n, end) - fine) for n in (250, 1000)])
    coarse, finer = np.mean(errors, axis=0)
    assert coarse / finer == pytest.approx(16.0, rel=0.15)


def test_a_shaft_without_backlash_beside_one_with_it_swings_to_the_same_bit():
    """Of two lanes one has a gap: the other is that of a batch that knows of none; a rigid shaft
    has no gap."""
    rows = {"swing_ratio": 0.1, "motor_inv": 1e3, "load_inv": 2e3, "net": 0.3, "taken": -0.1}
    found = []
    for features in (0, add.BACKLASH):
        w = blank(3)
        for row, value in rows.items():
            w[row][:] = value
        w["swing_rate"][:2] = 500.0
        w["backlash"][:] = (1e-4, 0.0, 1e-4) if features else 0.0
        for _ in range(50):
            swing(w, features, 1e-4)
        found.append((w["twist"].copy(), w["slip"].copy()))
    assert np.array_equal(found[0][0][1:], found[1][0][1:])
    assert np.array_equal(found[0][1][1:], found[1][1][1:])
    assert found[0][0][0] != found[1][0][0]
    assert (found[1][0][2], found[1][1][2]) == (0.0, 0.0)


def test_a_shaft_at_rest_stands_beyond_the_gap_by_the_torque_it_carries():
    """rate^2 (x - half) = push, on either side; without torque it may stand anywhere inside."""
    half, rate, push = 0.01, 300.0, 50.0
    for side in (1.0, -1.0):
        x = v = 0.0
        for _ in range(4000):
            x, v = swing_across(x, v, side * push, half, rate, 0.2, 1e-3)
        assert x == pytest.approx(side * (half + push / rate**2), rel=1e-12)
    assert swing_across(0.004, 0.0, 0.0, half, rate, 0.2, 1e-3) == (0.004, 0.0)
