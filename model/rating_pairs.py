"""Which stated numbers of a drive physics binds to each other, and the one number whose other unit
would mend them.

    R I         voltage of rated current at standstill      at most what the link gives
    w L I       reactance at rated speed                    at most some times that: nobody could push the current
    L I / psi   current's own flux over the magnet's         between some thousandths and some tens
    L / R       time constant of a winding                  between some microseconds and a second
    J w / T     time from rest to rated speed               between a tenth of a millisecond and a minute
    T w         shaft's power at rated values               at most what link and current give
    R I^2 / T w copper's loss over the shaft's power         at least some ten-thousandths
    L_q / L_d   saliency                                    between a fiftieth and fifty

Bounds are far outside what motors have (a gramme to a megawatt), and far inside a mistaken unit,
which is 1000 off.
"""  # noqa: E501

from __future__ import annotations

import dataclasses
import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass

from model.drive_files import ASSUMED, INJECTED
from model.errors import BadInput
from model.mapped import MappedMotor
from model.parameters import Drive, Motor


@dataclass(frozen=True)
class Pair:
    """A quantity that stated numbers make together, its bounds, and what it is in words."""

    size: Callable[[Drive], float]
    low: float
    high: float
    said: Callable[[Drive, float], str]


def _inductance(m: Motor) -> float:
    return max(m.inductance_d, m.inductance_q)


def _reactance(d: Drive) -> float:
    return (
        d.motor.rated_omega
        * _inductance(d.motor)
        * d.motor.rated_current
        / d.converter.voltage_limit
    )


def _drop(d: Drive) -> float:
    return d.motor.resistance * d.motor.rated_current / d.converter.voltage_limit


def _own_flux(d: Drive) -> float:
    m = d.motor
    return (
        min(m.inductance_d, m.inductance_q) * m.rated_current / m.magnet_flux
        if m.magnet_flux > 0.0
        else 1.0
    )


def _lag(d: Drive) -> float:
    return _inductance(d.motor) / d.motor.resistance


def _run_up(d: Drive) -> float:
    m = d.motor
    return m.inertia * m.rated_omega / m.pole_pairs / m.rated_torque


def _power(d: Drive) -> float:
    m = d.motor
    able = 1.5 * d.converter.voltage_limit * m.rated_current
    return m.rated_torque * m.rated_omega / m.pole_pairs / able


def _copper(d: Drive) -> float:
    m = d.motor
    return 1.5 * m.resistance * m.rated_current**2 / (m.rated_torque * m.rated_omega / m.pole_pairs)


def _saliency(d: Drive) -> float:
    return d.motor.inductance_q / d.motor.inductance_d


def link(d: Drive) -> str:
    """Return the DC link in words, and that it is no stated value where it is none."""
    usual = "dc_bus_voltage" in d.provenance.get(ASSUMED, "")
    return (
        f"the link of {d.converter.dc_bus_voltage:g} "
        f"V{' (a usual value, [drive] states none)' if usual else ''}"
    )


def injection(d: Drive) -> str:
    """Return the injection in words, and that it is no stated value where it is none."""
    usual = " (a usual value, [injection] states none)" if INJECTED in d.provenance else ""
    return f"an injection of {d.injection.amplitude:g} V{usual}"


def _volts(d: Drive) -> str:
    return f"{link(d)} gives {d.converter.voltage_limit:.3g} V"


PAIRS = (
    Pair(
        _drop,
        0.0,
        1.5,
        lambda d, x: (
            f"resistance x rated_current is {plain(x * d.converter.voltage_limit)} V, "
            f"and {_volts(d)}"
        ),
    ),
    Pair(
        _reactance,
        0.0,
        12.0,
        lambda d, x: (
            "inductance x rated_current at rated_speed_rpm takes "
            f"{plain(x * d.converter.voltage_limit)} V, and {_volts(d)}"
        ),
    ),
    Pair(
        _own_flux,
        1e-3,
        60.0,
        lambda d, x: f"inductance x rated_current is {plain(x)} times magnet_flux",
    ),
    Pair(_lag, 2e-6, 3.0, lambda d, x: f"inductance / resistance is {plain(x)} s"),
    Pair(
        _run_up,
        1e-4,
        60.0,
        lambda d, x: f"rated_torque brings inertia to rated_speed_rpm in {plain(x)} s",
    ),
    Pair(
        _power,
        0.0,
        2.5,
        lambda d, x: (
            f"rated_torque at rated_speed_rpm is {plain(x)} times the power that link "
            "and rated_current give"
        ),
    ),
    Pair(
        _copper,
        5e-4,
        math.inf,
        lambda d, x: (
            f"the loss of rated_current in resistance is {plain(100.0 * x)} % of the "
            "power at rated values"
        ),
    ),
    Pair(_saliency, 0.02, 50.0, lambda d, x: f"inductance_q is {plain(x)} times inductance_d"),
)


