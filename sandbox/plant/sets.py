"""Parameter sets for the plant: effects by their public names, checked, as rows of a batch.

Beside the effect library's parameters a bench has deviations that are no effect, named `bench.*`.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cache, lru_cache
from types import SimpleNamespace
from typing import Any, NamedTuple

import numpy as np

from model.array_types import Array
from model.effects import library
from model.effects.card import At, Effect, Ordinary, flux_scale
from model.errors import BadInput, unknown
from model.parameters import Converter, Motor
from model.spline import SplineEnergy
from sandbox.plant import additions as add
from sandbox.plant import ports
from sandbox.plant.batch import batch_type, more
from sandbox.plant.commutation import latest
from sandbox.plant.compose import field, further_field
from sandbox.plant.fixed import fix
from sandbox.plant.period import Timing

Set = Mapping[str, float]
SOFT_SIGN = 0.015  # of rated current: half the width in which sign(i) goes through zero
# standard deviation of that width's logarithm: measured ones reach from a switch as hard as
# readings can tell to 12 % of rated current (0.54 A of 4.5 A, a published inverter table), eight
# times the usual one
SIGN_SPREAD = 1.5
ORDINARY = 4.0  # standard deviations that a deviation may have and still be ordinary
RUBBING = ("torque", "friction", "load")  # a motor's own friction is neutral, but there
PORT_BITS = {
    "link": add.LINK,
    "drawn": add.DRAWN,
    "source": add.DRAWN | add.RING,
    "leg": add.LEG,
    "leg_curve": add.CURVE,
    "winding": add.WINDING,
    "magnets": add.MAGNETS,
    "energy": add.ENERGY,
    "angle": add.WOBBLE,
    "edge": add.COMMUTE,
    "iron": add.IRON,
    "excess": add.IRON | add.CORE_LOSS,
    "play": add.IRON | add.CORE_LOSS,
    "skin": add.SKIN,
    "layers": add.LAYERS,
    "filter": add.FILTER,
    "delay": add.DELAYED,
    "latency": add.DELAYED,
    "shaft": add.TWIST,
    "backlash": add.BACKLASH,
    "bristles": add.BRISTLES,
    "channels": add.CHANNELS,
}


ANY, NONE_BELOW = -math.inf, 0.0
# rows by the port whose equations make them, and their least values; all have to be finite
SOUND = {
    "supply": {"supply": ANY},
    "source": {
        "source_rate": NONE_BELOW,
        "source_ohm": NONE_BELOW,
        "source_damping": NONE_BELOW,
    },
    "resistance": {"resistance": ANY},
    "delay": {"delay": ANY},
    "iron": {"core_g": NONE_BELOW, "core_rate": NONE_BELOW},
    "excess": {"excess": NONE_BELOW},
    "play": {"play": NONE_BELOW, "play_reach": NONE_BELOW},
    "skin": {"skin_r": NONE_BELOW, "skin_rate": NONE_BELOW},
    "layers": {"layer_r": NONE_BELOW, "layer_rate": NONE_BELOW},
    "filter": {"filter_rate": NONE_BELOW},
    "instant": {"sample": ANY, "jitter": NONE_BELOW},
    "channels": {"channel_lag": ANY},
    "offset": {"offset": ANY},
    "latency": {"latency": ANY},
    "shaft": {
        "motor_inv": NONE_BELOW,
        "load_share": NONE_BELOW,
        "swing_rate": NONE_BELOW,
        "swing_ratio": NONE_BELOW,
    },
    "backlash": {"backlash": NONE_BELOW},
}
PASSIVE = dict.fromkeys(SOUND, "finite numbers") | {
    "source": "a rate, an impedance, a damping ratio, all at least 0",
    "iron": "a conductance, a time constant, both at least 0",
    "excess": "a current of at least 0",
    "play": "a current by flux, a flux, both at least 0",
    "skin": "a resistance, a time constant, both at least 0",
    "layers": "two resistances, a time constant, all at least 0",
    "filter": "a time constant of at least 0",
    "instant": "finite, a variance of at least 0",
    "shaft": "0 <= the load's inertia < all of it, no negative damping",
    "backlash": "an angle of at least 0",
}


@dataclass(frozen=True)
class BenchParameter:
    """An ordinary deviation of a bench: neutral value (None: of the drive), bounds, unit."""

    unit: str
    neutral: float | None
    low: float
    high: float
    ordinary: Ordinary | None = None


ANGLE_OFFSET = "encoder_offset.offset"  # what turns every angle that is read
BENCH = {
    # added to a locked rotor's angle
    "bench.lock_angle": BenchParameter("rad", 0.0, -math.pi, math.pi),
    # relative error of the load machine's torque
    "bench.load_torque_gain": BenchParameter("", 0.0, -1.0, 1.0),
    "bench.load_torque_offset": BenchParameter(
        "N m", 0.0, -1e5, 1e5, Ordinary("load_torque_offset", 0.002, "rated torque")
    ),
    "bench.common_offset": BenchParameter(  # in all three current readings alike
        "A",
        0.0,
        -1e4,
        1e4,
        Ordinary("current_offset", 0.001, "rated current", math.sqrt(1.0 / 3.0)),
    ),
    # half the width in which sign(i) goes through zero
    "bench.soft_current": BenchParameter("A", None, 1e-9, 1e5),
    "bench.soft_shape": BenchParameter("", 0.0, 0.0, 1.0),  # of it there: 0 linear, 1 tanh
    # where an edge is late by half, in these half-widths, of the current that keeps its leg
    "bench.soft_center": BenchParameter("", 0.0, -1.0, 1.0),
}


def parameter_names() -> tuple[str, ...]:
    """Return all names a parameter set may use: every effect parameter, then `bench.*`."""
    return (*library.parameters(), *BENCH)


def soft_current(motor: Motor) -> float:
    """Return half the width (A) in which the sign of a current usually goes through zero."""
    return SOFT_SIGN * motor.rated_current


def complete(motor: Motor, converter: Converter, values: Set | None = None) -> dict[str, float]:
    """Return every parameter of a set, checked; BadInput for an unknown name (with the nearest) or
    a wrong value."""
    given = dict(values or {})
    for name in given:
        if name not in BENCH and name not in library.parameters():
            raise unknown("parameter", name, parameter_names())
    effects = {name: value for name, value in given.items() if name not in BENCH}
    out = library.complete(motor, converter, effects)
    for name, p in BENCH.items():
        value = given.get(name, soft_current(motor) if p.neutral is None else p.neutral)
        if (
            isinstance(value, bool)
            or not isinstance(value, (int, float))
            or not p.low <= value <= p.high
        ):
            raise BadInput(
                f"{name} = {value!r} is out of range; give a number in [{p.low:g}, "
                f"{p.high:g}] {p.unit}".rstrip()
            )
        out[name] = float(value)
    return out


def rows_of(motor: Motor, v: Set) -> dict[str, Any]:
    """Return the batch's rows (fields of `PLANT` and of the ports' NUMBERS and FURTHER) of one
    completed set."""
    neutral = library.neutral(motor)
    rows: dict[str, Any] = {**machine_rows(motor, v), **{own: v[name] for own, name in numbers()}}
    for card in several():
        rows |= further_rows(card, v, neutral)
    rows["pairs"], rows["soft"] = float(motor.pole_pairs), 1.0 / v["bench.soft_current"]
    rows["shape"] = v["bench.soft_shape"]
    for name, value in zone_of(v).items():
        rows[f"dead_time_zone_{name}"] = value
    for row, usual in references(motor).items():
        rows[row] = rows[row] or usual
    rows["rated_flux"] = flux_scale(motor)
    rows["rated_slope"] = motor.rated_omega * flux_scale(motor)
    rows["common"] = v["bench.common_offset"]
    rows["load_gain"], rows["load_offset"] = (
        v["bench.load_torque_gain"],
        v["bench.load_torque_offset"],
    )
    return rows


def references(motor: Motor) -> dict[str, float]:
    """Return the rows of sizes that curves are shares of, each with what stands in for 0."""
    return {
        "leg_voltage_reference": motor.rated_current,
        "current_linearity_reference": motor.rated_current,
        "friction_torque_reference": motor.rated_omega / motor.pole_pairs,
    }


def zone_of(v: Set) -> dict[str, float]:
    """Return half-width (A), shape and center of the zone in which dead time's sign goes through
    zero, no capacitance given: what the effect does not say is the bench's."""
    width, shape = v["dead_time.zone_width"], v["dead_time.zone_shape"]
    center = v["dead_time.zone_center"]
    if not width:
        width = v["bench.soft_current"]
        shape, center = shape or v["bench.soft_shape"], center or v["bench.soft_center"]
    return {"width": width, "shape": shape, "center": center}


