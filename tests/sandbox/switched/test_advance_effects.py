"""Every effect of the switched bench does what its equation says: one closed form each."""

import dataclasses
import math

import numpy as np
import pytest
from scipy.linalg import expm

from model.effects.library import parameters
from sandbox.drive.switched_loop import encoder_slope
from sandbox.plant.backlash import swing_across
from sandbox.switched.advance import MODES, encoder, flux_for, replay, start
from sandbox.switched.bench_numbers import bench, quiet
from sandbox.switched.bench_state import Slot
from sandbox.switched.inverter import advance, integrate, moving
from sandbox.switched.machine_state import Driving
from sandbox.switched.phase_machine import current_and_torque, friction, powers, stored_energy
from tests.sandbox.plant.closed_forms import pulsed, settled
from tests.sandbox.plant.effect_motors import (
    CONVERTER,
    IPM,
    LINEAR,
    NO_MAGNET,
    TS,
    L,
    R,
    U,
    signs,
    vector,
)


def make(effects=None, motor=LINEAR):
    return quiet(bench(motor, CONVERTER, effects))


def paper(motor, d, q):
    """Return H, i_d, i_q of the paper's polynomial."""
    h = d * d / (2 * motor.inductance_d) + q * q / (2 * motor.inductance_q) + motor.alpha_30 * d**3
    h += (
        motor.alpha_12 * d * q * q
        + motor.alpha_40 * d**4
        + motor.alpha_22 * d * d * q * q
        + motor.alpha_04 * q**4
    )
    i_d = d / motor.inductance_d + 3 * motor.alpha_30 * d**2 + motor.alpha_12 * q**2
    i_d += 4 * motor.alpha_40 * d**3 + 2 * motor.alpha_22 * d * q * q
    i_q = (
        q / motor.inductance_q
        + 2 * motor.alpha_12 * d * q
        + 2 * motor.alpha_22 * d * d * q
        + 4 * motor.alpha_04 * q**3
    )
    return h, i_d, i_q


def test_every_effect_has_a_test():
    tested = " ".join(name for name in globals() if name.startswith("test_"))
    assert not [e for e in {name.partition(".")[0] for name in parameters()} if e not in tested]


def test_leg_voltage_takes_from_a_steady_current_what_its_curve_says():
    """24 V along alpha: leg a at i, the others at -i/2; the volts that are lost are the curve's
    there, two thirds and one third of them along alpha.  Terms saturate at 0.0125, 0.02, ... of the
    current of reference, here far below."""
    b = make({"leg_voltage.v_1": 0.6, "leg_voltage.v_3": -0.2, "leg_voltage.reference": 0.05})
    plain, got = settled(make({}), 24 + 0j), settled(b, 24 + 0j)
    ohm = 24.0 / plain.real
    assert got.real == pytest.approx((24.0 - (4.0 / 3.0) * (0.6 - 0.2)) / ohm, rel=1e-3)


def test_current_linearity_bends_each_reading():
    """At a steady current of the vector i along alpha phase a reads i and the others -i/2, each
    with its own cubic and square of its own size."""
    terms = {"second": 0.02, "third": -0.03, "reference": 2.0}
    b = make({f"current_linearity.{n}": x for n, x in terms.items()})
    plain, out = (replay(x, "locked", np.full(400, 24.0), np.zeros(400), U) for x in (make({}), b))
    for phase in "abc":
        i = plain[f"i_{phase}"][-1]
        bent = i * (1.0 + 0.02 * abs(i) / 2.0 - 0.03 * (i / 2.0) ** 2)
        assert out[f"i_{phase}"][-1] == pytest.approx(bent, rel=1e-12)


def test_friction_torque_is_its_curve():
    """Terms of 0.2 and -0.05 N m that grow up to 0.4 and 1 of 50 rad/s: at 10 rad/s a half and a
    fifth of them, from 50 rad/s on all."""
    sizes = {"t_5": 0.2, "t_6": -0.05, "reference": 50.0}
    b = make({f"friction_torque.{n}": x for n, x in sizes.items()})
    b = b._replace(viscous=0.0)
    assert friction(b, 10.0) == pytest.approx(0.2 * 0.5 - 0.05 * 0.2, rel=1e-12)
    assert friction(b, -10.0) == pytest.approx(-friction(b, 10.0), rel=1e-12)
    assert friction(b, 500.0) == pytest.approx(0.15, rel=1e-12)


