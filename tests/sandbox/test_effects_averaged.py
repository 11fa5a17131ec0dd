"""Every effect of the averaged kernel does what its equation says: one closed form each (motion: the file beside)."""

import dataclasses
import math

import numpy as np
import pytest
from scipy.linalg import expm

from model.effects import library
from model.energy import currents, energy
from sandbox.full import CORE_D, SLOW_D, magnetic
from sandbox.loop import Rig, read_phases
from sandbox.oldplant import PHI_D, PHI_Q
from sandbox.sensors import encoder
from tests.sandbox import test_effects_averaged_motion as motion
from tests.sandbox.averaged import Averaged
from tests.sandbox.effect_motors import CONVERTER, IPM, LINEAR, NO_MAGNET, TS, L, R, U, signs


def make(effects=None, motor=LINEAR, **how):
    return Averaged(motor, CONVERTER, effects, **how)


def settled(a, u, n=800):
    """Return the sampled current of a locked motor after a long time at constant voltage."""
    return a.run([u] * n)[-1]


def test_every_effect_has_a_test():
    tested = " ".join(name for name in (*globals(), *vars(motion)) if name.startswith("test_"))
    assert not [e for e in library.effect_names() if e not in tested]


def test_stator_resistance_sets_the_steady_current():
    assert settled(make({"stator_resistance.resistance": 8.0}, NO_MAGNET), 24 + 0j) == pytest.approx(3.0, rel=1e-9)


def test_magnet_flux_of_a_shorted_turning_motor():
    """(R + j omega L) i = -j omega phi_m in the rotor frame."""
    omega = 300.0
    a = make({"magnet_flux.magnet_flux": 0.13, "iron_loss.time_constant": 1e-3}, omega=omega)
    i = a.run([0j] * 800)[-1] * np.exp(-1j * omega * TS * 799)
    assert i == pytest.approx(-1j * omega * 0.13 / (R + 1j * omega * L), rel=1e-7)


def test_inductance_and_saturation_and_cross_saturation_are_the_papers_polynomials():
    effects = {"inductance.scale_d": 1.2, "inductance.scale_q": 0.9, "saturation.alpha_30": 6.0}
    effects |= {"saturation.alpha_40": 15.0, "saturation.alpha_04": 9.0}
    effects |= {"cross_saturation.alpha_12": 3.0, "cross_saturation.alpha_22": 11.0}
    true = dataclasses.replace(
        IPM, inductance_d=0.108, inductance_q=0.0405, alpha_30=6.0, alpha_40=15.0, alpha_04=9.0, alpha_12=3.0,
        alpha_22=11.0,
    )  # fmt: skip
    a = make(effects, IPM)
    assert a.plant.energy == pytest.approx(true.energy, rel=1e-14)
    i_d, i_q, torque = magnetic(a.plant, a.effects.machine, 1.0, 0.0, -0.07, 0.05)
    assert (i_d, i_q) == pytest.approx(currents(true.energy, -0.07, 0.05), rel=1e-13)
    assert torque == pytest.approx(9.0 * ((-0.07 + 0.1) * i_q - 0.05 * i_d), rel=1e-13)


def harmonic_h(psi, theta, gamma, psi_d6, psi_q6):
    """Return H of a stationary flux vector, with the harmonics as the effect library writes them."""
    seen = psi * np.exp(-1j * theta)
    d, q = seen.real - 0.1 - psi_d6 * math.cos(6 * theta), seen.imag - psi_q6 * math.sin(6 * theta)
    swing = math.cos(6 * theta) * (d * d - q * q) + 2 * math.sin(6 * theta) * d * q
    return energy(IPM.energy, d, q) + 0.5 * gamma * swing


