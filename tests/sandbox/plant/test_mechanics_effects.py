"""The exact plant's free rotor under each mechanical effect in closed form; the energy balance of
all at once."""

import dataclasses
import math

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from model.effects.coulomb_friction import sliding
from model.energy import energy
from sandbox.switched.advance import replay
from sandbox.switched.bench_numbers import bench, quiet
from tests.sandbox.plant.closed_forms import iron
from tests.sandbox.plant.effect_motors import CONVERTER, IPM, LINEAR, NO_MAGNET, TS
from tests.sandbox.plant.exact import Exact

LATE = 6e-14 / TS  # edges at one instant are taken 1e-14 s apart, and the shaft moves on meanwhile


def coasting(effects, n=400, speed=100.0, theta=0.0, load=0.0):
    """Return angles and speeds (n, mechanical) of a free motor without magnet."""
    plant, out = Exact(effects, NO_MAGNET, "free", theta, speed), []
    for _ in range(n):
        out.append(plant.motion)
        plant.advance(0j, load)
    return np.array(out).T


def test_inertia_sets_the_acceleration():
    speed = coasting({"inertia.inertia": 2e-3}, speed=0.0, load=0.3)[1]
    assert speed[399] == pytest.approx(-0.3 / 2e-3 * 399 * TS, rel=1.1 * LATE)


@pytest.mark.parametrize("width", [2.0, 0.05, 1e-3])
def test_coulomb_friction_is_resolved_however_narrow(width):
    """J dw/dt = -T tanh(w/width): sinh(w/width) decays exponentially, to rest and staying there;
    both plants.

    w = width asinh(sinh(w_0/width) exp(-T t/(J width))), written without overflow.  Tolerance: two
    steps a relaxation time, second order: 2 % of the width for the one sample on its way to rest.
    """
    torque, w_0, n = 0.1, 2.0, 200
    power = w_0 / width + np.log1p(-np.exp(-2 * w_0 / width)) - math.log(2.0)
    power = power - torque * TS * np.arange(n) / (1e-3 * width)
    expected = width * np.where(
        power > 20.0, power + math.log(2.0), np.arcsinh(np.exp(np.minimum(power, 20.0)))
    )
    speed = coasting({"coulomb_friction.torque": torque, "coulomb_friction.width": width}, n, w_0)[
        1
    ]
    b = quiet(
        bench(
            NO_MAGNET,
            CONVERTER,
            {"coulomb_friction.torque": torque, "coulomb_friction.width": width},
        )
    )
    out = replay(b, "free", np.zeros(n), np.zeros(n), 400.0, speed=w_0)
    for found in (speed, out["speed"]):
        assert found == pytest.approx(expected, abs=0.02 * width + 1e-5)


def test_coulomb_frictions_stribeck_hump_adds_at_low_speed():
    """J dw/dt = -(T_c + T_s exp(-(w/w_s)^2)) tanh(w/width) by SciPy; the level is odd in speed."""
    assert sliding(0.1, 2.0, 0.06, 5.0, -5.0) == pytest.approx(
        -(0.1 + 0.06 * math.exp(-1)) * math.tanh(2.5), rel=1e-12
    )
    effects = {"torque": 0.1, "width": 2.0, "stribeck_torque": 0.06, "stribeck_speed": 5.0}
    effects = {f"coulomb_friction.{name}": x for name, x in effects.items()}
    n = 500
    slow = solve_ivp(
        lambda t, w: -(0.1 + 0.06 * np.exp(-((w / 5.0) ** 2))) * np.tanh(w / 2.0) / 1e-3,
        (0, n * TS),
        [10.0],
        t_eval=TS * np.arange(n),
        rtol=1e-10,
        atol=1e-12,
    ).y[0]
    # step S: S^2/12 of the slope's second derivative, (0.16/(J 2))^2 S^2/12 of the speed where it
    # bends
    assert coasting(effects, n, 10.0)[1] == pytest.approx(
        slow, abs=10.0 * 80.0**2 * (0.5 * TS) ** 2 / 12
    )
    assert slow[-1] < 0.1


def test_viscous_friction_slows_exponentially():
    """Midpoint steps of S = T_s/2: relative error (c S/J)^2/6 a time constant."""
    speed = coasting({"viscous_friction.coefficient": 4e-3})[1]
    elapsed = 4.0 * 399 * TS
    assert speed[399] == pytest.approx(
        100 * math.exp(-elapsed), rel=elapsed * (4.0 * 0.5 * TS) ** 2
    )


