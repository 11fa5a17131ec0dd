"""The energy model against SymPy, closed forms and its own conservation laws."""

from __future__ import annotations

import math
from itertools import pairwise

import numpy as np
import pytest
import sympy as sp
from hypothesis import given
from hypothesis import strategies as st

from model import energy as en
from model import first_order, quartic
from model.drive_files import load_drive, motor_names
from model.errors import PhysicsError

SOUND = ("ipm", "ipm_exchanged", "spm_exchanged")
D, Q = sp.symbols("phi_d phi_q", real=True)
COEFFICIENTS = sp.symbols("g_d g_q a30 a12 a40 a22 a04")


def symbolic_energy():
    """Eq. (EnerSat) typed from the paper."""
    g_d, g_q, a30, a12, a40, a22, a04 = COEFFICIENTS
    return (
        g_d * D**2 / 2
        + g_q * Q**2 / 2
        + a30 * D**3
        + a12 * D * Q**2
        + a40 * D**4
        + a22 * D**2 * Q**2
        + a04 * Q**4
    )


@pytest.mark.parametrize("name", motor_names())
def test_currents_and_hessian_are_the_derivatives_of_the_energy(name):
    m = load_drive(name).motor.energy
    h = symbolic_energy().subs(dict(zip(COEFFICIENTS, (sp.Float(c, 30) for c in m), strict=True)))
    for d, q in ((0.03, -0.05), (-0.1, 0.08), (0.2, 0.0)):
        at = {D: sp.Float(d, 30), Q: sp.Float(q, 30)}
        expected = [
            float(sp.diff(h, *v).evalf(25, subs=at)) for v in ((D,), (Q,), (D, D), (D, Q), (Q, Q))
        ]
        found = [*en.currents(m, d, q), *en.hessian(m, d, q)]
        np.testing.assert_allclose(found, expected, rtol=1e-14)
        assert en.energy(m, d, q) == pytest.approx(float(h.evalf(25, subs=at)), rel=1e-14)


def test_printed_first_order_inductances_are_wrong_and_ours_are_the_derivatives():
    """The paper's own fluxes (phid), (phiq), differentiated by SymPy; printed L_dd lacks one factor
    L_d."""
    i_d, i_q, l_d, l_q, a30, a12, a40, a22, a04 = sp.symbols(
        "i_d i_q L_d L_q a30 a12 a40 a22 a04", positive=True
    )
    phi_d = l_d * (
        i_d
        - 3 * a30 * l_d**2 * i_d**2
        - a12 * l_q**2 * i_q**2
        - 4 * a40 * l_d**3 * i_d**3
        - 2 * a22 * l_d * l_q**2 * i_d * i_q**2
    )
    phi_q = l_q * (
        i_q
        - 2 * a12 * l_d * l_q * i_d * i_q
        - 2 * a22 * l_d**2 * l_q * i_d**2 * i_q
        - 4 * a04 * l_q**3 * i_q**3
    )
    printed_dd = l_d * (
        1 - 6 * a30 * l_d * i_d - 12 * a40 * l_d**2 * i_d**2 - 2 * a22 * l_q**2 * i_q**2
    )
    printed_qq = l_q * (
        1 - 2 * a12 * l_d * i_d - 2 * a22 * l_d**2 * i_d**2 - 12 * a04 * l_q**2 * i_q**2
    )
    numbers = (0.7, -0.4, 0.09, 0.05, 7.0, 5.0, 19.0, 22.0, 6.0)
    values = dict(zip((i_d, i_q, l_d, l_q, a30, a12, a40, a22, a04), numbers, strict=True))
    true = [
        float(sp.diff(*pair).subs(values)) for pair in ((phi_d, i_d), (phi_d, i_q), (phi_q, i_q))
    ]
    assert sp.simplify(sp.diff(phi_d, i_q) - sp.diff(phi_q, i_d)) == 0
    m = en.Energy(1 / 0.09, 1 / 0.05, 7.0, 5.0, 19.0, 22.0, 6.0)
    np.testing.assert_allclose(first_order.inductances(m, 0.7, -0.4), true, rtol=1e-12)
    np.testing.assert_allclose(
        first_order.fluxes(m, 0.7, -0.4),
        [float(p.subs(values)) for p in (phi_d, phi_q)],
        rtol=1e-12,
    )
    # printed: off by more than the whole correction, and not even of one dimension (a30 L_d i_d is
    # A/Wb)
    assert abs(float(printed_dd.subs(values)) - true[0]) > 5 * abs(true[0] - 0.09)
    assert abs(float(printed_qq.subs(values)) - true[2]) > 5 * abs(true[2] - 0.05)


