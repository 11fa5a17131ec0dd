"""The kernel against the readable reference, effect by effect: one equation each, one integrator
each."""

import dataclasses

import numpy as np
import pytest

from model.effects import library
from model.effects.iron_loss import USUAL
from sandbox.plant.sets import complete
from sandbox.replay.inputs import LEGS
from sandbox.replay.replay import replay
from tests.sandbox.plant.stated_duties import (
    DRIVE,
    SPEED,
    apart,
    duties,
    finer,
    from_duties,
    reference,
    turning,
)

PERIODS = 24
# one square wave: the reference takes 2500 of this filter's time constants a period, in steps
FEW = {"fast filter": 8}
# steps a period, of rated current: errors of steps alone fall by 2^2 or more on each halving
FINE, CLOSE = 32, 1e-6
EXACT = 2e-5
PERIOD = DRIVE.converter.sampling_period


def typical(name):
    """Return an effect at its typical size, without the jitter that no prediction shows."""
    return {
        k: v
        for k, v in library.typical(name, DRIVE.motor, DRIVE.converter).items()
        if not k.endswith("jitter")
    }


def kernel(values, duty, steps, speed=SPEED):
    """Return the kernel's readings (n, 3)."""
    prepared = finer(from_duties(DRIVE, duty, *turning(len(duty), speed)), steps)
    return replay(prepared, [values]).currents[0][:, :, 0]