def test_cogging_torque_swings_in_its_potential():
    """Small swings have the rate sqrt(A n/J); a large one keeps J w^2/2 + A/n cos(n theta +
    phase)."""
    effects = {
        "cogging_torque.amplitude": 0.2,
        "cogging_torque.order_mech": 12.0,
        "cogging_torque.phase": math.pi,
    }
    rate = math.sqrt(0.2 * 12 / 1e-3)
    angle = coasting(effects, 2000, 0.0, theta=0.004)[0]
    # explicit steps of S: the rate is off by (rate S)^2/6, over 3.9 turns
    late = rate * TS * 2000 * (rate * 0.5 * TS) ** 2 / 6
    assert angle == pytest.approx(
        0.001 * np.cos(rate * TS * np.arange(2000)), abs=0.001 * (late + 2e-3)
    )
    angle, speed = coasting(effects, 2000, 0.0, theta=0.8)
    kept = 0.5e-3 * speed**2 + 0.2 / 12 * np.cos(12 * angle + math.pi)
    print("cogging energy", np.ptp(kept) / (0.2 / 12))
    assert np.ptp(0.5e-3 * speed**2) > 0.02
    assert kept == pytest.approx(np.full(2000, kept[0]), abs=1e-3 * 0.2 / 12)


@pytest.mark.parametrize("ratio", [0.0, 0.1])
def test_shaft_compliance_resonates_at_its_frequency(ratio):
    """Twist after a load step: rate w = sqrt(K (1/J_1 + 1/J_2)) and damping ratio; exact steps,
    total inertia kept."""
    effects = {"shaft_compliance.stiffness": 300.0, "shaft_compliance.load_inertia": 4e-4}
    plant = Exact(effects | {"shaft_compliance.damping_ratio": ratio}, NO_MAGNET, "free")
    rate, tau, n, twist, speed = math.sqrt(300.0 * (1 / 6e-4 + 1 / 4e-4)), 0.05, 1000, [], []
    for _ in range(n):
        twist.append(plant.w["twist"][0])
        speed.append(plant.motion[1])
        plant.advance(0j, tau)
    t, swung = TS * np.arange(n), rate * math.sqrt(1 - ratio**2)
    bell = np.exp(-ratio * rate * t) * (
        np.cos(swung * t) + ratio * rate / swung * np.sin(swung * t)
    )
    steady = tau * 6e-4 / 1e-3 / 300.0  # the motor's side hangs on the shaft
    assert np.array(twist) == pytest.approx(
        steady * (1 - bell), abs=1.1 * LATE * rate * t[-1] * steady
    )
    slip = np.exp(-ratio * rate * t) * rate**2 / swung * np.sin(swung * t) * steady
    # two masses: J_1 w_1 + J_2 w_2 = -tau t, w_1 - w_2 = slip
    assert np.array(speed) == pytest.approx(
        -tau / 1e-3 * t + 0.4 * slip, abs=1.1 * LATE * (tau / 1e-3 * t[-1] + rate * t[-1])
    )


def test_iron_loss_brakes_a_shorted_motor():
    """Torque 3/2 p Im(psi* i_m) of the phasors of `iron`, i_m = (psi - phi_m)/L: the speed it costs
    in a period."""
    effects = {
        "iron_loss.core_resistance": 300.0,
        "iron_loss.time_constant": 5e-4,
        "inertia.inertia": 1e3,
    }
    plant, omega = Exact(effects, LINEAR, "free", 0.0, 100.0), 400.0
    for _ in range(800):
        plant.advance(0j)
    begun = plant.motion[1]
    plant.advance(0j)
    torque = [
        1.5 * 4 * (psi.conjugate() * (psi - 0.1) / 0.05).imag
        for psi in (iron(omega, c, 5e-4)[0] for c in (300.0, 1e9))
    ]
    assert (plant.motion[1] - begun) * 1e3 / TS == pytest.approx(torque[0], rel=1e-4)
    assert abs(torque[1] - torque[0]) > 0.02 * abs(torque[0])


