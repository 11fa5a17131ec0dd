"""Effects where they meet: closed forms for signs, factors and guards that one effect alone does not show."""

import dataclasses
import math

import numpy as np
import pytest

from model.effects.coulomb_friction import drag
from model.effects.encoder_offset import read as encoder_read
from model.effects.skin_effect import slope as skin_slope
from model.parameters import Converter, Motor
from sandbox.loop import Rig, read_current, read_phases
from sandbox.oldplant import PHI_D, PHI_Q
from sandbox.switched.effects import bench, quiet
from sandbox.switched.machine import friction
from sandbox.switched.simulate import replay
from tests.sandbox.averaged import Averaged, vector

L, R, U, TS = 0.05, 10.0, 400.0, 250e-6
BLANK = Motor("blank", 4, R, 0.0, L, L, 1e-3, 2.0, 1.0, 1000.0)
SALIENT = dataclasses.replace(BLANK, inductance_d=0.09, inductance_q=0.03)
CONVERTER = Converter(TS, U, 0.0, 0.0)
A = np.exp(2j * np.pi / 3)
BACK = np.array([1.0, A.conjugate(), A])  # phase x of a vector i: Re(i BACK_x)


def averaged(effects, u, motor=BLANK, resistance=None, theta=0.0):
    return Averaged(motor, CONVERTER, effects, resistance=resistance, theta=theta).run(np.asarray(u, complex))


def switched(effects, u, motor=BLANK, resistance=None, theta=0.0):
    b = quiet(bench(motor, CONVERTER, effects))
    b = b if resistance is None else b._replace(resistance=resistance)
    u = np.asarray(u, complex)
    return vector(replay(b, "locked", u.real.copy(), u.imag.copy(), U, theta=theta))


def duties_of(u):
    legs = (u * BACK).real
    return 0.5 + (legs - 0.5 * (legs.max() + legs.min())) / U


def clarke(legs):
    return 2.0 / 3.0 * (legs @ BACK.conjugate())


def until(u, t, link=U):
    """Return the volt-seconds of a centred pattern until t (s)."""
    duty = duties_of(u)
    return clarke(link * np.clip(t - 0.5 * (1 - duty) * TS, 0.0, duty * TS))


BOTH = pytest.mark.parametrize("plant", [averaged, switched])


@BOTH
def test_link_ripple_meets_a_delayed_pulse_in_its_later_middle(plant):
    """Without resistance a leg adds D T_s [V + A sin(w (t_mid + delay) + phase) sinc(w D T_s/2)]; here w delay 0.8."""
    amplitude, f, phase, delay, n = 20.0, 3000.0, 0.5, 4e-5, 6
    u = 60.0 * np.exp(0.4j)
    i = plant(
        {"dc_link_ripple.amplitude": amplitude, "dc_link_ripple.frequency": f, "dc_link_ripple.phase": phase,
         "pwm_delay.delay": delay}, [u] * (n + 1), resistance=0.0,
    )  # fmt: skip
    duty, middle = duties_of(u), (np.arange(n) + 0.5) * TS + delay
    sine = np.sin(2 * np.pi * f * middle[:, None] + phase) * np.sinc(f * duty * TS)
    expected = np.array([clarke(duty * TS * (U + amplitude * row)) for row in sine])
    assert np.diff(i) * L == pytest.approx(expected, rel=2e-4)  # Runge-Kutta over a third of the ripple's period
    assert np.abs(expected - u * TS).max() > 0.01 * abs(u) * TS


@BOTH
@pytest.mark.parametrize("s", [6e-5, 9e-5])
def test_sample_beyond_the_zero_vector_sees_the_true_link(plant, s):
    """i(t_k + s) = i_k + F(s)/L, duties formed with the link as read, volt-seconds of the true one."""
    gain, u = 0.06, np.array([150.0, 150.0, -90.0, 40j, 150.0]) * np.exp(0.2j)
    effects = {"dc_link_error.gain_error": gain, "current_sampling.delay": s}
    early = np.concatenate([[0j], np.cumsum((1 + gain) * u * TS / L)[:-1]])
    late = np.array([until(x, s, (1 + gain) * U) for x in u]) / L
    assert plant(effects, u, resistance=0.0) == pytest.approx(early + late, rel=1e-9)
    assert np.abs(late).max() > 0.1


@BOTH
def test_command_beyond_the_link_is_cut_by_the_reading(plant):
    """Duties end at 0 and 1 of the link as read; the true link, 10 % lower, is not what cuts them."""
    u = 380.0 + 0j
    duty = np.clip(duties_of(u), 0.0, 1.0)
    assert max(duty) == 1.0
    i = plant({"dc_link_error.gain_error": -0.1}, [u] * 4, resistance=0.0)
    assert np.diff(i) * L / TS == pytest.approx([0.9 * U * (2 * duty[0] - duty[1] - duty[2]) / 3] * 3, rel=1e-9)


@BOTH
@pytest.mark.parametrize("theta", [0.0, 0.4])
def test_delayed_pattern_lifts_the_sample_along_the_inverse_inductance(plant, theta):
    """Steady state of a salient motor at rest: i = u/R + delay G u, G = turned diag(1/L_d, 1/L_q); both components."""
    delay, u = 3e-5, 30.0 * np.exp(0.5j)
    still = plant({}, [u] * 900, SALIENT, theta=theta)[-1]
    i = plant({"pwm_delay.delay": delay}, [u] * 900, SALIENT, theta=theta)[-1]
    assert still == pytest.approx(u / R, rel=2e-3)
    seen = u * np.exp(-1j * theta)
    lifted = complex(seen.real / 0.09, seen.imag / 0.03) * np.exp(1j * theta) * delay
    miss = (i - still) - lifted
    assert max(abs(miss.real), abs(miss.imag)) < 0.02 * abs(lifted)  # of second order: R delay/L
    assert min(abs(lifted.real), abs(lifted.imag)) > 0.1 * abs(lifted)


