"""What is put into a withheld drive: effects of the library at a size from a ladder, and some that it does not hold.

A size is a multiple of the medium one, and that is what the practice recordings have where they show an effect, else
the card's typical size.  Signs, phases and shares are drawn.
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any

from numpy.random import Generator

from model.effects.card import scales
from model.effects.library import replaced, scaled
from model.parameters import Converter, Drive, Motor
from sandbox.validation.withheld.drives import ALPHAS

LADDER = (0.25, 0.5, 1.0, 2.0)
STEPS = {  # medium sizes of what the motor states, in its logarithm (viscous friction: rated torque / rated speed);
    # means, where every value has its own
    "stator_resistance": 0.18, "magnet_flux": 0.10, "inertia": 0.26, "inductance": 0.09, "saturation": 0.425,
    "cross_saturation": 1.4, "viscous_friction": 0.1,
}  # fmt: skip
Values = dict[str, float]
DRIFT_TIME = 11.0 / 3.0  # recordings: the winding's temperature settles within a campaign


@dataclass(frozen=True)
class Planted:
    """What one effect changes: the true motor, the believed one, the plant (public names), the switched bench's own."""

    true: Mapping[str, float] = field(default_factory=dict)
    believed: Mapping[str, float] = field(default_factory=dict)
    plant: Mapping[str, float] = field(default_factory=dict)
    bench: Mapping[str, float] = field(default_factory=dict)
    drift: float = 0.0  # of the resistance, relative, over the campaign


def sign(rng: Generator) -> float:
    """Return -1 or 1."""
    return float(rng.choice([-1.0, 1.0]))


def medium(name: str, motor: Motor, converter: Converter, size: float, rng: Generator) -> dict[str, float]:
    """Return the plant's parameters of an effect that acts beside the motor's own values."""
    unit, u, tau = scales(motor, converter), rng.uniform, math.tau
    rated, torque, ohm = motor.rated_current, motor.rated_torque, motor.resistance
    table: dict[str, Callable[[], Values]] = {
        "flux_harmonics": lambda: {
            "psi_d6": sign(rng) * 0.0133 * size * motor.magnet_flux,
            "psi_q6": sign(rng) * 0.0133 * size * motor.magnet_flux,
        },
        "inductance_harmonics": lambda: {"gamma_6": sign(rng) * 0.015 * size / motor.inductance_d},
        "iron_loss": lambda: {
            "core_resistance": 20.0 * unit["rated reactance"] / size,
            "time_constant": u(1e-4, 3e-4),
        },
        "skin_effect": lambda: {"resistance": 0.3 * size * ohm, "time_constant": u(1e-4, 3e-4)},
        "winding_asymmetry": lambda: {
            "delta_a": sign(rng) * 0.03 * size * ohm,
            "delta_b": sign(rng) * 0.02 * size * ohm,
        },
        "dead_time": lambda: {"time": 1.2e-6 * size},
        "device_drop": lambda: {"threshold": size, "on_resistance": 0.02 * size * ohm},
        "dc_link_error": lambda: {"gain_error": sign(rng) * 0.03 * size},
        "dc_link_ripple": lambda: {
            "amplitude": 0.02 * size * converter.dc_bus_voltage,
            "frequency": float(rng.choice([100.0, 300.0, 360.0])),
            "phase": u(0.0, tau),
        },
        "pwm_delay": lambda: {"delay": 0.15 * size * converter.sampling_period},
        "current_gain": lambda: {"gain_a": 1.0 + sign(rng) * 0.02 * size, "gain_b": 1.0 + sign(rng) * 0.01 * size},
        "current_offset": lambda: {
            "offset_a": sign(rng) * 0.018 * size * rated,
            "offset_b": sign(rng) * 0.010 * size * rated,
        },
        "current_filter": lambda: {"time_constant": 3e-5 * size},
        "current_sampling": lambda: {"delay": sign(rng) * 5e-6 * size},
        "encoder_offset": lambda: {"offset": sign(rng) * 0.047 * size},
        "encoder_eccentricity": lambda: {"amplitude_mech": 0.005 * size, "phase": u(0.0, tau)},
        "coulomb_friction": lambda: {"torque": 0.064 * size * torque},
        "cogging_torque": lambda: {
            "amplitude": 0.03 * size * torque,
            "order_mech": float(motor.pole_pairs * rng.choice([4, 6, 12])),
            "phase": u(0.0, tau),
        },
        "shaft_compliance": lambda: {
            "stiffness": 0.25 * unit["inertia x (2 pi 100 Hz)^2"] / size,
            "load_inertia": u(0.3, 0.6) * motor.inertia,
        },
    }
    return {f"{name}.{k}": float(v) for k, v in table[name]().items()} if name in table else {}


def plant(name: str, motor: Motor, converter: Converter, size: float, rng: Generator) -> Planted:
    """Return what an effect of the library changes on a drive; size: multiple of the medium one."""

    def off(field_: str, step: float) -> float:
        """Return the motor's value as it is believed, steps of its logarithm off."""
        return float(getattr(motor, field_)) * math.exp(-size * step)

    if name in ("stator_resistance", "magnet_flux", "inertia"):
        field_ = name.removeprefix("stator_")
        return Planted(believed={field_: off(field_, sign(rng) * STEPS[name])})
    if name == "viscous_friction":
        drag = STEPS[name] * size * scales(motor, converter)["rated torque / rated speed"]
        return Planted(true={name: motor.viscous_friction + drag})
    if name == "inductance":
        steps = {f"inductance_{axis}": sign(rng) * rng.uniform(0.06, 0.12) for axis in "dq"}
        return Planted(believed={k: off(k, s) for k, s in steps.items()})
    if name == "saturation":
        return Planted(believed={a: off(a, rng.uniform(0.25, 0.6)) for a in ALPHAS})
    if name == "cross_saturation":
        return Planted(believed={a: off(a, STEPS[name]) for a in ("alpha_12", "alpha_22")})
    return Planted(plant=medium(name, motor, converter, size, rng))