def machine_rows(motor: Motor, v: Set) -> dict[str, float]:
    """Return the rows of the motor's own numbers, as effects replace or scale them: of the energy
    each term's derivative, of a flux map what scales of its inductances add to it as seen at zero
    current."""
    own = SimpleNamespace(**{value: v[name] for name, value in library.replaced().items()})
    scale = SimpleNamespace(**{value: v[name] for name, value in library.scaled().items()})
    gamma_d = 1.0 / (scale.inductance_d * motor.inductance_d)
    gamma_q = 1.0 / (scale.inductance_q * motor.inductance_q)
    if isinstance(motor.energy, SplineEnergy):
        gamma_d, gamma_q = gamma_d - 1.0 / motor.inductance_d, gamma_q - 1.0 / motor.inductance_q
    return {
        "gamma_d": gamma_d,
        "gamma_q": gamma_q,
        "cubic_d": 3.0 * own.alpha_30,
        "cubic_q": own.alpha_12,
        "quartic_d": 4.0 * own.alpha_40,
        "quartic_dq": own.alpha_22,
        "quartic_q": 4.0 * own.alpha_04,
        "magnet": own.magnet_flux,
        "winding": own.resistance,
        "masses": own.inertia,
    }


@cache
def numbers() -> tuple[tuple[str, str], ...]:
    """Return the rows that hold effects' parameters, each with the parameter's name."""
    cards = [library.load_effect(name) for name in library.effect_names()]
    return tuple(
        (field(c.name, n), c.public(1, n)) for c in cards for at in c.at for n in at.numbers
    )