@BOTH
@pytest.mark.parametrize("filter_time", [0.0, 4e-6])
def test_iron_loss_reads_the_slope_of_the_zero_vector(plant, filter_time):
    """Core far faster than the zero vector, at rest: sampled i_c = -R i/R_c, mean 0; a short filter adds tau R/L."""
    u, core = 30.0 * np.exp(0.3j), 2000.0
    effects = {"iron_loss.core_resistance": core, "iron_loss.time_constant": 1e-5}
    i = plant(effects | {"current_filter.time_constant": filter_time}, [u] * 900)[-1]
    expected = u / R * (1 + filter_time * R / L) - u / core
    assert i == pytest.approx(expected, abs=0.05 * abs(u / core))  # tau/z and R/R_c aside


@pytest.mark.parametrize("duty_time", [1.2e-6, 3e-6])
def test_dead_time_swallows_a_pulse_shorter_than_itself(duty_time):
    """Current out of the leg of the narrow pulse: it loses min(t_d, D T_s), no more; the others lose or gain t_d.

    Every period alike, so what a late pattern carries over the end it has carried in; without resistance.
    """
    t_d, reach = 2e-6, U * (1.0 - 2.0 * duty_time / TS)  # between highest and lowest leg
    u = -reach / math.sqrt(3.0) * np.exp(-1j * math.pi / 6)  # legs: a lowest, c highest, b between
    a = Averaged(BLANK, CONVERTER, {"dead_time.time": t_d}, resistance=0.0)
    current = -2.0 * u / abs(u)  # a generator: current against the voltage, out of the narrow leg
    for _ in range(2):
        a.x[PHI_D], a.x[PHI_Q] = L * current.real, L * current.imag
        v = a.advance(u)
    duty, legs = duties_of(u), (current * BACK).real
    narrow = int(np.argmin(duty))
    assert duty[narrow] * TS == pytest.approx(duty_time, rel=1e-9)
    assert legs[narrow] > 0.5
    lost = np.where(np.abs(legs) < 0.1, 0.0, np.sign(legs)) * t_d
    lost[narrow] = min(t_d, duty_time)
    assert v == pytest.approx(u - clarke(U * lost / TS), rel=1e-6)


def test_third_sensors_gain_is_read():
    """g_2 = (g_a + a^2 g_b + a g_c)/3 with a = exp(2j pi/3), g_0 their mean: both plants' readings."""
    gains = {"current_gain.gain_a": 1.01, "current_gain.gain_b": 0.98, "current_gain.gain_c": 1.04}
    g = np.array(list(gains.values()))
    i = 2.0 * np.exp(1j * np.linspace(0.0, 6.0, 40))
    expected = g.mean() * i + (g @ np.array([1.0, A * A, A])) / 3.0 * i.conjugate()
    sensors = Averaged(BLANK, CONVERTER, gains).effects.sensors
    rig, rng = Rig(*6 * (0,), TS, 0.0, 0.0, 0.0, U, 0.0), np.random.default_rng(0)
    rows = np.array([read_phases(x.real, x.imag, sensors, rig, rng) for x in i])
    assert clarke(rows) == pytest.approx(expected, rel=1e-12)
    u = 30.0 * np.exp(0.7j)
    exact, read = switched({}, [u] * 50)[-1], switched(gains, [u] * 50)[-1]
    assert read == pytest.approx(g.mean() * exact + (g @ np.array([1.0, A * A, A])) / 3.0 * exact.conjugate(), rel=1e-9)


def test_counts_round_to_the_nearest():
    """Reading less truth is between half a count down and half a count up, its mean 0: angle and current."""
    step = 0.01
    truth = np.random.default_rng(1).uniform(-1.0, 1.0, 4000)
    angle = np.array([encoder_read(x, 0.0, 0.0, step) for x in truth]) - truth
    rig, rng = Rig(*6 * (0,), TS, 0.0, step, 0.0, U, 0.0), np.random.default_rng(0)
    current = np.array([read_current(x, rig, rng) for x in truth]) - truth
    for miss in (angle, current):
        assert abs(miss.mean()) < 0.02 * step
        assert (miss.min(), miss.max()) == (pytest.approx(-step / 2, rel=0.06), pytest.approx(step / 2, rel=0.06))


def test_stribecks_hump_adds_to_dry_friction_at_low_speed():
    """Level T_c + T_s exp(-(w/w_s)^2) on both plants: T_c + T_s/e at w_s, more below, T_c far above; odd in speed."""
    for omega, hump in ((5.0, math.exp(-1.0)), (-5.0, math.exp(-1.0)), (2.5, math.exp(-0.25)), (50.0, 0.0)):
        expected = (0.1 + 0.06 * hump) * math.tanh(omega / 2.0)
        assert drag(0.1, 2.0, 0.06, 5.0, omega) == pytest.approx(expected, rel=1e-12)
        b = bench(BLANK, CONVERTER, {"coulomb_friction.torque": 0.1, "coulomb_friction.stribeck_torque": 0.06})
        assert friction(b, omega) == pytest.approx(expected, rel=1e-12)


def test_slow_part_of_the_current_stands_in_the_stationary_frame():
    """tau dx/dt = i - x there is tau (dx/dt + j omega x) = i - x in the rotor frame: both components, both signs."""
    tau, i, x, omega = 3e-4, 1.0 - 0.4j, 0.3 + 0.7j, 250.0
    expected = (i - x) / tau - 1j * omega * x
    assert skin_slope(tau, i.real, i.imag, x.real, x.imag, omega) == pytest.approx((expected.real, expected.imag))
