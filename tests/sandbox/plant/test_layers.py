"""Layers of conductors: the plant's six branches are Dowell's formula; both plants run by it."""

from __future__ import annotations

import math

import mpmath
import numpy as np
import pytest

from model.effects.skin_effect import impedance
from sandbox.plant import additions as add
from sandbox.plant.layers import ODD, PLACES, WEIGHTS
from sandbox.plant.sets import batch_of, complete, features_of
from tests.sandbox.plant.effect_motors import CONVERTER, LINEAR, TS, L, R
from tests.sandbox.plant.exact import exact, switched

BOTH = pytest.mark.parametrize("plant", [exact, switched])
TAU = 1e-4


def layers(resistance, number, tau):
    """Return a set with layers."""
    return {
        "skin_effect.resistance": resistance,
        "skin_effect.layers": number,
        "skin_effect.time_constant": tau,
    }


def six(number, omega):
    """Return the impedance (n,) that the rows of a batch have over the resistance at rest, by
    omega (n,) rad/s."""
    v = complete(LINEAR, CONVERTER, layers(1.0, number, TAU))
    w = batch_of(LINEAR, CONVERTER, [v], 1)
    steps = 1j * np.multiply.outer(omega, 1.0 / w["layer_rate"][:, 0])
    return 1.0 + (steps / (1.0 + steps)) @ w["layer_r"][:, 0]


@pytest.mark.parametrize("odd", [True, False])
def test_branches_have_the_moments_of_the_series(odd):
    """Sum of n^-2k over odd or even n, k = 1 ... 6: as many as three places and weights can have,
    so these are them."""
    own = slice(ODD) if odd else slice(ODD, None)
    branches = list(zip(PLACES[own], WEIGHTS[own], strict=True))
    for k in range(1, 7):
        wanted = (1 - mpmath.mpf(2) ** (-2 * k)) if odd else mpmath.mpf(2) ** (-2 * k)
        found = math.fsum(weight * place**k for place, weight in branches)
        assert found == pytest.approx(float(wanted * mpmath.zeta(2 * k)), rel=1e-14)


@pytest.mark.parametrize(("most", "off"), [(6.2, 0.002), (10.6, 0.01)])
def test_resistance_over_frequency_is_dowells(most, off):
    """As `sandbox.plant.layers` says; with a millimetre of copper the first is 160 kHz, with three
    18 kHz (skin depth 0.38 mm at 30 kHz).  Of inductance the first holds as well."""
    xi = np.linspace(0.02, most, 400)
    omega = 2.0 * xi**2 / (math.pi**2 * TAU)
    for number in (0.5, 1.0, 1.3, 2.0, 3.0, 6.0, 20.0):
        wanted = np.array([impedance(number, TAU, x) for x in omega])
        found = six(number, omega)
        assert np.abs(found.real / wanted.real - 1.0).max() < off
        if most < 7.0:
            assert np.abs(found.imag / wanted.imag - 1.0).max() < off


def test_a_form_runs_its_own_loops_alone():
    for values, on, off in (
        ({"skin_effect.resistance": 1.0}, add.SKIN, add.LAYERS),
        (layers(1.0, 2.0, TAU), add.LAYERS, add.SKIN),
        ({"skin_effect.layers": 2.0}, 0, add.LAYERS | add.SKIN),
    ):
        features = features_of(LINEAR, complete(LINEAR, CONVERTER, values))
        assert features & on == on
        assert not features & off


@BOTH
@pytest.mark.parametrize(
    ("resistance", "number", "tau"),
    [(2.0, 2.0, 1e-4), (2.0, 2.0, 1e-3), (2.0, 4.0, 1e-3), (4.0, 1.0, 2e-3), (5.0, 6.0, 2e-5)],
)
def test_a_turning_shorted_rotor_meets_dowells_impedance(plant, resistance, number, tau):
    """i = -j omega phi/(R + j omega L + R_1 (Z - 1)); omega tau pi^2 up to 8, where six branches
    are right to 1e-5; 2e-5 for the lags' line, of which (0.04)^2/24 is not seen."""
    omega, n = 400.0, 1200
    i = plant(layers(resistance, number, tau), [0j] * n, speed=omega / LINEAR.pole_pairs)[-1]
    more = resistance * (impedance(number, tau, omega) - 1.0)
    wanted = -1j * omega * 0.1 / (R + 1j * omega * L + more)
    found = i * np.exp(-1j * omega * TS * (n - 1))
    assert found == pytest.approx(wanted, rel=2e-5)
    assert abs(wanted * (R + 1j * omega * L) / (-1j * omega * 0.1) - 1.0) > 1e-2


def test_both_plants_step_alike():
    """A square wave of voltage, whose edges the branches answer each in its own time; the bench has
    seven, of another quadrature."""
    u = 60.0 * np.exp(0.3j) * np.where(np.arange(200) % 8 < 4, 1.0, -1.0)
    for values in (layers(3.0, 2.0, 1e-4), layers(1.0, 4.0, 3e-5), layers(3.0, 1.0, 3e-5)):
        still, one, other = exact({}, u), exact(values, u), switched(values, u)
        size = np.abs(one).max()
        print(np.abs(one - other).max() / size, np.abs(still - one).max() / size)
        assert np.abs(one - other).max() < 2e-5 * size
        assert np.abs(still - one).max() > 5e-3 * size