ALL_ON = {
    "stator_resistance.resistance": 13.0,
    "flux_harmonics.psi_d6": 0.003,
    "flux_harmonics.psi_q6": -0.002,
    "inductance_harmonics.gamma_6": 0.6,
    "iron_loss.core_resistance": 1500.0,
    "iron_loss.time_constant": 2e-4,
    "winding_asymmetry.delta_a": 0.5,
    "winding_asymmetry.delta_b": -0.3,
    "device_drop.on_resistance": 0.3,
    "coulomb_friction.torque": 0.03,
    "coulomb_friction.width": 2.0,
    "coulomb_friction.stribeck_torque": 0.01,
    "coulomb_friction.stribeck_speed": 5.0,
    "viscous_friction.coefficient": 5e-4,
    "cogging_torque.amplitude": 0.05,
    "cogging_torque.order_mech": 12.0,
    "shaft_compliance.stiffness": 300.0,
    "shaft_compliance.load_inertia": 4e-4,
    "shaft_compliance.damping_ratio": 0.05,
}


def h(psi, theta):
    """Return H (J up to 3/2) of a flux vector, with the harmonics as the effect library writes
    them."""
    seen, c, s = psi * np.exp(-1j * theta), math.cos(6 * theta), math.sin(6 * theta)
    d, q = seen.real - 0.1 - 0.003 * c, seen.imag + 0.002 * s
    return energy(IPM.energy, d, q) + 0.3 * (c * (d * d - q * q) + 2 * s * d * q)


def magnetising(psi, theta):
    """Return its gradient (A), by central differences."""
    e = 1e-6
    x, y = h(psi + e, theta) - h(psi - e, theta), h(psi + 1j * e, theta) - h(psi - 1j * e, theta)
    return complex(x, y) / (2 * e)


def account(state, i, load):
    """Return power lost and to the load (W) and stored energy (J); state: of the plant, i: terminal
    current (A)."""
    position, speed, slip, twist, psi = state
    core = i - magnetising(psi, 6 * position)
    lost = (
        1.5 * 13.3 * abs(i) ** 2
        + 0.5 * i.real**2
        - 0.3 * (-i.real / 2 + math.sqrt(0.75) * i.imag) ** 2
    )
    lost += (
        1.5 * 1500.0 * abs(core) ** 2
        + 5e-4 * speed**2
        + sliding(0.03, 2.0, 0.01, 5.0, speed) * speed
    )
    lost += 2 * 0.05 * math.sqrt(300.0 / (1 / 6e-4 + 1 / 4e-4)) * slip**2
    stored = 1.5 * (h(psi, 6 * position) + 0.5 * 2e-4 * 1500.0 * abs(core) ** 2) + 150.0 * twist**2
    stored += 3e-4 * speed**2 + 2e-4 * (speed - slip) ** 2 + 0.05 / 12 * math.cos(12 * position)
    return np.array([lost, load * (speed - slip), stored])


def flows(period, n, load=0.2):
    """Return energy in, lost, to the load and stored (J) over n periods (s), by the trapezoidal
    rule over periods."""
    converter = dataclasses.replace(CONVERTER, sampling_period=period)
    plant, books, u, i = Exact(ALL_ON, IPM, "free", converter=converter), [], [], []
    for k in range(n + 1):
        state = *plant.motion, plant.w["slip"][0], plant.w["twist"][0], plant.flux
        square = 1.0 if math.sin(2 * math.pi * 500 * (k + 0.5) * period) > 0.0 else -1.0
        u.append((40.0 * square + 35.0j) * np.exp(6j * plant.motion[0]))
        i.append(plant.advance(u[-1], load))
        books.append(account(state, i[-1], load))
    lost, out, stored = np.transpose(books)
    power = 1.5 * (np.array(u[:-1]) * np.conj(0.5 * (np.array(i[1:]) + np.array(i[:-1])))).real
    mean = [period * 0.5 * np.sum(x[1:] + x[:-1]) for x in (lost, out)]
    return np.array([period * power.sum(), *mean, stored[-1] - stored[0]])


def test_energy_balance_with_everything_on():
    """Terminals in = load + losses + stored.

    The rule and the pulses' ripple (whose losses samples do not show) are of second order in the
    period: half of it leaves a quarter; what extrapolation to none leaves is the plant's.
    """
    whole, half = flows(TS / 8, 800), flows(TS / 16, 1600)
    left = [x[0] - x[1:].sum() for x in (whole, half)]
    print("energy", half, "left", left, "extrapolated", (4 * left[1] - left[0]) / 3 / half[0])
    assert min(abs(half[1:])) > 0.02 * half[0]
    assert left[0] / left[1] == pytest.approx(4.0, rel=0.2)
    assert abs(4 * left[1] - left[0]) / 3 < 2e-5 * half[0]
