"""How far a fit may take parameters, for the limits on their effects' cards."""

from __future__ import annotations

from collections.abc import Mapping

from model.effects.card import Effect
from model.errors import BadInput
from model.parameters import Drive

BELOW = 1.0 - 1e-6  # of a bound that a value must stay below


def ends(card: Effect, drive: Drive, values: Mapping[str, float]) -> dict[str, float]:
    """Return by public name how far parameters may go beside completed values: just below the
    limits that are of a parameter itself, none of sums and of products; {} where values have no
    limits, as a shaft without a load."""
    try:
        asked = list(card.limits_at(values, drive.motor, drive.converter))
    except BadInput:
        return {}
    own = (x for x in asked if not x.simulated and x.size == values.get(x.name))
    return {x.name: BELOW * x.bound for x in own}
