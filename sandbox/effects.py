"""Effects by their public names, in the compiled form of the averaged plant."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import NamedTuple

import numba
import numpy as np
from numpy.typing import NDArray

from model.effects.dead_time import SOFT_SIGN
from model.effects.library import friction_rate, neutral
from model.effects.shaft_compliance import damping_of
from model.parameters import Converter, Motor
from sandbox.full import DUTY, SIZE, Machine, Shaft
from sandbox.inverter import Inverter
from sandbox.oldplant import PHI_D, PHI_Q, THETA
from sandbox.sensors import Sensors

BARE, FULL = 0, 1
SAMPLE_ONLY = ("current_gain", "current_offset", "encoder_offset", "encoder_eccentricity")  # act in `measure` alone
REPLACED = ("stator_resistance", "magnet_flux", "inductance", "saturation", "cross_saturation", "inertia")


class Effects(NamedTuple):
    """All effects of one run; `path` tells whether the plant needs more than its bare equations."""

    path: int
    machine: Machine
    shaft: Shaft
    inverter: Inverter
    sensors: Sensors


EFFECTS = numba.typeof(
    Effects(0, Machine(*10 * (0.0,)), Shaft(*10 * (0.0,)), Inverter(*14 * (0.0,)), Sensors(*12 * (0.0,)))
)


def compiled(motor: Motor, converter: Converter, values: Mapping[str, float], free: bool) -> Effects:
    """Return the compiled form of complete values (`model.effects.library.complete`); free: the rotor turns freely."""
    v, period = values, converter.sampling_period
    conductance = 1.0 / v["iron_loss.core_resistance"]
    filter_time, core_time = v["current_filter.time_constant"], v["iron_loss.time_constant"]
    if conductance and abs(filter_time / core_time - 1.0) < 1e-4:
        filter_time = (1.0 + 1e-4) * core_time  # the ripple of i_c behind an equal filter: 0/0
    machine = Machine(
        v["flux_harmonics.psi_d6"], v["flux_harmonics.psi_q6"], v["inductance_harmonics.gamma_6"],
        conductance, core_time, v["skin_effect.resistance"], v["skin_effect.time_constant"],
        v["winding_asymmetry.delta_a"], v["winding_asymmetry.delta_b"], v["device_drop.on_resistance"],
    )  # fmt: skip
    inverter = Inverter(
        period, converter.dc_bus_voltage, (1.0 + v["dc_link_error.gain_error"]) * converter.dc_bus_voltage,
        v["dc_link_ripple.amplitude"], math.tau * v["dc_link_ripple.frequency"], v["dc_link_ripple.phase"],
        v["dead_time.time"], v["device_drop.threshold"], SOFT_SIGN * motor.rated_current,
        v["pwm_delay.delay"], filter_time, core_time if conductance else 0.0, conductance,
        v["dc_link_error.sag"],
    )  # fmt: skip
    counts = converter.encoder_counts
    sensors = Sensors(
        v["current_gain.gain_a"], v["current_gain.gain_b"], v["current_gain.gain_c"],
        v["current_offset.offset_a"], v["current_offset.offset_b"],
        filter_time, v["current_sampling.delay"], v["current_sampling.jitter"],
        v["encoder_offset.offset"], v["encoder_eccentricity.amplitude_mech"], v["encoder_eccentricity.phase"],
        math.tau * motor.pole_pairs / counts if counts else 0.0,
    )  # fmt: skip
    return Effects(_path(motor, v), machine, _shaft(motor, v, free), inverter, sensors)


def _path(motor: Motor, values: Mapping[str, float]) -> int:
    """Return BARE where nothing but the plant's own numbers and the reading of its samples differs from neutral."""
    idle = neutral(motor)
    handled = (*SAMPLE_ONLY, *REPLACED, "viscous_friction")
    return int(any(values[k] != idle[k] for k in values if k.partition(".")[0] not in handled))


def masses(values: Mapping[str, float]) -> tuple[float, float]:
    """Return the inertia on the motor's and on the load's side (kg m^2); a rigid shaft has all on the motor's."""
    load = values["shaft_compliance.load_inertia"]
    if not math.isfinite(values["shaft_compliance.stiffness"]):
        load = 0.0
    return values["inertia.inertia"] - load, load


def _shaft(motor: Motor, v: Mapping[str, float], free: bool) -> Shaft:
    inertia, load = masses(v)
    twisting = free and load > 0.0
    stiffness = v["shaft_compliance.stiffness"] if twisting else 0.0
    return Shaft(
        v["coulomb_friction.torque"], v["coulomb_friction.width"],
        v["coulomb_friction.stribeck_torque"], v["coulomb_friction.stribeck_speed"],
        v["cogging_torque.amplitude"], v["cogging_torque.order_mech"], v["cogging_torque.phase"], stiffness,
        damping_of(v["shaft_compliance.damping_ratio"], stiffness, inertia, load) if twisting else 0.0,
        motor.pole_pairs / load if twisting else 0.0,
    )  # fmt: skip


def longest_step(values: Mapping[str, float], step: float) -> float:
    """Return the plant step (s): `step`, or less where an effect has a time constant it could not resolve."""
    if math.isfinite(values["iron_loss.core_resistance"]):
        step = min(step, 0.7 * values["iron_loss.time_constant"])
    if values["skin_effect.resistance"] > 0.0:
        step = min(step, 0.7 * values["skin_effect.time_constant"])
    if friction_rate(values) > 0.0:
        step = min(step, 0.5 / friction_rate(values))
    inertia, load = masses(values)
    if load > 0.0:
        rate = math.sqrt(values["shaft_compliance.stiffness"] * (1.0 / inertia + 1.0 / load))
        step = min(step, 0.2 / rate)
    return step


def start(effects: Effects, theta: float) -> NDArray[np.float64]:
    """Return the plant's state at rest without current at an electrical angle (rad)."""
    x = np.zeros(SIZE)
    m = effects.machine
    x[PHI_D], x[PHI_Q], x[THETA] = m.psi_d6 * math.cos(6.0 * theta), m.psi_q6 * math.sin(6.0 * theta), theta
    x[DUTY : DUTY + 3] = 0.5
    return x
