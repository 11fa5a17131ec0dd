"""The link's resonance on the switched bench: the linear circuit's exponential, its rest, and what
it draws."""

import dataclasses
import math

import numpy as np
import pytest
from scipy.linalg import expm

from sandbox.switched.advance import MODES, start
from sandbox.switched.bench_numbers import bench, quiet
from sandbox.switched.bench_state import Slot
from sandbox.switched.inverter import integrate
from sandbox.switched.unlisted import unlisted
from tests.sandbox.plant.closed_forms import settled
from tests.sandbox.plant.effect_motors import CONVERTER, NO_MAGNET, L, R, U

PLAIN = quiet(bench(NO_MAGNET, CONVERTER))
RATE, Z, D = 2.0 * math.pi * 900.0, 12.0, 0.08


def rung(b, t, step=None):
    """Return dip, feed and i_alpha after t (s) with leg a on alone, from 2 A."""
    b = b if step is None else b._replace(step=step)
    state = start(b, i_alpha=2.0)
    integrate(state, b, MODES["locked"], complex(2.0 / 3.0), 0.0, t, 0.0, 0.0)
    return np.array([state[Slot.LINK_DIP], state[Slot.LINK_FEED], state[Slot.I_ALPHA]])


def test_a_step_of_the_draw_rings_as_the_circuit_does():
    """x' = w (Z i - y), y' = w (x - 2 D y), i' = (2/3 (U - x) - R i)/L: the matrix exponential;
    error by h^4."""
    b = unlisted(PLAIN, {"link_rate": RATE, "link_impedance": Z, "link_damping": D})
    a = np.array(
        [
            [0.0, -RATE, RATE * Z, 0.0],
            [RATE, -2.0 * D * RATE, 0.0, 0.0],
            [-2.0 / (3.0 * L), 0.0, -R / L, 2.0 / (3.0 * L) * U],
            [0.0, 0.0, 0.0, 0.0],
        ]
    )
    t = 1.3e-3
    expected = (expm(a * t) @ [0.0, 0.0, 2.0, 1.0])[:3]
    assert np.abs(expected[0]) > 5.0
    # a step of 0.2 rad of the resonance: 0.2^5 / 120 each, 7.4 rad / 0.2 of them, of a swing of
    # some 60 V: 6e-3
    assert rung(b, t) == pytest.approx(expected, abs=6e-3)
    errors = [np.abs(rung(b, t, step) - expected).max() for step in (3e-5, 1.5e-5)]
    assert math.log2(errors[0] / errors[1]) == pytest.approx(4.0, abs=0.3)


def test_at_a_slow_resonance_the_link_sags_as_behind_a_resistance():
    """A link whose capacitor holds its voltage over a period stays 2 D Z i_dc low, what
    `dc_link_error.sag` says."""
    u, ohm = 60.0, 25.0
    slow = unlisted(PLAIN, {"link_rate": 300.0, "link_impedance": 12.5, "link_damping": 1.0})
    sag = quiet(bench(NO_MAGNET, CONVERTER, {"dc_link_error.sag": ohm}))
    plain, found, expected = (settled(b, u + 0j).real for b in (PLAIN, slow, sag))
    # they differ by the capacitor's ripple, i_dc T_s / 8 / C = 1 A x 250 us / 8 x w Z = 0.1 V of
    # the sag's 20 V
    assert found - plain == pytest.approx(expected - plain, rel=1e-2)
    assert plain - found > 0.02 * plain


def test_without_inductance_current_the_link_rings_at_its_own_rate():
    """No draw (R huge): x'' + 2 D w x' + w^2 x = 0 from the feed's y: x(t) = -y_0/sqrt(1-D^2)
    exp(-D w t) sin(...)."""
    idle = quiet(
        bench(dataclasses.replace(NO_MAGNET, inductance_d=9.0, inductance_q=9.0), CONVERTER)
    )
    b = unlisted(idle, {"link_rate": RATE, "link_impedance": Z, "link_damping": D})._replace(
        step=2e-6
    )
    state = start(b)
    state[Slot.LINK_FEED] = 30.0
    t, damped = 1.1e-3, RATE * math.sqrt(1.0 - D * D)
    integrate(state, b, MODES["locked"], 0j, 0.0, t, 0.0, 0.0)
    expected = -30.0 / math.sqrt(1.0 - D * D) * math.exp(-D * RATE * t) * math.sin(damped * t)
    assert state[Slot.LINK_DIP] == pytest.approx(expected, abs=1e-6)


def test_off_it_is_the_bench_of_old_by_the_bit():
    idle = unlisted(PLAIN, {"link_damping": 0.1})
    assert settled(idle, 24 + 5j) == settled(PLAIN, 24 + 5j)
