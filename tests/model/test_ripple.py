"""The periodic solution against closed forms and SciPy; the order of what the paper's averaging
leaves out."""

import math

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from model.drive_files import load_drive
from model.energy import Energy, currents, flux_from_current, hessian
from model.ripple import flux_ripple, periodic, slopes, voltage_error

N, H = 8, 250e-6


def _square(amplitude, axis=0, n=N):
    v = np.zeros((n, 2))
    v[:, axis] = np.where(np.arange(n) < n // 2, amplitude, -amplitude)
    return v


def _solve(m, resistance, v, h, mean, threshold=0.0, delay=0.0):
    out = np.empty_like(v)
    u_d, u_q, status = periodic(
        m, resistance, threshold, 0.02, 0.3, v, h, delay, *map(float, mean), out
    )
    assert status == 0
    return np.array([u_d, u_q]), out


def test_a_square_wave_makes_a_triangle_of_amplitude_u_over_4f():
    psi = flux_ripple(_square(30.0)[:, 0], H)  # NOTES: u / (4 f_inj), f_inj = 500 Hz
    assert psi.max() == pytest.approx(30.0 / (4 * 500.0), rel=1e-12)
    np.testing.assert_allclose(np.diff(np.append(psi, psi[0])), _square(30.0)[:, 0] * H, atol=1e-15)


def test_any_waveform_has_the_primitive_of_its_own_shape():
    # fine sampling: F of cos is sin / omega up to (pi/n)^2/6 relative (held voltage, taken at
    # midpoints)
    n = 400
    t = np.arange(n) * 1e-5
    omega = 2 * math.pi / (n * 1e-5)
    wanted = np.sin(omega * t) / omega
    found = flux_ripple(np.cos(omega * (t + 0.5e-5)), 1e-5)
    assert np.max(np.abs(found - wanted)) < 2e-5 / omega


def test_linear_motor_follows_the_exponential_of_an_rl_circuit():
    resistance, inductance, v = 12.0, 0.05, _square(30.0)
    # exact step response of di/dt = (v - R i)/L over an interval
    a = math.exp(-resistance * H / inductance)
    i = np.zeros(N)
    for _ in range(400):
        for k in range(N):
            i[(k + 1) % N] = a * i[k] + (1 - a) / resistance * v[k, 0]
    m = Energy(1 / inductance, 1 / 0.08, *5 * (0.0,))
    u, out = _solve(m, resistance, v, H, (0.4, 0.0))
    np.testing.assert_allclose(out[:, 0], i - i.mean(), atol=1e-12)
    assert abs(out[:, 1]).max() < 1e-15
    assert u[1] == 0.0


@pytest.mark.parametrize("name", ["ipm", "ipm_exchanged", "spm_exchanged"])
def test_saturated_motor_agrees_with_an_independent_integrator(name):
    drive = load_drive(name)
    m, resistance = drive.motor.energy, drive.motor.resistance
    v = _square(drive.injection.amplitude) + _square(0.3 * drive.injection.amplitude, axis=1)
    mean = (0.7 * drive.motor.rated_current, -1.2 * drive.motor.rated_current)
    u, out = _solve(m, resistance, v, H, mean)

    def rate(_, x, drop_u):
        i_d, i_q = currents.py_func(m, x[0], x[1])
        return [drop_u[0] - resistance * i_d, drop_u[1] - resistance * i_q]

    def period(x):
        samples = []
        for k in range(N):
            samples.append(currents.py_func(m, *x))
            x = solve_ivp(rate, (0, H), x, args=(u + v[k],), rtol=1e-11, atol=1e-14).y[:, -1]
        return x, np.array(samples)

    x = np.array(flux_from_current(m, *mean)).ravel()
    for _ in range(6):  # Newton on the period map x -> P(x), Jacobian by differences
        p, samples = period(x)
        j = np.column_stack([(period(x + e)[0] - p) / 1e-5 for e in 1e-5 * np.eye(2)])
        x = x + np.linalg.solve(np.eye(2) - j, p - x)
    p, samples = period(x)
    np.testing.assert_allclose(samples.mean(axis=0), mean, atol=1e-9)
    np.testing.assert_allclose(samples - samples.mean(axis=0), out, atol=1e-9)


def test_remainder_and_amplitude_error_fall_as_the_square_of_the_period():
    m, resistance = load_drive("ipm").motor.energy, 12.15
    frequency = 500.0 * np.logspace(0, 1, 7)
    d, q = flux_from_current(m, 0.6, 0.9)
    gamma = hessian(m, float(d), float(q))[0]
    rest, error = [], []
    for f in frequency:
        v, h = _square(30.0), 1 / (N * f)
        psi = flux_ripple(v[:, 0], h)
        _, out = _solve(m, resistance, v, h, (0.6, 0.9))
        s = slopes(out, psi)
        rest.append(np.max(np.abs(out - np.outer(psi, s))))
        error.append(abs(s[0] / gamma - 1))
    for values in (rest, error):
        slope = np.polyfit(np.log(frequency), np.log(values), 1)[0]
        assert slope == pytest.approx(-2.0, abs=0.05)  # O(1/Omega^2), section III-C


def test_voltage_error_is_a_saturated_sign_of_each_phase():
    # 4/3 threshold along a current on phase a (signs +, -, -), half of it where that phase alone
    # saturates by half
    assert voltage_error(1.0, 0.0, 0.0, 2.0, 0.01) == pytest.approx((8 / 3, 0.0))
    e = voltage_error(0.005, 0.0, 0.0, 2.0, 0.01)  # 1/2, -1/4, -1/4: (2*1/2 + 1/2)/3 = 1/2
    assert e == pytest.approx((1.0, 0.0))
    # the same in a turned frame
    turned = voltage_error(math.cos(0.4), -math.sin(0.4), 0.4, 2.0, 0.01)
    assert np.hypot(*turned) == pytest.approx(8 / 3)


def test_a_constant_current_needs_the_voltage_that_is_lost():
    """Resistance and the inverter's error, on both axes; the injection is small, so no phase
    changes its sign."""
    m, mean = Energy(1 / 0.05, 1 / 0.08, *5 * (0.0,)), (0.9, 1.4)
    u, _ = _solve(m, 12.0, _square(1.0), H, mean, threshold=2.0)
    lost = voltage_error(*mean, 0.3, 2.0, 0.02)
    assert min(map(abs, lost)) > 0.5
    np.testing.assert_allclose(u, 12.0 * np.array(mean) + lost, rtol=1e-5)


def test_late_pulses_are_read_in_the_zero_vector():
    """Bench practice/p09: with pulses late by tau the reading stands tau before the middle of the
    zero vector."""
    resistance, inductance, tau = 12.0, 0.05, 40e-6
    m = Energy(1 / inductance, 1 / 0.08, *5 * (0.0,))
    # A, of a constant current i with di/dt = -R i / L in the zero vector: i + tau R i / L
    read = 1.5
    u, _ = _solve(m, resistance, _square(0.0), H, (read, 0.0), delay=tau)
    assert u[0] == pytest.approx(resistance * read / (1 + tau * resistance / inductance), rel=1e-12)
