"""Which sets run side by side: against every partition of few sets, and by what must hold of
any."""

from itertools import combinations

import numpy as np
import pytest

from model.drive_files import load_drive
from sandbox.plant import additions as add
from sandbox.plant.sets import complete
from sandbox.replay.grouping import ALONE, BARE, COSTS, ROOMS, SAMPLED, cost, grouped, room_of
from sandbox.replay.replay import needs_of

NEEDS = (
    0,
    add.RUB,
    add.IRON,
    add.SKIN | add.ROUND,
    add.LEG,
    add.LEG | add.ROUND,
    add.MAGNETS | add.DRAWN,
)


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
    return sum(
        cost(
            int(np.bitwise_or.reduce([needs[k] for k in g] + [common or 0])),
            len(g) + (common is not None),
        )
        for g in groups
    )


def test_rooms_and_costs_by_value():
    """Sums of the table by hand: 8 lanes are one vector, 24 three, one lane takes ALONE of one."""
    assert [room_of(n) for n in (1, 2, 8, 9, 24)] == [1, 8, 8, 24, 24]
    assert cost(add.RUB, 3) == sum(BARE)
    assert cost(add.RUB, 1) == BARE[0] + ALONE * BARE[1]
    legs = COSTS[add.LEG]
    assert cost(add.LEG, 20) == BARE[0] + legs[0] + 3.0 * (BARE[1] + legs[1])


@pytest.mark.parametrize("common", [None, add.LEG])
@pytest.mark.parametrize("seed", range(3))
def test_what_fits_in_one_vector_runs_in_one_block(seed, common):
    """Seven sets with drawn needs: none of 877 partitions is faster.  Two blocks of one vector that
    join pay for what both need once, and for a bare block once, so every join saves 640 ns or
    more."""
    needs = [int(x) for x in np.random.default_rng(seed).choice(NEEDS, 7)]
    found = grouped(needs, common)
    assert found == [list(range(7))]
    assert time_of(found, needs, common) == min(
        time_of(p, needs, common) for p in partitions(list(range(7)))
    )


@pytest.mark.parametrize("common", [None, add.LEG])
@pytest.mark.parametrize("seed", range(6))
def test_no_two_blocks_would_be_faster_as_one(seed, common):
    """Forty sets with drawn needs, more than a block takes: each stands in one block, no join of
    two that fit saves time, and the whole takes no longer than sets of equal needs apart.  Times
    are whole numbers of ns: compared as they are."""
    needs = [int(x) for x in np.random.default_rng(seed).choice(NEEDS, 40)]
    found = grouped(needs, common)
    assert sorted(k for g in found for k in g) == list(range(40))
    most = ROOMS[-1] - (common is not None)
    for a, b in combinations(found, 2):
        if len(a) + len(b) <= most:
            assert time_of([a + b], needs, common) >= time_of([a, b], needs, common), (a, b)
    apart = [[k for k in range(40) if needs[k] == n] for n in set(needs)]
    assert max(map(len, apart)) <= most
    assert time_of(found, needs, common) <= time_of(apart, needs, common)


@pytest.mark.parametrize(
    ("more", "blocks", "time"), [(add.IRON, 2, 2506.0), (add.ROUND, 1, 1760.0)]
)
def test_a_join_has_to_save(more, blocks, time):
    """Nine bare sets (three vectors, 1600 ns) and one that needs more, by the table: with iron loss
    906 ns alone and 1330 beside them, with a round sign 633 alone and 160 beside them."""
    needs = [0] * 9 + [more]
    found = grouped(needs)
    assert (len(found), time_of(found, needs)) == (blocks, time)


def test_what_joined_sets_need_counts_in_the_next_join():
    """Seven sets with friction and nine bare ones share a block (three vectors, 1600 ns); one with
    iron loss stays alone (906 ns), though the seven would have taken it in (1170): together all
    would take 2930 ns."""
    needs = [add.RUB] * 7 + [add.IRON] + [0] * 9
    assert time_of([list(range(17))], needs) == 2930.0
    assert time_of(grouped(needs), needs) == 906.0 + 1600.0


@pytest.mark.parametrize("common", [None, 0])
def test_no_block_is_too_large(common):
    """A hundred sets of one kind: full rooms; each set once."""
    found = grouped([add.RUB] * 100, common)
    most = ROOMS[-1] - (common is not None)
    assert sorted(len(g) for g in found) == sorted([most] * (100 // most) + [100 % most])
    assert sorted(k for g in found for k in g) == list(range(100))


def test_sets_alike_stay_together_and_heavy_ones_apart():
    """Twenty bare sets and one with iron loss: the one does not make the twenty walk through its
    lag."""
    groups = grouped([0] * 20 + [add.IRON])
    assert [20] in groups
    assert len(groups) == 2


def test_sets_that_sample_off_the_pattern_run_apart():
    """Many that need nothing and a few that sample late, more than one room takes: no block mixes
    them."""
    needs = [0] * 20 + [SAMPLED] * 6
    groups = grouped(needs, 0)
    assert all(len({needs[k] for k in g}) == 1 for g in groups)


def test_a_set_that_samples_late_needs_to():
    drive = load_drive("ipm")
    sets = [
        complete(drive.motor, drive.converter, {"current_sampling.delay": x}) for x in (0.0, 1e-6)
    ]
    apart = [needs_of(drive.motor, drive.converter, s) & SAMPLED for s in sets]
    assert apart == [0, SAMPLED]
