"""Prior probability of a set of effects, and which sets there are."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence

from model.effects import library
from sandbox.gap.posterior.settings import USUAL, Settings

Set = tuple[str, ...]


def log_prior(effects: Sequence[str], settings: Settings = USUAL) -> float:
    """Return the log prior of a set: its number of effects is geometric, all sets of one size are alike."""
    n, whole = len(effects), len(library.effect_names())
    return math.log((1.0 - settings.more) * settings.more**n / math.comb(whole, n))


def contained(effect: str) -> frozenset[str]:
    """Return the effects whose parameters are part of an effect's own: never claimed together with it."""
    whole = {own.partition(".")[0]: double.partition(".")[0] for double, own in library.same_numbers().items()}
    return frozenset({whole[effect]} if effect in whole else ())


def possible(effects: Iterable[str]) -> bool:
    """Return whether no effect of a set is part of another of it."""
    chosen = set(effects)
    return not any(contained(e) & chosen for e in chosen)
