"""Which parameter sets run side by side: few lanes stay idle, and no set pays for many effects of
its neighbours.

All lanes of a block walk through what any of them needs, so sets that need much run apart from
those that need little. A block's time is estimated as a constant and a part for every VECTOR lanes,
both larger for each kind of effect that it needs; groups of sets with equal needs are joined as
long as that saves time.  Estimates decide what is fast, nothing else.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import combinations

from sandbox.plant import additions as add

# lanes that a block may have: one set, some, many; each size is compiled for itself, in 10 to 20 s
ROOMS = (1, 8, 24)
VECTOR = 8
SAMPLED = 1 << 24  # beside the plant's own bits: samples that are not taken as a pattern begins
ALONE = 0.7  # of a VECTOR's time: a block of one lane; measured 0.44 (iron loss) to 0.79 (bare)
# ns a period, measured by `experiments/lane_cost.py`: constant, and for every VECTOR lanes
# (CURVE, WOBBLE, SAMPLED and LAYERS on a busy machine, scaled by what BARE took there)
BARE = (160.0, 480.0)
COSTS = {
    add.LEG: (150.0, 310.0),
    add.IRON: (130.0, 400.0),
    add.SKIN: (170.0, 340.0),
    add.LAYERS: (0.0, 2800.0),
    add.FILTER: (110.0, 230.0),
    add.ENERGY: (230.0, 300.0),
    add.LINK: (140.0, 130.0),
    add.MAGNETS: (120.0, 0.0),
    add.COMMUTE: (120.0, 110.0),
    add.ROUND: (130.0, 10.0),
    add.WINDING: (90.0, 0.0),
    add.DELAYED: (140.0, 220.0),
    add.WOBBLE: (165.0, 165.0),
    add.CURVE: (100.0, 1300.0),
    add.CORE_LOSS: (580.0, 1450.0),  # beside IRON
    SAMPLED: (70.0, 630.0),
}


def room_of(sets: int) -> int:
    """Return the lanes of the smallest room for so many sets."""
    return next(n for n in ROOMS if n >= sets)


def cost(needs: int, sets: int) -> float:
    """Return about how long (ns) a period of a block of so many sets takes that need these effects
    together."""
    vectors = max(ALONE, room_of(sets) / VECTOR)
    own = [BARE, *(c for bit, c in COSTS.items() if needs & bit)]
    return sum(constant + each * vectors for constant, each in own)


def grouped(needs: Sequence[int], common: int | None = None) -> list[list[int]]:
    """Return the places of sets with these needs, block by block; common: needs of a set that every
    block holds, too.

    Begins with sets of equal needs and joins the two groups that save most, until none do.
    """
    common_sets, always = (0, 0) if common is None else (1, common)
    most = ROOMS[-1] - common_sets
    equal: dict[int, list[int]] = {}
    for k, need in enumerate(needs):
        equal.setdefault(need | always, []).append(k)
    groups = [
        (need, own[k : k + most]) for need, own in equal.items() for k in range(0, len(own), most)
    ]
    while len(groups) > 1:
        saved, (i, j) = max(
            (
                (_saved(groups[i], groups[j], common_sets), (i, j))
                for i, j in combinations(range(len(groups)), 2)
            ),
            key=lambda x: x[0],
        )
        if saved <= 0.0:
            break
        joined = groups[i][0] | groups[j][0], sorted(groups[i][1] + groups[j][1])
        groups = [g for k, g in enumerate(groups) if k not in (i, j)] + [joined]
    return [own for _, own in groups]


def _saved(one: tuple[int, list[int]], other: tuple[int, list[int]], common_sets: int) -> float:
    """Return the time that two groups save in one block; negative where they are too many for it,
    or cost more."""
    sets = len(one[1]) + len(other[1])
    if sets + common_sets > ROOMS[-1]:
        return -1.0
    apart = cost(one[0], len(one[1]) + common_sets) + cost(other[0], len(other[1]) + common_sets)
    return apart - cost(one[0] | other[0], sets + common_sets)
