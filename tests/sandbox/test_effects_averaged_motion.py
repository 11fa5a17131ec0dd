"""Motion of a free rotor under each effect in closed form (averaged kernel); then the energy balance of all at once."""

import math

import numpy as np
import pytest

from model.effects.coulomb_friction import drag as coulomb_drag
from model.effects.inductance_harmonics import energy as harmonic_energy
from model.effects.library import complete as library_complete
from model.energy import energy
from model.frames import phases, stationary
from model.parameters import load_drive
from model.pulses import duties
from sandbox.effects import compiled as effects_compiled
from sandbox.effects import start as effects_start
from sandbox.full import CLOCK, LOAD_OMEGA, TWIST, advance, sixth, terminal
from sandbox.inverter import deliver, leg_links
from sandbox.oldplant import OMEGA, PHI_D, PHI_Q, THETA
from tests.sandbox.averaged import Averaged
from tests.sandbox.effect_motors import CONVERTER, IPM, LINEAR, NO_MAGNET, TS, U


def make(effects=None, motor=LINEAR, **how):
    return Averaged(motor, CONVERTER, effects, **how)


def coasting(effects, n=400, omega=400.0, theta=0.0, load=0.0):
    """Return mechanical speeds and angles of a free motor without magnet, and where it ended."""
    a = make(effects, NO_MAGNET, free=True, omega=omega, theta=theta)
    out = []
    for _ in range(n):
        out.append((a.x[OMEGA] / 4, a.x[THETA] / 4))
        a.advance(0j, load)
    return *np.array(out).T, a


def test_inertia_sets_the_acceleration():
    speed, _, _ = coasting({"inertia.inertia": 2e-3}, omega=0.0, load=0.3)
    assert speed[399] == pytest.approx(-0.3 / 2e-3 * 399 * TS, rel=1e-12)


def test_coulomb_friction_slows_at_a_constant_rate_and_has_stribecks_hump():
    speed, _, _ = coasting({"coulomb_friction.torque": 0.1})
    assert speed[399] == pytest.approx(100 - 0.1 / 1e-3 * 399 * TS, rel=1e-6)
    assert coulomb_drag(0.1, 2.0, 0.06, 5.0, 5.0) == pytest.approx((0.1 + 0.06 * math.exp(-1)) * math.tanh(2.5))
    slow, _, _ = coasting(
        {"coulomb_friction.torque": 0.1}, omega=2.0, n=200
    )  # sinh(w/width) decays as exp(-t T/(J width))
    expected = 2.0 * np.arcsinh(math.sinh(0.25) * np.exp(-0.1 / (1e-3 * 2.0) * TS * np.arange(200)))
    assert slow == pytest.approx(expected, abs=1e-5)


def test_viscous_friction_slows_exponentially():
    speed, _, _ = coasting({"viscous_friction.coefficient": 4e-3})
    assert speed[399] == pytest.approx(100 * math.exp(-4.0 * 399 * TS), rel=1e-9)


def test_cogging_torque_oscillates_like_a_pendulum():
    effects = {"cogging_torque.amplitude": 0.2, "cogging_torque.order_mech": 12.0, "cogging_torque.phase": math.pi}
    _, angle, _ = coasting(effects, n=2000, omega=0.0, theta=0.004)
    rate = math.sqrt(0.2 * 12 / 1e-3)
    assert angle == pytest.approx(0.001 * np.cos(rate * TS * np.arange(2000)), abs=5e-6)


def test_shaft_compliance_resonates_at_its_frequency():
    """Twist after a load step: rate sqrt(K (1/J_1 + 1/J_2)), here without damping; total inertia unchanged."""
    effects = {"shaft_compliance.stiffness": 300.0, "shaft_compliance.load_inertia": 4e-4}
    a = make(effects | {"shaft_compliance.damping_ratio": 0.0}, NO_MAGNET, free=True)
    rate, tau, n, twist = math.sqrt(300.0 * (1 / 6e-4 + 1 / 4e-4)), 0.05, 1000, []
    for _ in range(n):
        twist.append(a.x[TWIST])
        a.advance(0j, tau)
    steady = tau * 6e-4 / 1e-3 / 300.0
    assert np.array(twist) == pytest.approx(steady * (1 - np.cos(rate * TS * np.arange(n))), abs=2e-3 * steady)
    momentum = (6e-4 * a.x[OMEGA] + 4e-4 * a.x[LOAD_OMEGA]) / 4
    assert momentum == pytest.approx(-tau * n * TS, rel=1e-9)


ALL_ON = {
    "stator_resistance.resistance": 13.0, "flux_harmonics.psi_d6": 0.003, "flux_harmonics.psi_q6": -0.002,
    "inductance_harmonics.gamma_6": 0.6, "iron_loss.core_resistance": 1500.0, "iron_loss.time_constant": 2e-4,
    "skin_effect.resistance": 3.0, "skin_effect.time_constant": 3e-4, "winding_asymmetry.delta_a": 0.5,
    "winding_asymmetry.delta_b": -0.3, "device_drop.threshold": 1.0, "device_drop.on_resistance": 0.3,
    "dead_time.time": 2e-6, "dc_link_error.gain_error": 0.02, "dc_link_error.sag": 20.0,
    "dc_link_ripple.amplitude": 8.0, "pwm_delay.delay": 1e-5,
    "coulomb_friction.torque": 0.03, "coulomb_friction.stribeck_torque": 0.01, "viscous_friction.coefficient": 5e-4,
    "cogging_torque.amplitude": 0.05, "cogging_torque.order_mech": 12.0, "shaft_compliance.stiffness": 300.0,
    "shaft_compliance.load_inertia": 4e-4,
}  # fmt: skip