@dataclass(frozen=True)
class Unit:
    """Another unit in which numbers may stand: names of [motor] or [drive], in words, and the
    factor to ours; of what: in words, where they are no names of the file's."""

    names: tuple[str, ...]
    said: str
    factor: float
    of: str = ""

    @property
    def guess(self) -> str:
        """Return what may stand in which unit."""
        return f"{self.of or ' and '.join(self.names)} {self.said}"


INDUCTANCES = ("inductance_d", "inductance_q")
SMALL = "1000 times too small"
UNITS: tuple[Unit, ...] = (
    Unit(INDUCTANCES, "in mH", 1e-3),
    Unit(INDUCTANCES, "in uH", 1e-6),
    Unit(INDUCTANCES[:1], "in mH", 1e-3),
    Unit(INDUCTANCES[1:], "in mH", 1e-3),
    Unit(("resistance",), "in mohm", 1e-3),
    Unit(("magnet_flux",), "in mWb", 1e-3),
    Unit(("inertia",), "in kg cm^2", 1e-4),
    Unit(("inertia",), "in g m^2", 1e-3),
    Unit(("inertia",), "in g cm^2", 1e-7),
    Unit(("rated_current",), "in mA", 1e-3),
    Unit(("rated_current",), "in kA", 1e3),
    Unit(("rated_torque",), "in mN m", 1e-3),
    Unit(("rated_torque",), "in kN m", 1e3),
    Unit(("rated_speed_rpm",), "in rad/s", 30.0 / math.pi),
    Unit(("rated_speed_rpm",), "in 1/s", 60.0),
    Unit(("dc_bus_voltage",), "in kV", 1e3),
    Unit(("dc_bus_voltage",), "in mV", 1e-3),
    Unit(INDUCTANCES, SMALL, 1e3),
    Unit(("resistance",), SMALL, 1e3),
    Unit(("magnet_flux",), SMALL, 1e3),
    Unit(("inertia",), SMALL, 1e3),
    Unit(("inertia",), "10 000 times too small", 1e4),
)


FROM_MAP = (*INDUCTANCES, "magnet_flux")
# a map is of a motor with iron
PAIRS_OF_MAP = (*PAIRS[:2], dataclasses.replace(PAIRS[2], low=0.01), *PAIRS[3:])
IN_HEADER = "(write it into its header, e.g. {})"
UNITS_OF_MAP = (
    Unit(INDUCTANCES, f"in mA {IN_HEADER.format('i_d [mA]')}", 1e3, "the flux map's currents"),
    Unit(FROM_MAP, f"in mWb {IN_HEADER.format('psi_d [mWb]')}", 1e-3, "the flux map's fluxes"),
    Unit(
        ("magnet_flux",),
        f"in mA and mWb {IN_HEADER.format('i_d [mA], psi_d [mWb]')}",
        1e-3,
        "the flux map's currents and fluxes",
    ),
    Unit(INDUCTANCES, f"in kA {IN_HEADER.format('i_d [kA]')}", 1e-3, "the flux map's currents"),
    *(u for u in UNITS if u.names[0] not in FROM_MAP),
)


def pairs_off(drive: Drive) -> list[str]:
    """Return in words the pairs of stated numbers that cannot belong to one motor."""
    own, pairs, _ = _compared(drive)
    return [p.said(own, x) for p in pairs if not p.low <= (x := p.size(own)) <= p.high]


def mending(drive: Drive, sound: Callable[[Drive], bool]) -> list[str]:
    """Return in words the single values in another unit that would mend all pairs; sound: whether
    further tests of a drive find nothing."""
    return [u.guess for u in _mending(*_compared(drive), sound)]


def _compared(drive: Drive) -> tuple[Drive, Sequence[Pair], Sequence[Unit]]:
    """Return the drive, pairs and units to compare; of a flux map the values at zero current."""
    electrical = Unit(("rated_speed_rpm",), "electrical", 1.0 / drive.motor.pole_pairs)
    if isinstance(drive.motor, MappedMotor):
        own = dataclasses.replace(drive, motor=drive.motor.linear)
        return own, PAIRS_OF_MAP, (*UNITS_OF_MAP, electrical)
    doubled = Unit(("magnet_flux",), "multiplied by pole_pairs", 1.0 / drive.motor.pole_pairs)
    return drive, PAIRS, (*UNITS, electrical, doubled)


def _mending(
    drive: Drive, pairs: Sequence[Pair], units: Sequence[Unit], sound: Callable[[Drive], bool]
) -> Iterator[Unit]:
    """Yield the units that mend all that is off."""
    for u in units:
        part = "converter" if u.names[0] == "dc_bus_voltage" else "motor"
        own = getattr(drive, part)
        try:
            changed = dataclasses.replace(own, **{n: getattr(own, n) * u.factor for n in u.names})
            other = dataclasses.replace(drive, **{part: changed})
        except (BadInput, TypeError):
            continue
        if all(p.low <= p.size(other) <= p.high for p in pairs) and sound(other):
            yield u


def plain(x: float) -> str:
    """Return a number as a person writes it, without a power of ten where it is large."""
    return f"{x:.0f}" if 100.0 <= x < 1e15 else f"{x:.3g}"
