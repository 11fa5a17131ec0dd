"""All effects by name: found in this folder, checked together, neutral until told otherwise.

Effects of a run are a plain mapping such as {"dead_time.time": 2e-6}; what is not named is neutral.
`python -m model.effects.library` writes the table of README.md anew.
"""

from __future__ import annotations

import dataclasses
import math
import textwrap
from collections.abc import Mapping
from functools import cache, lru_cache
from importlib import import_module
from pathlib import Path
from typing import Any

from model.effects import own
from model.effects.card import SUBSYSTEMS, Effect, Parameter
from model.errors import BadInput, unknown
from model.parameters import Converter, Motor
from model.spline import SplineEnergy

FOLDER = Path(__file__).parent
NOT_EFFECTS = ("__init__", "adopt", "card", "library", "own")
SHARED = ("alpha_12", "alpha_22")  # cross_saturation is a part of saturation
OF_MOTOR = {  # parameters that replace a value of the motor
    "stator_resistance.resistance": "resistance",
    "magnet_flux.magnet_flux": "magnet_flux",
    "viscous_friction.coefficient": "viscous_friction",
    "inertia.inertia": "inertia",
    **{f"saturation.alpha_{n}": f"alpha_{n}" for n in ("30", "12", "40", "22", "04")},
}
SCALES_OF_MOTOR = {f"inductance.scale_{axis}": f"inductance_{axis}" for axis in "dq"}  # that multiply one
WHOLE = tuple(
    f"{effect}.{k}.order" for effect in ("flux_harmonics", "inductance_harmonics") for k in range(2, 7)
)  # electrical orders: windings of all pole pairs in series see no others
FASTEST_FRICTION = 1e6  # 1/s
LATEST = 3.0  # sampling periods: the latest that a recorded voltage may act
BEGIN, END = "<!-- table: python -m model.effects.library -->\n", "<!-- end of table -->\n"


@cache
def effect_names() -> tuple[str, ...]:
    """Return the names of all effects: machine, inverter, sensor, mechanics, each in the alphabet's order; then own."""
    cards = [load_effect(p.stem) for p in sorted(FOLDER.glob("*.py")) if p.stem not in NOT_EFFECTS]
    cards += [card for card, _ in own.cards()]
    return tuple(c.name for c in sorted(cards, key=lambda c: SUBSYSTEMS.index(c.subsystem)))


@cache
def load_effect(name: str) -> Effect:
    """Return an effect's card; BadInput with the nearest name for an unknown one."""
    for card, _ in own.cards():
        if card.name == name:
            return card
    if name in NOT_EFFECTS or name not in {path.stem for path in FOLDER.glob("*.py")}:
        raise unknown("effect", name, effect_names())
    found: Effect = import_module(f"model.effects.{name}").CARD
    return found


@cache
def parameters() -> dict[str, Parameter]:
    """Return every parameter by its public name: `effect.parameter`, or `effect.k.parameter` of a k-th part."""
    cards = [load_effect(name) for name in effect_names()]
    return {c.public(k, p.name): p for c in cards for k in range(1, c.repeats + 1) for p in c.part(k).parameters}


def is_further(name: str) -> bool:
    """Return whether a public name is that of an effect's second or later part."""
    return name.count(".") > 1


@cache
def same_numbers() -> dict[str, str]:
    """Return the parameters that are the same number as another effect's: {double: the other's}."""
    return {name: p.same_as for name, p in parameters().items() if p.same_as}


def moved(name: str, to: float) -> dict[str, float]:
    """Return what moving a parameter changes: itself and its doubles."""
    return {name: to, **{double: to for double, own in same_numbers().items() if own == name}}


def parse(text: str) -> dict[str, float]:
    """Return the effects written as "dead_time.time=2e-6,current_offset.offset_a=0.01"; BadInput says what is wrong."""
    found: dict[str, float] = {}
    for item in filter(None, (part.strip() for part in text.split(","))):
        name, equals, number = (part.strip() for part in item.partition("="))
        if not equals:
            raise BadInput(f"effect '{item}' has no value; write effect.parameter=number, e.g. dead_time.time=2e-6")
        if name in found:
            raise BadInput(f"effect parameter '{name}' is given twice; give it once")
        try:
            value = number_of(number)
        except ValueError:
            raise BadInput(f"effect {name}: '{number}' is no number; write it as 2e-6") from None
        found[name] = checked(name, value)
    return found


