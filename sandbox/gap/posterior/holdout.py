"""Which recordings are held out.

Slopes decide, residuals do not: of all choices of one recording a kind of rotor
(two where there are five), the one after which no effect has lost much of what the campaign can say
about it, while the recordings held out still feel every effect.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from itertools import combinations, product

import numpy as np

from sandbox.gap.evidence.normal import NormalEquations
from sandbox.gap.posterior.linear_model import LinearModel

CHANNELS = ("current", "motion", "angle")
# at most, each costs some milliseconds: of many recordings of a kind some, spread evenly, are tried
CHOICES = 500
# a held-out recording needs to feel an effect only so many times less than the fitted ones
FELT = 4.0


def weights_of(recordings: int, left_out: Sequence[int] = ()) -> dict[tuple[int, str], float]:
    """Return weight 1 for every channel of every recording but those left out."""
    return {(k, c): 1.0 for k in range(recordings) if k not in left_out for c in CHANNELS}


def choices(rotors: Sequence[str]) -> list[tuple[int, ...]]:
    """Return the choices of recordings to hold out, at most CHOICES; () where every kind is there
    only once."""
    kinds = [
        [k for k, r in enumerate(rotors) if r == kind] for kind in ("locked", "driven", "free")
    ]
    options = [_of_kind(own) for own in kinds]
    sizes = [len(own) for own in kinds]
    while math.prod(len(o) for o in options) > CHOICES:
        k = max(range(len(kinds)), key=lambda k: len(options[k]))
        sizes[k] -= 1
        some = [kinds[k][round(i)] for i in np.linspace(0, len(kinds[k]) - 1, sizes[k])]
        options[k] = _of_kind(some, len(options[k][0]))
    return [tuple(sorted(k for part in parts for k in part)) for parts in product(*options)]


def _of_kind(own: Sequence[int], left_out: int | None = None) -> list[tuple[int, ...]]:
    """Return the choices among recordings of one kind; left_out: how many of them, two of five and
    more by default."""
    if left_out is None:
        left_out = (2 if len(own) >= 5 else 1) if len(own) >= 2 else 0
    return list(combinations(own, left_out))


def held_out(model: LinearModel) -> tuple[int, ...]:
    """Return the recordings (places in the campaign) to hold out; () where there are too few to
    spare any.

    model: the equations of all effects beside ordinary deviations alone.
    """
    options = choices([r.rotor for r in model.point.prepared.recordings])
    if options == [()]:
        return ()
    own = [
        (k,) for k, c in enumerate(model.coordinates) if not model.of_effects[k] and not c.of_point
    ]
    groups: list[tuple[int, ...]] = [*own, *model.members.values()]
    labels = [[model.coordinates[k].label for k in g] for g in groups]
    return max(options, key=lambda left: worst_share(model.normal, left, labels))


def worst_share(n: NormalEquations, left: Sequence[int], groups: Sequence[Sequence[str]]) -> float:
    """Return the smallest share of information about any group of coordinates that fit and check
    keep.

    Fit: variance with all recordings over variance without those left out; check: A of those left
    out over all A.
    """
    count = 1 + max(s.recording for s in n.segments)
    whole, kept = n.summed().a, n.summed(weights_of(count, left)).a
    prior = np.diag([c.deviation**-2 for c in n.coordinates])
    narrow, wide = np.diag(np.linalg.inv(whole + prior)), np.diag(np.linalg.inv(kept + prior))
    place = {c.label: k for k, c in enumerate(n.coordinates)}
    shares = []
    for group in groups:
        own = [
            place[g]
            for g in group
            if whole[place[g], place[g]] * n.coordinates[place[g]].deviation ** 2 > 1.0
        ]
        for k in own:
            shares.append(min(narrow[k] / wide[k], FELT * (1.0 - kept[k, k] / whole[k, k])))
    return float(min(shares, default=0.0))
