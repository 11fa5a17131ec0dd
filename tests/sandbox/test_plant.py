"""The plant kernel against its readable twin, its order, and its energy balance."""

from __future__ import annotations

import numpy as np
import pytest

from model import energy as en
from model.parameters import load_drive
from sandbox.oldplant import Plant, advance, steps_per_period, turn
from sandbox.reference import trajectory

PERIOD = 250e-6


def plant_of(motor, step, free=True):
    acceleration = motor.pole_pairs / motor.inertia if free else 0.0
    return Plant(
        motor.energy, motor.magnet_flux, motor.resistance, float(motor.pole_pairs), acceleration,
        motor.viscous_friction, step,
    )  # fmt: skip


def kernel_trajectory(motor, u, start, steps, load=0.0, free=True):
    x, states = np.array(start, dtype=float), [np.array(start, dtype=float)]
    plant = plant_of(motor, PERIOD / steps, free)
    for u_alpha, u_beta in u:
        advance(x, plant, u_alpha, u_beta, load, 0.0, steps)
        states.append(x.copy())
    return np.array(states)


def voltages(n=60, seed=0):
    """Steps of tens of volts with an injected square wave, in the stator frame."""
    rng = np.random.default_rng(seed)
    return 15.0 * rng.standard_normal((n, 2)) + np.where(np.arange(n) % 8 < 4, 30.0, -30.0)[:, None] * [0.8, 0.6]


@pytest.mark.parametrize("name", ["ipm", "ipm_exchanged", "spm_exchanged"])
@pytest.mark.parametrize("free", [True, False])
def test_kernel_agrees_with_its_twin(name, free):
    motor = load_drive(name).motor
    start = [0.02, -0.03, 40.0, 1.0]
    twin = trajectory(motor, voltages(), PERIOD, np.array(start), load=0.2, free=free)
    ours = kernel_trajectory(motor, voltages(), start, 20, load=0.2, free=free)
    # RK4 at h = 12.5 us: local error (lambda h)^5/120 with lambda = R Gamma < 600/s, 1200 steps: < 1e-10 relative
    assert np.abs(ours - twin)[:, :2].max() < 1e-10
    assert np.abs(ours - twin)[:, 2:].max() < 1e-7


def test_fourth_order():
    motor, start = load_drive("ipm_exchanged").motor, [0.02, -0.03, 200.0, 1.0]
    u = voltages(20)
    twin = trajectory(motor, u, PERIOD, np.array(start))
    errors = [np.abs(kernel_trajectory(motor, u, start, n) - twin)[:, :2].max() for n in (1, 2, 4)]
    rates = np.log2(np.array(errors[:-1]) / errors[1:])
    assert np.all((rates > 3.6) & (rates < 4.7)), rates


def test_energy_balance():
    """Electrical work = magnetic energy + kinetic energy + copper and friction loss + work on the load."""
    motor = load_drive("ipm_exchanged").motor
    p, load, steps, n = motor.pole_pairs, 0.3, 400, 40
    plant = plant_of(motor, PERIOD / steps)
    x = np.array([0.0, 0.0, 60.0, 0.3])

    def stored(x):
        kinetic = 0.5 * motor.inertia * (x[2] / p) ** 2
        return 1.5 * en.energy(motor.energy, x[0], x[1]) + kinetic

    def powers(x, u):
        i = np.array(en.currents(motor.energy, x[0], x[1]))
        c, s = np.cos(x[3]), np.sin(x[3])
        u_dq = np.array([c * u[0] + s * u[1], c * u[1] - s * u[0]])
        w = x[2] / p
        return 1.5 * u_dq @ i - 1.5 * motor.resistance * i @ i - motor.viscous_friction * w**2 - load * w

    before, flow = stored(x), 0.0
    for u in voltages(n):
        for _ in range(steps):
            a = powers(x, u)
            advance(x, plant, u[0], u[1], load, 0.0, 1)
            flow += 0.5 * (a + powers(x, u)) * PERIOD / steps
    # trapezium rule at h = 0.6 us: h^2/12 p'' T, p'' < 1e3 * (2e3/s)^2 W/s^2, T = 10 ms: < 2e-6 J
    assert stored(x) - before == pytest.approx(flow, abs=2e-6)
    assert abs(flow) > 1e-3


def test_turn_is_a_rotation_to_rounding():
    for angle in np.linspace(-0.1, 0.1, 21):
        exact = np.exp(-1j * angle) * (3.0 - 4.0j)
        assert complex(*turn(3.0, -4.0, angle)) == pytest.approx(exact, rel=1e-12)


def test_steps_keep_the_turn_small():
    assert steps_per_period(250e-6, 12.5e-6, 0.0) == 20
    assert steps_per_period(250e-6, 1e-3, 0.0) == 1
    n = steps_per_period(250e-6, 1e-3, 2000.0)
    assert 2000.0 * 250e-6 / n <= 0.1
