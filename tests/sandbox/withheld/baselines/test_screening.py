"""Effects of which one contains another: never both in a set of a simple method, and no coordinate
charged twice."""

import math

import pytest

from model.effects.library import load_effect
from sandbox.gap.evidence.normal import ParameterPoint
from sandbox.gap.evidence.priors import Coordinate
from sandbox.plant.sets import complete
from sandbox.replay.replay import prepare
from sandbox.withheld.baselines import refit as fit
from sandbox.withheld.baselines.screening import barred, lesser, new, screened, staying
from sandbox.withheld.baselines.stepwise import Search, searched
from tests.sandbox.replay.benches import DRIVE, campaign

PART, WHOLE, OTHER = "cross_saturation", "saturation", "dead_time"


def coordinates(effect):
    """Return an effect's coordinates by label, the cross part's under saturation's names."""
    names = [p.same_as or f"{effect}.{p.name}" for p in load_effect(effect).parameters]
    return {n: Coordinate(n, 0.0, 1.0, "linear", (n,)) for n in names}


def test_only_new_coordinates_are_charged():
    """Five of saturation alone, three beside its cross part."""
    own = coordinates(WHOLE).values()
    assert [new(effects, own) for effects in ((), (PART,), (OTHER,))] == [5, 3, 5]


def test_a_new_number_costs_the_logarithm_of_the_readings():
    """Schwarz' criterion, 3 x 200 readings: a drop's two numbers are paid for where the point has
    none of them, and not where it has both.  What one step reaches is the same."""
    recorded = campaign({}, [("locked", 0.0)], n=200)
    point = ParameterPoint(prepare(recorded, steps=1), complete(DRIVE.motor, DRIVE.converter))
    probe = fit.beginning(point, "device_drop")
    added, kept = (
        screened(point, fit.usual(recorded), [probe], own)[0].criterion
        for own in ((), ("device_drop",))
    )
    assert added - kept == pytest.approx(2.0 * math.log(600.0), rel=1e-9)


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
