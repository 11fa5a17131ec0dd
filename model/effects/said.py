"""Quantities as a person sets them on a drive: two digits, a prefix, the unit's sign."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence

from model.parameters import Motor

PREFIXES = ((1e9, "G"), (1e6, "M"), (1e3, "k"), (1.0, ""), (1e-3, "m"), (1e-6, "µ"), (1e-9, "n"))
PREFIXED = ("s", "A", "V", "Wb", "ohm", "N m", "rad", "Hz", "H")
SIGNS = {"ohm": "Ω", "N m": "N·m", "kg m^2": "kg·m²", "N m s/rad": "N·m·s/rad"}
# K: IEC 60034-1, resistance proportional to 235 + temperature (°C), from 20 °C
COPPER = 235.0 + 20.0
# 1/K that the remanence falls by (data sheets: 0.11 to 0.12 %, 0.2 %)
MAGNETS = {"NdFeB": 0.0012, "ferrite": 0.002}
# K from 20 °C: no bench is colder, no winding's or magnet's insulation lasts hotter
COLDEST, HOTTEST = -60.0, 200.0
# units of alphas
PER_FLUXES = {"30": "A/Wb²", "12": "A/Wb²", "40": "A/Wb³", "22": "A/Wb³", "04": "A/Wb³"}


def quantity(value: float, unit: str, digits: int = 2) -> str:
    """Return a size with its unit: "2.0 µs"."""
    scale, prefix = 1.0, ""
    if unit in PREFIXED and value and math.isfinite(value):
        rounded = float(f"{abs(value):.{digits - 1}e}")
        scale, prefix = next(((s, p) for s, p in PREFIXES if rounded >= s), PREFIXES[-1])
    sign = "−" if value < 0.0 else ""
    return f"{sign}{number(abs(value) / scale, digits)} {prefix}{SIGNS.get(unit, unit)}".rstrip()


def number(value: float, digits: int = 2) -> str:
    """Return a number with so many digits, no more of them after the point than it takes."""
    if not value or not math.isfinite(value):
        return f"{value:g}"
    places = digits - 1 - math.floor(math.log10(float(f"{abs(value):.{digits - 1}e}")))
    return f"{round(value, places):.{max(places, 0)}f}"


def percent(share: float) -> str:
    """Return a change in percent with its sign: "+15 %"."""
    return f"{'−' if share < 0.0 else '+'}{number(100.0 * abs(share))} %"


def angle(value: float) -> str:
    """Return the size of an angle (rad) in degrees."""
    return f"{number(math.degrees(abs(value)))}°"


def wave(size: str, order: float, phase: float) -> str:
    """Return a sine of an angle x as a person types it: "20 mN·m sin(36 x + 29°)"; phase: rad."""
    turn, degrees = (
        "x" if order == 1 else f"{order:g} x",
        round(math.degrees(math.remainder(phase, math.tau))),
    )
    sign = "+" if degrees > 0 else "−"
    return f"{size} sin({turn}{f' {sign} {abs(degrees)}°' if degrees else ''})"


def stated(name: str, value: float, unit: str) -> str:
    """Return a value as a motor's file states it, without a prefix: "inductance_d = 0.0412 H"."""
    return f"{name} = {number(value, 3)} {SIGNS.get(unit, unit)}"


def on_q(torque: float, motor: Motor) -> str:
    """Return the q current that makes a torque (N m) with the magnets alone, in brackets; nothing
    without magnets."""
    if not motor.magnet_flux:
        return ""
    return f" (about {quantity(torque / (1.5 * motor.pole_pairs * motor.magnet_flux), 'A')} on q)"


def warmer(kelvin: float) -> str:
    """Return a change of temperature in words; nothing where no winding and no magnet can be so
    warm or so cold."""
    if not COLDEST <= kelvin <= HOTTEST:
        return ""
    return f"{number(abs(kelvin))} K {'warmer' if kelvin > 0.0 else 'colder'}"


def model_for(motor: Motor, values: Mapping[str, float], names: Sequence[str]) -> str:
    """Return what to do about coefficients of saturation; values: completed ones, as the effect has
    them."""
    coefficients = ", ".join(
        f"{n} = {values[f'saturation.{n}']:.4g} {PER_FLUXES[n[-2:]]}" for n in names
    )
    if motor.has_map:
        return added_to_map(coefficients)
    return (
        f"give the estimator and the current control a model with {coefficients} (motor.toml has "
        "them), or a flux map"
    )


def added_to_map(text: str) -> str:
    """Return what to do about iron or magnets that are not as the motor's flux map has them."""
    return (
        f"not as the flux map has it: {text}; measure the map again as warm as the drive "
        "runs, or take effects.toml"
    )
