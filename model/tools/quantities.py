"""A quantity as a data sheet writes it: "0.2 mH", "6,4 mWb", "12.5 A rms", into SI units of one
phase, peak.

Sources: the definitions of the units; amplitude-invariant transformation (a vector is as long as a
phase's peak).
"""

from __future__ import annotations

import math
import re
from typing import NamedTuple

from model.errors import BadInput, brief, unknown

RPM = math.pi / 30.0  # rad/s
UNITS: dict[str, dict[str, float]] = {  # of each kind: unit as written, what it is in SI
    "ohm": {"ohm": 1.0, "mohm": 1e-3, "kohm": 1e3},
    "H": {"H": 1.0, "mH": 1e-3, "uH": 1e-6, "nH": 1e-9},
    "Wb": {"Wb": 1.0, "mWb": 1e-3, "uWb": 1e-6, "Vs": 1.0, "mVs": 1e-3},
    "A": {"A": 1.0, "mA": 1e-3, "kA": 1e3},
    "V": {"V": 1.0, "mV": 1e-3, "kV": 1e3},
    "N m": {
        "Nm": 1.0,
        "mNm": 1e-3,
        "Ncm": 1e-2,
        "kNm": 1e3,
        "ozin": 7.0615518e-3,
        "lbin": 0.11298483,
    },
    "rpm": {
        "rpm": 1.0,
        "rad/s": 1.0 / RPM,
        "krpm": 1e3,
        "1/min": 1.0,
        "min-1": 1.0,
        "r/min": 1.0,
        "rps": 60.0,
        "Hz": 60.0,
    },
    "kg m^2": {"kgm2": 1.0, "kgcm2": 1e-4, "gcm2": 1e-7, "kgmm2": 1e-6, "gmm2": 1e-9},
    "s": {"s": 1.0, "ms": 1e-3, "us": 1e-6},
    "Hz": {"Hz": 1.0, "kHz": 1e3},
    "rpm/V": {"rpm/V": 1.0},
    "V s/rad": {
        "V/krpm": 1e-3 / RPM,
        "V/1000rpm": 1e-3 / RPM,
        "mV/rpm": 1e-3 / RPM,
        "Vs/rad": 1.0,
        "V/(rad/s)": 1.0,
    },
    "N m/A": {
        "Nm/A": 1.0,
        "mNm/A": 1e-3,
        "Ncm/A": 1e-2,
        "ozin/A": 7.0615518e-3,
        "lbin/A": 0.11298483,
    },
    "": {"": 1.0},
}
RMS = re.compile(
    r"(?<=[AVb\d\s_(])[\s_(]*(rms|eff)\)?(?=\s*(/|$))|^[\s_(]*(rms|eff)\)?$", re.IGNORECASE
)
PEAK = re.compile(r"(?<=[AVb\d\s_(])[\s_(]*(peak|pk)\)?(?=\s*(/|$))", re.IGNORECASE)
WRITTEN = re.compile(r"^\s*([-+]?(?:\d+(?:[.,]\d*)?|[.,]\d+)(?:[eE][-+]?\d+)?)\s*(.*?)\s*$")


class Quantity(NamedTuple):
    """A value in SI units (rms where it says so), how it was written, and the number and unit of
    that."""

    value: float
    rms: bool
    written: str
    number: float
    unit: str


def quantity_of(text: str, kind: str, what: str) -> Quantity:
    """Return a quantity of a kind (a key of UNITS; none written: SI); BadInput says what is wrong
    with it."""
    found = WRITTEN.match(text)
    if not found:
        raise BadInput(
            f"{what} = {brief(text)} is no quantity; write a number and its unit, such "
            f"as {_example(kind)}"
        )
    number, unit = float(found[1].replace(",", ".")), found[2]
    rms = bool(RMS.search(unit))
    bare = PEAK.sub("", RMS.sub("", unit)).strip(" (_")
    plain = re.sub(r"[ ·*^\[\]]", "", bare).replace("²", "2").replace("µ", "u").replace("μ", "u")
    plain = plain.replace("Ω", "ohm").replace("Ohm", "ohm")
    known = UNITS[kind]
    if plain and plain not in known:
        same = [u for u in known if u.lower() == plain.lower() and plain[0] not in "mM"]
        if not same:
            raise unknown(f"unit of {what}", bare, [u for u in known if u])
        plain = same[0]
    value = number * (known[plain] if plain else 1.0)
    if not math.isfinite(value):
        raise BadInput(f"{what} = {brief(text)} is no finite number")
    return Quantity(value, rms, text.strip(), number, bare)


def _example(kind: str) -> str:
    return f"'2.5 {next(iter(UNITS[kind]))}'"
