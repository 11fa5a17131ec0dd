"""Quantities as a person sets them on a drive: two digits, a prefix, the unit's sign."""

from __future__ import annotations

import math

PREFIXES = ((1e9, "G"), (1e6, "M"), (1e3, "k"), (1.0, ""), (1e-3, "m"), (1e-6, "µ"), (1e-9, "n"))
PREFIXED = ("s", "A", "V", "Wb", "ohm", "N m", "rad", "Hz", "H")
SIGNS = {"ohm": "Ω", "N m": "N·m", "kg m^2": "kg·m²", "N m s/rad": "N·m·s/rad"}
COPPER = 235.0 + 20.0  # K: IEC 60034-1, resistance proportional to 235 + temperature (°C), from 20 °C
NEODYMIUM = 0.0012  # 1/K that the remanence of NdFeB falls by (data sheets)


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


def degrees(angle: float) -> str:
    """Return an angle (rad) in degrees with its sign."""
    return f"{'−' if angle < 0.0 else '+'}{number(math.degrees(abs(angle)))}°"