def _hysteresis(drive: Drive, size: float, rng: Generator) -> Planted:
    """A play of a tenth of the flux of rated current, 3 % of rated current wide at medium size."""
    motor = drive.motor
    inductance = math.sqrt(motor.inductance_d * motor.inductance_q)
    radius = 0.1 * size * inductance * motor.rated_current
    return Planted(bench={"grip": 0.3 / inductance, "grip_radius": radius})


def _inter_turn_short(drive: Drive, size: float, rng: Generator) -> Planted:
    """4 % of phase a's turns shorted through as much resistance as they have themselves."""
    conductance = 0.04 * size / (3.0 * drive.motor.resistance)
    return Planted(bench={"short_conductance": conductance, "short_time": rng.uniform(1e-4, 3e-4)})


def _knee(drive: Drive, size: float, rng: Generator) -> Planted:
    """Saturation with a knee at 0.8 of the rated current's flux; 15 % of rated current more at twice that flux."""
    motor = drive.motor
    start = 0.8 * math.sqrt(motor.inductance_d * motor.inductance_q) * motor.rated_current
    return Planted(bench={"knee": 0.15 * size * motor.rated_current / start**2, "knee_flux": start})


def _sensor_curvature(drive: Drive, size: float, rng: Generator) -> Planted:
    """Every current sensor reads 2.5 % less at rated current, by the square of the current.

    Not more: control must still reach 1.7 times rated current as read, and at double size it takes 2.0 times.
    """
    return Planted(bench={"curvature": 0.025 * size / drive.motor.rated_current**2})


def _fan(drive: Drive, size: float, rng: Generator) -> Planted:
    """A fan on the shaft: 10 % of rated torque at rated speed, by the square of the speed."""
    motor = drive.motor
    speed = motor.rated_omega / motor.pole_pairs
    return Planted(bench={"fan": 0.1 * size * motor.rated_torque / speed**2})


def _resolver(drive: Drive, size: float, rng: Generator) -> Planted:
    """Windings of a resolver that are not square: 0.4 degrees mechanical, twice a turn."""
    return Planted(bench={"resolver": math.radians(0.4) * size, "resolver_phase": rng.uniform(0.0, math.tau)})


def _least_vector(drive: Drive, size: float, rng: Generator) -> Planted:
    """Active vectors shorter than 0.5 % of the PWM period are left out, as a drive does that reads a single shunt."""
    return Planted(bench={"least_vector": 0.005 * size * drive.converter.sampling_period})


def _link_resonance(drive: Drive, size: float, rng: Generator) -> Planted:
    """The link's capacitors and its supply's inductance resonate at 600 Hz, damped by 0.05: three windings' R."""
    impedance = 3.0 * size * drive.motor.resistance
    return Planted(bench={"link_rate": math.tau * 600.0, "link_impedance": impedance, "link_damping": 0.05})


def _one_sided(drive: Drive, size: float, rng: Generator) -> Planted:
    """Upper devices of another kind than the lower: 5 % of the winding's resistance more while a current flows out."""
    return Planted(bench={"one_sided": 0.05 * size * drive.motor.resistance})


def _temperature_drift(drive: Drive, size: float, rng: Generator) -> Planted:
    """The winding warms up: resistance 15 % (40 K) higher at the campaign's end than at its beginning."""
    return Planted(drift=0.15 * size)


@dataclass(frozen=True)
class Outside:
    """An effect that the library does not hold: the subsystem it lies in, and what it changes at a size."""

    subsystem: str
    planted: Callable[[Drive, float, Generator], Planted]


OUTSIDE = {
    "hysteresis": Outside("machine", _hysteresis),
    "inter_turn_short": Outside("machine", _inter_turn_short),
    "knee": Outside("machine", _knee),
    "temperature_drift": Outside("machine", _temperature_drift),
    "sensor_curvature": Outside("sensor", _sensor_curvature),
    "fan": Outside("mechanics", _fan),
    "resolver": Outside("sensor", _resolver),
    "least_vector": Outside("inverter", _least_vector),
    "link_resonance": Outside("inverter", _link_resonance),
    "one_sided": Outside("inverter", _one_sided),
}


def truth_of(names: list[str], true: Motor, believed: Motor, plant_values: Mapping[str, float]) -> dict[str, float]:
    """Return the true parameters of effects by public name; scales and replaced values against the stated motor."""
    of_motor = {name: float(getattr(true, field_)) for name, field_ in replaced().items()}
    of_motor |= {f"cross_{k}": v for k, v in of_motor.items() if k in ("saturation.alpha_12", "saturation.alpha_22")}
    of_motor |= {name: getattr(true, field_) / getattr(believed, field_) for name, field_ in scaled().items()}
    known = of_motor | dict(plant_values)
    return {k: v for k, v in known.items() if k.partition(".")[0] in names}


def changed(motor: Motor, values: Mapping[str, float]) -> Motor:
    """Return the motor with some values replaced."""
    new: dict[str, Any] = dict(values)
    return dataclasses.replace(motor, **new)
