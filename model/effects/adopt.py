"""Taking over a user's effects: a Python file becomes cards of this process, checked at the
door."""

from __future__ import annotations

import hashlib
import importlib.util
import inspect
import math
import os
import sys
from dataclasses import fields
from itertools import chain
from keyword import iskeyword
from pathlib import Path
from types import ModuleType
from typing import Any

from numba.core import types

from model.drive_files import load_drive
from model.effects import library
from model.effects.card import (
    PORTS,
    REPEATED,
    At,
    Effect,
    EffectPart,
    Legs,
    LegSlope,
    Parameter,
    flux_scale,
)
from model.effects.own import EQUATIONS, FILES, PLANT, VARIABLE
from model.errors import BadInput, brief, raised
from model.given import given_bytes
from model.kernels.folders import depend_on
from model.parameters import Drive
from model.plugins import brought, place_of, warn

MOST_BYTES = 1_000_000  # of a file of effects
MOST_PARTS = 12
WHOLE = ("side", "shape")  # quantities of ports that are whole numbers
LONGEST_TEXT = 1000  # characters of a card's line
TRIED_ON = "ipm"  # the motor with which a card's functions are tried
ZONE = 0.1  # A: half the width in which a current's sign goes through zero there


def adopt(path: str | Path) -> tuple[Effect, ...]:
    """Add the effects of a Python file to the library of this process; return their cards.

    Taking the same file over again does nothing.  BadInput says in one sentence what is wrong with
    the file, or that it comes too late.
    """
    file = Path(path).expanduser().resolve()
    if str(file) in FILES:
        return tuple(sys.modules[FILES[str(file)]].EFFECTS)
    text = given_bytes(file, MOST_BYTES, "give a Python file with effects")
    if PLANT in sys.modules:
        raise BadInput(
            f"{path}: the plant is compiled already; name your effects before the first "
            "run of the process"
        )
    if os.pathsep in str(file):
        raise BadInput(
            f"{path}: a path with '{os.pathsep}' cannot be handed on to other processes; rename it"
        )
    digest = hashlib.sha256(text).hexdigest()[:16]
    name = f"sensorless_effects_{digest}"
    depend_on(digest, EQUATIONS)
    cards = read_cards(file, name)
    for card in cards:
        check_card(card, file)
        check_named(card, sys.modules[name], file)
    FILES[str(file)] = name
    os.environ[VARIABLE] = os.pathsep.join(FILES)
    library.forget()
    return cards


def read_cards(file: Path, name: str) -> tuple[Effect, ...]:
    """Return the cards that a Python file names in EFFECTS, loaded as a module of this name;
    BadInput where it does not load or names none."""
    spec = importlib.util.spec_from_file_location(name, file)
    if spec is None or spec.loader is None:
        values = "; a file of values (.toml) goes with --effects" * (file.suffix == ".toml")
        raise BadInput(f"{file}: no Python file; give one that ends in .py{values}")
    module = importlib.util.module_from_spec(spec)
    sys.modules[name] = module
    try:
        spec.loader.exec_module(module)
    except (Exception, SystemExit) as error:  # whatever a user's file raises is the user's to mend
        del sys.modules[name]
        raise BadInput(f"{file}: {raised(error)}; mend it there") from None
    cards = getattr(module, "EFFECTS", None)
    if not isinstance(cards, tuple) or not cards or not all(isinstance(c, Effect) for c in cards):
        raise BadInput(f"{file}: no effects; name the cards in EFFECTS = (CARD, ...)")
    return cards