def test_first_order_error_is_of_second_order_in_the_alphas():
    m = load_drive("ipm").motor.energy
    errors = []
    for scale in (0.04, 0.02, 0.01):
        small = en.Energy(m.gamma_d, m.gamma_q, *(scale * a for a in m[2:]))
        exact = en.flux_from_current(small, 1.0, 0.8)
        errors.append(abs(float(first_order.fluxes(small, 1.0, 0.8)[0]) - float(exact[0])))
    slopes = np.diff(np.log2(errors))
    np.testing.assert_allclose(slopes, -2.0, atol=0.1)


@pytest.mark.parametrize("name", SOUND)
@given(angle=st.floats(-math.pi, math.pi), size=st.floats(0.0, 1.8))
def test_flux_from_current_round_trip(name, angle, size):
    motor = load_drive(name).motor
    i_d, i_q = (
        size * motor.rated_current * math.cos(angle),
        size * motor.rated_current * math.sin(angle),
    )
    d, q = en.flux_from_current(motor.energy, i_d, i_q)
    back = en.currents(motor.energy, float(d), float(q))
    # residual of a few roundings of terms as large as gamma phi
    assert math.hypot(back[0] - i_d, back[1] - i_q) <= 1e-13 * (
        abs(i_d) + abs(i_q) + motor.rated_current
    )


def test_newton_converges_quadratically(monkeypatch):
    m = load_drive("ipm_exchanged").motor.energy
    exact = np.array(en.flux_newton(m, 1.0, 1.5, 0.0, 0.0)[:2])
    errors = []
    for steps in (1, 2, 3, 4):
        monkeypatch.setattr(quartic, "NEWTON_STEPS", steps)
        errors.append(
            np.linalg.norm(np.array(en.flux_newton.py_func(m, 1.0, 1.5, 0.0, 0.0)[:2]) - exact)
        )
    ratios = [b / a**2 for a, b in pairwise(errors) if b > 1e-15]
    assert len(ratios) >= 2
    # third derivative over twice the smallest eigenvalue bounds the constant: 2*(6 a30 + 24 a40 phi
    # ...)/(2*10) < 20/Wb
    assert max(ratios) < 20.0


def test_spm_as_printed_ends_where_its_quadratic_says():
    """On the d axis Gamma_dd = 1/L_d + 6 a30 phi + 12 a40 phi^2; its larger root is where convexity
    ends."""
    m = load_drive("spm").motor.energy
    a, b, c = 12 * m.alpha_40, 6 * m.alpha_30, m.gamma_d
    phi = (-b + math.sqrt(b * b - 4 * a * c)) / (2 * a)
    limit = c * phi + 3 * m.alpha_30 * phi**2 + 4 * m.alpha_40 * phi**3
    assert limit == pytest.approx(-0.786, abs=5e-4)
    en.flux_from_current(m, limit + 1e-4, 0.0)
    for beyond in (limit - 1e-4, -1.0, -5.0, -7.5):
        # at -7.5 A a solution exists, beyond a gap without one
        with pytest.raises(PhysicsError, match=r"convex at i_d = -0\.786.*eigenvalue"):
            en.flux_from_current(m, beyond, 0.0)


def test_newton_does_not_jump_over_a_gap():
    """At -7.5 A the SPM as printed has a stationary point beyond a stretch of negative Gamma_dd; it
    is not ours."""
    m = load_drive("spm").motor.energy
    assert en.flux_newton(m, -7.5, 0.0, 0.0, 0.0)[2] == en.OUTSIDE


