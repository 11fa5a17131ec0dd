"""Cross-saturation angles against brute force on finite differences, and the audit of every
motor."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy.optimize import fsolve

from model.drive_files import load_drive, motor_names
from model.energy import currents, flux_from_current, hessian, min_eigenvalue
from model.errors import BadInput, PhysicsError
from model.saliency import (
    audit,
    current_for_torque,
    local_angle,
    ripple,
    self_consistent_angle,
    tracking_sign,
)

# Angles in degrees at half rated, rated and 180 % of rated q current: (local, self-consistent),
# checked when the project began by an independent program, rounded to 0.1 degree.
TABLE = {
    "ipm_exchanged": ((-3.1, None), (-6.1, -5.9), (-10.6, -9.7)),
    "spm_exchanged": ((-12.0, -11.6), (-17.9, -15.9), (-20.2, -15.0)),
}


@pytest.mark.parametrize("name", TABLE)
def test_angles_of_the_table(name):
    motor = load_drive(name).motor
    for load, (local, closed) in zip((0.5, 1.0, 1.8), TABLE[name], strict=True):
        i_q = load * motor.rated_current
        assert math.degrees(local_angle(motor.energy, 0.0, i_q)) == pytest.approx(local, abs=0.051)
        if closed is not None:
            assert math.degrees(self_consistent_angle(motor.energy, 0.0, i_q)) == pytest.approx(
                closed, abs=0.051
            )


def test_ipm_as_printed_errs_to_the_other_side():
    motor = load_drive("ipm").motor
    assert 2.5 < math.degrees(local_angle(motor.energy, 0.0, 1.2)) < 3.5
    assert tracking_sign(motor.energy) == -1.0


def brute_force_q_ripple(motor, i_d, i_q, e):
    """Return y_q at error e: currents from the paper's polynomials, fluxes by fsolve, L by
    differences, inverted."""

    def currents(phi):
        d, q = phi
        return np.array(
            [
                d / motor.inductance_d
                + 3 * motor.alpha_30 * d**2
                + motor.alpha_12 * q**2
                + 4 * motor.alpha_40 * d**3
                + 2 * motor.alpha_22 * d * q**2,
                q / motor.inductance_q
                + 2 * motor.alpha_12 * d * q
                + 2 * motor.alpha_22 * d**2 * q
                + 4 * motor.alpha_04 * q**3,
            ]
        )

    def flux(i):
        start = np.array([motor.inductance_d, motor.inductance_q]) * i
        return fsolve(lambda phi: currents(phi) - i, 0.6 * start, xtol=1e-13)

    i, h = np.array([i_d, i_q]), 1e-4
    inductance = np.column_stack([(flux(i + h * a) - flux(i - h * a)) / (2 * h) for a in np.eye(2)])
    turn = np.array([[math.cos(e), -math.sin(e)], [math.sin(e), math.cos(e)]])
    return (turn @ np.linalg.inv(inductance) @ turn.T @ [1.0, 0.0])[1]


@pytest.mark.parametrize("name", ["ipm", "ipm_exchanged", "spm_exchanged"])
def test_ripple_vanishes_at_both_angles_by_brute_force(name):
    motor = load_drive(name).motor
    for load in (-1.3, 0.7, 1.8):
        i_q = load * motor.rated_current
        scale = abs(1 / motor.inductance_d - 1 / motor.inductance_q)
        e = float(local_angle(motor.energy, 0.0, i_q))
        assert abs(brute_force_q_ripple(motor, 0.0, i_q, e)) < 1e-6 * scale
        e = self_consistent_angle(motor.energy, 0.0, i_q)
        actual = (math.sin(e) * i_q, math.cos(e) * i_q)
        assert abs(brute_force_q_ripple(motor, *actual, e)) < 1e-6 * scale


def test_ripple_is_the_formula_of_the_notes():
    dd, dq, qq, e = 21.0, 1.7, 12.0, 0.3
    y_d, y_q = ripple(dd, dq, qq, e)
    assert y_q == pytest.approx(0.5 * (dd - qq) * math.sin(2 * e) + dq * math.cos(2 * e), rel=1e-14)
    assert y_d == pytest.approx(
        0.5 * (dd + qq) + 0.5 * (dd - qq) * math.cos(2 * e) - dq * math.sin(2 * e), rel=1e-14
    )


@pytest.mark.parametrize("closed", [True, False])
def test_current_for_torque_gives_that_torque(closed):
    motor = load_drive("ipm_exchanged").motor
    from model import energy as en

    for torque in (0.0, 0.4, -1.5):
        i_q, e = current_for_torque(motor, torque, closed)
        a = e if closed else 0.0
        d, q = en.flux_from_current(motor.energy, math.sin(a) * i_q, math.cos(a) * i_q)
        assert float(
            en.torque.py_func(motor.energy, d, q, motor.magnet_flux, 6.0)
        ) == pytest.approx(torque, abs=1e-7)
    with pytest.raises(PhysicsError, match="out of reach"):
        current_for_torque(motor, 1e3, closed)


@pytest.mark.parametrize("name", motor_names())
def test_audit(name):
    result = audit(load_drive(name).motor)
    if name == "spm":
        assert not result.passed
        assert result.valid_radius == pytest.approx(0.786, abs=1e-3)
        nearest = result.violations[0]
        assert (nearest["i_d"], nearest["i_q"]) == (
            pytest.approx(-0.786, abs=1e-3),
            pytest.approx(0.0, abs=1e-6),
        )
        assert np.isnan(result.grid_eigenvalue).any()
    else:
        assert result.passed
        assert result.valid_radius == result.radius == result.saliency_radius
        assert result.min_eigenvalue > 0
        assert np.isfinite(result.angle_local).all()


def test_motor_without_saliency_is_refused():
    import dataclasses

    motor = dataclasses.replace(load_drive("ipm").motor, inductance_q=0.0919)
    with pytest.raises(BadInput, match=r"no saliency.*L_d and L_q differ"):
        local_angle(motor.energy, 0.0, 1.0)


def numerical_hessian(m, d, q, step=1e-6):
    """Central differences of the currents, which are the energy's gradient."""
    along_d = np.subtract(currents(m, d + step, q), currents(m, d - step, q))
    along_q = np.subtract(currents(m, d, q + step), currents(m, d, q - step))
    return np.array([along_d, along_q]).T / (2.0 * step)