@pytest.mark.parametrize("harmonics", [(0.7, 0.0, 0.0), (0.0, 0.004, -0.002), (0.7, 0.004, -0.002)])
def test_inductance_harmonics_and_flux_harmonics_derive_from_one_energy(harmonics):
    """Current = gradient and torque = -3/2 p dH/dtheta at constant flux linkage, by central differences."""
    gamma, psi_d6, psi_q6 = harmonics
    effects = {"inductance_harmonics.gamma_6": gamma}
    a = make(effects | {"flux_harmonics.psi_d6": psi_d6, "flux_harmonics.psi_q6": psi_q6}, IPM)
    psi, theta, h = 0.09 + 0.06j, 0.37, 1e-6
    seen = psi * np.exp(-1j * theta)
    c, s = math.cos(theta), math.sin(theta)
    i_d, i_q, torque = magnetic(a.plant, a.effects.machine, c, s, seen.real - 0.1, seen.imag)
    i = (i_d + 1j * i_q) * np.exp(1j * theta)

    def at(p, t):
        return harmonic_h(p, t, *harmonics)

    assert i.real == pytest.approx((at(psi + h, theta) - at(psi - h, theta)) / (2 * h), rel=1e-7)
    assert i.imag == pytest.approx((at(psi + 1j * h, theta) - at(psi - 1j * h, theta)) / (2 * h), rel=1e-7)
    assert torque == pytest.approx(-9.0 * (at(psi, theta + h) - at(psi, theta - h)) / (2 * h), rel=1e-7)


def test_flux_harmonics_give_fifth_and_seventh_back_emf():
    """A shorted turning motor: lines -5 and 7 of psi_d6 cos 6 theta + j psi_q6 sin 6 theta drive j omega psi each."""
    d6, q6 = 0.002, 0.0012
    c_6, s_6 = np.cos(6 * np.arange(64) * np.pi / 32), np.sin(6 * np.arange(64) * np.pi / 32)
    psi = (0.1 + d6 * c_6 + 1j * q6 * s_6) * np.exp(1j * np.arange(64) * np.pi / 32)
    lines = np.fft.fft(psi)[[-5, 7]] / 64
    assert lines == pytest.approx([0.5 * (d6 - q6), 0.5 * (d6 + q6)])
    omega = 100.0
    a = make({"flux_harmonics.psi_d6": d6, "flux_harmonics.psi_q6": q6}, omega=omega)
    i = a.run([0j] * (8 * 251))[-251:]
    t = TS * np.arange(7 * 251, 8 * 251)
    basis = np.exp(1j * np.outer(t, omega * np.array([1, -5, 7])))
    fit = np.linalg.lstsq(basis, i, rcond=None)[0]
    for order, flux, found in zip((1, -5, 7), (0.1, lines[0], lines[1]), fit, strict=True):
        assert found == pytest.approx(-1j * order * omega * flux / (R + 1j * order * omega * L), rel=1e-3), order


def test_iron_loss_current_rises_with_its_time_constant_and_loses_its_power():
    """At constant flux slope v: i_c = v/R_c (1 - exp(-t/tau)); then the loss is 3/2 R_c i_c^2 = 3/2 v^2/R_c."""
    tau, v = 1.5e-4, 40.0
    a = make({"iron_loss.core_resistance": 800.0, "iron_loss.time_constant": tau}, NO_MAGNET, resistance=0.0)
    for k in range(1, 20):
        a.advance(v + 0j)
        assert a.x[CORE_D] == pytest.approx(v / 800 * (1 - math.exp(-k * TS / tau)), rel=1e-5)
    assert 1.5 * 800.0 * a.x[CORE_D] ** 2 == pytest.approx(1.5 * v * v / 800.0, rel=1e-6)


def test_skin_effect_is_the_linear_two_state_circuit():
    """L di/dt = v - R i - R_1 (i - x), tau dx/dt = i - x: the matrix exponential."""
    r_1, tau = 3.0, 2e-4
    a = make({"skin_effect.resistance": r_1, "skin_effect.time_constant": tau}, NO_MAGNET)
    for _ in range(3):
        a.advance(40.0 + 0j)
    m = np.array([[-(R + r_1) / L, r_1 / L, 1 / L], [1 / tau, -1 / tau, 0], [0, 0, 0]])
    expected = expm(m * 3 * TS) @ [0.0, 0.0, 40.0]
    assert [a.x[PHI_D] / L, a.x[SLOW_D]] == pytest.approx(expected[:2], rel=1e-6)


