"""Magnet flux other than nominal (temperature, tolerance, partial demagnetisation)."""

from __future__ import annotations

from collections.abc import Mapping

from model.effects.card import Effect, Ordinary, Parameter
from model.effects.said import MAGNETS, added_to_map, percent, quantity, stated, warmer
from model.parameters import Converter, Motor


def do(v: Mapping[str, float], motor: Motor, converter: Converter) -> str:
    """Return what to do about it, at completed values."""
    found = v["magnet_flux.magnet_flux"]
    out = f"set {stated('magnet_flux', found, 'Wb')} in the motor's file and the estimator"
    if not motor.magnet_flux:
        return added_to_map(f"magnet flux {quantity(found, 'Wb', 3)}") if motor.has_map else out
    change = found / motor.magnet_flux - 1.0
    warm = {name: warmer(-change / slope) for name, slope in MAGNETS.items()}
    causes = [f"{name} {kelvin}" for name, kelvin in warm.items() if kelvin]
    why = ", or ".join([*causes, "partly demagnetised" if change < 0.0 else "a stronger grade"])
    if motor.has_map:
        return added_to_map(f"magnet flux {percent(change)} ({why})")
    return f"{out} ({percent(change)}: {why})"


CARD = Effect(
    name="magnet_flux",
    summary="magnet flux other than nominal (temperature, tolerance, partial demagnetisation)",
    subsystem="machine",
    equation="back-EMF omega phi_m on q, torque 3/2 p phi_m i_q; replaces the nominal value",
    formulas=(
        r"\psi_d = \phi_d + \phi_m, \qquad u_q \;\text{+=}\; \omega\,\phi_m, \qquad T "
        r"\;\text{+=}\; \tfrac32\,p\,\phi_m\,i_q",
    ),
    source="Park's equations; NdFeB remanence about -0.12 %/K (data sheets)",
    parameters=(
        Parameter(
            "magnet_flux",
            "Wb",
            None,
            0.0,
            1e2,
            0.94,
            "neutral",
            "magnet_flux",
            ordinary=Ordinary("magnet_flux", 0.02, of_motor=True),
            title="magnet flux",
        ),
    ),
    axis="q",
    order="0",
    region="grows with speed, absent at standstill",
    confused_with=("dc_link_error", "viscous_friction", "encoder_offset"),
    separated_by="driven or coasting rotor at zero current: terminal voltage over speed",
    do=do,
)
