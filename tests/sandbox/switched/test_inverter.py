"""The switched bench against an independent rotor-frame integration with exact edges; steps,
neutral values, errors."""

import itertools

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from model.drive_files import load_drive
from model.effects.library import neutral, parameters
from model.errors import BadInput
from sandbox.switched.advance import MODES, measure, replay, run, start
from sandbox.switched.bench_numbers import bench, quiet
from sandbox.switched.bench_state import Slot
from sandbox.switched.inverter import advance
from sandbox.switched.phase_machine import link_voltage, phase_currents
from tests.sandbox.plant.effect_motors import vector
from tests.sandbox.switched.all_effects import ALL_ON, commands, stored, unaccounted


def drive(name="ipm"):
    """Return motor and converter of a built-in drive."""
    loaded = load_drive(name)
    return loaded.motor, loaded.converter


def reference(motor, period, u_link, u_dc, u_alpha, u_beta, load, x):
    """Return i_alpha + j i_beta at every t_k: rotor-frame flux, the paper's polynomials, one
    solve_ivp per interval."""

    def currents(d, q):  # eqs. (id), (iq)
        i_d = d / motor.inductance_d + 3 * motor.alpha_30 * d**2 + motor.alpha_12 * q**2
        i_d += 4 * motor.alpha_40 * d**3 + 2 * motor.alpha_22 * d * q**2
        i_q = q / motor.inductance_q + 2 * motor.alpha_12 * d * q
        return i_d, i_q + 2 * motor.alpha_22 * d**2 * q + 4 * motor.alpha_04 * q**3

    def rates(t, x, v_alpha, v_beta):
        d, q, theta, speed = x
        i_d, i_q = currents(d, q)
        omega = motor.pole_pairs * speed
        v_d = v_alpha * np.cos(theta) + v_beta * np.sin(theta)
        v_q = v_beta * np.cos(theta) - v_alpha * np.sin(theta)
        torque = 1.5 * motor.pole_pairs * ((d + motor.magnet_flux) * i_q - q * i_d)
        return [
            v_d - motor.resistance * i_d + omega * q,
            v_q - motor.resistance * i_q - omega * (d + motor.magnet_flux),
            omega,
            (torque - motor.viscous_friction * speed - load) / motor.inertia,
        ]

    def seen(x):
        return complex(*currents(x[0], x[1])) * np.exp(1j * x[2])

    samples = [seen(x)]
    for alpha, beta in zip(u_alpha, u_beta, strict=True):
        legs = np.array(
            [alpha, -alpha / 2 + np.sqrt(3) / 2 * beta, -alpha / 2 - np.sqrt(3) / 2 * beta]
        )
        duty = 0.5 + (legs - 0.5 * (legs.max() + legs.min())) / u_dc
        edges = np.sort(
            np.concatenate([[0.0, period], 0.5 * (1 - duty) * period, 0.5 * (1 + duty) * period])
        )
        for begin, end in itertools.pairwise(edges):
            middle = 0.5 * (begin + end)
            on = (np.abs(middle - 0.5 * period) < 0.5 * duty * period) * u_link
            v = (2 * on[0] - on[1] - on[2]) / 3, (on[1] - on[2]) / np.sqrt(3)
            x = solve_ivp(rates, (0.0, end - begin), x, "DOP853", rtol=1e-11, atol=1e-13, args=v).y[
                :, -1
            ]
        samples.append(seen(x))
    return np.array(samples)


@pytest.mark.parametrize("name", ["ipm", "spm"])
def test_agrees_with_independent_reference(name):
    motor, converter = drive(name)
    u_alpha, u_beta = commands(12, amplitude=0.2 * converter.dc_bus_voltage)
    x = [0.0, 0.0, 0.4, 30.0]
    link, read, load = converter.dc_bus_voltage, 0.99 * converter.dc_bus_voltage, 0.2
    expected = reference(motor, converter.sampling_period, link, read, u_alpha, u_beta, load, x)[
        :-1
    ]
    b = quiet(bench(motor, converter))
    got = vector(replay(b, "free", u_alpha, u_beta, read, load_torque=load, theta=0.4, speed=30.0))
    assert np.abs(expected).max() > 0.3 * motor.rated_current
    assert np.abs(got - expected).max() < 2e-6 * motor.rated_current


