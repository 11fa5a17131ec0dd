"""Electrical effects in closed form, of both plants: samples under told voltages, a motor at rest
or driven."""

import dataclasses
import math

import numpy as np
import pytest

from sandbox.drive.sensing import encoder, read_current
from sandbox.plant import additions as add
from tests.sandbox.plant.closed_forms import iron, pulsed, turned_core
from tests.sandbox.plant.effect_motors import LINEAR, NO_MAGNET, TS, L, R, U, signs
from tests.sandbox.plant.exact import Exact, exact, switched

SALIENT = dataclasses.replace(NO_MAGNET, inductance_d=0.09, inductance_q=0.03)
A = np.exp(2j * np.pi / 3)
BACK = np.array([1.0, A.conjugate(), A])  # phase x of a vector i: Re(i BACK_x)
NO_RESISTANCE = {"stator_resistance.resistance": 0.0}
BOTH = pytest.mark.parametrize("plant", [exact, switched])


def settled(plant, effects, u, n=800, **how):
    """Return the sample after a long time at constant voltage."""
    return plant(effects, [u] * n, **({"motor": NO_MAGNET} | how))[-1]


def shorted(plant, effects, omega, n=1200):
    """Return the samples of a driven motor without voltage (no pulses, no ripple) in the rotor's
    frame, settled."""
    i = plant(effects, [0j] * n, speed=omega / LINEAR.pole_pairs)
    return (i * np.exp(-1j * omega * TS * np.arange(n)))[800:]


def duties_of(u):
    legs = (u * BACK).real
    return 0.5 + (legs - 0.5 * (legs.max() + legs.min())) / U


def clarke(legs):
    return 2.0 / 3.0 * (legs @ BACK.conjugate())


def until(u, t, link=U):
    """Return the volt-seconds of a centred pattern until t (s)."""
    duty = duties_of(u)
    return clarke(link * np.clip(t - 0.5 * (1 - duty) * TS, 0.0, duty * TS))


@BOTH
def test_resistance_and_pulses_set_the_steady_sample(plant):
    """A linear circuit under centred pulses, exact (`pulsed`); the exact plant's drop is right to
    1e-5."""
    assert settled(plant, {"stator_resistance.resistance": 8.0}, 24 + 0j) == pytest.approx(
        pulsed(24.0, 8.0), rel=1e-5
    )


@BOTH
def test_magnet_flux_of_a_shorted_turning_motor(plant):
    """(R + j omega L) i = -j omega phi_m in the rotor frame; no pulses, the drop right to 1e-5."""
    omega = 300.0
    i = shorted(plant, {"magnet_flux.magnet_flux": 0.13}, omega)[-1]
    assert i == pytest.approx(-1j * omega * 0.13 / (R + 1j * omega * L), rel=1e-5)


@BOTH
def test_skin_effect_impedance_rises_with_frequency(plant):
    """Z(s) = R + s L + R_1 s tau/(1 + s tau): on a turning shorted rotor the stationary frame sees
    omega.

    5e-5: lags close over a line, omega T_s/2 = 0.05 of whose turn they do not see, squared over 24,
    of R_1 and R alike.
    """
    r_1, tau, omega = 5.0, 1e-3, 400.0
    i = shorted(plant, {"skin_effect.resistance": r_1, "skin_effect.time_constant": tau}, omega)[-1]
    s = 1j * omega
    assert i == pytest.approx(-s * 0.1 / (R + s * L + r_1 * s * tau / (1 + s * tau)), rel=5e-5)


@BOTH
def test_iron_loss_of_a_shorted_turning_motor(plant):
    core, tau, omega = 300.0, 5e-4, 400.0
    i = shorted(plant, {"iron_loss.core_resistance": core, "iron_loss.time_constant": tau}, omega)[
        -1
    ]
    expected = iron(omega, core, tau)[1]
    assert i == pytest.approx(expected, rel=5e-5)  # as the skin effect's
    assert abs(iron(omega, 1e9, tau)[1] - expected) > 1e-2 * abs(expected)


CORE = {
    "iron_loss.excess_current": 0.1,
    "iron_loss.time_constant": 5e-4,
    "iron_loss.hysteresis_current": 0.2,
    "iron_loss.hysteresis_reach": 0.1,
}


