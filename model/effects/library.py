"""All effects by name: found in this folder, checked together, neutral until told otherwise.

Effects of a run are a plain mapping such as {"dead_time.time": 2e-6}; what is not named is neutral.
`python -m model.effects.library` writes the table of README.md anew.
"""

from __future__ import annotations

import dataclasses
import math
import re
import textwrap
from collections.abc import Mapping
from functools import cache, lru_cache
from importlib import import_module
from itertools import chain
from pathlib import Path
from typing import Any

from model.effects import own
from model.effects.card import PORTS, SUBSYSTEMS, Effect, Legs, LegSlope, Parameter
from model.errors import BadInput, unknown
from model.parameters import Converter, Motor, finite
from model.remedies import remedy
from model.spline import SplineEnergy

FOLDER = Path(__file__).parent
DECIMAL_COMMA = re.compile(r"=\s*([+-]?\d+),(\d+(?:[eE][+-]?\d+)?)\s*(?:,|$)")
CARD_WIDTH = 80  # columns of a card, which fits a terminal and a page
NOT_EFFECTS = ("__init__", "adopt", "advice", "card", "library", "own", "said")
BEGIN, END = "<!-- table: python -m model.effects.library -->\n", "<!-- end of table -->\n"


@cache
def effect_names() -> tuple[str, ...]:
    """Return the names of all effects: machine, inverter, sensor, mechanics, each in the alphabet's
    order; then own."""
    cards = [load_effect(p.stem) for p in sorted(FOLDER.glob("*.py")) if p.stem not in NOT_EFFECTS]
    cards += [card for card, _ in own.cards()]
    return tuple(c.name for c in sorted(cards, key=lambda c: SUBSYSTEMS.index(c.subsystem)))


@cache
def causes() -> tuple[str, ...]:
    """Return the names of the effects that are a cause, not a curve that may stand for several."""
    return tuple(name for name in effect_names() if not load_effect(name).free)


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
    """Return every parameter by its public name: `effect.parameter`, or `effect.k.parameter` of a
    k-th part."""
    cards = [load_effect(name) for name in effect_names()]
    return {
        c.public(k, p.name): p
        for c in cards
        for k in range(1, c.repeats + 1)
        for p in c.part(k).parameters
    }


def title(name: str) -> str:
    """Return a parameter's public name as words of a sentence, such as "6th harmonic of d flux"."""
    known = parameters().get(name)
    said = (known.title if known else "") or name.rpartition(".")[2].replace("_", " ")
    return f"{said} (part {name.split('.')[1]})" if is_further(name) else said


def is_further(name: str) -> bool:
    """Return whether a public name is that of an effect's second or later part."""
    return name.count(".") > 1


@cache
def replaced() -> dict[str, str]:
    """Return the parameters that replace a value of the motor: {parameter: the motor's field}."""
    return {name: p.of_motor for name, p in _of_library().items() if p.of_motor and not p.same_as}


@cache
def scaled() -> dict[str, str]:
    """Return the parameters that multiply a value of the motor: {parameter: the motor's field}."""
    return {name: p.scales for name, p in _of_library().items() if p.scales}


def _of_library() -> dict[str, Parameter]:
    """Return the parameters of effects that are nobody's own: those alone are values of the
    motor."""
    others = {card.name for card, _ in own.cards()}
    return {name: p for name, p in parameters().items() if name.partition(".")[0] not in others}


@cache
def same_numbers() -> dict[str, str]:
    """Return the parameters that are the same number as another effect's: {double: the other's}."""
    return {name: p.same_as for name, p in parameters().items() if p.same_as}


@cache
def shared() -> frozenset[str]:
    """Return the parameters that stand under two names, by either."""
    return frozenset((*same_numbers(), *same_numbers().values()))


@cache
def drifting() -> Effect:
    """Return the effect that may have another size in each recording."""
    return next(card for card in map(load_effect, effect_names()) if card.drifts)


