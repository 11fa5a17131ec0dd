"""What to write in place of a stated value that cannot be: the same in the unit of a data sheet,
without its sign, or where such a value comes from."""

from __future__ import annotations

import math
import re

MEANT = {  # units of data sheets, by ours
    "s": {"ms": 1e-3, "us": 1e-6},
    "H": {"mH": 1e-3, "uH": 1e-6},
    "Wb": {"mWb": 1e-3, "uWb": 1e-6},
    "ohm": {"mohm": 1e-3},
    "kg m^2": {"g cm^2": 1e-7, "kg cm^2": 1e-4},
    "A peak": {"mA": 1e-3},
    "N m": {"mN m": 1e-3},
    "V": {"mV": 1e-3},
}
NUMBER_WITH_UNIT = re.compile(r"([-+]?[\d.,]+(?:[eE][-+]?\d+)?)\s*(.*)", re.DOTALL)
# or three places after a decimal comma: nobody can say which
THOUSAND = re.compile(r"[+-]?[1-9]\d{0,2},\d{3}")
SATURATION = "0 without saturation, or what `sensorless identify` finds"
UNKNOWN = "0 where it is not known"
FROM = {  # where a value comes from, by its key
    "pole_pairs": "half of the number of the rotor's poles",
    "resistance": "half of what is measured between two terminals",
    "magnet_flux": "the peak voltage between two open terminals over sqrt(3) and the speed in "
    "electrical rad/s",
    "inductance_d": "half of the smallest inductance between two terminals as the rotor turns",
    "inductance_q": "half of the largest inductance between two terminals as the rotor turns",
    "inertia": "that of the rotor and of all that turns with it",
    "mass": "that of the slide and of all that moves with it",
    "torque_constant": "the rated torque over the rated peak current",
    "force_constant": "the rated force over the rated peak current",
    "rated_current": "sqrt(2) times the data sheet's rms value",
    "rated_torque": "the data sheet's, at rated current",
    "rated_speed_rpm": "the data sheet's, of the shaft",
    "alpha_30": SATURATION,
    "alpha_12": SATURATION,
    "alpha_40": SATURATION,
    "alpha_22": SATURATION,
    "alpha_04": SATURATION,
    "viscous_friction": UNKNOWN,
    "sampling_period": "the time from one row of a log to the next, or of the drive's control",
    "dc_bus_voltage": "the link's volts, or the battery's",
    "current_resolution": "the sensors' range over the converter's counts, " + UNKNOWN,
    "current_noise": "the scatter of a reading without current, " + UNKNOWN,
    "link_noise": "the scatter of the reading at a steady link, " + UNKNOWN,
    "pwm_frequency": "the drive's switching frequency",
    "encoder_counts": "four times an encoder's lines, or 2 to the power of its bits",
    "least_pulse": "the shortest pulse that the drive gives, " + UNKNOWN,
    "frequency": "that of the injected voltage",
    "amplitude": "that of the injected voltage",
}


def remedy(name: str, value: float, low: float, high: float, unit: str) -> str:
    """Return what to write for a value outside its range (nan included), as the end of a sentence;
    nothing where nobody can say."""
    if not math.isfinite(value):
        return f": {FROM[name]}" if name in FROM else ""
    meant = [
        f"{own}? write {factor * value:g}"
        for own, factor in MEANT.get(unit, {}).items()
        if low <= factor * value <= high
    ]
    if meant:
        return f"; is it {', or '.join(meant)}"
    if value < 0.0 and low <= -value <= high:
        return f"; is its sign wrong? write {-value:g}"
    return f": {FROM[name]}" if name in FROM else ""


def number_of(value: object, low: float, high: float, unit: str) -> str:
    """Return what to write for a text of a number and a unit, such as "45.8 mH"; nothing where that
    is not clear or out of range."""
    found = NUMBER_WITH_UNIT.fullmatch(value.strip()) if isinstance(value, str) else None
    number, own = found.groups() if found else ("", "")
    unit = unit or "no unit"
    factor = {unit: 1.0, "": 1.0, **MEANT.get(unit, {})}.get(own)
    if factor is None or THOUSAND.fullmatch(number):
        return ""
    try:
        meant = factor * float(number.replace(",", "."))
    except ValueError:
        return ""
    # NaN is in no range
    return f": write {meant:g}" if low <= meant <= high else ""