def test_skin_effect_impedance_rises_with_frequency():
    """Z(s) = R + s L + R_1 s tau/(1 + s tau): on a turning shorted rotor the stationary frame sees omega."""
    r_1, tau, omega = 5.0, 1e-3, 400.0
    a = make({"skin_effect.resistance": r_1, "skin_effect.time_constant": tau}, omega=omega)
    i = a.run([0j] * 800)[-1] * np.exp(-1j * omega * TS * 799)
    s = 1j * omega
    assert i == pytest.approx(-s * 0.1 / (R + s * L + r_1 * s * tau / (1 + s * tau)), rel=1e-6)


def test_winding_asymmetry_unbalances_the_steady_current():
    """(R + C diag(delta_a, delta_b, 0) C^+) i = u with Clarke's C; at a rotor angle that does not matter."""
    a = make({"winding_asymmetry.delta_a": 0.8, "winding_asymmetry.delta_b": -0.5}, NO_MAGNET, theta=0.8)
    clarke = np.array([[2, -1, -1], [0, math.sqrt(3), -math.sqrt(3)]]) / 3
    back = np.array([[1, 0], [-0.5, math.sqrt(0.75)], [-0.5, -math.sqrt(0.75)]])
    i = np.linalg.solve(R * np.eye(2) + clarke @ np.diag([0.8, -0.5, 0.0]) @ back, [15.0, 10.0])
    assert settled(a, 15 + 10j) == pytest.approx(complex(*i), rel=1e-9)


@pytest.mark.parametrize("angle", [0.0, 0.3, 1.2, 4.0])
def test_dead_time_volt_seconds(angle):
    """Mean voltage lost: u_dc t_d/T_s times the vector of signs; the sample is t_d/2 (u - lost)/L above the mean."""
    t_d, u = 2e-6, 30 * np.exp(1j * angle)
    lost = U * t_d / TS * signs(u)
    late = settled(make({"dead_time.time": t_d}, NO_MAGNET), u)
    assert late - u / R == pytest.approx(-lost / R + 0.5 * t_d * (u - lost) / L, rel=3e-3)
    free = make({"dead_time.time": t_d}, NO_MAGNET, resistance=0.0)
    current = u / R
    free.x[PHI_D], free.x[PHI_Q] = L * current.real, L * current.imag
    assert u - free.advance(u) == pytest.approx(lost, rel=1e-9)


def test_dead_time_is_soft_around_zero_current():
    smooth = dataclasses.replace(NO_MAGNET, inductance_d=0.5, inductance_q=0.5)  # hardly any ripple at the edges
    a = make({"dead_time.time": 2e-6, "stator_resistance.resistance": 200.0}, smooth)
    assert settled(a, 0.4 + 0j).real == pytest.approx(0.4 / (200 + U * 2e-6 / TS * 1.0 / (0.015 * 2.0)), rel=2e-2)


def test_dead_time_fundamental_is_four_over_pi_with_6k_lines():
    t_d, n = 2e-6, 1000
    smooth = dataclasses.replace(NO_MAGNET, inductance_d=0.5, inductance_q=0.5)
    a = make({"dead_time.time": t_d}, smooth, resistance=0.0)
    u, lost = 150 * np.exp(2j * np.pi * np.arange(n) / n), np.empty(n, complex)
    for k, v in enumerate(u):
        a.x[PHI_D], a.x[PHI_Q] = 0.5 * v.real / 100, 0.5 * v.imag / 100  # 1.5 A in phase with the voltage
        lost[k] = v - a.advance(v)
    line = np.fft.fft(lost)[[1, -5, 7, -11, 13]] / n
    v_1 = U * t_d / TS * 4 / np.pi
    assert np.abs(line) == pytest.approx(v_1 / np.array([1, 5, 7, 11, 13]), rel=0.02)


