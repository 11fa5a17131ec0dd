"""Viscous friction other than nominal."""

from __future__ import annotations

from collections.abc import Mapping

from model.compiled import inlined
from model.effects.card import At, Effect, Ordinary, Parameter
from model.effects.said import quantity, stated
from model.parameters import Converter, Motor


@inlined
def drag(coefficient, omega_mech):
    """Return the torque (N m) against a mechanical speed (rad/s)."""
    return coefficient * omega_mech


def do(v: Mapping[str, float], motor: Motor, converter: Converter) -> str:
    """Return what to do about it, at completed values."""
    found = v["viscous_friction.coefficient"]
    torque = found * motor.rated_omega / motor.pole_pairs
    return (
        f"set {stated('viscous_friction', found, 'N m s/rad')} in the motor's file "
        f"({quantity(torque, 'N m')} at "
        f"{motor.rated_speed_rpm:.4g} rpm); far more than stated: look at lubrication and fan"
    )


CARD = Effect(
    name="viscous_friction",
    summary="viscous friction other than nominal",
    subsystem="mechanics",
    equation="torque B w_mech (total), on the motor's side; replaces the nominal value",
    formulas=(r"T \;\text{-=}\; B\,w_\text{mech}",),
    source="Newton's law of viscosity in bearings; linear drag",
    parameters=(
        Parameter(
            "coefficient",
            "N m s/rad",
            None,
            0.0,
            1e4,
            0.05,
            "rated torque / rated speed",
            "viscous_friction",
            ordinary=Ordinary("viscous_friction", 0.2, of_motor=True),
            title="viscous friction",
        ),
    ),
    axis="motion (and i_q under speed control)",
    order="0",
    region="free rotor, grows with speed",
    confused_with=("coulomb_friction", "iron_loss", "magnet_flux"),
    separated_by="coasting down from high speed: exponential against straight line",
    at=(At("friction", drag, ("coefficient",)),),
    do=do,
)