ORDERS = {  # odd ones and backward ones, too; the sixth beside them
    "flux_harmonics.psi_d6": 0.004,
    "flux_harmonics.2.psi_d": 0.003,
    "flux_harmonics.2.psi_q": -0.002,
    "flux_harmonics.4.psi_q": 0.002,
    "flux_harmonics.4.order": 18.0,
    "flux_harmonics.4.phase": 0.7,
    "inductance_harmonics.3.gamma": 1.0,
    "inductance_harmonics.3.order": -6.0,
    "inductance_harmonics.3.phase": 0.4,
    "inductance_harmonics.5.pulse": 0.8,
    "inductance_harmonics.5.order": 7.0,
    "inductance_harmonics.gamma_6": 0.6,
    "inductance_harmonics.6.back": 0.3,
    "inductance_harmonics.6.alpha_30": 4.0,
    "inductance_harmonics.6.alpha_12": -3.0,
    "inductance_harmonics.6.alpha_21": 5.0,
    "inductance_harmonics.6.alpha_03": 2.0,
    "inductance_harmonics.6.phase": -0.8,
}
TEETH = {
    "cogging_torque.amplitude": 0.02,
    "cogging_torque.order_mech": 36.0,
    "cogging_torque.3.amplitude": 0.05,
    "cogging_torque.3.order_mech": 12.0,
    "cogging_torque.3.phase": 1.0,
    "cogging_torque.6.amplitude": 0.03,
    "cogging_torque.6.order_mech": 1.5,
}
LAYERS = {
    "skin_effect.resistance": 2.0,
    "skin_effect.layers": 2.0,
    "skin_effect.time_constant": 1e-4,
}
# of rated current each, beside eddy currents: what a core usually has (`iron_loss.USUAL`)
CORE = {
    "iron_loss.core_resistance": 1e3,
    "iron_loss.excess_current": USUAL * DRIVE.motor.rated_current,
    "iron_loss.hysteresis_current": USUAL * DRIVE.motor.rated_current,
}
HYSTERESIS = {k: x for k, x in CORE.items() if k.endswith("hysteresis_current")}
CASES = {
    name: typical(name)
    for name in ("stator_resistance", *library.effect_names())
    if name != "encoder_eccentricity"
}
CASES |= {
    "nothing": {},
    "ripple of 3 kHz": {"dc_link_ripple.amplitude": 20.0, "dc_link_ripple.frequency": 3000.0},
    "sag": {"dc_link_error.sag": 30.0},
    "a link that rings": {
        "dc_link_error.sag": 5.0,
        "dc_link_error.resonance": 400.0,
        "dc_link_error.impedance": 20.0,
    },
    "a link that creeps": {
        "dc_link_error.sag": 30.0,
        "dc_link_error.resonance": 90.0,
        "dc_link_error.impedance": 6.0,
    },
    "large harmonics": {"inductance_harmonics.gamma_6": 1.5, "flux_harmonics.psi_d6": 0.005},
    "many orders": ORDERS,
    "harmonics behind skin": {"inductance_harmonics.gamma_6": 1.5, "skin_effect.resistance": 4.0},
    "early and filtered": {
        "current_sampling.delay": -0.45 * PERIOD,
        "current_filter.time_constant": 3e-5,
    },
    "late, sampled between": {
        "pwm_delay.delay": 0.3 * PERIOD,
        "current_sampling.delay": 0.2 * PERIOD,
    },
    "phase after phase": {"current_sampling.channel_lag": 1e-6},
    "core sampled between": {"iron_loss.core_resistance": 2e3, "current_sampling.delay": 6e-5},
    "layers": LAYERS,
    "layers behind iron, sampled between": LAYERS
    | {"iron_loss.core_resistance": 4e3, "current_sampling.delay": 6e-5},
    "core loss": CORE,
    "core loss sampled between": CORE | {"current_sampling.delay": 6e-5},
    "hysteresis alone": HYSTERESIS,
    "hysteresis of little reach": HYSTERESIS | {"iron_loss.hysteresis_reach": 0.03},
    "excess loss alone": {k: x for k, x in CORE.items() if k.endswith("excess_current")},
    "core loss behind late edges": CORE | {"dead_time.time": 4e-6},
    "fast skin": {"skin_effect.resistance": 8.0, "skin_effect.time_constant": 2e-5},
    "slow filter": {"current_filter.time_constant": 1e-3},
    "fast filter": {"current_filter.time_constant": 1e-7},
    "dead time": {"dead_time.time": 2e-5, "bench.soft_current": 0.6},
    "dead time's own zone": {
        "dead_time.time": 4e-6,
        "dead_time.zone_width": 0.5,
        "dead_time.zone_shape": 0.7,
    },
    "dead time's zone beside zero": {
        "dead_time.time": 4e-6,
        "dead_time.zone_width": 0.4,
        "dead_time.zone_center": 0.6,
    },
    "early edges, a round zone beside zero": {
        "dead_time.time": -3e-6,
        "bench.soft_current": 0.3,
        "bench.soft_shape": 0.5,
        "bench.soft_center": -0.8,
    },
    "dead time, round sign": {
        "dead_time.time": 4e-6,
        "bench.soft_current": 0.5,
        "bench.soft_shape": 0.7,
    },
    "early edges": {"dead_time.time": -3e-6},
    "large drop": {"device_drop.threshold": 5.0},
    "drop with a knee": {"device_drop.threshold": 2.0, "device_drop.knee_current": 0.4},
    "knee beside late edges": {
        "device_drop.threshold": 2.0,
        "device_drop.knee_current": 0.4,
        "dead_time.time": 4e-6,
    },
    "drop beside late edges": {"device_drop.threshold": 2.0, "dead_time.time": 4e-6},
}


@pytest.mark.parametrize("name", CASES)
def test_readings_are_those_of_the_reference(name):
    """At 600 rad/s with a square wave of 8 % of the link on top, currents up to twice the rated
    one."""
    values, duty = CASES[name], duties(FEW.get(name, PERIODS))
    told_by_reference, _ = reference(DRIVE, values, duty)
    fine, coarse = (
        apart(DRIVE, kernel(values, duty, steps), told_by_reference) for steps in (FINE, 2)
    )
    print(
        f"{name}: {fine * 1e6:.3f} ppm of rated current with {FINE} steps, "
        f"{coarse * 1e6:.1f} with 2"
    )
    assert fine < CLOSE
    assert coarse < EXACT
    if values:
        plain = apart(DRIVE, kernel({}, duty, 2), told_by_reference)
        still = (
            library.load_effect(name).subsystem == "mechanics"
            if name in library.effect_names()
            else False
        )
        assert still or plain > 20.0 * coarse


