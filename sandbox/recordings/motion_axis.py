"""Whether a motion is a shaft's or a linear axis's, and the units and words of its values.

The equations are the same: metres stand for radians, newtons for newton metres, kilograms for
kg m^2.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, NamedTuple

from model.errors import BadInput, unknown

KEYS = {"inertia": "mass", "torque_constant": "force_constant"}  # of [motor]: a shaft's, an axis's


class Axis(NamedTuple):
    """A kind of motion.

    name: as [motor] axis states it; units: what stands for a shaft's unit; least: rad or m that a
    motion takes; torque, inertia: what these are called; moves, what: of whose motion, in words.
    """

    name: str
    units: Mapping[str, str]
    least: float
    torque: str
    inertia: str
    moves: str
    what: str

    def unit(self, of_shaft: str) -> str:
        """Return what stands for a shaft's unit."""
        return self.units.get(of_shaft, of_shaft)

    def words(self, text: str) -> str:
        """Return a sentence on a shaft in this motion's words."""
        return text.replace("torque", self.torque).replace("inertia", self.inertia)


ROTARY = Axis("rotary", {}, 0.05, "torque", "inertia", "the rotor turns", "a rotating shaft")
LINEAR = Axis(
    "linear",
    {
        "N m": "N",
        "N m s/rad": "N s/m",
        "N m/A": "N/A",
        "kg m^2": "kg",
        "rad": "m",
        "rad/s": "m/s",
    },
    1e-3,
    "force",
    "mass",
    "the axis moves",
    "a linear axis",
)
AXES = {a.name: a for a in (ROTARY, LINEAR)}


def shafts_keys(motor: Mapping[str, Any]) -> dict[str, Any]:
    """Return [motor] with an axis's keys under a shaft's names."""
    names = {v: k for k, v in KEYS.items()}
    return {names.get(k, k): v for k, v in motor.items()}


def axis_of(motor: Mapping[str, Any], source: str) -> Axis:
    """Return what [motor] says of the motion: `axis`, or a mass or a force constant; a shaft's
    where it says nothing.  BadInput for an unknown kind, and for values of both."""
    of_linear = [k for k in KEYS.values() if k in motor]
    stated = motor.get("axis", LINEAR.name if of_linear else ROTARY.name)
    if stated not in AXES:
        raise BadInput(f"{source}: {unknown('axis of [motor]', str(stated), AXES)}")
    other = [k for k in KEYS if k in motor] if stated == LINEAR.name else of_linear
    if other:
        pairs = {**KEYS, **{v: k for k, v in KEYS.items()}}
        raise BadInput(
            f"{source}: [motor] {other[0]} is no value of a {stated} axis; give "
            f"{pairs[other[0]]} in its place"
        )
    return AXES[stated]
