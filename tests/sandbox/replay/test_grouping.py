"""Which sets run side by side: against every partition of few sets, and by what must hold of any."""

import numpy as np
import pytest

from sandbox.plant import additions as add
from sandbox.replay.grouping import BARE, COSTS, ROOMS, cost, grouped, room_of

NEEDS = (0, add.RUB, add.IRON, add.SKIN | add.ROUND, add.LEG, add.LEG | add.ROUND, add.MAGNETS | add.DRAWN)


def partitions(items):
    """Yield every partition of a list."""
    if not items:
        yield []
        return
    first, *rest = items
    for smaller in partitions(rest):
        yield [[first], *smaller]
        for k in range(len(smaller)):
            yield [*smaller[:k], [first, *smaller[k]], *smaller[k + 1 :]]


def time_of(groups, needs, common=None):
    """Return what a partition costs."""
    return sum(cost(int(np.bitwise_or.reduce([needs[k] for k in g] + [common or 0])), len(g) + (common is not None))
               for g in groups)  # fmt: skip


def test_rooms_and_costs_by_value():
    """Sums of the table by hand: 8 lanes are one vector, 24 three."""
    assert [room_of(n) for n in (1, 8, 9, 24)] == [8, 8, 24, 24]
    assert cost(add.RUB, 3) == sum(BARE)
    legs = COSTS[add.LEG]
    assert cost(add.LEG, 20) == BARE[0] + legs[0] + 3.0 * (BARE[1] + legs[1])


@pytest.mark.parametrize("common", [None, add.LEG])
@pytest.mark.parametrize("seed", range(6))
def test_groups_are_hardly_slower_than_the_best_of_all_partitions(seed, common):
    """Seven sets with drawn needs: 877 partitions are tried; joining pairs may end in a partition a tenth slower."""
    needs = [int(x) for x in np.random.default_rng(seed).choice(NEEDS, 7)]
    found = grouped(needs, common)
    best = min(time_of(p, needs, common) for p in partitions(list(range(7))))
    assert sorted(k for g in found for k in g) == list(range(7))
    assert time_of(found, needs, common) <= 1.1 * best
    assert time_of(found, needs, common) <= time_of([list(range(7))], needs, common)


@pytest.mark.parametrize("common", [None, 0])
def test_no_block_is_too_large(common):
    """A hundred sets of one kind: full rooms; each set once."""
    found = grouped([add.RUB] * 100, common)
    most = ROOMS[-1] - (common is not None)
    assert sorted(len(g) for g in found) == sorted([most] * (100 // most) + [100 % most])
    assert sorted(k for g in found for k in g) == list(range(100))


def test_sets_alike_stay_together_and_heavy_ones_apart():
    """Twenty bare sets and one with iron loss: the one does not make the twenty walk through its lag."""
    groups = grouped([0] * 20 + [add.IRON])
    assert [20] in groups
    assert len(groups) == 2