def check_card(card: Effect, file: Path) -> None:
    """Raise BadInput unless a card's names and equations are such as the plant can take, its texts
    such as a page."""
    _check_kinds(card, file)
    parameters = [p for k in (1, 2) for p in card.part(k).parameters]
    for name in (card.name, *(p.name for p in parameters)):
        fits = (
            isinstance(name, str) and name.isidentifier() and name.islower() and not iskeyword(name)
        )
        if not fits or len(name) > 40:
            raise BadInput(
                f"{file}: {brief(name, 60)} is no name of an effect or parameter; use "
                "a-z, 0-9 and _"
            )
    texts = [getattr(card, f.name) for f in fields(card) if f.type == "str"]
    texts += [
        text for f in fields(card) if f.type == "tuple[str, ...]" for text in getattr(card, f.name)
    ]
    for text in texts + [
        getattr(p, f.name) for p in parameters for f in fields(p) if f.type == "str"
    ]:
        if not isinstance(text, str) or not text.isprintable() or len(text) > LONGEST_TEXT:
            raise BadInput(
                f"{file}: {brief(text)} in '{card.name}' is no line of at most "
                f"{LONGEST_TEXT} characters"
            )
    if card.name in library.effect_names():
        raise BadInput(f"{file}: there is an effect '{card.name}' already; give yours another name")
    if not 1 <= card.repeats <= MOST_PARTS:
        raise BadInput(
            f"{file}: '{card.name}' has repeats = {card.repeats}; give 1 ... {MOST_PARTS}"
        )
    for k in (1, 2) if card.repeats > 1 else (1,):
        _check_equations(card, card.part(k), file)
    for at in card.part(2).at if card.repeats > 1 else ():
        if at.port not in REPEATED:
            raise BadInput(
                f"{file}: '{card.name}' repeats at the port '{at.port}'; it can at "
                f"{', '.join(REPEATED)}"
            )
    _try(card, file)


def _check_kinds(card: Effect, file: Path) -> None:
    """Raise BadInput unless a card's lists are tuples of what belongs in them, and its parameters
    have bounds."""
    kinds = {f.name: str for f in fields(card) if f.type == "tuple[str, ...]"}
    for name, kind in {**kinds, "parameters": Parameter, "at": At}.items():
        own = getattr(card, name)
        if not isinstance(own, tuple) or not all(isinstance(x, kind) for x in own):
            raise BadInput(
                f"{file}: {name} = {brief(own)} of {brief(card.name)} is no tuple of "
                f"{kind.__name__}"
            )
    for p in card.parameters:
        ends = (p.low, p.high)
        if not all(isinstance(x, (int, float)) for x in ends) or not p.low < p.high:
            raise BadInput(
                f"{file}: {brief(p.name)} has bounds {brief(ends)}; give the lower, then "
                "the higher number"
            )


def _check_equations(card: Effect, part: EffectPart, file: Path) -> None:
    if not part.at:
        raise BadInput(
            f"{file}: effect '{card.name}' has no equation at a port; give at=(At(port, "
            "equation, ...),)"
        )
    own = [p.name for p in part.parameters]
    for at in part.at:
        if at.port not in PORTS:
            raise BadInput(
                f"{file}: '{card.name}' names the port '{at.port}'; ports are {', '.join(PORTS)}"
            )
        for number in at.numbers:
            if number not in own:
                raise BadInput(
                    f"{file}: '{card.name}' hands on '{number}', which is none of its parameters"
                )
        if at.form and at.form[0] not in own:
            raise BadInput(
                f"{file}: the form of an equation of '{card.name}' is told by '{at.form[0]}', "
                "which is none of its parameters"
            )
        function = getattr(at.equation, "py_func", None)
        wanted = len(at.numbers) + len(PORTS[at.port].quantities)
        if function is None or len(inspect.signature(function).parameters) != wanted:
            quantities = ", ".join((*at.numbers, *PORTS[at.port].quantities))
            raise BadInput(
                f"{file}: the equation of '{card.name}' must be @inlined and take ({quantities})"
            )
        _check_compiled(card, at, file)


def check_named(card: Effect, module: ModuleType, file: Path) -> None:
    """Raise BadInput for an equation that the plant does not find in the user's file by its
    function's name."""
    for at in (at for k in range(1, card.repeats + 1) for at in card.part(k).at):
        called = getattr(at.equation, "__name__", "")
        if getattr(module, called, None) is not at.equation:
            raise BadInput(
                f"{file}: no '{called}' there is the equation of '{card.name}'; define "
                "or import it as that"
            )


def _check_compiled(card: Effect, at: At, file: Path) -> None:
    """Raise BadInput unless an equation can be compiled as the plant calls it, and returns as many
    numbers as asked."""
    port = PORTS[at.port]
    kinds = [types.int64 if quantity in WHOLE else types.float64 for quantity in port.quantities]
    function: Any = at.equation
    given = (types.float64,) * len(at.numbers) + tuple(kinds)
    try:
        function.compile(given)
        found = function.overloads[given].signature.return_type
    except Exception as error:  # numba raises whatever an equation leads it to
        raise BadInput(
            f"{file}: the equation of '{card.name}' at '{at.port}' cannot be compiled: "
            f"{raised(error)}; mend it"
        ) from None
    each = list(getattr(found, "types", [found]))
    plain = all(isinstance(kind, (types.Integer, types.Float, types.Boolean)) for kind in each)
    if (
        not plain
        or len(each) != port.returns
        or isinstance(found, types.BaseTuple) != (port.returns > 1)
    ):
        numbers = f"{port.returns} number{'s' * (port.returns > 1)}"
        raise BadInput(
            f"{file}: the equation of '{card.name}' returns {str(found)[:60]}; "
            f"at '{at.port}' it returns {numbers}: {port.what}"
        )