def test_the_slope_of_the_null_is_the_difference_of_the_eigenvalues():
    """Of the inverse inductances, over that at zero current: L_dq counts by its double."""
    motor = load_drive("ipm_exchanged").motor
    m, found = motor.energy, audit(motor, rays=4, points=4)
    for load, slope in zip(found.load[::6], found.slope[::6], strict=True):
        d, q = flux_from_current(m, 0.0, load * motor.rated_current)
        low, high = np.linalg.eigvalsh(numerical_hessian(m, float(d), float(q)))
        assert slope == pytest.approx((high - low) / abs(m.gamma_d - m.gamma_q), rel=1e-6)


def test_rays_of_an_audit_go_round_once():
    """Four rays are the half axes: the least eigenvalue is that of the worst of them."""
    motor = load_drive("ipm_exchanged").motor
    found = audit(motor, rays=4, points=6)
    least = math.inf
    for angle in (0.0, 0.5, 1.0, 1.5):
        for r in np.linspace(0.0, found.radius, 7):
            i = r * np.cos(angle * math.pi), r * np.sin(angle * math.pi)
            d, q = flux_from_current(motor.energy, *i)
            least = min(least, min_eigenvalue(*hessian(motor.energy, float(d), float(q))))
    assert found.min_eigenvalue == pytest.approx(least, rel=1e-9)
    assert min(abs(x) for x in found.worst_current) < 1e-12