@BOTH
@pytest.mark.parametrize("left_out", ["", "excess_current", "hysteresis_current"])
def test_core_loss_of_a_shorted_turning_motor(plant, left_out):
    """Excess loss and hysteresis under a flux that turns, each alone and both.

    The root of excess loss begins straight within 1e-4 of the rated slope: at 0.4 of it the current
    is (1e-4/0.4)^2/4 smaller.  Of hysteresis the exact plant sees chords, which lie turn^2/12 of
    the flux inside of its circle.
    """
    effects = {k: 0.0 if left_out and k.endswith(left_out) else x for k, x in CORE.items()}
    psi, excess, hysteresis = turned_core(400.0, effects)
    found = shorted(plant, effects, 400.0)[-1]
    # beside what the skin effect's misses
    chords = abs(psi) / 0.01 * effects["iron_loss.hysteresis_current"] * (200.0 * TS) ** 2 / 12.0
    assert found == pytest.approx(-400j * psi / R, abs=5e-5 * abs(found) + chords)
    for own in (excess, hysteresis):
        assert own == 0.0 or abs(own) > 2e-2 * abs(found)


def test_losses_of_a_turning_flux_go_by_its_speed_and_size():
    """3/2 Re(i* j omega psi): omega^1.5 psi^1.5 of excess loss; of hysteresis 3/2 omega I_h
    sqrt(psi^2 - r^2): 2 pi r k sqrt(psi^2 - r^2) a turn."""
    alone = CORE | {"iron_loss.time_constant": 1e-5}
    found = [turned_core(omega, alone) for omega in (100.0, 400.0)]
    for omega, (psi, excess, hysteresis) in zip((100.0, 400.0), found, strict=True):
        power = [1.5 * (i.conjugate() * 1j * omega * psi).real for i in (excess, hysteresis)]
        size, rated = abs(psi), LINEAR.rated_omega * 0.1
        assert power[0] == pytest.approx(1.5 * 0.1 * (omega * size) ** 1.5 / math.sqrt(rated), 1e-4)
        assert power[1] == pytest.approx(1.5 * omega * 0.2 * math.sqrt(size**2 - 0.01**2))


@BOTH
def test_flux_harmonics_give_fifth_and_seventh_back_emf(plant):
    """Lines -5 and 7 of psi_d6 cos 6 theta + j psi_q6 sin 6 theta drive j omega psi each through
    R + j omega L."""
    d6, q6, omega, n = 0.002, 0.0012, 100.0, 251  # a turn within 1e-3
    i = plant(
        {"flux_harmonics.psi_d6": d6, "flux_harmonics.psi_q6": q6}, [0j] * 8 * n, speed=omega / 4
    )[-n:]
    t = TS * np.arange(7 * n, 8 * n)
    fit = np.linalg.lstsq(np.exp(1j * np.outer(t, omega * np.array([1, -5, 7]))), i, rcond=None)[0]
    for order, flux, found in zip(
        (1, -5, 7), (0.1, (d6 - q6) / 2, (d6 + q6) / 2), fit, strict=True
    ):
        assert found == pytest.approx(
            -1j * order * omega * flux / (R + 1j * order * omega * L), rel=1e-3
        ), order


@BOTH
def test_winding_asymmetry_unbalances_the_steady_current(plant):
    """(R + C diag(delta_a, delta_b, 0) C^+) i = u with Clarke's C; the ripple in the drop aside, (R
    T_s/L)^2/24."""
    effects = {"winding_asymmetry.delta_a": 0.8, "winding_asymmetry.delta_b": -0.5}
    c = np.array([[2, -1, -1], [0, math.sqrt(3), -math.sqrt(3)]]) / 3
    back = np.array([[1, 0], [-0.5, math.sqrt(0.75)], [-0.5, -math.sqrt(0.75)]])
    i = np.linalg.solve(R * np.eye(2) + c @ np.diag([0.8, -0.5, 0.0]) @ back, [15.0, 10.0])
    assert settled(plant, effects, 15 + 10j, theta=0.8) == pytest.approx(
        complex(*i), rel=(R * TS / L) ** 2 / 24
    )


@BOTH
@pytest.mark.parametrize("angle", [0.0, 0.3, 1.2, 4.0])
def test_dead_time_mean_loss(plant, angle):
    """Lost: u_dc t_d/T_s times the vector of signs; the pattern is late by t_d/2, which lifts the
    sample: see below."""
    t_d, u = 2e-6, 30 * np.exp(1j * angle)
    lost = U * t_d / TS * signs(u)
    ideal, late = settled(plant, {}, u), settled(plant, {"dead_time.time": t_d}, u)
    # of second order: R T_s/L
    assert late - ideal == pytest.approx(-lost / R + 0.5 * t_d * (u - lost) / L, rel=3e-3)