def holders(effect: str) -> tuple[str, ...]:
    """Return the other effects that have all numbers of an effect among their own, so that they can
    stand for it."""
    first = same_numbers()

    def numbers(e: str) -> set[str]:
        """Return the parameters of an effect, each by its first name."""
        return {first.get(name, name) for name in parameters() if name.partition(".")[0] == e}

    return tuple(e for e in effect_names() if e != effect and numbers(e) >= numbers(effect))


def moved(name: str, to: float) -> dict[str, float]:
    """Return what moving a parameter changes: itself and its doubles."""
    return {name: to, **{double: to for double, own in same_numbers().items() if own == name}}


def parse(text: str) -> dict[str, float]:
    """Return the effects written as "dead_time.time=2e-6,current_offset.offset_a=0.01"; BadInput
    says what is wrong."""
    found: dict[str, float] = {}
    if comma := DECIMAL_COMMA.search(text):
        whole, tail = comma.groups()
        raise BadInput(
            f"effects '{text[:40]}' hold a decimal comma: write {whole}.{tail}, with a point"
        )
    for item in filter(None, (part.strip() for part in text.split(","))):
        name, equals, number = (part.strip() for part in item.partition("="))
        if not equals:
            raise BadInput(
                f"effect '{item}' has no value; write effect.parameter=number, e.g. "
                "dead_time.time=2e-6"
            )
        if name in found:
            raise BadInput(f"effect parameter '{name}' is given twice; give it once")
        try:
            value = number_of(number)
        except ValueError:
            raise BadInput(f"effect {name}: '{number}' is no number; write it as 2e-6") from None
        found[name] = checked(name, value)
    if text.strip() and not found:
        raise BadInput(
            f"effects '{text[:40]}' name none; write effect.parameter=number, e.g. "
            "dead_time.time=2e-6"
        )
    return found


def number_of(text: str) -> float:
    """Return a number as people write it; ValueError for what only Python takes for one (1_0e-6,
    other digits)."""
    if "_" in text or not text.isascii():
        raise ValueError(text)
    return float(text)


def checked(name: str, value: float) -> float:
    """Return the value as a float; BadInput for an unknown name (with the nearest) or a value out
    of bounds."""
    known = parameters()
    if name not in known:
        own = [k for k in known if k.partition(".")[0] == name.partition(".")[0]]
        raise unknown("effect parameter", name, own or known)
    p = known[name]
    if (
        isinstance(value, bool)
        or not isinstance(value, (int, float))
        or not p.low <= value <= p.high
    ):
        number = finite(value)
        how = "" if number is None else remedy(p.name, number, p.low, p.high, p.unit)
        bound = f"[{p.low:g}, {p.high:g}] {p.unit}".rstrip()
        raise BadInput(f"{name} = {value!r} is out of range; give a number in {bound}{how}")
    if math.isinf(p.low) and not math.isfinite(value):
        raise BadInput(f"{name} = {value!r} is not finite; give a number in {p.unit}")
    if p.whole and (value != round(value) or value == 0.0):
        negative = ", or a negative one" if p.low < 0.0 else ""
        raise BadInput(
            f"{name} = {value:g} is no whole order; give 1, 2, ..., {p.high:g}{negative}"
        )
    return float(value)


def forget() -> None:
    """Look for the effects anew."""
    for function in (
        effect_names,
        causes,
        load_effect,
        parameters,
        replaced,
        scaled,
        same_numbers,
        shared,
        drifting,
        _neutral,
        _limited,
        _sloped,
    ):
        function.cache_clear()


def neutral(motor: Motor) -> dict[str, float]:
    """Return every parameter's neutral value for a motor."""
    return dict(_neutral(motor))


@lru_cache(maxsize=64)
def _neutral(motor: Motor) -> dict[str, float]:
    return {name: p.neutral_for(motor) for name, p in parameters().items()}


