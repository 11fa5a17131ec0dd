"""Effects of which one contains another: never both in a set of a simple method, and no coordinate
charged twice."""

import pytest

from model.effects.library import load_effect
from sandbox.gap.evidence.priors import Coordinate
from sandbox.withheld.baselines.screening import barred, lesser, new, staying
from sandbox.withheld.baselines.stepwise import Search, searched

PART, WHOLE, OTHER = "cross_saturation", "saturation", "dead_time"


def coordinates(effect):
    """Return an effect's coordinates by label, the cross part's under saturation's names."""
    names = [p.same_as or f"{effect}.{p.name}" for p in load_effect(effect).parameters]
    return {n: Coordinate(n, 0.0, 1.0, "linear", (n,)) for n in names}


def test_only_new_coordinates_are_charged():
    """Five of saturation alone, three beside its cross part."""
    own = coordinates(WHOLE).values()
    assert [new(effects, own) for effects in ((), (PART,), (OTHER,))] == [5, 3, 5]


def test_a_whole_takes_the_place_of_its_part_and_keeps_it_out():
    assert staying((OTHER, PART), WHOLE) == (OTHER,)
    assert staying((OTHER, WHOLE), "inertia") == (OTHER, WHOLE)
    assert set(barred((OTHER, WHOLE))) == {OTHER, WHOLE, PART}
    assert barred((PART,)) == (PART,)
    assert lesser((OTHER, WHOLE), ()) == [(WHOLE,), (OTHER,), (OTHER, PART)]
    assert lesser((WHOLE,), (PART,)) == [()]


@pytest.mark.parametrize(
    ("criteria", "best"),
    [
        (
            {
                (): 100.0,
                (PART,): 50.0,
                (WHOLE,): 60.0,
                (OTHER,): 90.0,
                (PART, OTHER): 40.0,
                (WHOLE, OTHER): 20.0,
            },
            {WHOLE, OTHER},
        ),
        (
            {
                (): 100.0,
                (PART,): 60.0,
                (WHOLE,): 50.0,
                (OTHER,): 90.0,
                (PART, OTHER): 20.0,
                (WHOLE, OTHER): 40.0,
            },
            {PART, OTHER},
        ),
    ],
)
def test_part_and_whole_are_exchanged_and_never_both_named(criteria, best, on_a_table):
    """First the part joins and the whole takes its place beside another effect; then the other way
    round.  A table that holds no set of both fails where one is asked for."""
    none, _ = on_a_table(criteria)
    assert {*searched(Search((), lambda: False), none).effects} == best