def test_stator_resistance_sets_the_steady_current():
    got = settled(make({"stator_resistance.resistance": 8.0}), 24 + 0j)
    assert got == pytest.approx(pulsed(24.0, 8.0), rel=1e-9)
    assert got == pytest.approx(24.0 / 8.0, rel=3e-5)  # the mean voltage alone, up to (R T_s/L)^2


def test_magnet_flux_sets_torque_and_open_circuit_voltage():
    b = make({"magnet_flux.magnet_flux": 0.13})
    theta = 0.7
    psi = flux_for(b, 2j * np.exp(1j * theta), theta)
    assert current_and_torque(b, psi, theta)[1] == pytest.approx(1.5 * 4 * 0.13 * 2.0, rel=1e-12)


def test_inertia_sets_the_acceleration():
    b = make({"inertia.inertia": 2e-3}, NO_MAGNET)
    out = replay(b, "free", np.zeros(101), np.zeros(101), U, load_torque=0.3)
    assert out["speed"][100] == pytest.approx(-0.3 / 2e-3 * 100 * TS, rel=1e-12)


@pytest.mark.parametrize("theta", [0.0, 1.1, -2.0])
def test_inductance_and_saturation_and_cross_saturation_are_the_papers_polynomials(theta):
    effects = {"inductance.scale_d": 1.2, "inductance.scale_q": 0.9, "saturation.alpha_30": 6.0}
    effects |= {"saturation.alpha_40": 15.0, "saturation.alpha_04": 9.0}
    effects |= {"cross_saturation.alpha_12": 3.0, "cross_saturation.alpha_22": 11.0}
    true = dataclasses.replace(
        IPM,
        inductance_d=0.108,
        inductance_q=0.0405,
        alpha_30=6.0,
        alpha_40=15.0,
        alpha_04=9.0,
        alpha_12=3.0,
        alpha_22=11.0,
    )
    b = make(effects, IPM)
    d, q = -0.07, 0.05
    turn = np.exp(1j * theta)
    psi = (d + IPM.magnet_flux + 1j * q) * turn
    h, i_d, i_q = paper(true, d, q)
    i, torque = current_and_torque(b, psi, theta)
    assert i == pytest.approx((i_d + 1j * i_q) * turn, rel=1e-12)
    assert stored_energy(b, psi, theta) == pytest.approx(h, rel=1e-12)
    assert torque == pytest.approx(9.0 * ((d + 0.1) * i_q - q * i_d), rel=1e-11)


def rotor_energy(motor, psi, theta, gamma, psi_d6, psi_q6):
    """Return H in the rotor frame, with the harmonics as the effect library writes them."""
    seen = psi * np.exp(-1j * theta)
    d = seen.real - motor.magnet_flux - psi_d6 * math.cos(6 * theta)
    q = seen.imag - psi_q6 * math.sin(6 * theta)
    swing = math.cos(6 * theta) * (d * d - q * q) + 2 * math.sin(6 * theta) * d * q
    return paper(motor, d, q)[0] + 0.5 * gamma * swing


@pytest.mark.parametrize("harmonics", [(0.7, 0.0, 0.0), (0.0, 0.004, -0.002), (0.7, 0.004, -0.002)])
def test_inductance_harmonics_and_flux_harmonics_derive_from_one_energy(harmonics):
    """Current = gradient and torque = -3/2 p dH/dtheta of the library's H, by central
    differences."""
    gamma, psi_d6, psi_q6 = harmonics
    b = make(
        {
            "inductance_harmonics.gamma_6": gamma,
            "flux_harmonics.psi_d6": psi_d6,
            "flux_harmonics.psi_q6": psi_q6,
        },
        IPM,
    )
    psi, theta, h = 0.09 + 0.06j, 0.37, 1e-6

    def at(p, t):
        return rotor_energy(IPM, p, t, gamma, psi_d6, psi_q6)

    i, torque = current_and_torque(b, psi, theta)
    assert i.real == pytest.approx((at(psi + h, theta) - at(psi - h, theta)) / (2 * h), rel=1e-7)
    assert i.imag == pytest.approx(
        (at(psi + 1j * h, theta) - at(psi - 1j * h, theta)) / (2 * h), rel=1e-7
    )
    assert torque == pytest.approx(
        -9.0 * (at(psi, theta + h) - at(psi, theta - h)) / (2 * h), rel=1e-7
    )