@pytest.mark.parametrize(("effects", "bound"), [({}, 1e-8), (ALL_ON, 1e-4)], ids=["none", "all"])
def test_step_is_short_enough(effects, bound):
    """A sixteenth of the step moves no sample by more than a small part of 0.1 % of rated current.

    Smooth equations are exact to 1e-9; the soft sign of the device drop has kinks inside steps,
    hence 1e-4.
    """
    motor, converter = drive()
    b = quiet(bench(motor, converter, effects))
    u_alpha, u_beta = commands(400)
    coarse, fine = (
        replay(b._replace(step=b.step * f), "free", u_alpha, u_beta, 399.0, speed=40.0)
        for f in (1.0, 0.0625)
    )
    assert np.abs(vector(coarse) - vector(fine)).max() < bound * motor.rated_current


@pytest.mark.parametrize("name", list(parameters()))
def test_neutral_value_builds_the_same_bench(name):
    motor, converter = drive()
    assert bench(motor, converter, {name: neutral(motor)[name]}) == bench(motor, converter)


def test_neutral_effects_leave_every_reading_bit_identical():
    motor, converter = drive()
    u_alpha, u_beta = commands(50)
    plain = replay(bench(motor, converter), "free", u_alpha, u_beta, 401.0, speed=10.0)
    # parts of an effect that is off: iron loss' time constant, ripple's frequency, ... must not
    # matter
    idle = {
        "iron_loss.time_constant": 1e-4,
        "dc_link_ripple.frequency": 50.0,
        "skin_effect.time_constant": 1e-4,
        "encoder_eccentricity.phase": 1.0,
        "coulomb_friction.width": 5.0,
        "cogging_torque.phase": 0.5,
        "shaft_compliance.damping_ratio": 0.1,
    }
    off = replay(
        bench(motor, converter, neutral(motor) | idle), "free", u_alpha, u_beta, 401.0, speed=10.0
    )
    for name, column in plain.items():
        assert np.array_equal(column, off[name])


def test_unequal_spelling_out_of_bounds_and_contradiction_are_told():
    motor, converter = drive()
    with pytest.raises(BadInput, match=r"dead_tim.time.*did you mean 'dead_time.time'"):
        bench(motor, converter, {"dead_tim.time": 1e-6})
    for bad in (1.0, np.nan, "x", True):
        with pytest.raises(BadInput, match=r"dead_time.time = .*out of range"):
            bench(motor, converter, {"dead_time.time": bad})
    with pytest.raises(BadInput, match="not finite"):
        bench(motor, converter, {"cogging_torque.phase": np.inf})
    with pytest.raises(BadInput, match="contradict"):
        bench(motor, converter, {"saturation.alpha_12": 1.0, "cross_saturation.alpha_12": 2.0})
    with pytest.raises(BadInput, match="half the PWM period"):
        bench(motor, converter, {"pwm_delay.delay": 2e-4})
    with pytest.raises(BadInput, match="the total inertia"):
        bench(
            motor,
            converter,
            {"shaft_compliance.stiffness": 1.0, "shaft_compliance.load_inertia": 1.0},
        )
    with pytest.raises(BadInput, match="unknown rotor 'fre'; did you mean 'free'"):
        replay(bench(motor, converter), "fre", [0.0], [0.0], 400.0)
    with pytest.raises(BadInput, match="'u_beta'"):
        replay(bench(motor, converter), "free", [0.0, 0.0], [0.0], 400.0)


def test_energy_balance_closes_with_everything_on():
    """Electrical in = losses + mechanical out + change of what is stored."""
    motor, converter = drive()
    b = quiet(bench(motor, converter, ALL_ON))._replace(audit=1.0)
    state = start(b, theta=0.2, speed=60.0)
    before, peak = unaccounted(b, state), 0.0
    u_alpha, u_beta = commands(800, amplitude=60.0)
    for k in range(800):
        advance(state, b, MODES["free"], u_alpha[k], u_beta[k], 398.0, 0.15, 0.0)
        peak = max(peak, abs(unaccounted(b, state) - before))
    assert state[Slot.LOSS] > 5.0
    assert abs(state[Slot.OUTPUT]) > 0.05
    assert peak < 2e-5 * state[Slot.LOSS]