@BOTH
def test_dead_time_is_soft_around_zero_current(plant):
    """Within the width w the loss is a resistance, U t_d/T_s x 1/w, of 2 % of uncertainty by what
    ripple is left."""
    smooth = dataclasses.replace(NO_MAGNET, inductance_d=0.5, inductance_q=0.5)
    i = settled(
        plant,
        {"dead_time.time": 2e-6, "stator_resistance.resistance": 200.0},
        0.4 + 0j,
        motor=smooth,
    )
    assert i.real == pytest.approx(0.4 / (200 + U * 2e-6 / TS / (0.015 * 2.0)), rel=2e-2)


def test_dead_time_swallows_a_pulse_shorter_than_itself():
    """Current out of the leg of the narrow pulse, into the leg of the narrow gap: each loses or
    gains no more of it."""
    t_d = 2e-6
    for duty_time in (1.2e-6, 3e-6):
        reach = U * (1.0 - 2.0 * duty_time / TS)  # between highest and lowest leg
        # legs: a lowest, c highest, b between
        u = -reach / math.sqrt(3.0) * np.exp(-1j * math.pi / 6)
        plant = Exact({"dead_time.time": t_d} | NO_RESISTANCE, NO_MAGNET)
        # a generator: current against the voltage, out of the narrow leg
        current = -2.0 * u / abs(u)
        for _ in range(2):
            # every period alike, so that what a late pattern carries over its end it has carried in
            plant.w["psi_alpha"][0], plant.w["psi_beta"][0] = L * current.real, L * current.imag
            plant.w["volt_alpha"][0] = plant.w["volt_beta"][0] = 0.0
            plant.advance(u)
        duty, legs = duties_of(u), (current * BACK).real
        narrow = int(np.argmin(duty))
        assert duty[narrow] * TS == pytest.approx(duty_time, rel=1e-9)
        assert legs[narrow] > 0.5
        assert np.sort(np.abs(legs)) == pytest.approx(
            [0.0, math.sqrt(3.0), math.sqrt(3.0)], abs=1e-9
        )
        lost = np.where(np.abs(legs) < 0.1, 0.0, np.sign(legs)) * min(t_d, duty_time)
        assert plant.flux - L * current == pytest.approx(u * TS - clarke(U * lost), rel=1e-6)


@BOTH
def test_device_drop_lowers_the_steady_current(plant):
    u = 30 * np.exp(0.4j)
    i = settled(plant, {"device_drop.threshold": 0.9, "device_drop.on_resistance": 0.5}, u)
    assert i == pytest.approx((u - 0.9 * signs(u)) / (R + 0.5), rel=((R + 0.5) * TS / L) ** 2 / 24)


@BOTH
def test_dc_link_error_sags_with_the_power_drawn(plant):
    """Along alpha i_dc = 3/2 u i/V at the sample, so the pulses are of V - sag i_dc; i is theirs
    (`pulsed`)."""
    u, sag = 60.0, 25.0
    i = settled(plant, {"dc_link_error.sag": sag}, u + 0j)
    assert i == pytest.approx(pulsed(u, R, U - sag * 1.5 * u / U * i.real), rel=1e-5)
    assert u - i.real * R > 0.02 * u


@BOTH
def test_link_ripple_meets_a_delayed_pulse_in_its_later_middle(plant):
    """Without resistance a leg adds D T_s [V + A sin(w (t_mid + delay) + phase) sinc(w D T_s/2)];
    here w delay 0.8."""
    amplitude, f, phase, delay, n = 20.0, 3000.0, 0.5, 4e-5, 6
    u = 60.0 * np.exp(0.4j)
    effects = {
        "dc_link_ripple.amplitude": amplitude,
        "dc_link_ripple.frequency": f,
        "dc_link_ripple.phase": phase,
    }
    i = plant(effects | NO_RESISTANCE | {"pwm_delay.delay": delay}, [u] * (n + 1), NO_MAGNET)
    duty, middle = duties_of(u), (np.arange(n) + 0.5) * TS + delay
    sine = np.sin(2 * np.pi * f * middle[:, None] + phase) * np.sinc(f * duty * TS)
    expected = np.array([clarke(duty * TS * (U + amplitude * row)) for row in sine])
    assert np.diff(i) * L == pytest.approx(expected, rel=2e-4)
    assert np.abs(expected - u * TS).max() > 0.01 * abs(u) * TS