def test_iron_loss_current_rises_with_its_time_constant_and_loses_its_power():
    """At constant flux slope v: i_c = v/R_c (1 - exp(-t/tau)); then the loss is 3/2 v^2/R_c."""
    effects = {
        "iron_loss.core_resistance": 800.0,
        "iron_loss.time_constant": 1.5e-4,
        "stator_resistance.resistance": 0.0,
    }
    b = make(effects, NO_MAGNET)
    state, v = start(b), 40.0
    integrate(state, b, MODES["locked"], complex(v / U), 0.0, 2e-4, 0.0, 0.0)
    assert state[Slot.CORE_ALPHA] == pytest.approx(v / 800 * (1 - math.exp(-2 / 1.5)), rel=1e-3)
    assert state[Slot.I_ALPHA] == pytest.approx(v * 2e-4 / L + state[Slot.CORE_ALPHA], rel=1e-12)
    integrate(state, b, MODES["locked"], complex(v / U), 0.0, 3e-3, 0.0, 0.0)
    found = powers(
        b,
        0.0,
        Driving(complex(v / U), 0.0, 0.0, 0j, 0j, MODES["locked"], 0.0),
        0j,
        moving(state)._replace(psi=0j),
    )
    assert found.loss == pytest.approx(1.5 * v * v / 800.0, rel=1e-6)


def test_skin_effect_is_the_linear_two_state_circuit():
    """L di/dt = v - R i - R_1 (i - x), tau dx/dt = i - x: the matrix exponential; at rest R
    alone."""
    r_1, tau = 3.0, 2e-4
    b = make({"skin_effect.resistance": r_1, "skin_effect.time_constant": tau}, NO_MAGNET)
    state = start(b)
    integrate(state, b, MODES["locked"], complex(40.0 / U), 0.0, 5e-4, 0.0, 0.0)
    a = np.array([[-(R + r_1) / L, r_1 / L, 1 / L], [1 / tau, -1 / tau, 0], [0, 0, 0]])
    expected = expm(a * 5e-4) @ [0.0, 0.0, 40.0]
    assert [state[Slot.I_ALPHA], state[Slot.SKIN_ALPHA]] == pytest.approx(expected[:2], rel=2e-4)
    assert settled(b, 20 + 0j) == pytest.approx(2.0, rel=1e-4)


def test_winding_asymmetry_unbalances_the_steady_current():
    """(R + C diag(delta_a, delta_b, 0) C^+) i = u with Clarke's C."""
    b = make({"winding_asymmetry.delta_a": 0.8, "winding_asymmetry.delta_b": -0.5}, NO_MAGNET)
    clarke = np.array([[2, -1, -1], [0, math.sqrt(3), -math.sqrt(3)]]) / 3
    back = np.array([[1, 0], [-0.5, math.sqrt(0.75)], [-0.5, -math.sqrt(0.75)]])
    i = np.linalg.solve(R * np.eye(2) + clarke @ np.diag([0.8, -0.5, 0.0]) @ back, [15.0, 10.0])
    assert settled(b, 15 + 10j) == pytest.approx(complex(*i), rel=1e-4)


@pytest.mark.parametrize("angle", [0.0, 0.3, 1.2, 4.0])
def test_dead_time_volt_seconds(angle):
    """Mean voltage lost: u_dc t_d / T_s times the vector of signs; the pulses come t_d / 2 late on
    average.

    A pattern late by x lowers the mean of the flux ripple by x u, so the sample is above the mean
    by x u / L.
    """
    t_d, u = 2e-6, 30 * np.exp(1j * angle)
    ideal, late = (
        settled(make(motor=NO_MAGNET), u),
        settled(make({"dead_time.time": t_d}, NO_MAGNET), u),
    )
    lost = U * t_d / TS * signs(u)
    assert late - ideal == pytest.approx(-lost / R + 0.5 * t_d * (u - lost) / L, rel=3e-3)


