"""Sizes of effects from published ranges (`published.toml`, a source each) in place of the ladder's
multiples.

A size is drawn as a place in its range, 0 its weak and 1 its strong end on a logarithmic scale.
What the seal calls size stays a multiple of the ladder's medium one, so that figures by size can be
compared.
"""

from __future__ import annotations

import math
import tomllib
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
from numpy.random import Generator

from model.effects.card import scales
from model.effects.library import replaced, scaled
from model.parameters import Converter, Motor
from sandbox.withheld.making.effect_sizes import STEPS, Planted, medium, sign

TABLE = Path(__file__).with_name("published.toml")
INVERSE = ("core_resistance", "stiffness")  # the larger, the smaller the effect
FIELDS = {**replaced(), **scaled()}
SI = ("s", "V", "rad", "rad/s")


@dataclass(frozen=True)
class Range:
    """What is published of one parameter; keys as `published.toml` explains them."""

    source: str
    range: Sequence[float] = ()
    unit: str = ""
    sign: str = "positive"
    ratio: str | None = None
    about: float = 0.0
    choices: Sequence[float] = ()
    turn: bool = False
    form: str | None = None

    def at(self, place: float) -> float:
        """Return the size at a place of the range, 0 to 1."""
        low, high = self.range
        return float(low * (high / low) ** place)


@cache
def table() -> Mapping[str, Mapping[str, Range]]:
    """Return all ranges by effect and parameter, the one that is an effect's size first."""
    content: dict[str, dict[str, dict[str, Any]]] = tomllib.loads(TABLE.read_text(encoding="utf-8"))
    return {
        effect: {name: Range(**entry) for name, entry in own.items()}
        for effect, own in content.items()
    }


def core_loss(share: float, motor: Motor, values: Mapping[str, float]) -> float:
    """Return the core's resistance (ohm) that loses a share of rated power at rated speed without
    current."""
    power = motor.rated_torque * motor.rated_omega / motor.pole_pairs
    return 1.5 * (motor.rated_omega * motor.magnet_flux) ** 2 / (share * power)


def volts_at_rated(volts: float, motor: Motor, values: Mapping[str, float]) -> float:
    """Return the resistance (ohm) that drops so many volts at rated current."""
    return volts / motor.rated_current


def resonance(frequency: float, motor: Motor, values: Mapping[str, float]) -> float:
    """Return the stiffness (N m/rad) of a shaft with a resonance in Hz between its two inertias."""
    load = values["load_inertia"]
    return (motor.inertia - load) * load / motor.inertia * (math.tau * frequency) ** 2


FORMS: Mapping[str, Callable[[float, Motor, Mapping[str, float]], float]] = {
    "core_loss": core_loss,
    "volts_at_rated": volts_at_rated,
    "resonance": resonance,
}


def planted(name: str, motor: Motor, converter: Converter, place: float, rng: Generator) -> Planted:
    """Return what an effect of the library changes on a drive, its size at a place of the published
    range."""
    drawn, values, believed = table()[name], dict[str, float](), dict[str, float]()
    unit = scales(motor, converter) | dict.fromkeys(SI, 1.0)
    leading = next(iter(drawn))
    for key in reversed(list(drawn)):  # the size last: a stiffness follows from the inertias
        r = drawn[key]
        if r.turn:
            values[key] = rng.uniform(0.0, math.tau)
        elif r.choices:
            values[key] = float(rng.choice(r.choices)) * unit[r.unit]
        else:
            x = r.at(place if key == leading else rng.uniform())
            way = sign(rng) if "either" in (r.sign, r.ratio) else 1.0
            if r.ratio is not None:
                field = FIELDS[f"{name.removeprefix('cross_')}.{key}"]
                believed[field] = getattr(motor, field) * (1.0 + x) ** (
                    way if r.ratio == "down" else -way
                )
            elif r.form is not None:
                values[key] = FORMS[r.form](x, motor, values)
            else:
                values[key] = r.about + way * x * unit[r.unit]
    if name == "viscous_friction":
        return Planted(true={name: motor.viscous_friction + values["coefficient"]})
    return Planted(believed=believed, plant={f"{name}.{k}": float(v) for k, v in values.items()})


def multiple(name: str, motor: Motor, converter: Converter, found: Planted) -> float:
    """Return the size of what was planted as a multiple of the ladder's medium one."""
    leading = next(iter(table()[name]))
    if name == "viscous_friction":
        more = found.true[name] - motor.viscous_friction
        return more / (STEPS[name] * scales(motor, converter)["rated torque / rated speed"])
    if found.believed:
        field = FIELDS[f"{name.removeprefix('cross_')}.{leading}"]
        return abs(math.log(getattr(motor, field) / found.believed[field])) / STEPS[name]
    about, key = table()[name][leading].about, f"{name}.{leading}"
    usual = medium(name, motor, converter, 1.0, np.random.default_rng(0))
    ratio = abs((found.plant[key] - about) / (usual[key] - about))
    return 1.0 / ratio if leading in INVERSE else ratio