def test_convexity_needs_trace_and_determinant():
    """A Hessian that is negative definite has a positive determinant, too."""
    m = en.Energy(-1.0, -2.0, 0.0, 0.0, 0.0, 0.0, 0.0)
    assert not en.is_convex_to(m, 0.1, 0.1)


def test_of_many_currents_those_outside_have_no_flux():
    """Beyond the SPM's gap, and of nothing; the others as one by one, to the bit."""
    m = load_drive("spm").motor.energy
    found = np.array(en.flux_or_nan(m, [1.0, -7.5, 0.5, math.nan], [0.2, 0.0, -0.3, 0.0]))
    assert np.isnan(found).tolist() == [[False, True, False, True]] * 2
    for k, (i_d, i_q) in ((0, (1.0, 0.2)), (2, (0.5, -0.3))):
        assert tuple(found[:, k]) == en.flux_from_current(m, i_d, i_q)


def test_not_finite_current_is_refused():
    with pytest.raises(PhysicsError, match="not finite"):
        en.flux_from_current(load_drive("ipm").motor.energy, math.nan, 0.0)


@pytest.mark.parametrize("name", SOUND)
def test_inductances_invert_finite_differences_of_the_flux(name):
    motor = load_drive(name).motor
    m, h = motor.energy, 1e-5 * motor.rated_current
    i_d, i_q = -0.4 * motor.rated_current, 0.9 * motor.rated_current
    l_dd, l_dq, l_qq = (float(v) for v in en.inductances(m, i_d, i_q))

    def slope(da, db):
        hi, lo = (
            en.flux_from_current(m, i_d + da, i_q + db),
            en.flux_from_current(m, i_d - da, i_q - db),
        )
        return (np.array(hi) - np.array(lo)) / (2 * h)

    by_d, by_q = slope(h, 0.0), slope(0.0, h)
    # central differences: third derivatives times h^2, and rounding 1e-16/h
    np.testing.assert_allclose([by_d[0], by_q[0], by_q[1]], [l_dd, l_dq, l_qq], rtol=2e-8)
    assert by_d[1] == pytest.approx(by_q[0], rel=1e-6)  # reciprocity of the exact map


def co_energy(m, i_d, i_q):
    """Return the Legendre transform phi . i - H (J up to the factor 3/2)."""
    d, q = (float(x) for x in en.flux_from_current(m, i_d, i_q))
    return d * i_d + q * i_q - en.energy(m, d, q)


@pytest.mark.parametrize("name", SOUND)
def test_co_energy_gradient_is_flux_and_its_turn_is_torque(name):
    """Flux = dW'/di; torque = 3/2 p dW'/dtheta at fixed stator current, the magnet's part phi_m i_d
    included."""
    motor = load_drive(name).motor
    m, i_r = motor.energy, motor.rated_current
    i_d, i_q, h = 0.3 * i_r, -0.8 * i_r, 1e-5
    d, q = (float(v) for v in en.flux_from_current(m, i_d, i_q))
    by_d = (co_energy(m, i_d + h * i_r, i_q) - co_energy(m, i_d - h * i_r, i_q)) / (2 * h * i_r)
    assert float(by_d) == pytest.approx(d, rel=1e-8)

    def turned(angle):
        x, y = (
            math.cos(angle) * i_d + math.sin(angle) * i_q,
            -math.sin(angle) * i_d + math.cos(angle) * i_q,
        )
        return float(co_energy(m, x, y)) + motor.magnet_flux * x

    by_angle = 1.5 * motor.pole_pairs * (turned(h) - turned(-h)) / (2 * h)
    assert en.torque(m, d, q, motor.magnet_flux, float(motor.pole_pairs)) == pytest.approx(
        by_angle, rel=1e-8
    )


@given(d=st.floats(-0.3, 0.3), q=st.floats(-0.3, 0.3))
def test_symmetry_about_the_magnet_axis(d, q):
    m = load_drive("ipm").motor.energy
    assert en.currents(m, d, -q) == (en.currents(m, d, q)[0], -en.currents(m, d, q)[1])