def number_of(text: str) -> float:
    """Return a number as people write it; ValueError for what only Python takes for one (1_0e-6, other digits)."""
    if "_" in text or not text.isascii():
        raise ValueError(text)
    return float(text)


def checked(name: str, value: float) -> float:
    """Return the value as a float; BadInput for an unknown name (with the nearest) or a value out of bounds."""
    known = parameters()
    if name not in known:
        own = [k for k in known if k.partition(".")[0] == name.partition(".")[0]]
        raise unknown("effect parameter", name, own or known)
    p = known[name]
    if isinstance(value, bool) or not isinstance(value, (int, float)) or not p.low <= value <= p.high:
        raise BadInput(
            f"{name} = {value!r} is out of range; give a number in [{p.low:g}, {p.high:g}] {p.unit}".rstrip()
        )
    if math.isinf(p.low) and not math.isfinite(value):
        raise BadInput(f"{name} = {value!r} is not finite; give a number in {p.unit}")
    return float(value)


def neutral(motor: Motor) -> dict[str, float]:
    """Return every parameter's neutral value for a motor."""
    return dict(_neutral(motor))


@lru_cache(maxsize=64)
def _neutral(motor: Motor) -> dict[str, float]:
    return {name: p.neutral_for(motor) for name, p in parameters().items()}


def complete(motor: Motor, converter: Converter, effects: Mapping[str, float] | None = None) -> dict[str, float]:
    """Return all parameters, the given ones checked alone and together.

    BadInput also where effects contradict each other: two values of one coefficient, a load heavier than the
    total inertia, delays beyond half the PWM period.
    """
    given = dict(effects or {})
    values = neutral(motor)
    for name, value in given.items():
        if not (type(value) is float and value == values.get(name)):  # a neutral one is right as it is
            values[name] = checked(name, value)
    for alpha in SHARED:
        one, other = f"saturation.{alpha}", f"cross_saturation.{alpha}"
        if one in given and other in given and values[one] != values[other]:
            raise BadInput(f"{one} = {values[one]:g} and {other} = {values[other]:g} contradict each other; give one")
        values[one] = values[other] = values[other] if other in given else values[one]
    _check_timing(converter, values)
    total, load = values["inertia.inertia"], values["shaft_compliance.load_inertia"]
    if not load < total:
        raise BadInput(
            f"shaft_compliance.load_inertia = {load:g} is out of range; give less than the total inertia of "
            f"{total:g} kg m^2"
        )
    _check_sizes(motor, converter, values, given)
    return values


def friction_rate(v: Mapping[str, float]) -> float:
    """Return how fast dry friction pulls a free rotor to rest within its width, 1/s."""
    load = v["shaft_compliance.load_inertia"] if math.isfinite(v["shaft_compliance.stiffness"]) else 0.0
    level = v["coulomb_friction.torque"] + v["coulomb_friction.stribeck_torque"]
    return level / (v["coulomb_friction.width"] * (v["inertia.inertia"] - load))