def test_a_measured_table_of_the_inverter():
    """Of 0.5 A half-width on a drive of 5 A rated, beside dead time; piecewise straight, so the
    same to the step's error; at 120 rad/s, where currents cross the table's points slowly."""
    points = ((0.0, 0.0), (0.1, 2.0), (0.25, 3.4), (0.5, 4.4), (1.0, 4.9), (4.0, 5.6))
    drive = dataclasses.replace(
        DRIVE, converter=dataclasses.replace(DRIVE.converter, inverter_table=points)
    )
    duty = 0.5 + 0.3 * (duties(PERIODS, 120.0, 0.05) - 0.5)
    values = {"dead_time.time": 1e-6}
    told_by_reference, _ = reference(drive, values, duty, 120.0, table=points)
    found = {}
    for steps, with_table in ((2, drive), (32, drive), (2, DRIVE)):
        prepared = finer(from_duties(with_table, duty, *turning(len(duty), 120.0)), steps)
        now = replay(prepared, [values]).currents[0][:, :, 0]
        found[steps, with_table is drive] = apart(DRIVE, now, told_by_reference)
    print({k: f"{x * 1e6:.2f} ppm" for k, x in found.items()})
    assert found[32, True] < CLOSE
    assert found[2, True] < EXACT
    assert found[2, False] > 100.0 * EXACT


LAGGING = {
    "core": {"iron_loss.core_resistance": 1e3},
    "core loss": CORE,
    "filter": {"current_filter.time_constant": 3e-5},
    "fast filter": {"current_filter.time_constant": 2e-6},
    "skin": {"skin_effect.resistance": 2.0, "skin_effect.time_constant": 2e-4},
    "layers": LAYERS,
    "core before filter, sampled between": {
        "iron_loss.core_resistance": 1e3,
        "current_filter.time_constant": 3e-5,
        "current_sampling.delay": 6e-5,
    },
}


@pytest.mark.parametrize("name", LAGGING)
def test_lags_behind_late_edges(name):
    """Dead time of 20 us before lags, at low voltage: all edges act within one segment, and kink
    what the lags see."""
    values = LAGGING[name] | {"dead_time.time": 2e-5, "bench.soft_current": 0.6}
    duty = 0.5 + 0.1 * (duties(PERIODS, 20.0, 0.02) - 0.5)
    told_by_reference, _ = reference(DRIVE, values, duty, 20.0)
    found = apart(DRIVE, kernel(values, duty, 4, 20.0), told_by_reference)
    print(f"{name}: {found * 1e6:.2f} ppm of rated current")
    assert found < CLOSE


DROPS = {
    "skin": {"skin_effect.resistance": 2.0},
    "drop": {"device_drop.threshold": 2.0, "bench.soft_current": 0.6},
    "windings": {"winding_asymmetry.delta_a": 2.0},
    "all": {
        "skin_effect.resistance": 2.0,
        "device_drop.threshold": 2.0,
        "bench.soft_current": 0.6,
        "winding_asymmetry.delta_a": 2.0,
    },
}


@pytest.mark.parametrize("name", DROPS)
def test_iron_beside_what_else_drops_is_of_second_order(name):
    """Four times the steps leave a sixteenth; a part of the drop that the iron does not see leaves
    a quarter, and 0.1 to 1.7 ppm with 64 steps.  Half-way between both on a scale of logarithms is
    8."""
    values, duty = {"iron_loss.core_resistance": 1e3} | DROPS[name], duties(16)
    told_by_reference, _ = reference(DRIVE, values, duty)
    some, many = (
        apart(DRIVE, kernel(values, duty, steps), told_by_reference) for steps in (16, 64)
    )
    print(f"{name}: {some * 1e6:.3f} ppm of rated current with 16 steps, {many * 1e6:.4f} with 64")
    assert many < some / 8.0
    assert many < 0.1 * CLOSE


DISC = "encoder_eccentricity"
STEP = 30  # periods until a load comes
MOVED = {name: typical(name) for name in library.effect_names() if name != "encoder_offset"}
MOVED |= {
    "nothing": {},
    "load": {"bench.load_torque_gain": 0.1, "bench.load_torque_offset": 0.01},
    "teeth": TEETH | ORDERS,
    "bristles": {
        **typical("coulomb_friction"),
        "coulomb_friction.stribeck_torque": 0.03,
        "coulomb_friction.presliding": 3e-3,
        "coulomb_friction.presliding_damping": 0.2,
    },
    "backlash": {**typical("shaft_compliance"), "shaft_compliance.backlash": 5e-4},
    "both": {**typical("shaft_compliance"), **typical("cogging_torque"), **typical("iron_loss")},
    "orders of the encoder": {
        "encoder_eccentricity.2.amplitude_mech": 0.004,
        "encoder_eccentricity.2.phase": 0.5,
        "encoder_eccentricity.3.amplitude_mech": 0.001,
        "encoder_eccentricity.3.order_mech": 4.0,
    },
    "an encoder read late": {"encoder_offset.latency": 2e-5},
}