def test_dead_time_is_soft_around_zero_current_and_its_fundamental_is_four_over_pi():
    t_d, n = 2e-6, 4000
    # hardly any ripple at the edges
    smooth = dataclasses.replace(NO_MAGNET, inductance_d=0.5, inductance_q=0.5)
    b = make({"dead_time.time": t_d, "stator_resistance.resistance": 200.0}, smooth)
    assert settled(b, 0.4 + 0j).real == pytest.approx(
        0.4 / (200 + U * t_d / TS * 1.0 / (0.015 * 2.0)), rel=2e-2
    )
    u = 150 * np.exp(2j * np.pi * np.arange(n) / n)  # one slow turn
    i = [vector(replay(q, "locked", u.real, u.imag, U)) for q in (b, b._replace(dead_time=0.0))]
    line = np.fft.fft((i[0] - i[1]) * 200.0)[[1, -5, 7]] / n
    v_1 = U * t_d / TS * 4 / np.pi
    mean_delay = 0.5 * t_d * 150.0 * 200.0 / 0.5  # V, see the test above
    assert abs(line[0]) == pytest.approx(v_1 - mean_delay, rel=5e-3)
    # 6k lines, backward and forward
    assert np.abs(line[1:]) == pytest.approx([v_1 / 5, v_1 / 7], rel=0.1)


def test_device_drop_lowers_the_steady_current():
    u = 30 * np.exp(0.4j)
    b = make({"device_drop.threshold": 0.9, "device_drop.on_resistance": 0.5}, NO_MAGNET)
    assert settled(b, u) == pytest.approx((u - 0.9 * signs(u)) / (R + 0.5), rel=1e-4)


def test_dc_link_error_scales_the_delivered_voltage():
    assert settled(make({"dc_link_error.gain_error": 0.03}, NO_MAGNET), 20 + 0j) == pytest.approx(
        pulsed(20.0, R, 1.03 * U), rel=1e-9
    )


def test_dc_link_error_sags_with_the_power_drawn():
    """Along alpha i_dc = 3/2 u i/V, so delivered u' = u - u sag P/V^2 at the power P = 3/2 u i;
    i = u'/R."""
    u, sag = 60.0, 25.0
    i = settled(make({"dc_link_error.sag": sag}, NO_MAGNET), u + 0j)
    assert i == pytest.approx(pulsed(u, R, U - sag * 1.5 * u / U * i.real), rel=1e-9)
    lost = u - i.real * R
    # the sample less the mean voltage / R
    assert lost == pytest.approx(u * sag * 1.5 * u * i.real / U**2, rel=3e-3)
    assert lost > 0.02 * u


def test_dc_link_ripple_volt_seconds_of_one_period():
    """Each leg delivers D T_s [V + A sin(w t_mid + phase) sinc(w D T_s / 2)]; t from the
    recording's start."""
    amplitude, f, phase, u, n = 20.0, 700.0, 0.5, 100.0, 5
    effects = {
        "dc_link_ripple.amplitude": amplitude,
        "dc_link_ripple.frequency": f,
        "dc_link_ripple.phase": phase,
    }
    b = make(effects | {"stator_resistance.resistance": 0.0}, NO_MAGNET)
    i = vector(replay(b, "locked", np.full(n + 1, u), np.zeros(n + 1), U))
    v_0 = -0.5 * (u - u / 2)
    duty = 0.5 + (np.array([u, -u / 2, -u / 2]) + v_0) / U
    middle = (np.arange(n) + 0.5) * TS
    leg = (
        duty
        * TS
        * (U + amplitude * np.sin(2 * np.pi * f * middle[:, None] + phase) * np.sinc(f * duty * TS))
    )
    assert np.diff(i).real * L == pytest.approx(
        (2 * leg[:, 0] - leg[:, 1] - leg[:, 2]) / 3, rel=1e-5
    )


def test_pwm_delay_moves_the_pulses_but_not_the_volt_seconds():
    """Sampled in the zero vector the flux increment is u T_s as before; the mean current is lower
    by delay u / L."""
    u, delay = 30.0, 2e-5
    b = make({"pwm_delay.delay": delay}, NO_MAGNET)
    assert settled(b, u + 0j) == pytest.approx(u / R + delay * u / L, rel=1e-4)
    free = make({"pwm_delay.delay": delay, "stator_resistance.resistance": 0.0}, NO_MAGNET)
    steps = np.array([30.0, -30.0, 60.0, 0.0, 20.0])
    i = vector(replay(free, "locked", steps, 0 * steps, U)).real
    assert np.diff(i) * L == pytest.approx(steps[:-1] * TS, rel=1e-9)


