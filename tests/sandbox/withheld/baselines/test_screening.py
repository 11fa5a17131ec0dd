"""Effects of which one contains another: never both in a set of a simple method, and no coordinate
charged twice."""

from types import SimpleNamespace

import pytest

from model.effects.library import load_effect
from sandbox.gap.evidence.priors import Coordinate
from sandbox.gap.posterior.candidates import Candidate
from sandbox.withheld.baselines import screening
from sandbox.withheld.baselines.screening import Columns, barred, lesser, screened, staying
from sandbox.withheld.baselines.stepwise import Search, searched

PART, WHOLE, OTHER = "cross_saturation", "saturation", "dead_time"


def coordinates(effect):
    """Return an effect's coordinates by label, the cross part's under saturation's names."""
    names = [p.same_as or f"{effect}.{p.name}" for p in load_effect(effect).parameters]
    return {n: Coordinate(n, 0.0, 1.0, "linear", (n,)) for n in names}


def test_only_new_coordinates_are_charged(monkeypatch):
    """With log n = 1 and equations that promise nothing the criterion is the number of new
    coordinates: five of saturation alone, three beside its cross part; what a fit moves as an
    ordinary deviation is charged."""
    own = [(Candidate(e, {}), coordinates(e)) for e in (WHOLE, OTHER)]
    known = [*coordinates(WHOLE).values()]
    still = SimpleNamespace(most_probable=lambda prior: SimpleNamespace(objective=0.0))
    monkeypatch.setattr(screening, "columns", lambda *_: Columns(known, own))
    monkeypatch.setattr(screening, "normal", lambda *_: None)
    monkeypatch.setattr(screening, "algebra", lambda n: still)
    monkeypatch.setattr(screening, "readings", lambda n: 2.718281828459045)
    monkeypatch.setattr(screening, "held_but", lambda n, free: None)
    for effects, wanted in (((), 5.0), ((PART,), 3.0), ((OTHER,), 5.0)):
        found = {p.probe.effect: p.criterion for p in screened(None, known, [], effects)}
        assert found[WHOLE] == pytest.approx(wanted, rel=1e-12)


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
