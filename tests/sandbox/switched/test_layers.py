"""Layers of conductors on the switched bench: modes against the formula, a ladder, and energy."""

import cmath
import math

import numpy as np
import pytest
from scipy.linalg import expm

from model.drive_files import load_drive
from sandbox.switched.advance import MODES, advance, start
from sandbox.switched.bench_numbers import bench, quiet
from sandbox.switched.bench_state import Slot
from sandbox.switched.inverter import integrate
from sandbox.switched.layers import modes
from tests.sandbox.plant.effect_motors import CONVERTER, NO_MAGNET, L, R, U
from tests.sandbox.switched.all_effects import ALL_ON, commands, unaccounted

LAYERED = {
    "skin_effect.resistance": 3.0,
    "skin_effect.layers": 2.0,
    "skin_effect.time_constant": 1e-4,
}


def off(m, xi):
    """Return by how much the modes' resistance misses the formula's, a share; of conductors xi skin
    depths high."""
    x, own = xi * (1.0 + 1.0j), modes(1.0, m, 1.0)
    z = x / cmath.tanh(x) + 2.0 / 3.0 * (m * m - 1.0) * x * cmath.tanh(0.5 * x)
    s = 2j * xi * xi / math.pi**2
    found = 1.0 + sum(r * s * t / (1.0 + s * t) for r, t in zip(own.ohms, own.times, strict=True))
    return abs(found.real / z.real - 1.0)


@pytest.mark.parametrize("m", [0.5, 1.0, 2.0, 5.0])
def test_modes_have_the_formulas_resistance(m):
    """Their tail's first two moments are right, so its error grows with the sixth power of xi."""
    assert max(off(m, xi) for xi in np.linspace(0.1, 6.5, 100)) < 2e-3
    assert off(m, 1.0) < 1e-8


def ladder(first, scale, count):
    """Return (A, b, c) of dx/dt = A x + b i, drop = c x + d i, of the continued fraction a/(first +
    a/(first + 2 + ...)), a = s scale."""
    a, b = np.zeros((count, count)), np.zeros(count)
    for k in range(count):
        # voltage across inductance k: all resistances from there on times what flows through them
        for m in range(k, count):
            ohm = first + 4 * m + 2
            b[k] += ohm
            a[k, : m + 1] -= ohm
    rates = (first + 4.0 * np.arange(count)) / scale
    return rates[:, None] * a, rates * b, a[0], b[0]


def test_a_step_is_that_of_the_ladder():
    """x coth x = 1 + y/(3 + y/(5 + ...)), x tanh(x/2) = 2 u/(1 + u/(3 + ...)), u = y/4, y = s T:
    inductances and resistances, by the matrix exponential; eight cells each."""
    ohm, m, tau = (LAYERED[f"skin_effect.{x}"] for x in ("resistance", "layers", "time_constant"))
    whole, count, v = math.pi**2 * tau, 8, 40.0
    parts = [
        (ohm, *ladder(3, whole, count)),
        (4.0 / 3.0 * (m * m - 1.0) * ohm, *ladder(1, 0.25 * whole, count)),
    ]
    full = np.zeros((2 * count + 2, 2 * count + 2))  # current, both ladders, and 1
    full[0, 0], full[0, -1] = -R / L, v / L
    for k, (size, a, b, c, d) in enumerate(parts):
        own = slice(1 + k * count, 1 + (k + 1) * count)
        full[own, own], full[own, 0] = a, b
        full[0, own] -= size * c / L
        full[0, 0] -= size * d / L
    b = quiet(bench(NO_MAGNET, CONVERTER, LAYERED))
    for t in (2e-5, 1e-4, 5e-4):
        state = start(b)
        integrate(state, b, MODES["locked"], complex(v / U), 0.0, t, 0.0, 0.0)
        expected = (expm(full * t) @ [*np.zeros(2 * count + 1), 1.0])[0]
        assert state[Slot.I_ALPHA] == pytest.approx(expected, rel=2e-6)
        assert abs(expected / (v / R * -math.expm1(-R * t / L)) - 1.0) > 5e-3


def test_energy_closes():
    """What came in is lost, given to the load or stored, with everything else on."""
    drive = load_drive("ipm_exchanged")
    b = quiet(bench(drive.motor, drive.converter, ALL_ON | LAYERED))._replace(audit=1.0)
    state, link = start(b, 0.4), drive.converter.dc_bus_voltage
    before = unaccounted(b, state)
    for u in zip(*commands(60), strict=True):
        advance(state, b, MODES["free"], *u, link, 0.05, 0.0)
    assert unaccounted(b, state) == pytest.approx(before, abs=1e-5 * state[Slot.LOSS])
    # the currents in the modes are not the terminal's: they hold energy of their own
    places = range(Slot.MODES, Slot.MODES + 14, 2)
    assert max(abs(state[k] - state[Slot.I_ALPHA]) for k in places) > 1e-3