def account(a, u, load):
    """Return power in, power lost, power to the load (W) and stored energy (J) of the kernel's state."""
    x, p, m, f = a.x, a.plant, a.effects.machine, a.effects.shaft
    c, s = math.cos(x[THETA]), math.sin(x[THETA])
    y = (x[0], x[1], x[2], x[4], x[5], x[6], x[7], x[8], x[9])
    i = complex(*terminal(p, m, c, -s, y))
    core, slow = complex(x[4], x[5]), complex(x[6], x[7]) * complex(c, s)
    i_a, i_b = i.real, -i.real / 2 + math.sqrt(0.75) * i.imag
    lost = 1.5 * (p.resistance + m.on_resistance) * abs(i) ** 2 + m.delta_a * i_a**2 + m.delta_b * i_b**2
    lost += 1.5 * m.skin_resistance * abs(i - slow) ** 2 + 1.5 * abs(core) ** 2 / m.core_conductance
    w, w_load = x[OMEGA] / p.pole_pairs, x[LOAD_OMEGA] / p.pole_pairs
    lost += p.viscous * w * w + coulomb_drag(f.coulomb, f.width, f.stribeck, f.stribeck_speed, w) * w
    lost += f.damping * (w - w_load) ** 2
    c_6, s_6 = sixth(c, s)
    d, q = x[PHI_D] - m.psi_d6 * c_6, x[PHI_Q] - m.psi_q6 * s_6
    magnetic_energy = energy(p.energy, d, q) + harmonic_energy(m.gamma_6, c_6, s_6, d, q)
    magnetic_energy += 0.5 * m.skin_resistance * m.skin_time * abs(slow) ** 2
    magnetic_energy += 0.5 * m.core_time / m.core_conductance * abs(core) ** 2
    j_motor, j_load = p.pole_pairs / p.acceleration, p.pole_pairs / f.load_acceleration
    stored = 1.5 * magnetic_energy + 0.5 * (j_motor * w**2 + j_load * w_load**2 + f.stiffness * x[TWIST] ** 2)
    stored += f.cogging / f.cogging_order * math.cos(f.cogging_order * x[THETA] / p.pole_pairs + f.cogging_phase)
    return 1.5 * (u * i.conjugate()).real, lost, load * w_load, stored


def terminal_current(a):
    """Return the terminal current vector (A) of the kernel's state."""
    c, s = math.cos(a.x[THETA]), math.sin(a.x[THETA])
    return complex(*terminal(a.plant, a.effects.machine, c, -s, tuple(a.x[[0, 1, 2, 4, 5, 6, 7, 8, 9]])))


def test_energy_balance_with_everything_on():
    """Terminals in = load + losses + stored, by the trapezoidal rule over steps of 2 us; link = terminals + inverter.

    What the inverter takes is V t_d |i| + threshold |i| T_s a leg and period (i: mean of both samples; the ripple at
    the edges and the half-sine of zero crossings are a few percent of it).
    """
    a = make(ALL_ON, IPM, free=True, step=2e-6)
    e, load = a.effects, 0.2
    total, before, inverter, expected = np.zeros(3), account(a, 0j, load)[3], 0.0, 0.0
    for k in range(400):
        i = terminal_current(a)
        axis = np.exp(1j * a.x[THETA])
        u = ((40.0 if k % 8 < 4 else -40.0) + 1j * (35.0 - 8.0 * (i / axis).imag)) * axis
        duty = duties(u.real, u.imag, U)
        links = leg_links(e.inverter, a.x[CLOCK], duty, i.real, i.imag)
        v = deliver_to(a, u)
        now = np.array(account(a, v, load)[:3])
        for _ in range(a.steps):
            advance(a.x, a.plant, e.machine, e.shaft, 0.0, v.real, v.imag, load, 0.0, 1)
            then = np.array(account(a, v, load)[:3])
            total += 0.5 * a.plant.step * (now + then)
            now = then
        mean = 0.5 * (i + terminal_current(a))
        link = complex(*stationary(*(d * w for d, w in zip(duty, links, strict=True))))
        inverter += TS * 1.5 * ((link - v) * mean.conjugate()).real
        legs = np.array(phases(mean.real, mean.imag))
        size = legs @ np.clip(legs / e.inverter.soft_current, -1.0, 1.0)
        expected += size * (e.inverter.dead_time * links[0] + e.inverter.threshold * TS)
    supplied, lost, out = total
    stored = account(a, 0j, load)[3] - before
    assert min(lost, abs(out), stored) > 0.05
    assert supplied - lost - out - stored == pytest.approx(0.0, abs=2e-5 * supplied)
    print(f"inverter takes {inverter:.4f} J, closed form {expected:.4f} J, of {supplied:.3f} J")
    assert inverter == pytest.approx(expected, rel=0.06)
    assert inverter > 0.02 * supplied


def deliver_to(a, u):
    """Return the voltage (V) that the inverter holds over the coming period."""
    return complex(*deliver(a.x, a.plant, a.effects.machine, a.effects.inverter, u.real, u.imag))


def test_plant_starts_without_current_and_torque_beside_flux_harmonics():
    drive = load_drive("ipm_exchanged")
    harmonics = {"flux_harmonics.psi_d6": 2e-3, "flux_harmonics.psi_q6": 1e-3}
    values = library_complete(drive.motor, drive.converter, harmonics)
    for theta in (0.0, 0.37, 1.9):
        x = effects_start(effects_compiled(drive.motor, drive.converter, values, True), theta)
        magnet = (2e-3 * np.cos(6 * theta), 1e-3 * np.sin(6 * theta))
        assert (x[0], x[1]) == (pytest.approx(magnet[0], abs=1e-15), pytest.approx(magnet[1], abs=1e-15))
