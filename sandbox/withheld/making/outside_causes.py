"""Causes outside the library: what the switched bench can have and no effect of the library
describes.

OUTSIDE are those of mixed checks, whose seeds draw from exactly these; a check of the kind
"outside" draws from EVERY. A size is a multiple of the medium one; phases are drawn.  `SOURCES`
says where the medium sizes of MORE come from, and the check's README why no combination of library
effects reaches any of them.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

from numpy.random import Generator

from model.parameters import Drive
from sandbox.withheld.making.effect_sizes import Planted

DRIFT_TIME = 11.0 / 3.0  # recordings: the winding's temperature settles within a campaign
TURNS = (2.3, 6.0)  # of the motor for one of a load behind a belt or gear, least and most


def _hysteresis(drive: Drive, size: float, rng: Generator) -> Planted:
    """A play of a tenth of the flux of rated current, 3 % of rated current wide at medium size."""
    motor = drive.motor
    inductance = math.sqrt(motor.inductance_d * motor.inductance_q)
    radius = 0.1 * size * inductance * motor.rated_current
    return Planted(bench={"grip": 0.3 / inductance, "grip_radius": radius})


def _inter_turn_short(drive: Drive, size: float, rng: Generator) -> Planted:
    """4 % of phase a's turns shorted through as much resistance as they have themselves."""
    conductance = 0.04 * size / (3.0 * drive.motor.resistance)
    return Planted(bench={"short_conductance": conductance, "short_time": rng.uniform(1e-4, 3e-4)})


def _knee(drive: Drive, size: float, rng: Generator) -> Planted:
    """Saturation with a knee at 0.8 of the rated current's flux; 15 % of rated current more at
    twice that flux."""
    motor = drive.motor
    start = 0.8 * math.sqrt(motor.inductance_d * motor.inductance_q) * motor.rated_current
    return Planted(bench={"knee": 0.15 * size * motor.rated_current / start**2, "knee_flux": start})


def _sensor_curvature(drive: Drive, size: float, rng: Generator) -> Planted:
    """Every current sensor reads 2.5 % less at rated current, by the square of the current.

    Not more: control must still reach 1.7 times rated current as read, and at double size it takes
    2.0 times.
    """
    return Planted(bench={"curvature": 0.025 * size / drive.motor.rated_current**2})


def _fan(drive: Drive, size: float, rng: Generator) -> Planted:
    """A fan on the shaft: 10 % of rated torque at rated speed, by the square of the speed."""
    motor = drive.motor
    speed = motor.rated_omega / motor.pole_pairs
    return Planted(bench={"fan": 0.1 * size * motor.rated_torque / speed**2})


def _resolver(drive: Drive, size: float, rng: Generator) -> Planted:
    """Windings of a resolver that are not square: 0.4 degrees mechanical, twice a turn."""
    return Planted(
        bench={"resolver": math.radians(0.4) * size, "resolver_phase": rng.uniform(0.0, math.tau)}
    )


def _least_vector(drive: Drive, size: float, rng: Generator) -> Planted:
    """Active vectors shorter than 0.5 % of the PWM period are left out, as a drive does that reads
    a single shunt."""
    return Planted(bench={"least_vector": 0.005 * size * drive.converter.sampling_period})


def _link_resonance(drive: Drive, size: float, rng: Generator) -> Planted:
    """The link's capacitors and its supply's inductance resonate at 600 Hz, damped by 0.05: three
    windings' R."""
    impedance = 3.0 * size * drive.motor.resistance
    return Planted(
        bench={"link_rate": math.tau * 600.0, "link_impedance": impedance, "link_damping": 0.05}
    )


def _one_sided(drive: Drive, size: float, rng: Generator) -> Planted:
    """Upper devices of another kind than the lower: 5 % of the winding's resistance more while a
    current flows out."""
    return Planted(bench={"one_sided": 0.05 * size * drive.motor.resistance})


def _temperature_drift(drive: Drive, size: float, rng: Generator) -> Planted:
    """The winding warms up: resistance 15 % (40 K) higher at the campaign's end than at its
    beginning."""
    return Planted(drift=0.15 * size)


def _one_by_one(drive: Drive, size: float, rng: Generator) -> Planted:
    """One converter reads the phases one after another: each later by 4.5 % of the period (11 us at
    4 kHz)."""
    return Planted(bench={"channel_lag": 0.045 * size * drive.converter.sampling_period})


def _sensor_memory(drive: Drive, size: float, rng: Generator) -> Planted:
    """Cores of the current sensors keep 1 % of rated current, once it has moved by 30 % of rated
    current."""
    radius = 0.15 * drive.motor.rated_current
    return Planted(bench={"remanence": 0.01 * size / 0.15, "remanence_radius": radius})


def _crank(drive: Drive, size: float, rng: Generator) -> Planted:
    """The load hangs on a crank: its inertia swings by 8 % of all inertia, twice a turn."""
    return Planted(
        bench={
            "crank": 0.08 * size * drive.motor.inertia,
            "crank_phase": rng.uniform(0.0, math.tau),
        }
    )


def _lobe(drive: Drive, size: float, rng: Generator) -> Planted:
    """A load behind a belt is out of true: 5 % of rated torque, once in 2.3 to 6 turns of the
    motor."""
    turns, phase = rng.uniform(*TURNS), rng.uniform(0.0, math.tau)
    return Planted(
        bench={
            "lobe": 0.05 * size * drive.motor.rated_torque,
            "lobe_turns": turns,
            "lobe_phase": phase,
        }
    )


def _load_lag(drive: Drive, size: float, rng: Generator) -> Planted:
    """The load machine's torque lags what it is told (and what the log says) by 20 ms."""
    return Planted(bench={"load_lag": 0.02 * size})


@dataclass(frozen=True)
class Outside:
    """An effect that the library does not hold: the subsystem it lies in, and what it changes at a
    size."""

    subsystem: str
    planted: Callable[[Drive, float, Generator], Planted]


OUTSIDE = {
    "hysteresis": Outside("machine", _hysteresis),
    "inter_turn_short": Outside("machine", _inter_turn_short),
    "knee": Outside("machine", _knee),
    "temperature_drift": Outside("machine", _temperature_drift),
    "sensor_curvature": Outside("sensor", _sensor_curvature),
    "fan": Outside("mechanics", _fan),
    "resolver": Outside("sensor", _resolver),
    "least_vector": Outside("inverter", _least_vector),
    "link_resonance": Outside("inverter", _link_resonance),
    "one_sided": Outside("inverter", _one_sided),
}
MORE = {
    "one_by_one": Outside("sensor", _one_by_one),
    "sensor_memory": Outside("sensor", _sensor_memory),
    "crank": Outside("mechanics", _crank),
    "lobe": Outside("mechanics", _lobe),
    "load_lag": Outside("mechanics", _load_lag),
}
EVERY = OUTSIDE | MORE
SOURCES = {  # "usual": as makers' data sheets have it, from experience, none looked up for this
    "one_by_one": "usual: converters with one sample-and-hold read 0.07 to 1 million times a "
    "second, so 15 to 1 us each, faster ones on faster drives",
    "sensor_memory": "usual: open-loop Hall sensors keep some 0.5 % of their range after a "
    "large current, and their range is two to three times the motor's rated current",
    "crank": "a reciprocating mass m at radius r swings by m r^2 / 2 about a mean of as much "
    "(kinematics of a long rod); its share of all inertia is an estimate",
    "lobe": "estimate",
    "load_lag": (
        "usual: particle and hysteresis brakes settle in some 10 to 100 ms, load machines in 1 to "
        "10 ms"
    ),
}