def test_device_drop_lowers_the_steady_current():
    u = 30 * np.exp(0.4j)
    a = make({"device_drop.threshold": 0.9, "device_drop.on_resistance": 0.5}, NO_MAGNET)
    assert settled(a, u) == pytest.approx((u - 0.9 * signs(u)) / (R + 0.5), rel=1e-9)


def test_dc_link_error_scales_the_delivered_voltage():
    assert make({"dc_link_error.gain_error": 0.03}).advance(20 + 5j) == pytest.approx(1.03 * (20 + 5j), rel=1e-12)


def test_dc_link_error_sags_with_the_power_drawn():
    """i_dc = 3/2 u i/V: delivered u' = u - u sag P/V^2 at the power P = 3/2 u i; a generator raises the link."""
    u, sag = 60.0 * np.exp(0.7j), 25.0
    a = make({"dc_link_error.sag": sag}, NO_MAGNET)
    i = settled(a, u)
    power = 1.5 * (u * i.conjugate()).real
    assert i * R == pytest.approx(u * (1.0 - sag * power / U**2), rel=1e-9)
    assert abs(i) * R == pytest.approx(60.0 / (1.0 + 1.5 * sag * 60.0**2 / (R * U**2)), rel=1e-9)
    assert abs(a.advance(-u)) == pytest.approx(60.0 * (1.0 + sag * power / U**2), rel=1e-9)


def test_dc_link_ripple_volt_seconds_of_one_period():
    """Each leg delivers D T_s [V + A sin(w t_mid + phase) sinc(w D T_s/2)]; t from the run's start."""
    amplitude, f, phase, u, n = 20.0, 700.0, 0.5, 100.0, 5
    effects = {"dc_link_ripple.amplitude": amplitude, "dc_link_ripple.frequency": f, "dc_link_ripple.phase": phase}
    a = make(effects)
    delivered = np.array([a.advance(u + 0j) for _ in range(n)])
    duty = 0.5 + (np.array([u, -u / 2, -u / 2]) - u / 4) / U
    middle = (np.arange(n) + 0.5) * TS
    leg = duty * (U + amplitude * np.sin(2 * np.pi * f * middle[:, None] + phase) * np.sinc(f * duty * TS))
    assert delivered.real == pytest.approx((2 * leg[:, 0] - leg[:, 1] - leg[:, 2]) / 3, rel=1e-9)


def test_pwm_delay_keeps_the_volt_seconds_and_moves_the_mean():
    """Up to the zero vector: samples as commanded without resistance; with it the sample is delay u/L above u/R."""
    delay = 2e-5
    steps = [30.0, -30.0, 60.0, 0.0, 20.0]
    i = make({"pwm_delay.delay": delay}, NO_MAGNET, resistance=0.0).run([complex(s) for s in steps]).real
    assert np.diff(i) * L == pytest.approx(np.array(steps[:-1]) * TS, rel=1e-9)
    assert settled(make({"pwm_delay.delay": delay}, NO_MAGNET), 30 + 0j) == pytest.approx(
        3.0 + delay * 30 / L, rel=1e-4
    )


def test_pwm_delay_beyond_the_zero_vector_moves_volt_seconds_to_the_next_period():
    delay, u = 9e-5, np.array([0.0, 150.0, -150.0, 200.0, 50.0, 0.0])
    i = make({"pwm_delay.delay": delay}, NO_MAGNET, resistance=0.0).run(u + 0j).real

    def until(u, t):
        legs = np.array([u, -u / 2, -u / 2])
        duty = 0.5 + (legs - u / 4) / U
        on = U * np.clip(t - 0.5 * (1 - duty) * TS, 0.0, duty * TS)
        return (2 * on[0] - on[1] - on[2]) / 3

    early = np.array([until(x, TS - delay) for x in u])
    assert np.diff(i)[1:] * L == pytest.approx(u[:-2] * TS - early[:-2] + early[1:-1], abs=1e-9)


