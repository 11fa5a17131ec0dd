"""What a person should do about effects that were found: one sentence each, from the effects'
cards."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping

from model.effects.library import load_effect, neutral, parameters, same_numbers
from model.parameters import Converter, Motor

NONE = "nothing to set yet: its likeliest size is none"
KEEP = "keep it in the simulator (effects.toml has it), and measure it on its own"


def what_to_do(
    effects: Iterable[str], found: Mapping[str, float], motor: Motor, converter: Converter
) -> dict[str, str]:
    """Return by effect what to do about it.

    effects: names of the library's, or of your own; found: estimated parameters by public name,
    those that are missing are neutral; motor: the nominal one, whose values the sentences compare
    with.
    """
    values = completed(found, motor)
    return {name: advice(name, values, motor, converter) for name in effects}


def advice(effect: str, values: Mapping[str, float], motor: Motor, converter: Converter) -> str:
    """Return what to do about one effect at completed values; of one that is off, nothing; of one
    whose card says nothing, to keep it in the simulator."""
    card = load_effect(effect)
    if not card.is_on(values, neutral(motor)):
        return NONE
    return card.do(values, motor, converter) if card.do else KEEP


def completed(found: Mapping[str, float], motor: Motor) -> dict[str, float]:
    """Return every parameter's value, neutral where it is not found; names that are none are left
    out."""
    known, values = parameters(), neutral(motor)
    values |= {name: float(x) for name, x in found.items() if name in known and math.isfinite(x)}
    for other, one in same_numbers().items():
        values[one] = values[other] = values[other] if other in found else values[one]
    return values