@pytest.mark.parametrize("name", MOVED)
def test_a_free_rotor_moves_as_the_reference_says(name):
    """Nothing corrects the motion predicted from the first reading on; up to twice rated current, a
    step of load.

    Bounds: the torque's course inside a period is taken as its mean, so that the angle misses by
    T^3/12 times the slope of the acceleration a period, T^2/12 times its change in all; friction is
    taken at the middle of the period. A delayed pattern, and an angle read late, go by the period's
    mean speed: the sample then reads off by G psi a d T/2.
    """
    n, pairs, values = 70, DRIVE.motor.pole_pairs, MOVED[name]
    u = 0.06 * np.exp(1j * (1.9 + 0.5 * np.sin(np.arange(n) / 40.0)))
    legs = np.stack([u.real, u.imag], axis=1) @ LEGS.T
    duty = 0.5 + legs - 0.5 * (legs.max(axis=1) + legs.min(axis=1))[:, None]
    load = np.where(np.arange(n) >= STEP, 0.1, 0.0)
    readings, states = reference(
        DRIVE, values, duty, None, load=lambda t: 0.1 if t >= STEP * PERIOD - 1e-9 else 0.0
    )
    v, theta, speed = (
        complete(DRIVE.motor, DRIVE.converter, values),
        states[:, 8],
        pairs * states[:, 9],
    )
    read = theta - v["encoder_offset.latency"] * speed
    slope, turn = np.ones_like(theta), theta / pairs
    for k, order in (("", 1.0), *((f"{k}.", v[f"{DISC}.{k}.order_mech"]) for k in (2, 3, 4))):
        size, phase = v[f"{DISC}.{k}amplitude_mech"], v[f"{DISC}.{k}phase"]
        read += pairs * size * np.sin(order * turn + phase)
        slope += order * size * np.cos(order * turn + phase)
    slope *= speed
    found = replay(finer(from_duties(DRIVE, duty, read, slope, "free", load), 4), [values])
    change = np.ptp(np.diff(speed)) / PERIOD
    miss, gap = (
        np.abs(found.motion[0][:, 0]).max(),
        apart(DRIVE, found.currents[0][:, :, 0], readings),
    )
    print(f"{name}: motion {miss:.1e} rad of {np.ptp(theta):.2f}, currents {gap * 1e6:.1f} ppm")
    delay = v["pwm_delay.delay"] + v["encoder_offset.latency"]
    late = DRIVE.motor.magnet_flux / DRIVE.motor.inductance_d / DRIVE.motor.rated_current
    assert gap < EXACT + late * np.abs(np.diff(speed)).max() * delay * 0.5
    assert miss < 3.0 * PERIOD**2 / 12.0 * change + 1e-5
    if name in (
        "load",
        "both",
        "teeth",
        "cogging_torque",
        "coulomb_friction",
        "bristles",
        "inertia",
        "shaft_compliance",
        "backlash",
    ):
        assert (
            np.abs(
                replay(from_duties(DRIVE, duty, read, slope, "free", load), [{}]).motion[0]
            ).max()
            > 20.0 * miss
        )


@pytest.mark.parametrize("size", [0.0, 0.02])
def test_a_drop_sees_the_corners_that_late_edges_make(size):
    """At standstill, legs close together: one step a period, beside 32.  2e-6 of rated current
    (seen: 0.9e-6 and 0.5e-6; with the corners cut 23e-6 and 9e-6)."""
    values, duty = typical("device_drop") | typical("dead_time"), duties(48, 0.0, size=size)
    assert apart(DRIVE, kernel(values, duty, 1, 0.0), kernel(values, duty, FINE, 0.0)) < 2e-6