def readings(effects, turns=3, n=300):
    """Return what three sensors make of 2 A turning steadily, seen from the turning frame."""
    sensors = make(effects).effects.sensors
    rig = Rig(*6 * (0,), TS, 0.0, 0.0, 0.0, U, 0.0)
    rng = np.random.default_rng(0)
    angle = 2 * np.pi * turns * np.arange(n) / n
    rows = np.array([read_phases(2 * np.cos(x), 2 * np.sin(x), sensors, rig, rng) for x in angle])
    i = (2 * rows[:, 0] - rows[:, 1] - rows[:, 2]) / 3 + 1j * (rows[:, 1] - rows[:, 2]) / math.sqrt(3)
    return np.fft.fft(i * np.exp(-1j * angle)) / n


def test_current_offset_appears_at_first_order():
    lines = readings({"current_offset.offset_a": 0.02, "current_offset.offset_b": -0.01})
    assert abs(lines[-3]) == pytest.approx(abs(complex(0.02, (-0.01 + 0.01) / math.sqrt(3))), rel=1e-9)
    lines[[0, -3]] = 0.0
    assert np.abs(lines).max() < 1e-12


def test_current_gain_mismatch_appears_at_second_order():
    """i (1 + g_0) + conj(i) g_2 with g_2 = (g_a + A^-1 g_b + A g_c)/3 of the deviations, A = exp(2 pi j/3)."""
    lines = readings({"current_gain.gain_a": 1.02, "current_gain.gain_b": 0.995})
    mismatch = (0.02 - 0.005 * np.exp(4j * math.pi / 3)) / 3
    assert abs(lines[-6]) == pytest.approx(2 * abs(mismatch), rel=1e-9)
    assert lines[0] == pytest.approx(2 * (1 + 0.015 / 3), rel=1e-9)


def test_current_filter_lags_the_zero_vector_not_the_mean_slope():
    """A tau short against the zero vector reads i(t_k - tau): at rest i (1 + tau R/L), above the mean."""
    tau = 4e-6
    i = settled(make({"current_filter.time_constant": tau}, NO_MAGNET), 30 + 0j)
    assert i.real == pytest.approx(3.0 * (1 + tau * R / L), rel=1e-5)
    assert i.imag == pytest.approx(0.0, abs=1e-9)


@pytest.mark.parametrize("delay", [1e-5, -1e-5])
def test_current_sampling_sees_the_zero_vector(delay):
    i = settled(make({"current_sampling.delay": delay}, NO_MAGNET), 30 + 0j)
    assert i == pytest.approx(3.0 * math.exp(-R * delay / L), rel=1e-5)


def test_current_sampling_jitter_scatters_with_the_slope():
    i = make({"current_sampling.jitter": 5e-6}, NO_MAGNET).run([30 + 0j] * 6000)[1000:]
    assert i.real.std() == pytest.approx(5e-6 * R / L * 3.0, rel=0.05)


def test_encoder_offset_and_encoder_eccentricity_and_counts():
    effects = {"encoder_offset.offset": 0.04, "encoder_eccentricity.amplitude_mech": 0.01}
    e = make(effects | {"encoder_eccentricity.phase": 0.3}).effects.sensors
    theta, h = 7.0, 1e-6
    read, speed = encoder(e, 4.0, theta, 50.0)
    assert read == pytest.approx(theta + 0.04 + 4 * 0.01 * math.sin(theta / 4 + 0.3), abs=1e-12)
    assert speed == pytest.approx(50.0 * (encoder(e, 4.0, theta + h, 0.0)[0] - read) / h, rel=1e-5)
    counted = Averaged(LINEAR, dataclasses.replace(CONVERTER, encoder_counts=1000)).effects.sensors
    step = 2 * math.pi * 4 / 1000
    values = np.array([encoder(counted, 4.0, x, 0.0)[0] - x for x in np.linspace(-3.0, 3.0, 500)])
    assert np.abs(values).max() == pytest.approx(0.5 * step, rel=0.02)