@cache
def several() -> tuple[Effect, ...]:
    """Return the cards of effects that can be there several times."""
    return tuple(
        card for card in map(library.load_effect, library.effect_names()) if card.repeats > 1
    )


def further_parts(card: Effect, v: Set, neutral: Set) -> list[int]:
    """Return which parts of an effect from the second on are there."""
    return [k for k in range(2, card.repeats + 1) if not card.switched_off(v, neutral, k)]


def further_rows(card: Effect, v: Set, neutral: Set) -> dict[str, list[float]]:
    """Return the rows of an effect's further parts: those that are there first, neutral ones
    behind."""
    there = further_parts(card, v, neutral)
    order = [*there, *(k for k in range(2, card.repeats + 1) if k not in there)]
    names = {n for at in card.part(2).at for n in at.numbers}
    return {further_field(card.name, n): [v[card.public(k, n)] for k in order] for n in names}


class Need(NamedTuple):
    """What the plant needs (bits) while one of some parameters is other than neutral, or than 0
    where zero says so; form: of an equation that has its place in one form of its effect, the
    parameter that tells the form, and whether it is other than neutral there."""

    bits: int
    names: tuple[str, ...]
    zero: bool = False
    form: tuple[str, bool] | None = None


@cache
def needs() -> tuple[Need, ...]:
    """Return what all effects need, by their cards."""
    out = []
    for card in map(library.load_effect, library.effect_names()):
        parts = range(1, card.repeats + 1)
        out += [
            Need(
                PORT_BITS[at.port],
                _switches(card, at),
                form=at.form and (card.public(1, at.form[0]), at.form[1]),
            )
            for at in card.at
            if at.port in PORT_BITS
        ]
        rubbing = [card.switches or at.numbers for at in card.at if at.port in RUBBING]
        out += [
            Need(add.RUB, tuple(card.public(1, n) for n in names), zero=True) for names in rubbing
        ]
        out += [
            Need(PORT_BITS.get(at.port, add.RUB), card.switched_by[k - 1])
            for k in parts[1:]
            for at in card.part(k).at
        ]
    return tuple(out)


def _switches(card: Effect, at: At) -> tuple[str, ...]:
    """Return the parameters of an effect's first part that switch one of its equations on."""
    names = at.switches or [n for n in at.numbers if n in card.switches] or at.numbers
    return tuple(card.public(1, n) for n in names)


def features_of(motor: Motor, v: Set) -> int:
    """Return what a completed set needs beside the bare plant (bits of
    `sandbox.plant.additions`)."""
    neutral, out = library.neutral(motor), add.ROUND if v["bench.soft_shape"] else 0
    for bits, names, zero, form in needs():
        other = form is not None and (v[form[0]] != neutral[form[0]]) != form[1]
        for name in () if other else names:
            if v[name] != (0.0 if zero else neutral[name]):
                out |= bits
                break
    return out