@BOTH
@pytest.mark.parametrize("s", [6e-5, 9e-5])
def test_sample_beyond_the_zero_vector_sees_the_true_link(plant, s):
    """i(t_k + s) = i_k + F(s)/L, duties formed with the link as read, volt-seconds of the true
    one."""
    gain, u = 0.06, np.array([150.0, 150.0, -90.0, 40j, 150.0]) * np.exp(0.2j)
    effects = {"dc_link_error.gain_error": gain, "current_sampling.delay": s}
    early = np.concatenate([[0j], np.cumsum((1 + gain) * u * TS / L)[:-1]])
    late = np.array([until(x, s, (1 + gain) * U) for x in u]) / L
    assert plant(effects | NO_RESISTANCE, u, NO_MAGNET) == pytest.approx(early + late, rel=1e-9)
    assert np.abs(late).max() > 0.1


@BOTH
def test_command_beyond_the_link_is_cut_by_the_reading(plant):
    """Duties end at 0 and 1 of the link as read; the true link, 10 % lower, is not what cuts
    them."""
    u = 380.0 + 0j
    duty = np.clip(duties_of(u), 0.0, 1.0)
    assert max(duty) == 1.0
    i = plant({"dc_link_error.gain_error": -0.1} | NO_RESISTANCE, [u] * 4, NO_MAGNET)
    assert np.diff(i) * L / TS == pytest.approx(
        [0.9 * U * (2 * duty[0] - duty[1] - duty[2]) / 3] * 3, rel=1e-9
    )


@BOTH
@pytest.mark.parametrize("theta", [0.0, 0.4])
def test_delayed_pattern_lifts_the_sample_along_the_inverse_inductance(plant, theta):
    """Steady state of a salient motor at rest: i = u/R + delay G u, G = turned diag(1/L_d, 1/L_q);
    both components."""
    delay, u = 3e-5, 30.0 * np.exp(0.5j)
    still = settled(plant, {}, u, 900, motor=SALIENT, theta=theta)
    i = settled(plant, {"pwm_delay.delay": delay}, u, 900, motor=SALIENT, theta=theta)
    assert still == pytest.approx(u / R, rel=2e-3)
    seen = u * np.exp(-1j * theta)
    lifted = complex(seen.real / 0.09, seen.imag / 0.03) * np.exp(1j * theta) * delay
    miss = (i - still) - lifted
    assert max(abs(miss.real), abs(miss.imag)) < 0.02 * abs(lifted)  # of second order: R delay/L
    assert min(abs(lifted.real), abs(lifted.imag)) > 0.1 * abs(lifted)


@BOTH
def test_pwm_delay_beyond_the_zero_vector_moves_volt_seconds_to_the_next_period(plant):
    """psi_k+1 - psi_k = u_k-1 T_s - F_k-1(T_s - delay) + F_k(T_s - delay), F(t) volt-seconds until
    t."""
    delay, u = 9e-5, np.array([0.0, 150.0, -150.0, 200.0, 50.0, 0.0])
    i = plant({"pwm_delay.delay": delay} | NO_RESISTANCE, u, NO_MAGNET)
    early = np.array([until(x, TS - delay) for x in u])
    assert np.diff(i)[1:] * L == pytest.approx(u[:-2] * TS - early[:-2] + early[1:-1], abs=1e-9)


@BOTH
@pytest.mark.parametrize("filter_time", [0.0, 4e-6])
def test_iron_loss_reads_the_slope_of_the_zero_vector(plant, filter_time):
    """Core far faster than the zero vector, at rest: sampled i_c = -R i/R_c, mean 0; a short filter
    adds tau R/L."""
    u, core = 30.0 * np.exp(0.3j), 2000.0
    effects = {"iron_loss.core_resistance": core, "iron_loss.time_constant": 1e-5}
    i = settled(plant, effects | {"current_filter.time_constant": filter_time}, u, 900)
    expected = u / R * (1 + filter_time * R / L) - u / core
    assert i == pytest.approx(expected, abs=0.05 * abs(u / core))  # tau/z and R/R_c aside


@BOTH
@pytest.mark.parametrize("delay", [1e-5, -1e-5])
def test_current_sampling_sees_the_zero_vector(plant, delay):
    """Up to the zero vector's end either way the reading is i exp(-R delay/L); (R T_s/2L)^2/24 of
    the drop."""
    expected = settled(plant, {}, 30 + 0j) * math.exp(-R * delay / L)
    assert settled(plant, {"current_sampling.delay": delay}, 30 + 0j) == pytest.approx(
        expected, rel=(R * TS / L / 2) ** 2 / 24 * R * 1e-5 / L
    )


