"""Units as people and programs write them, each with factor and offset to ours (SI; peak values;
degrees Celsius)."""

from __future__ import annotations

import math

PEAK = math.sqrt(2.0)  # of a sine over its rms
DEGREE = math.pi / 180.0
UNITS: dict[str, dict[str, tuple[float, float]]] = {
    "time": {
        "s": (1, 0),
        "sec": (1, 0),
        "second": (1, 0),
        "seconds": (1, 0),
        "ms": (1e-3, 0),
        "msec": (1e-3, 0),
        "us": (1e-6, 0),
        "µs": (1e-6, 0),
        "μs": (1e-6, 0),
        "ns": (1e-9, 0),
    },
    "voltage": {
        "V": (1, 0),
        "Volt": (1, 0),
        "Volts": (1, 0),
        "mV": (1e-3, 0),
        "kV": (1e3, 0),
        "Vrms": (PEAK, 0),
        "V rms": (PEAK, 0),
    },
    "current": {
        "A": (1, 0),
        "mA": (1e-3, 0),
        "kA": (1e3, 0),
        "Arms": (PEAK, 0),
        "A rms": (PEAK, 0),
        "Apk": (1, 0),
        "A peak": (1, 0),
        "Amp": (1, 0),
        "Amps": (1, 0),
        "Ampere": (1, 0),
    },
    "angle": {
        "rad": (1, 0),
        "deg": (DEGREE, 0),
        "°": (DEGREE, 0),
        "degrees": (DEGREE, 0),
        "rev": (math.tau, 0),
        "turns": (math.tau, 0),
    },
    "duty": {"1": (1, 0), "%": (0.01, 0), "-": (1, 0)},
    "state": {"1": (1, 0), "-": (1, 0)},
    "torque": {
        "N m": (1, 0),
        "Nm": (1, 0),
        "N.m": (1, 0),
        "N·m": (1, 0),
        "mNm": (1e-3, 0),
        "mN m": (1e-3, 0),
        "kNm": (1e3, 0),
    },
    "temperature": {"°C": (1, 0), "degC": (1, 0), "C": (1, 0), "K": (1, -273.15)},
    "speed": {
        "rad/s": (1, 0),
        "rpm": (math.tau / 60.0, 0),
        "RPM": (math.tau / 60.0, 0),
        "1/min": (math.tau / 60.0, 0),
        "rev/s": (math.tau, 0),
        "Hz": (math.tau, 0),
        "deg/s": (DEGREE, 0),
    },
    "flux": {
        "Wb": (1, 0),
        "mWb": (1e-3, 0),
        "uWb": (1e-6, 0),
        "µWb": (1e-6, 0),
        "Vs": (1, 0),
        "V s": (1, 0),
        "V.s": (1, 0),
        "V·s": (1, 0),
        "mVs": (1e-3, 0),
    },
}
KNOWN = frozenset(unit for units in UNITS.values() for unit in units)


def kinds_of(unit: str) -> frozenset[str]:
    """Return the kinds of quantity that a unit measures, none where it is no known unit."""
    return frozenset(kind for kind, units in UNITS.items() if unit in units)
