"""What the switched bench has beside the effect library: hysteresis, shorted turns, a knee, a fan,
curved sensors."""

import dataclasses
import math

import numpy as np
import pytest

from model.drive_files import load_drive
from model.effects.card import SUBSYSTEMS
from model.errors import BadInput
from sandbox.drive.switched_loop import encoder_slope
from sandbox.switched.advance import encoder, replay, sensor, start
from sandbox.switched.bench_numbers import bench, quiet
from sandbox.switched.bench_state import Slot
from sandbox.switched.phase_machine import (
    accelerations,
    current_and_torque,
    friction,
    pull,
    stored_energy,
)
from sandbox.switched.unlisted import UNLISTED, unlisted

DRIVE = load_drive("ipm_exchanged")
BENCH = quiet(bench(DRIVE.motor, DRIVE.converter))


def test_hysteresis_loop_has_the_area_of_a_play():
    """Alternating flux of amplitude A, play r, slope g: a parallelogram of area 4 g r (A - r),
    width 2 g r."""
    b = BENCH._replace(grip=3.0, grip_radius=0.02)
    n, amplitude, held = 20000, 0.09, complex(0.0, 0.0)
    # the second turn is periodic
    psi = amplitude * np.sin(2.0 * np.pi * 2.0 * np.arange(n + 1) / n)
    i = np.empty(n + 1)
    for k in range(n + 1):
        held = psi[k] - pull(b, complex(psi[max(k - 1, 0)]), complex(psi[k]), held)
        i[k] = 3.0 * (psi[k] - held).real
    area = np.sum(0.5 * (i[n // 2 + 1 :] + i[n // 2 : -1]) * np.diff(psi[n // 2 :]))
    assert area == pytest.approx(4.0 * 3.0 * 0.02 * (0.09 - 0.02), rel=1e-3)
    assert i.max() == pytest.approx(3.0 * 0.02, rel=1e-9)


def test_turning_flux_loses_what_the_play_drags():
    """A circle of radius A: the held flux runs on sqrt(A^2 - r^2), at right angles behind; loss 2
    pi g r sqrt(...)."""
    b = BENCH._replace(grip=3.0, grip_radius=0.02)
    n, held, loss = 20000, complex(0.09, 0.0), 0.0
    psi = 0.09 * np.exp(2j * np.pi * 3.0 * np.arange(n + 1) / n)
    for k in range(1, n + 1):
        ahead = pull(b, psi[k - 1], psi[k], held)
        held = psi[k] - ahead
        if k > 2 * n // 3:
            step = psi[k] - psi[k - 1]
            loss += 3.0 * (ahead * step.conjugate()).real
    assert loss == pytest.approx(
        2.0 * math.pi * 3.0 * 0.02 * math.sqrt(0.09**2 - 0.02**2), rel=2e-3
    )


def test_hysteresis_in_the_bench_is_a_slope_while_the_flux_stays_in_the_play():
    """Small pulses at locked rotor, inside the play: as if 1/L were larger by `grip`."""
    linear = dataclasses.replace(
        DRIVE.motor, alpha_30=0, alpha_12=0, alpha_40=0, alpha_22=0, alpha_04=0
    )
    n = 40
    u = np.where(np.arange(n) % 8 < 4, 5.0, -5.0)
    grip = 4.0
    held = quiet(bench(linear, DRIVE.converter))._replace(grip=grip, grip_radius=1.0)
    stiff = dataclasses.replace(
        linear,
        **{
            f"inductance_{x}": 1.0 / (1.0 / getattr(linear, f"inductance_{x}") + grip) for x in "dq"
        },
    )
    columns = (u, 0.0 * u, 400.0)
    a, b = (
        replay(x, "locked", *columns)["i_a"] for x in (held, quiet(bench(stiff, DRIVE.converter)))
    )
    assert a == pytest.approx(b, abs=1e-9)
    assert (
        np.abs(a - replay(quiet(bench(linear, DRIVE.converter)), "locked", *columns)["i_a"]).max()
        > 1e-3
    )
    assert start(held, 0.7)[Slot.HELD_ALPHA] == pytest.approx(math.cos(0.7) * linear.magnet_flux)


def phasor(v, omega, ohm, henry, share, fault, leakage):
    """Return i_alpha, i_beta of a star with a part of phase a shorted: five equations in phase
    quantities."""
    flux = henry * (np.eye(3) - 1.0 / 3.0)  # no zero-sequence flux
    a = np.zeros((5, 5), complex)  # i_a, i_b, i_c, i_f, star point
    turns = np.array([share, 0.0, 0.0])
    for k in range(3):
        a[k, :3] = 1j * omega * flux[k]
        a[k, k] += ohm
        a[k, 3] = -1j * omega * flux[k] @ turns - (ohm * share if k == 0 else 0.0)
        a[k, 4] = 1.0
    a[3, :3] = share * 1j * omega * flux[0]
    a[3, 0] += share * ohm
    a[3, 3] = -share * 1j * omega * flux[0] @ turns - share * ohm - fault - 1j * omega * leakage
    a[4, :3] = 1.0
    phases = np.array(
        [v[0], -0.5 * v[0] + math.sqrt(0.75) * v[1], -0.5 * v[0] - math.sqrt(0.75) * v[1]]
    )
    i = np.linalg.solve(a, np.append(phases, [0.0, 0.0]))[:3]
    return (2.0 * i[0] - i[1] - i[2]) / 3.0, (i[1] - i[2]) / math.sqrt(3.0)


@pytest.mark.parametrize("hertz", [10.0, 50.0])
def test_short_circuited_turns_as_coupled_windings(hertz):
    """Sinusoidal voltage at locked rotor against the phasors of coupled windings; 2e-3: the pulses'
    own ripple.

    The loop's own zero-sequence flux, share^2 L / 3 at most, is what the bench leaves out (here
    1e-3 of the loop).
    """
    motor = dataclasses.replace(
        DRIVE.motor,
        inductance_q=DRIVE.motor.inductance_d,
        magnet_flux=0.0,
        alpha_30=0,
        alpha_12=0,
        alpha_40=0,
        alpha_22=0,
        alpha_04=0,
    )
    share, fault = 0.2, 1.0
    total = fault + share * motor.resistance
    leakage = 2e-3 * total
    shorted = quiet(bench(motor, DRIVE.converter))._replace(
        short_conductance=2.0 / 3.0 * share**2 / total, short_time=2e-3
    )
    n = round(4000.0 / hertz) * 10
    t = np.arange(n) * 250e-6
    turn = 2.0 * np.pi * hertz * (t + 125e-6)  # the middle of the period a command acts in
    out = replay(shorted, "locked", 20.0 * np.cos(turn), 20.0 * np.sin(turn), 400.0)
    last = slice(n - round(4000.0 / hertz), n)
    basis = 2.0 * np.mean(
        np.stack([out["i_a"], (out["i_b"] - out["i_c"]) / math.sqrt(3.0)])[:, last]
        * np.exp(-2j * np.pi * hertz * t[last]),
        axis=1,
    )
    omega = 2.0 * np.pi * hertz
    expected = np.array(
        phasor((20.0, -20.0j), omega, motor.resistance, motor.inductance_d, share, fault, leakage)
    )
    healthy = np.array(
        phasor((20.0, -20.0j), omega, motor.resistance, motor.inductance_d, 1e-9, fault, leakage)
    )
    assert (
        np.abs(basis - expected).max()
        < 0.02 * np.abs(healthy - expected).max() + 1e-3 * np.abs(healthy).max()
    )
    assert np.abs(healthy - expected).max() > 0.03 * np.abs(healthy).max()


def test_knee_is_the_gradient_of_its_energy_and_makes_no_torque_of_its_own():
    b = BENCH._replace(knee=50.0, knee_flux=0.05)
    psi, theta, h = complex(0.16, 0.11), 0.4, 1e-6
    i, torque = current_and_torque(b, psi, theta)
    by_energy = complex(
        (stored_energy(b, psi + h, theta) - stored_energy(b, psi - h, theta)) / (2 * h),
        (stored_energy(b, psi + 1j * h, theta) - stored_energy(b, psi - 1j * h, theta)) / (2 * h),
    )
    assert i == pytest.approx(by_energy, rel=1e-7)
    slope = (stored_energy(b, psi, theta + h) - stored_energy(b, psi, theta - h)) / (2 * h)
    assert torque == pytest.approx(-1.5 * 6 * slope, rel=1e-6)
    assert abs(i - current_and_torque(BENCH, psi, theta)[0]) > 0.1


def test_common_offset_is_in_all_three_readings():
    u = np.zeros(20)
    a, b = (
        replay(BENCH, "locked", u, u, 400.0),
        replay(BENCH._replace(common_offset=0.01), "locked", u, u, 400.0),
    )
    for phase in ("i_a", "i_b", "i_c"):
        assert b[phase] - a[phase] == pytest.approx(np.full(20, 0.01), abs=1e-12)


def test_neutral_sensors_and_loads_are_the_ones_without_by_the_bit():
    """Gain, offset and a load torque alone, in the order in which the bench without them
    computes."""
    assert all(getattr(BENCH, name) == 0.0 for name in UNLISTED)
    rng = np.random.default_rng(4)
    none, b = BENCH._replace(resolution=0.0), BENCH._replace(gain_a=1.013, inertia=0.0123)
    for i, offset, torque, load, speed in rng.standard_normal((200, 5)):
        assert sensor(none, i, 1.013, offset, rng) == 1.013 * i + offset
        a, _ = accelerations(b, torque, load, 0.3, speed, speed, 0.0)
        assert a == (torque - friction(b, speed) - load) / b.inertia


@pytest.mark.parametrize("direction", [1.0, -1.0])
def test_a_fan_alone_slows_a_rotor_hyperbolically(direction):
    """J d omega/dt = -k omega |omega|: omega = omega_0 / (1 + k omega_0 t / J); no magnet, no
    friction, no current."""
    motor = dataclasses.replace(DRIVE.motor, magnet_flux=0.0, viscous_friction=0.0)
    b = quiet(bench(motor, DRIVE.converter))
    k, first, n = 0.05 * motor.inertia, 40.0, 4000
    u, t = np.zeros(n), np.arange(n) * DRIVE.converter.sampling_period
    out = replay(b._replace(fan=k), "free", u, u, 400.0, speed=direction * first)
    assert out["speed"] == pytest.approx(
        direction * first / (1.0 + k * first / motor.inertia * t), rel=1e-9
    )
    assert abs(out["speed"][-1]) < 0.4 * first
    assert replay(b, "free", u, u, 400.0, speed=direction * first)["speed"] == pytest.approx(
        direction * first
    )


def test_a_fan_turns_with_the_load_behind_a_shaft():
    b = BENCH._replace(fan=2e-3, load_inertia=3e-3, stiffness=50.0, damping=0.1)
    without = accelerations(b._replace(fan=0.0), 1.0, 0.2, 0.3, 10.0, -12.0, 1e-3)
    found = accelerations(b, 1.0, 0.2, 0.3, 10.0, -12.0, 1e-3)
    assert found[0] == without[0]
    assert found[1] - without[1] == pytest.approx(2e-3 * 12.0**2 / 3e-3)


def test_a_curved_sensor_loses_by_the_square():
    """Each phase on its own, gain on what is left; the true currents are those of straight
    sensors."""
    u = 15.0 * np.sin(np.arange(400) / 30.0)
    curvature, columns = 0.04 / DRIVE.motor.rated_current**2, (u, 0.3 * u, 400.0)
    straight, curved = (
        replay(b._replace(gain_a=1.02), "locked", *columns)
        for b in (BENCH, BENCH._replace(curvature=curvature))
    )
    for phase, gain in (("i_a", 1.02), ("i_b", 1.0), ("i_c", 1.0)):
        true = straight[phase] / gain
        assert curved[phase] == pytest.approx(gain * (true - curvature * true**3), abs=1e-12)
    assert np.array_equal(straight["torque"], curved["torque"])
    assert np.abs(straight["i_a"] - curved["i_a"]).max() > 0.01 * DRIVE.motor.rated_current


def test_a_resolver_errs_twice_a_mechanical_turn():
    """Reading = theta + p a sin(2 theta_mech + phase), a in mechanical rad, and its slope
    by differences."""
    b = unlisted(BENCH, {"resolver": 4e-3, "resolver_phase": 0.7})
    theta = np.linspace(-40.0, 40.0, 301)
    read = np.array([encoder(b, x) for x in theta])
    assert read == pytest.approx(theta + 6 * 4e-3 * np.sin(2.0 * theta / 6 + 0.7), abs=1e-12)
    h, speed = 1e-5, 12.0
    for x in (0.3, 2.0, -5.0):
        slope = (encoder(b, x + h) - encoder(b, x - h)) / (2 * h) * 6 * speed
        assert encoder_slope(b, x, speed) == pytest.approx(slope, rel=1e-8)
        assert encoder_slope(b, x, speed) != pytest.approx(6 * speed, rel=1e-4)
    out = replay(b, "driven", 0 * theta, 0 * theta, 400.0, theta=theta)
    assert out["theta"] == pytest.approx(read, abs=1e-12)
    assert out["position"] == pytest.approx(theta, abs=1e-12)


def test_names_outside_the_library_are_checked():
    assert {one.subsystem for one in UNLISTED.values()} == set(SUBSYSTEMS)
    with pytest.raises(
        BadInput, match="unknown effect outside the library 'fann'; did you mean 'fan'"
    ):
        unlisted(BENCH, {"fann": 1e-5})
    for bad in (-1.0, math.nan, True, "x"):
        with pytest.raises(
            BadInput, match=r"fan = .* is out of range; give a number in \[0, 1000\] N m s"
        ):
            unlisted(BENCH, {"fan": bad})
    with pytest.raises(
        BadInput, match="link_rate = 3000 alone does nothing sound; give link_impedance"
    ):
        unlisted(BENCH, {"link_rate": 3000.0})
    with pytest.raises(
        BadInput, match=r"least_pulse = 0\.0002 s is out of range; give less than half"
    ):
        unlisted(BENCH, {"least_pulse": 2e-4})


@pytest.mark.parametrize(
    ("name", "share"), [("least_pulse", 0.5), ("least_vector", 0.5), ("channel_lag", 0.1)]
)
def test_times_stay_below_their_share_of_the_period(name, share):
    """Just below is taken, the share itself is not."""
    least = share * BENCH.period
    assert getattr(unlisted(BENCH, {name: 0.99 * least}), name) == 0.99 * least
    with pytest.raises(BadInput, match=f"{name} = .* out of range; give less than"):
        unlisted(BENCH, {name: least})
