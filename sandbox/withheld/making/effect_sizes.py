"""What is put into a withheld drive of the library's effects, at a size from a ladder (others:
`outside_causes`).

A size is a multiple of the medium one, and that is what the practice recordings have where they
show an effect, else the card's typical size.  Signs, phases and shares are drawn.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field

from numpy.random import Generator

from model.effects.card import scales
from model.effects.library import replaced, scaled
from model.mapped import ALPHAS
from model.parameters import Converter, Motor

EFFECT_SIZES = (0.25, 0.5, 1.0, 2.0)
# medium sizes of what the motor states, in its logarithm (viscous friction: rated torque / rated
# speed);
STEPS = {
    # means, where every value has its own
    "stator_resistance": 0.18,
    "magnet_flux": 0.10,
    "inertia": 0.26,
    "inductance": 0.09,
    "saturation": 0.425,
    "cross_saturation": 1.4,
    "viscous_friction": 0.1,
}
Values = dict[str, float]


@dataclass(frozen=True)
class Planted:
    """What one effect changes: the true motor, the believed one, the plant (public names), the
    switched bench's own."""

    true: Mapping[str, float] = field(default_factory=dict)
    believed: Mapping[str, float] = field(default_factory=dict)
    plant: Mapping[str, float] = field(default_factory=dict)
    bench: Mapping[str, float] = field(default_factory=dict)
    # alphas that the stated flux map has beyond the true one
    of_map: Mapping[str, float] = field(default_factory=dict)
    drift: float = 0.0  # of the resistance, relative, over the campaign


def sign(rng: Generator) -> float:
    """Return -1 or 1."""
    return float(rng.choice([-1.0, 1.0]))


def medium(
    name: str, motor: Motor, converter: Converter, size: float, rng: Generator
) -> dict[str, float]:
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
        "current_gain": lambda: {
            "gain_a": 1.0 + sign(rng) * 0.02 * size,
            "gain_b": 1.0 + sign(rng) * 0.01 * size,
        },
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


def truth_of(
    names: list[str],
    true: Motor,
    believed: Motor,
    plant_values: Mapping[str, float],
    added_to_map: Mapping[str, float] | None = None,
) -> dict[str, float]:
    """Return the true parameters of effects by public name; scales and replaced values against the
    stated motor.

    beside_map: alphas by which the true motor saturates beyond a flux map that is stated.
    """
    of_motor = {name: float(getattr(true, field_)) for name, field_ in replaced().items()}
    of_motor |= {f"saturation.{alpha}": size for alpha, size in (added_to_map or {}).items()}
    of_motor |= {
        f"cross_{k}": v
        for k, v in of_motor.items()
        if k in ("saturation.alpha_12", "saturation.alpha_22")
    }
    of_motor |= {
        name: getattr(true, field_) / getattr(believed, field_) for name, field_ in scaled().items()
    }
    known = of_motor | dict(plant_values)
    return {k: v for k, v in known.items() if k.partition(".")[0] in names}