def test_link_power_is_machine_terminals_plus_inverter_with_everything_on():
    """From the link = what the machine stores, loses and gives + device drop; as commanded = that +
    dead time.

    The devices' share in closed form is (threshold sign(i) + r i) i T_s a leg and period, dead
    time: V t_d |i| (one edge is late).  There i is the mean of both samples, not the current at the
    edge: ripple makes a few percent.
    """
    motor, converter = drive()
    b = quiet(bench(motor, converter, ALL_ON))._replace(audit=1.0)
    state = start(b, theta=0.2, speed=60.0)

    before, dead, devices = stored(b, state), 0.0, 0.0
    u_alpha, u_beta = commands(800, amplitude=60.0)
    old = np.zeros(3)
    for k in range(800):
        advance(state, b, MODES["free"], u_alpha[k], u_beta[k], 398.0, 0.15, 0.0)
        new = np.array(phase_currents(complex(state[Slot.I_ALPHA], state[Slot.I_BETA])))
        i = 0.5 * (old + new)
        dead += (
            b.dead_time
            * link_voltage(b, state[Slot.TIME], state[Slot.LINK_SAG])
            * np.sum(i * np.clip(i / b.soft_current, -1.0, 1.0))
        )
        devices += b.period * np.sum(
            i * (b.threshold * np.clip(i / b.soft_current, -1.0, 1.0) + b.on_resistance * i)
        )
        old = new
    machine = stored(b, state) - before + state[Slot.OUTPUT]
    machine += state[Slot.LOSS] - state[Slot.DEVICES]
    print(
        f"link {state[Slot.INPUT]:.4f} J, machine {machine:.4f}, "
        f"devices {state[Slot.DEVICES]:.4f}, "
        f"dead time {state[Slot.COMMANDED] - state[Slot.INPUT]:.4f} (closed form {dead:.4f})"
    )
    assert state[Slot.INPUT] == pytest.approx(
        machine + state[Slot.DEVICES], abs=2e-5 * state[Slot.LOSS]
    )
    assert state[Slot.DEVICES] == pytest.approx(devices, rel=0.05)
    assert min(state[Slot.DEVICES], dead) > 0.01 * state[Slot.INPUT]
    assert state[Slot.COMMANDED] - state[Slot.INPUT] == pytest.approx(dead, rel=0.05)


def test_columns_of_any_kind_run_the_same_machine_code():
    """Of one value, read-only, every second of an array, a list: seconds of compiling, were it made
    for each."""
    b, u = quiet(bench(*drive())), np.full(8, 5.0)
    plain = replay(b, "free", u, u, 400.0)
    made, frozen = len(run.signatures), u.copy()
    frozen.setflags(write=False)
    for column in (np.full(16, 5.0)[::2], frozen, u.tolist(), np.broadcast_to(5.0, 8)):
        assert np.array_equal(replay(b, "free", column, u, 400.0)["i_a"], plain["i_a"])
        assert np.array_equal(replay(b, "free", u, column, 400.0)["i_a"], plain["i_a"])
    assert len(run.signatures) == made


def test_measure_and_advance_by_hand_equal_replay():
    motor, converter = drive()
    b = bench(motor, converter, ALL_ON)
    u_alpha, u_beta = commands(60)
    expected = replay(
        b, "free", u_alpha, u_beta, 399.0, load_torque=0.1, theta=0.1, speed=5.0, seed=4
    )
    state, rng = start(b, 0.1, 5.0), np.random.default_rng(4)
    for k in range(60):
        reading = measure(state, b, MODES["free"], u_alpha[k], u_beta[k], 399.0, 0.1, 0.0, rng)
        assert np.array_equal(
            reading, [expected[name][k] for name in ("i_a", "i_b", "i_c", "theta")]
        )
        advance(state, b, MODES["free"], u_alpha[k], u_beta[k], 399.0, 0.1, 0.0)