def _check_sizes(motor: Motor, converter: Converter, v: Mapping[str, float], given: Mapping[str, float]) -> None:
    """Raise BadInput for sizes that no drive can have beside the rest of it."""
    idle = neutral(motor)
    shaft = [f"shaft_compliance.{p}" for p in ("stiffness", "load_inertia")]
    changed = [name for name in shaft if given.get(name, idle[name]) != idle[name]]
    if len(changed) == 1:
        raise BadInput(f"{changed[0]} alone does nothing; give shaft_compliance.stiffness and .load_inertia together")
    resistance = v["stator_resistance.resistance"] + min(v["winding_asymmetry.delta_a"], v["winding_asymmetry.delta_b"])
    least = min(1.0 / motor.inductance_d, 1.0 / motor.inductance_q)
    stiffness, load = v["shaft_compliance.stiffness"], v["shaft_compliance.load_inertia"]
    rate = 0.0
    if load > 0.0 and math.isfinite(stiffness) and load < v["inertia.inertia"]:
        rate = math.sqrt(stiffness * (1.0 / load + 1.0 / (v["inertia.inertia"] - load)))
    bounds = (
        ("dc_link_error.sag", v["dc_link_error.sag"], 0.2 * converter.dc_bus_voltage / motor.rated_current,
         "ohm: a fifth of the link is lost where it feeds rated current"),
        ("coulomb_friction.width", friction_rate(v), FASTEST_FRICTION,
         "1/s, torque over width and inertia: the steps that resolve it would be too short (give a wider one)"),
        ("dc_link_ripple.amplitude", abs(v["dc_link_ripple.amplitude"]), converter.dc_bus_voltage, "V, the DC link"),
        ("current_sampling.jitter", 6.0 * v["current_sampling.jitter"], 0.5 * converter.sampling_period,
         "s in six sigma, half the PWM period"),
        ("inductance_harmonics.gamma_6", _together(v, "inductance_harmonics", ("gamma_6", "gamma", "pulse")), least,
         "1/H in all orders together, where H is not convex"),
        ("flux_harmonics.psi_d6", _together(v, "flux_harmonics", ("psi_d6", "psi_d")), motor.magnet_flux,
         "Wb in all orders together, the magnet flux"),
        ("flux_harmonics.psi_q6", _together(v, "flux_harmonics", ("psi_q6", "psi_q")), motor.magnet_flux,
         "Wb in all orders together, the magnet flux"),
        ("shaft_compliance resonance", rate, math.pi / converter.sampling_period,
         "rad/s, half the sampling frequency (give stiffness = inf for a rigid shaft)"),
    )  # fmt: skip
    for name in WHOLE:
        if v[name] != round(v[name]) or v[name] == 0.0:
            raise BadInput(f"{name} = {v[name]:g} is no whole order; give 1, 2, ..., 60, or a negative one")
    for name, size, bound, what in bounds:
        if size > 0.0 and not size < bound:
            raise BadInput(f"{name}: {size:g} is out of range; it must stay below {bound:g} {what}")
    if resistance < 0.0:
        raise BadInput(f"winding_asymmetry leaves a phase {resistance:g} ohm; give more than minus the resistance")


def _together(v: Mapping[str, float], effect: str, names: tuple[str, ...]) -> float:
    """Return the sum of sizes of all parts of an effect."""
    card = load_effect(effect)
    parts = range(1, card.repeats + 1)
    return sum(abs(v[card.public(k, p.name)]) for k in parts for p in card.part(k).parameters if p.name in names)


def _check_timing(converter: Converter, values: Mapping[str, float]) -> None:
    period = converter.sampling_period
    timing = max(abs(values["current_sampling.delay"]), abs(values["dead_time.time"]))
    if timing >= 0.5 * period:
        raise BadInput(
            f"current_sampling.delay or dead_time.time = {timing:g} s is out of range; "
            f"give less than half the sampling period of {period:g} s"
        )
    if values["pwm_delay.delay"] >= LATEST * period:
        raise BadInput(
            f"pwm_delay.delay = {values['pwm_delay.delay']:g} s is out of range; give less than {LATEST:g} sampling "
            f"periods of {period:g} s"
        )


def check_inside(converter: Converter, values: Mapping[str, float]) -> None:
    """Raise BadInput for completed values that a simulated drive cannot have, though a recorded one may: a voltage that
    comes so late that its control would know nothing of it."""
    late, period = values["pwm_delay.delay"] + abs(values["dead_time.time"]), converter.sampling_period
    if late >= 0.5 * period:
        raise BadInput(
            f"pwm_delay.delay + dead_time.time = {late:g} s is out of range; a simulated drive takes less than half "
            f"the PWM period of {period:g} s"
        )
    if converter.double:
        raise BadInput(
            f"[drive] pwm_frequency = {converter.pwm_frequency:g} Hz is double update, which only recordings may have; "
            "give 1 / sampling_period"
        )