def batch_of(motor: Motor, converter: Converter, sets: Sequence[Set], lanes: int) -> Any:
    """Return the batch of completed sets at rest without flux; lanes beyond them repeat the
    first."""
    w = np.zeros(1, batch_type(lanes))[0]
    compiled = [rows_of(motor, v) for v in sets]
    compiled += [compiled[0]] * (lanes - len(compiled))
    plain = [name for name in compiled[0] if name not in ports.FURTHER]
    for name, values in zip(
        plain, np.array([[rows[name] for name in plain] for rows in compiled]).T, strict=True
    ):
        w[name] = values
    for name in ports.FURTHER:
        w[name] = np.array([rows[name] for rows in compiled]).T
    neutral = library.neutral(motor)
    for card in several():
        count = max(len(further_parts(card, v, neutral)) for v in sets)
        for at in card.part(2).at if count else ():
            w[more(at.port)] = max(w[more(at.port)], count)
    if converter.inverter_table:
        i, u = np.array(converter.inverter_table).T
        w["table_points"], area = (
            len(i),
            np.append(0.0, np.cumsum(0.5 * (u[1:] + u[:-1]) * np.diff(i))),
        )
        for name, values in (("current", i), ("volts", u), ("sum", area)):
            w[f"table_{name}"][: len(i)] = values
    fix(w, converter.dc_bus_voltage, converter.update_period)
    _check_fixed(w, motor, sets)
    w["link"][:] = w["supply"]
    w["off_c"][:], w["off_s"][:] = np.cos(w["offset"]), np.sin(w["offset"])
    w["when"][:] = readings_at(w["sample"], converter.update_period)
    return w


def _check_fixed(w: Any, motor: Motor, sets: Sequence[Set]) -> None:
    """Raise BadInput where equations that are asked once made what no passive part of a drive
    has."""
    for port, rows in SOUND.items():
        for name, least in rows.items():
            wrong = ~(np.isfinite(w[name]) & (w[name] >= least))
            if wrong.any():
                lane = int(np.argwhere(wrong)[0, -1])
                cards = [library.load_effect(n) for n in library.effect_names()]
                hosted = {
                    c.public(1, n)
                    for c in cards
                    for at in c.at
                    if at.port == port
                    for n in at.numbers
                }
                v, neutral = sets[lane if lane < len(sets) else 0], library.neutral(motor)
                given = ", ".join(f"{n} = {v[n]:g}" for n in sorted(hosted) if v[n] != neutral[n])
                raise BadInput(
                    f"what effects say at '{port}' is no part of a drive "
                    f"({PASSIVE[port]}): correct {given}"
                )


def sampled_at(motor: Motor, converter: Converter, v: Set) -> float:
    """Return how much later than its pattern begins a completed set's sample is taken (s)."""
    return _sampled_at(motor, converter, tuple(v[name] for name in usual_timing()))


@lru_cache(maxsize=1024)
def _sampled_at(motor: Motor, converter: Converter, timing: tuple[float, ...]) -> float:
    """Return the same for the values of `_timing`, on which alone it depends."""
    neutral, given = library.neutral(motor), dict(zip(usual_timing(), timing, strict=True))
    if all(value == neutral[name] for name, value in given.items()):
        return 0.0
    v = complete(motor, converter, given)
    return float(batch_of(motor, converter, [v], 1)["sample"][0])


@cache
def usual_timing() -> tuple[str, ...]:
    """Return the parameters that say when pulses come and samples are taken."""
    cards = [library.load_effect(name) for name in library.effect_names()]
    return tuple(
        c.public(1, n)
        for c in cards
        for at in c.at
        if at.port in ("delay", "instant")
        for n in at.numbers
    )


def readings_at(sample: Array, period: float) -> Array:
    """Return at which instants of a pattern (s) samples lie that are taken so much later than it
    begins."""
    return np.where(sample >= 0.0, sample, period + sample)


def timing_of(w: Any, period: float, parts: int) -> Timing:
    """Return how a batch's periods run; parts: no step is longer than half a period over it."""
    sample = w["sample"]
    return Timing(
        period, 0.5 * period / parts, float(latest(w)), float(sample.min()), float(sample.max())
    )