def complete(
    motor: Motor, converter: Converter, effects: Mapping[str, float] | None = None
) -> dict[str, float]:
    """Return all parameters, the given ones checked alone and together.

    BadInput also where effects contradict each other or the drive: two values of one coefficient, a
    size beyond a limit of its card.
    """
    given, moved = effects or {}, dict[str, None]()  # moved: effects, as a set that keeps its order
    values = neutral(motor)
    for name, value in given.items():
        if not (type(value) is float and value == values.get(name)):
            # a neutral one is right as it is
            values[name] = checked(name, value)
            moved[name.partition(".")[0]] = None
    for other, one in same_numbers().items():
        if one in given and other in given and values[one] != values[other]:
            raise BadInput(
                f"{one} = {values[one]:g} and {other} = {values[other]:g} contradict "
                "each other; give one"
            )
        values[one] = values[other] = values[other] if other in given else values[one]
        if other.partition(".")[0] in moved:
            moved[one.partition(".")[0]] = None
    for card in _limited():
        if card.name in moved:
            _hold(card, motor, converter, values)
    return values


@cache
def _limited() -> tuple[Effect, ...]:
    return tuple(card for card in map(load_effect, effect_names()) if card.limits or card.inside)


def _hold(
    card: Effect,
    motor: Motor,
    converter: Converter,
    values: Mapping[str, float],
    simulated: bool = False,
) -> None:
    """Raise BadInput for a size beyond a limit of its card; simulated: those of a simulated drive
    alone."""
    asked = (x for x in card.limits_at(values, motor, converter) if x.simulated == simulated)
    more = card.inside(values, motor, converter) if card.inside and simulated else ()
    for limit in chain(asked, more):  # one by one: a later one may raise
        if limit.broken:
            raise BadInput(
                f"{limit.name}: {limit.size:g} is out of range; it must stay below "
                f"{limit.bound:g} {limit.what}"
            )


def check_inside(motor: Motor, converter: Converter, values: Mapping[str, float]) -> None:
    """Raise BadInput for completed values, or a converter, that a simulated drive cannot have,
    though a recorded one may."""
    for card in _limited():
        _hold(card, motor, converter, values, simulated=True)
    if converter.double:
        raise BadInput(
            f"[drive] pwm_frequency = {converter.pwm_frequency:g} Hz is double update, which only "
            "recordings may have; give 1 / sampling_period"
        )
    if converter.periods_a_row > 1:
        raise BadInput(
            f"[drive] pwm_frequency = {converter.pwm_frequency:g} Hz is {converter.periods_a_row} "
            "times 1 / sampling_period, that of a slow log; a simulated drive samples in every "
            f"PWM period: give sampling_period = {converter.update_period:.9g}"
        )


def longest_step(motor: Motor, values: Mapping[str, float], omega: float) -> float:
    """Return the longest step (s) that the effects of completed values allow a closed loop, inf
    where none matters.

    motor: the true one; omega: rad/s electrical, its highest speed.
    """
    idle = neutral(motor)
    cards = [
        card
        for card in map(load_effect, effect_names())
        if card.longest and card.is_on(values, idle)
    ]
    found = {card.name: card.longest(values, motor, omega) for card in cards if card.longest}
    for name, step in found.items():
        if not step > 0.0:
            raise BadInput(
                f"effect '{name}' asks for steps of {step:g} s; its card must give more than 0"
            )
    return min(found.values(), default=math.inf)


def leg_slope(values: Mapping[str, float], motor: Motor, legs: Legs) -> LegSlope:
    """Return what all effects of completed values take from a leg around zero current; where any
    gives volts back, within the widest of their zones, else within none."""
    found = [card.leg_slope(values, motor, legs) for card in _sloped() if card.leg_slope]
    ohms = sum(slope.ohms for slope in found)
    return LegSlope(ohms, max((x.within for x in found if x.ohms < 0.0), default=0.0))


@cache
def _sloped() -> tuple[Effect, ...]:
    return tuple(card for card in map(load_effect, effect_names()) if card.leg_slope)