def test_pwm_delay_longer_than_the_zero_vector_moves_volt_seconds_to_the_next_period():
    """psi_k+1 - psi_k = u_k-1 T_s - F_k-1(T_s - delay) + F_k(T_s - delay), F(t) volt-seconds until
    t."""
    delay = 9e-5
    b = make({"pwm_delay.delay": delay, "stator_resistance.resistance": 0.0}, NO_MAGNET)
    u = np.array([0.0, 150.0, -150.0, 200.0, 50.0, 0.0])
    i = vector(replay(b, "locked", u, 0 * u, U)).real

    def until(u, t):
        legs = np.array([u, -u / 2, -u / 2])
        duty = 0.5 + (legs - u / 4) / U
        on = U * np.clip(t - 0.5 * (1 - duty) * TS, 0.0, duty * TS)
        return (2 * on[0] - on[1] - on[2]) / 3

    early = np.array([until(x, TS - delay) for x in u])
    assert np.diff(i)[1:] * L == pytest.approx(u[:-2] * TS - early[:-2] + early[1:-1], abs=1e-9)


def shorted(effects, n=4000, omega=100 * math.pi):
    """Return the readings of a driven, shorted motor in the rotor frame over whole turns, after
    settling."""
    b = make(effects)
    total = 4 * n
    theta = omega * TS * np.arange(total)
    out = replay(b, "driven", np.zeros(total), np.zeros(total), U, theta=theta, speed=omega / 4)
    return (vector(out) * np.exp(-1j * theta))[-n:], n * omega * TS / (2 * math.pi)


def test_current_offset_appears_at_first_order():
    i, turns = shorted({"current_offset.offset_a": 0.02, "current_offset.offset_b": -0.01})
    lines = np.abs(np.fft.fft(i)) / len(i)
    offset = complex(0.02, (-0.01 + -0.01 + 0.02) / math.sqrt(3) + (-0.01 - -0.01) / math.sqrt(3))
    assert lines[-round(turns)] == pytest.approx(abs(offset), rel=1e-9)
    assert lines[[round(turns), 2 * round(turns), -2 * round(turns)]] == pytest.approx(
        [0.0] * 3, abs=1e-9
    )


def test_current_gain_mismatch_appears_at_second_order():
    """i_read = i (1 + g_0) + conj(i) g_2 with g_2 = (g_a + A^-1 g_b + A g_c)/3 of the deviations,
    A = exp(2 pi j/3)."""
    i, turns = shorted({"current_gain.gain_a": 1.02, "current_gain.gain_b": 0.995})
    ideal = shorted({})[0]
    lines = np.fft.fft(i - ideal) / len(i)
    mismatch = (0.02 - 0.005 * np.exp(4j * math.pi / 3)) / 3
    assert abs(lines[-2 * round(turns)]) == pytest.approx(
        abs(mismatch) * abs(ideal.mean()), rel=1e-6
    )
    assert lines[0] == pytest.approx(ideal.mean() * 0.015 / 3, rel=1e-6)
    assert abs(lines[-round(turns)]) < 1e-9


def test_current_filter_lags_the_zero_vector_not_the_mean_slope():
    """A tau short against the zero vector reads i(t_k - tau): at rest i (1 + tau R / L), above the
    mean."""
    tau, u = 4e-6, 30.0
    b = make({"current_filter.time_constant": tau}, NO_MAGNET)
    i = settled(make(motor=NO_MAGNET), u + 0j)
    assert settled(b, u + 0j).real == pytest.approx(i.real * (1 + tau * R / L), rel=1e-6)


@pytest.mark.parametrize("delay", [1e-5, -1e-5])
def test_current_sampling_sees_the_zero_vector(delay):
    """Late or early by less than the zero vector lasts, the reading is i exp(-R delay / L)."""
    i = settled(make(motor=NO_MAGNET), 30 + 0j)
    b = make({"current_sampling.delay": delay}, NO_MAGNET)
    assert settled(b, 30 + 0j) == pytest.approx(i * math.exp(-R * delay / L), rel=1e-7)