def _try(card: Effect, file: Path) -> None:
    """Raise BadInput unless a card's functions work neutral and at each end of each parameter, the
    others neutral."""
    drive = load_drive(TRIED_ON)
    own = {
        card.public(k, p.name): p
        for k in range(1, card.repeats + 1)
        for p in card.part(k).parameters
    }
    neutral = library.neutral(drive.motor) | {
        name: p.neutral_for(drive.motor) for name, p in own.items()
    }
    bounded = [(name, p) for name, p in own.items() if math.isfinite(p.low)]
    for name, end in [(n, x) for n, p in bounded for x in (p.low, neutral[n], p.high)]:
        try:
            _ask(card, neutral | {name: end}, neutral, drive)
        except BadInput:  # a limit of the card, in its own words
            continue
        except Exception as error:  # whatever a user's file raises is the user's to mend
            raise BadInput(
                f"{file}: '{card.name}' fails with {name} = {end:g}: {raised(error)}"
            ) from None


def _ask(card: Effect, values: dict[str, float], neutral: dict[str, float], drive: Drive) -> None:
    """Call a card's functions as a run does."""
    inside = card.inside(values, drive.motor, drive.converter) if card.inside else ()
    for limit in chain(card.limits_at(values, drive.motor, drive.converter), inside):
        if limit.broken:
            return  # nothing else is asked then
    for at in card.at:
        if PORTS[at.port].once:
            _ask_once(card, at, values, drive, off=not card.is_on(values, neutral))
    if card.longest and card.is_on(values, neutral):
        step = card.longest(values, drive.motor, drive.motor.rated_omega)
        if not step > 0.0:
            raise ValueError(f"longest gives {step}; give s, more than 0")
    if card.leg_slope:
        period, link = drive.converter.sampling_period, drive.converter.dc_bus_voltage
        _check_slope(card.leg_slope(values, drive.motor, Legs(link, period, ZONE)))


def _check_slope(slope: LegSlope) -> None:
    """Raise ValueError unless ohms and the zone in which they hold are numbers, the zone one that
    has a width where volts are given back."""
    ohms, within = slope
    if not (math.isfinite(ohms) and math.isfinite(within)) or (ohms < 0.0 and within <= 0.0):
        raise ValueError(
            f"leg_slope gives {ohms} ohm within {within} A; give finite ones, where volts are "
            "given back within more than 0 A"
        )


def _ask_once(card: Effect, at: At, values: dict[str, float], drive: Drive, *, off: bool) -> None:
    """Raise ValueError unless an equation that is asked once a batch returns numbers, the first 0
    where it is off."""
    flux = flux_scale(drive.motor)
    rated = {"flux": flux, "slope": drive.motor.rated_omega * flux}
    quantities = [
        rated[name] if name in rated else getattr(drive.motor, name)
        for name in PORTS[at.port].quantities
    ]
    answers = at.equation(*(values[card.public(1, n)] for n in at.numbers), *quantities)
    numbers = answers if isinstance(answers, tuple) else (answers,)
    if not all(map(math.isfinite, numbers)) or min(numbers[1:], default=0.0) < 0.0:
        raise ValueError(
            f"its equation at '{at.port}' returns {numbers}; give finite ones, from the "
            "second on none < 0"
        )
    if off and numbers[0] != 0.0:
        raise ValueError(
            f"its equation at '{at.port}' returns {numbers[0]:g} while it is off; give 0"
        )


def inherit() -> None:
    """Take over what the process that started this one had, and the effects of other installed
    packages.

    A package whose effects cannot be taken is left out, and the log says why.
    """
    for file in filter(None, os.environ.get(VARIABLE, "").split(os.pathsep)):
        adopt(file)
    for point in brought("effects").values():
        try:
            names = [card.name for card in adopt(place_of(point))]
            if point.name not in names:
                raise BadInput(
                    f"'{point.value}' of another package has no effect '{point.name}'; "
                    "mend it there"
                )
        except BadInput as error:
            warn(error)
