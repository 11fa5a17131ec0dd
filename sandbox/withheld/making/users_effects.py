"""Effects of a user (`--effects-from`) in a check: recorded by the switched bench where it has
their equation, too.

The bench shares no code with the plant, so it cannot take over a user's equation.  It knows a few
effects outside the library by its own numbers (`switched.unlisted`); an effect called like one of
them is drawn as those of the library.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence

from numpy.random import Generator

from model.effects import own
from model.effects.card import Effect
from model.errors import BadInput
from model.parameters import Converter, Motor
from sandbox.switched.unlisted import UNLISTED
from sandbox.withheld.making.effect_sizes import EFFECT_SIZES, Planted


def users_cards() -> dict[str, Effect]:
    """Return the cards taken over by name; BadInput for one that the bench has no equation for."""
    found = {card.name: card for card, _ in own.cards()}
    for card in found.values():
        numbers(card)
    return found


def numbers(card: Effect) -> dict[str, str]:
    """Return the bench's number of each parameter of a card: `effect` for the first,
    `effect_parameter` for others; BadInput where the bench has no such number."""
    out = {
        p.name: f"{card.name}_{p.name}" if k else card.name for k, p in enumerate(card.parameters)
    }
    for parameter, number in out.items():
        if number not in UNLISTED:
            raise BadInput(
                f"the switched bench has no number '{number}' for '{card.name}.{parameter}', so it "
                f"cannot record that effect; it knows {', '.join(UNLISTED)}"
            )
    return out


def size_at(place: float) -> float:
    """Return the multiple of the typical size at a place, 0 to 1, of the range that the ladder
    spans."""
    return float(EFFECT_SIZES[0] * (EFFECT_SIZES[-1] / EFFECT_SIZES[0]) ** place)


def users_planted(
    card: Effect, motor: Motor, converter: Converter, size: float, rng: Generator
) -> Planted:
    """Return what the bench gets for an effect of a multiple of its card's typical size; phases are
    drawn."""
    bench = dict[str, float]()
    for k, (p, number) in enumerate(zip(card.parameters, numbers(card).values(), strict=True)):
        if p.name in (card.polar or ())[1:]:
            bench[number] = rng.uniform(0.0, math.tau)
        else:
            bench[number] = (size if k == 0 else 1.0) * p.typical_for(motor, converter)
    return Planted(bench=bench)


def users_truth(names: Sequence[str], bench: Mapping[str, float]) -> dict[str, float]:
    """Return the true parameters of a user's effects by public name, from the bench's numbers."""
    cards = {card.name: card for card, _ in own.cards() if card.name in names}
    return {
        f"{name}.{p}": bench[number]
        for name, card in cards.items()
        for p, number in numbers(card).items()
    }
