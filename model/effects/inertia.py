"""Inertia other than nominal."""

from __future__ import annotations

from collections.abc import Mapping

from model.effects.card import Effect, Ordinary, Parameter
from model.effects.said import percent, stated
from model.parameters import Converter, Motor


def do(v: Mapping[str, float], motor: Motor, converter: Converter) -> str:
    """Return what to do about it, at completed values."""
    found = v["inertia.inertia"]
    return (
        f"set {stated('inertia', found, 'kg m^2')} ({percent(found / motor.inertia - 1.0)}) in the "
        "motor's file and the speed control: it counts the load, too"
    )


CARD = Effect(
    name="inertia",
    summary="inertia other than nominal",
    subsystem="mechanics",
    equation="J dw/dt = torque - load - friction; replaces the nominal value",
    formulas=(r"J\,\frac{d w}{d t} = T - T_\text{load} - T_\text{friction}",),
    source="Newton",
    parameters=(
        Parameter(
            "inertia",
            "kg m^2",
            None,
            1e-9,
            1e4,
            1.3,
            "neutral",
            "inertia",
            ordinary=Ordinary("inertia", 0.05, of_motor=True),
            title="inertia",
        ),
    ),
    axis="motion",
    order="0",
    region="free rotor: accelerations after steps of load and torque",
    confused_with=("shaft_compliance", "coulomb_friction", "magnet_flux"),
    separated_by="free rotor, known torque step: acceleration at the first instants",
    do=do,
)