def test_current_sampling_jitter_scatters_with_the_slope():
    b = make({"current_sampling.jitter": 5e-6}, NO_MAGNET)._replace(jitter=5e-6)
    n = 20000
    i = vector(replay(b, "locked", np.full(n, 30.0), np.zeros(n), U))[4000:]
    assert i.real.std() == pytest.approx(5e-6 * R / L * 3.0, rel=0.03)


def test_encoder_offset_and_encoder_eccentricity_readings():
    effects = {"encoder_offset.offset": 0.04, "encoder_eccentricity.amplitude_mech": 0.01}
    b = make(effects | {"encoder_eccentricity.phase": 0.3})
    theta = np.linspace(0.0, 30.0, 500)
    out = replay(b, "driven", np.zeros(500), np.zeros(500), U, theta=theta)
    assert out["theta"] == pytest.approx(
        theta + 0.04 + 4 * 0.01 * np.sin(theta / 4 + 0.3), abs=1e-12
    )


def test_an_encoder_that_answers_late_reads_an_older_angle():
    """theta less the way of its latency at the electrical speed, 4 pole pairs."""
    b, theta = make({"encoder_offset.latency": 3e-5}), np.linspace(0.0, 3.0, 50)
    out = replay(b, "driven", np.zeros(50), np.zeros(50), U, theta=theta, speed=np.full(50, 120.0))
    assert out["theta"] == pytest.approx(theta - 3e-5 * 4 * 120.0, abs=1e-12)


def test_further_orders_of_the_encoder_s_reading():
    """theta + p sum A_n sin(n theta_mech + phase_n); undone, and its slope by differences."""
    b = make(
        {
            "encoder_eccentricity.amplitude_mech": 0.01,
            "encoder_eccentricity.3.amplitude_mech": 0.004,
            "encoder_eccentricity.3.phase": 0.7,
            "encoder_eccentricity.4.amplitude_mech": 0.002,
            "encoder_eccentricity.4.order_mech": 5.0,
        }
    )
    theta = np.linspace(-10.0, 30.0, 500)
    out = replay(b, "driven", np.zeros(500), np.zeros(500), U, theta=theta)
    x = theta / 4
    off = 0.01 * np.sin(x) + 0.004 * np.sin(2.0 * x + 0.7) + 0.002 * np.sin(5.0 * x)
    assert out["theta"] == pytest.approx(theta + 4 * off, abs=1e-12)
    h, speed = 1e-5, 12.0
    for y in (0.3, 2.0, -5.0):
        slope = (encoder(b, y + h) - encoder(b, y - h)) / (2 * h) * 4 * speed
        assert encoder_slope(b, y, speed) == pytest.approx(slope, rel=1e-8)


def test_encoder_counts_round_to_the_nearest():
    b = bench(LINEAR, dataclasses.replace(CONVERTER, encoder_counts=1000))
    theta = np.linspace(-3.0, 3.0, 700)
    out = replay(b, "driven", np.zeros(700), np.zeros(700), U, theta=theta)
    step = 2 * math.pi * 4 / 1000
    assert np.abs(out["theta"] - theta).max() <= 0.5 * step * (1 + 1e-9)
    assert np.abs(out["theta"] / step - np.round(out["theta"] / step)).max() < 1e-9


def test_coulomb_friction_slows_at_a_constant_rate_and_has_stribecks_hump():
    b = make({"coulomb_friction.torque": 0.1}, NO_MAGNET)
    out = replay(b, "free", np.zeros(400), np.zeros(400), U, speed=100.0)
    assert out["speed"][399] == pytest.approx(100 - 0.1 / 1e-3 * 399 * TS, rel=1e-6)
    sizes = {"torque": 0.1, "width": 2.0, "stribeck_torque": 0.06, "stribeck_speed": 5.0}
    hump = make({f"coulomb_friction.{name}": x for name, x in sizes.items()})
    assert friction(hump, 5.0) == pytest.approx(
        (0.1 + 0.06 * math.exp(-1)) * math.tanh(2.5), rel=1e-12
    )