def true_motor(motor: Motor, values: Mapping[str, float], *, keep_map: bool = False) -> Motor:
    """Return the motor with the values that effects replace (`complete`d); BadInput where none can
    have them.

    keep_map: a flux map stays as it is, whatever effects on the magnetics add to it in the plant.
    """
    changes = [(field, values[name]) for name, field in replaced().items()]
    changes += [(field, values[name] * getattr(motor, field)) for name, field in scaled().items()]
    kept: dict[str, Any] = {
        field: value for field, value in changes if value != getattr(motor, field)
    }
    if keep_map and isinstance(motor.energy, SplineEnergy):
        kept = {
            field: value
            for field, value in kept.items()
            if not field.startswith(("inductance_", "alpha_"))
        }
    return dataclasses.replace(motor, **kept) if kept else motor


def typical(name: str, motor: Motor, converter: Converter) -> dict[str, float]:
    """Return an effect's parameters at their typical size on a drive, as `simulate` takes them."""
    return {
        f"{name}.{p.name}": p.typical_for(motor, converter) for p in load_effect(name).parameters
    }


def card_text(card: Effect) -> str:
    """Return a card as lines a person can read."""
    sizes = [entry(f"  {card.name}.{p.name}", _parameter(p), 32) for p in card.parameters]
    if card.repeats > 1:
        sizes.append(f"further ones, k = 2 ... {card.repeats}:")
        sizes += [
            entry(f"  {card.name}.k.{p.name}", _parameter(p), 32) for p in card.part(2).parameters
        ]
    lines = [
        entry(f"{card.name} ({card.subsystem}):", card.summary, 2),
        "",
        entry("equation", card.equation),
    ]
    lines += [entry("source", card.source), "", "parameters: neutral; bounds; typical", *sizes, ""]
    lines += [entry("enters at", "; ".join(places(card))), entry("axis", card.axis)]
    lines += [entry("order", card.order), entry("region", card.region)]
    lines += [entry("drifts", "may have another size in each recording")] if card.drifts else []
    return "\n".join(
        [
            *lines,
            entry("confused with", ", ".join(card.confused_with)),
            entry("separated by", card.separated_by),
        ]
    )


def places(card: Effect) -> list[str]:
    """Return where an effect enters: ports with what its equations give there, and values of the
    motor."""
    names, of_motor = same_numbers(), replaced() | scaled()
    public = [card.public(1, p.name) for p in card.parameters]
    values = dict.fromkeys(of_motor[names.get(n, n)] for n in public if names.get(n, n) in of_motor)
    out = [
        f"port `{port}`: {PORTS[port].what}" for port in dict.fromkeys(at.port for at in card.at)
    ]
    return [*out, f"the motor's own {', '.join(values)}"] if values else out


def entry(head: str, text: str, column: int = 14) -> str:
    """Return one entry of a card, folded; its text begins at a column, or one blank after a longer
    head."""
    head = f"{head:<{column - 1}} "
    return textwrap.fill(
        text,
        CARD_WIDTH,
        initial_indent=head,
        subsequent_indent=column * " ",
        break_on_hyphens=False,
    )


def _parameter(p: Parameter) -> str:
    neutral_value = f"nominal {p.of_motor}" if p.neutral is None else f"{p.neutral:g}"
    neutral_value += f" x {p.neutral_relative_to}" if p.neutral_relative_to else ""
    size = f"{p.typical:g}" + (f" x {p.relative_to}" if p.relative_to else f" {p.unit}")
    return f"{neutral_value}; [{p.low:g}, {p.high:g}] {p.unit}; {size}".replace("  ", " ").replace(
        " ;", ";"
    )


def table() -> str:
    """Return the markdown table of all cards."""
    lines = [
        (
            "| effect | parameters (unit, typical size) | equation | order | confused with | "
            "separated by |"
        )
    ]
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
    cells = [
        f"[`{card.name}`]({card.name}.py)",
        " ".join(sizes),
        card.equation,
        card.order,
        confused,
    ]
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
