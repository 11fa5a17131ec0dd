"""Dowell's formula as the card has it: against its real form in print, its limits, its series, and
what follows of a drive."""

import math

import mpmath
import numpy as np
import pytest

from model.drive_files import load_drive
from model.effects import library
from model.effects.skin_effect import CARD, dowell, impedance, ladder, longest
from model.errors import BadInput

DRIVE = load_drive("ipm")
LAYERS = (0.5, 1.0, 1.7, 2.0, 5.0, 10.0)


def printed(layers, xi):
    """Return R_ac/R_dc as printed, of conductors xi skin depths high."""
    xi = mpmath.mpf(xi)
    own = (mpmath.sinh(2 * xi) + mpmath.sin(2 * xi)) / (mpmath.cosh(2 * xi) - mpmath.cos(2 * xi))
    others = (mpmath.sinh(xi) - mpmath.sin(xi)) / (mpmath.cosh(xi) + mpmath.cos(xi))
    return float(xi * (own + mpmath.mpf(2) / 3 * (mpmath.mpf(layers) ** 2 - 1) * others))


def at(layers, xi, tau=1e-4):
    """Return the card's impedance there: xi^2 = omega pi^2 tau/2."""
    return impedance(layers, tau, 2.0 * xi * xi / (math.pi**2 * tau))


@pytest.mark.parametrize("layers", LAYERS)
def test_its_real_part_is_the_formula_in_print(layers):
    """As PE texts print it after Dowell: sinh and sin of twice the height, and of the height."""
    for xi in (0.02, 0.1, 0.5, 1.0, 2.0, 5.0, 20.0, 100.0):
        assert at(layers, xi).real == pytest.approx(printed(layers, xi), rel=1e-12)


@pytest.mark.parametrize("layers", LAYERS)
def test_its_limits(layers):
    """Below: 1 + (5 m^2 - 1)/45 xi^4, whose next term is of xi^8, and an inductance of m^2/3 T by
    1 ohm; above: xi (1 + 2/3 (m^2 - 1)), to exp(-xi)."""
    xi, square = 0.05, layers * layers
    low = at(layers, xi)
    assert low.real - 1.0 == pytest.approx((5.0 * square - 1.0) / 45.0 * xi**4, rel=1e-4)
    assert low.imag == pytest.approx(2.0 * xi * xi * square / 3.0, rel=1e-4)
    assert at(layers, 40.0).real == pytest.approx(40.0 * (2.0 * square + 1.0) / 3.0, rel=1e-12)
    assert at(layers, 0.0) == 1.0


@pytest.mark.parametrize("layers", LAYERS)
def test_branches_at_the_port_add_up_to_it(layers):
    """1 + sum of w_n s tau_n/(1 + s tau_n): the tail beyond n = N has w/N of s tau at most, of w/2
    for each kind of n on average."""
    tau, count = 1e-4, 20000
    even, odd, first = dowell(1.0, tau, layers)
    assert (even, first) == (2.0, tau)
    n = np.arange(1, count + 1)
    weights = np.where(n % 2 == 1, odd, even)
    for omega in (1e3, 1e4, 1e5):
        s = 1j * omega * tau / n**2
        found = 1.0 + np.sum(weights * s / (1.0 + s))
        tail = 0.5 * (even + odd) * omega * tau / count
        assert found == pytest.approx(impedance(layers, tau, omega), abs=1.01 * tail)


def test_one_form_at_a_time():
    assert ladder(2.0, 1e-4, 0.0) == (2.0, 1e-4)
    assert dowell(2.0, 1e-4, 0.0)[:2] == (0.0, 0.0)
    assert ladder(2.0, 1e-4, 1.0)[0] == 0.0
    assert dowell(0.0, 1e-4, 3.0)[:2] == (0.0, 0.0)


def set_of(**values):
    """Return a completed set."""
    own = {f"skin_effect.{k}": x for k, x in values.items()}
    return library.complete(DRIVE.motor, DRIVE.converter, own)


@pytest.mark.parametrize("layers", [0.01, 0.49])
def test_less_than_half_a_layer_is_refused(layers):
    with pytest.raises(BadInput, match=r"skin_effect.layers = 0\.\d+ is out of range; give at"):
        set_of(resistance=1.0, layers=layers)
    assert set_of(resistance=1.0, layers=0.5)["skin_effect.layers"] == 0.5


def test_a_step_is_as_long_as_what_changes_within_it_lets_it_be():
    """Between that of R alone and that of R and all ohms that the frequency 1/step meets."""
    motor, tau = DRIVE.motor, 1e-4
    v = set_of(resistance=3.0, layers=4.0, time_constant=tau)
    step = longest(v, motor, 0.0)
    more = 3.0 * (impedance(4.0, tau, 1.0 / step).real - 1.0)
    stiffest = max(motor.energy.gamma_d, motor.energy.gamma_q)
    assert step * (motor.resistance + more) * stiffest == pytest.approx(0.1, rel=1e-9)
    alone = longest(set_of(resistance=3.0, time_constant=tau), motor, 0.0)
    assert alone == pytest.approx(0.1 / ((motor.resistance + 3.0) * stiffest))
    assert step < alone
    slow = longest(set_of(resistance=1e-9, layers=4.0, time_constant=tau), motor, 0.0)
    assert slow == pytest.approx(0.1 / (motor.resistance * stiffest), rel=1e-6)


def test_what_to_do_says_what_the_formula_says():
    v = set_of(resistance=3.0, layers=2.0, time_constant=1.0 / (math.pi**3 * 1000.0))
    said = CARD.do(v, DRIVE.motor, DRIVE.converter)
    assert "count 1.3 Ω times x²" in said
    assert "x = f/(1.0 kHz)" in said
    assert "9.0 Ω times √x" in said