def test_viscous_friction_slows_exponentially():
    b = make({"viscous_friction.coefficient": 4e-3}, NO_MAGNET)
    out = replay(b, "free", np.zeros(400), np.zeros(400), U, speed=100.0)
    assert out["speed"][399] == pytest.approx(100 * math.exp(-4.0 * 399 * TS), rel=1e-9)


def test_cogging_torque_oscillates_like_a_pendulum():
    """Around its stable angle small swings have the rate sqrt(A n / J)."""
    effects = {
        "cogging_torque.amplitude": 0.2,
        "cogging_torque.order_mech": 12.0,
        "cogging_torque.phase": math.pi,
    }
    b, n = make(effects, NO_MAGNET), 4000
    out = replay(b, "free", np.zeros(n), np.zeros(n), U, theta=0.004)
    rate = math.sqrt(0.2 * 12 / 1e-3)
    assert out["theta"] == pytest.approx(0.004 * np.cos(rate * TS * np.arange(n)), abs=2e-5)


def test_shaft_compliance_resonates_at_its_frequency():
    """Twist after a load step: rate sqrt(K (1/J_1 + 1/J_2)), lightly damped; the total inertia is
    unchanged."""
    stiffness, load_inertia, tau = 300.0, 4e-4, 0.05
    effects = {
        "shaft_compliance.stiffness": stiffness,
        "shaft_compliance.load_inertia": load_inertia,
    }
    b = make(effects | {"shaft_compliance.damping_ratio": 0.0}, NO_MAGNET)
    rate = math.sqrt(stiffness * (1 / 6e-4 + 1 / 4e-4))
    state, twist, n = start(b), [], 2000
    for _ in range(n):
        twist.append(state[Slot.TWIST])
        advance(state, b, MODES["free"], 0.0, 0.0, U, tau, 0.0)
    steady = tau * 6e-4 / 1e-3 / stiffness
    assert np.array(twist) == pytest.approx(
        steady * (1 - np.cos(rate * TS * np.arange(n))), abs=2e-3 * steady
    )
    momentum = 6e-4 * state[Slot.SPEED] + 4e-4 * state[Slot.SPEED + 1]
    assert momentum == pytest.approx(-tau * n * TS, rel=1e-9)


def test_backlash_joins_the_shaft_beyond_its_gap():
    """A load step across the gap against the plant's exact pieces (its own test: against SciPy),
    damped in contact alone.  A crossing inside a Runge-Kutta step of h = T_s/16 misses at most a
    stage's damping, 2 ratio rate slip h/2, of the slip; three crossings move the twist by no more
    than that times the whole time."""
    stiffness, load_inertia, tau, gap, ratio = 300.0, 4e-4, 0.05, 2e-4, 0.02
    effects = {
        "shaft_compliance.stiffness": stiffness,
        "shaft_compliance.load_inertia": load_inertia,
        "shaft_compliance.damping_ratio": ratio,
        "shaft_compliance.backlash": gap,
    }
    b = make(effects, NO_MAGNET)
    rate = math.sqrt(stiffness * (1 / 6e-4 + 1 / 4e-4))
    state, x, v, n, found, expected, fastest = start(b), 0.0, 0.0, 60, [], [], 0.0
    for _ in range(n):
        found.append(state[Slot.TWIST])
        expected.append(x)
        advance(state, b, MODES["free"], 0.0, 0.0, U, tau, 0.0)
        x, v = swing_across(x, v, tau / load_inertia, 0.5 * gap, rate, ratio, TS)
        fastest = max(fastest, abs(v))
    jump = 2.0 * ratio * rate * fastest * TS / 32.0
    assert min(expected[20:]) < 0.5 * gap < max(expected)  # it comes back into the gap
    assert np.array(found) == pytest.approx(np.array(expected), abs=3.0 * jump * n * TS)
    assert 3.0 * jump * n * TS < 0.05 * max(expected)


def test_driven_rotor_follows_the_imposed_motion():
    b = make()
    state = start(b, theta=0.2, speed=10.0)
    advance(state, b, MODES["driven"], 0.0, 0.0, U, 0.0, 400.0)
    assert state[Slot.SPEED] == pytest.approx(10.1, rel=1e-12)
    assert state[Slot.SPEED - 1] == pytest.approx(0.2 + 4 * (10 * TS + 200 * TS * TS), rel=1e-12)