def true_motor(motor: Motor, values: Mapping[str, float], *, keep_map: bool = False) -> Motor:
    """Return the motor with the values that effects replace (`complete`d); BadInput where none can have them.

    keep_map: a flux map stays as it is, whatever effects on the magnetics add to it in the plant.
    """
    changes: dict[str, Any] = {field: values[name] for name, field in OF_MOTOR.items()}
    scaled = {field: values[name] for name, field in SCALES_OF_MOTOR.items()}
    changes |= {field: scale * getattr(motor, field) for field, scale in scaled.items()}
    if keep_map and isinstance(motor.energy, SplineEnergy):
        changes = {field: value for field, value in changes.items() if not field.startswith(("inductance_", "alpha_"))}
    kept = {field: value for field, value in changes.items() if value != getattr(motor, field)}
    return dataclasses.replace(motor, **kept) if kept else motor


def typical(name: str, motor: Motor, converter: Converter) -> dict[str, float]:
    """Return an effect's parameters at their typical size on a drive, as `simulate` takes them."""
    return {f"{name}.{p.name}": p.typical_for(motor, converter) for p in load_effect(name).parameters}


def card_text(card: Effect) -> str:
    """Return a card as lines a person can read."""
    sizes = [f"  {card.name}.{p.name:<18} {_parameter(p)}" for p in card.parameters]
    if card.repeats > 1:
        sizes.append(f"further ones, k = 2 ... {card.repeats}:")
        sizes += [f"  {card.name}.k.{p.name:<16} {_parameter(p)}" for p in card.part(2).parameters]
    lines = [f"{card.name} ({card.subsystem}): {card.summary}", "", _entry("equation", card.equation)]
    lines += [_entry("source", card.source), "", "parameters: neutral; bounds; typical", *sizes, ""]
    lines += [_entry("axis", card.axis), _entry("order", card.order), _entry("region", card.region)]
    return "\n".join(
        [*lines, _entry("confused with", ", ".join(card.confused_with)), _entry("separated by", card.separated_by)]
    )


def _entry(head: str, text: str) -> str:
    return textwrap.fill(text, 110, initial_indent=f"{head:<14}", subsequent_indent=14 * " ")


def _parameter(p: Parameter) -> str:
    neutral_value = f"nominal {p.of_motor}" if p.neutral is None else f"{p.neutral:g}"
    size = f"{p.typical:g}" + (f" x {p.relative_to}" if p.relative_to else f" {p.unit}")
    return f"{neutral_value}; [{p.low:g}, {p.high:g}] {p.unit}; {size}".replace("  ", " ")


def table() -> str:
    """Return the markdown table of all cards."""
    lines = ["| effect | parameters (unit, typical size) | equation | order | confused with | separated by |"]
    lines.append("|---|---|---|---|---|---|")
    for subsystem in SUBSYSTEMS:
        lines.append(f"| **{subsystem}** | | | | | |")
        for card in map(load_effect, effect_names()):
            if card.subsystem == subsystem:
                lines.append(_row(card))
    return "\n".join(lines) + "\n"


def _row(card: Effect) -> str:
    sizes = [f"`.{p.name}` ({_typical(p)})" for p in card.parameters]
    if card.repeats > 1:
        sizes.append(f"further orders, k = 2 … {card.repeats}:")
        sizes += [f"`.k.{p.name}` ({_typical(p)})" for p in card.part(2).parameters]
    confused = ", ".join(f"`{c}`" for c in card.confused_with)
    cells = [f"[`{card.name}`]({card.name}.py)", " ".join(sizes), card.equation, card.order, confused]
    return f"| {' | '.join([*cells, card.separated_by])} |"


def _typical(p: Parameter) -> str:
    relative = f"{p.typical:g} × {p.relative_to}" if p.relative_to else f"{p.typical:g}"
    return ", ".join(filter(None, (p.unit, relative)))


def readme() -> str:
    """Return README.md with the table as it is now."""
    text = (FOLDER / "README.md").read_text(encoding="utf-8")
    head, _, rest = text.partition(BEGIN)
    return head + BEGIN + "\n" + table() + "\n" + END + rest.partition(END)[2]


if __name__ == "__main__":
    (FOLDER / "README.md").write_text(readme(), encoding="utf-8")
