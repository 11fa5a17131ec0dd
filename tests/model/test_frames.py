"""Frame changes: amplitude-invariant, inverse to each other, wrapped angles in range."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from model.frames import multiple, phases, rotate, stationary, wrap, wrapped

NUMBERS = st.floats(-1e3, 1e3)


@given(NUMBERS, NUMBERS)
def test_phases_and_back(alpha, beta):
    a, b, c = phases(alpha, beta)
    assert a + b + c == pytest.approx(0.0, abs=1e-12 * (1 + abs(alpha) + abs(beta)))
    assert stationary(a, b, c) == (
        pytest.approx(alpha, abs=1e-12 * 1e3),
        pytest.approx(beta, abs=1e-12 * 1e3),
    )
    assert stationary(a + 5.0, b + 5.0, c + 5.0)[0] == pytest.approx(alpha, abs=1e-11 * 1e3)


def test_amplitude_invariant():
    angle = np.linspace(0, 2 * np.pi, 7)
    for t in angle:
        a, b, _ = phases(math.cos(t), math.sin(t))
        assert a == pytest.approx(math.cos(t), abs=1e-15)
        assert b == pytest.approx(math.cos(t - 2 * math.pi / 3), abs=1e-15)


@given(NUMBERS, NUMBERS, st.floats(-10, 10))
def test_rotation_keeps_length_and_inverts(x, y, angle):
    u, v = rotate(x, y, angle)
    assert math.hypot(u, v) == pytest.approx(math.hypot(x, y), rel=1e-12, abs=1e-12)
    assert rotate(u, v, -angle) == (pytest.approx(x, abs=1e-10), pytest.approx(y, abs=1e-10))


@given(st.floats(-1e4, 1e4))
def test_wrap(angle):
    assert -math.pi - 1e-11 <= wrap(angle) <= math.pi
    assert math.cos(wrap(angle)) == pytest.approx(math.cos(angle), abs=1e-10)
    assert wrapped(angle) == pytest.approx(wrap(angle), abs=1e-11)


@pytest.mark.parametrize("order", [-60, -7, -1, 0, 1, 2, 6, 12, 31, 60])
def test_multiples_of_an_angle(order):
    """Against the library's sine and cosine; six doublings of rounding errors of 1e-16 make
    1e-14."""
    for angle in np.linspace(-3.0, 3.0, 13):
        c, s = multiple(math.cos(angle), math.sin(angle), float(order))
        assert (c, s) == pytest.approx(
            (math.cos(order * angle), math.sin(order * angle)), abs=2e-14
        )