@BOTH
def test_current_gain_and_offset_are_read(plant):
    """i g_0 + conj(i) g_2 and offsets: g_2 = (g_a + a^2 g_b + a g_c)/3, a = exp(2j pi/3), g_0 their
    mean."""
    gains = {"current_gain.gain_a": 1.01, "current_gain.gain_b": 0.98, "current_gain.gain_c": 1.04}
    g, u = np.array(list(gains.values())), [30.0 * np.exp(0.7j)] * 50
    offsets = {"current_offset.offset_a": 0.02, "current_offset.offset_b": -0.01}  # c: -0.01
    i, read = plant({}, u, NO_MAGNET), plant(gains | offsets, u, NO_MAGNET)
    expected = g.mean() * i + (g @ np.array([1.0, A * A, A])) / 3.0 * i.conjugate()
    assert read == pytest.approx(expected + clarke(np.array([0.02, -0.01, -0.01])), rel=1e-9)


def test_counts_round_to_the_nearest():
    """Reading less truth is between half a count down and half a count up, its mean 0: angle and
    current."""
    step, w = 0.01, Exact().w
    truth = np.random.default_rng(1).uniform(-1.0, 1.0, 4000)
    angle = np.array([encoder(w, add.WOBBLE, x, 0.0, step)[0] for x in truth]) - truth
    rig, rng = Exact().rig._replace(resolution=step), np.random.default_rng(0)
    current = np.array([read_current(x, rig, rng) for x in truth]) - truth
    for miss in (angle, current):
        assert abs(miss.mean()) < 0.02 * step
        assert (miss.min(), miss.max()) == (
            pytest.approx(-step / 2, rel=0.06),
            pytest.approx(step / 2, rel=0.06),
        )


def test_encoder_offset_and_encoder_eccentricity_and_their_slope():
    """theta + offset + p A sin(theta_mech + phase), and the slope of it: omega (1 + A
    cos(theta_mech + phase))."""
    effects = {"encoder_offset.offset": 0.04, "encoder_eccentricity.amplitude_mech": 0.01}
    effects |= {"encoder_eccentricity.phase": 0.3}
    plant = Exact(effects, rotor="driven", theta=7.0, speed=12.5)
    read, slope = plant.encoder
    assert read == pytest.approx(7.0 + 0.04 + 4 * 0.01 * math.sin(7.0 / 4 + 0.3), abs=1e-12)
    # a difference of 1e-6 rad
    assert slope == pytest.approx(50.0 * (1 + 0.01 * math.cos(7.0 / 4 + 0.3)), rel=1e-7)


def test_an_encoder_that_answers_late_reads_an_older_angle():
    """theta - latency omega, omega = 4 pole pairs of 12.5 rad/s; its slope is the speed."""
    read, slope = Exact(
        {"encoder_offset.latency": 2e-4}, rotor="driven", theta=7.0, speed=12.5
    ).encoder
    assert read == pytest.approx(7.0 - 2e-4 * 50.0, abs=1e-12)
    assert slope == pytest.approx(50.0, rel=1e-12)


def test_further_orders_of_the_encoder_add_up():
    """theta + p sum A_n sin(n theta_mech + phase_n), and the slope of it; parts 2 and 4, none
    between."""
    effects = {"encoder_eccentricity.amplitude_mech": 0.01, "encoder_eccentricity.phase": 0.3}
    effects |= {"encoder_eccentricity.2.amplitude_mech": 0.004}
    effects |= {"encoder_eccentricity.4.amplitude_mech": -0.002}
    effects |= {"encoder_eccentricity.4.order_mech": 4.0, "encoder_eccentricity.4.phase": 1.1}
    read, slope = Exact(effects, rotor="driven", theta=7.0, speed=12.5).encoder
    waves, x = ((1.0, 0.01, 0.3), (2.0, 0.004, 0.0), (4.0, -0.002, 1.1)), 7.0 / 4
    off = sum(a * math.sin(n * x + phase) for n, a, phase in waves)
    bent = sum(n * a * math.cos(n * x + phase) for n, a, phase in waves)
    assert read == pytest.approx(7.0 + 4 * off, abs=1e-12)
    assert slope == pytest.approx(50.0 * (1 + bent), rel=1e-7)  # a difference of 1e-6 rad
