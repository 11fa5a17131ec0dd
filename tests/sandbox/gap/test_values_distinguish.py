"""Numbers of how alike two hypotheses are: a cosine by hand, the way from one fit to the other told by a script."""

import math
from types import SimpleNamespace

import numpy as np
import pytest

from model.errors import BadInput
from sandbox.gap.evidence.algebra import Algebra, Prior
from sandbox.gap.evidence.priors import Coordinate
from sandbox.gap.evidence.spike_slab import Table
from sandbox.gap.report import distinguishability as distinct


def told_table(rival):
    """Equations of an effect's size, a rival's and an ordinary value; only the ordinary one moves without effects."""
    a = np.array([[4.0, 1.0, 1.0], [1.0, 2.0, 0.0], [1.0, 0.0, 3.0]])
    zero, far = np.zeros(3), np.full(3, np.inf)
    narrow, wide = (Prior(zero, np.array([x, y, 0.5]), -far, far) for x, y in ((0.0, 0.0), (2.0, 1.0)))
    of_effects = np.array([True, True, False])
    equations = Algebra(a, np.array([0.5, 0.0, 0.0]), 99.0, zero)
    table = Table(None, None, equations, narrow, wide, {"e": (0,), "f": (1,)}, of_effects)
    return SimpleNamespace(table=table, equations=equations, effects=("e",)), ("f",) if rival else ()


@pytest.mark.parametrize(
    ("rival", "temperature", "squares"),
    [
        (False, 1.0, 27.0 / 28.0),
        (True, 1.0, 1.0 - 1.0 / 3.0 * 7.0 / 27.0),
        (True, 2.0, 1.0 - 0.125 / (2.0 - 0.25 / 5.5)),
    ],
)
def test_a_cosine_by_hand(rival, temperature, squares):
    """4 less 1/(3 + 4) that the ordinary value takes up, less 1/(2 + 1) that the rival does; at a temperature of 2:
    2 less 0.25/(1.5 + 4), less 0.25/(1 + 1)."""
    j, other = told_table(rival)
    assert distinct._cosines(j, other, temperature) == {"e": pytest.approx(math.sqrt(1.0 - squares))}


class Way:
    """A point on the way: the value of its coordinate, and the turns it was given."""

    def __init__(self, prepared, values, turns):
        self.values, self.turns, self.x = values, turns, None

    def moved(self, coordinates, x):
        out = Way(None, self.values, self.turns)
        out.x = float(x[0])
        return out


def test_the_way_from_one_fit_to_the_other_by_hand(monkeypatch):
    """From 1 (second) to 3 (first) in eighths, the last one none a drive can be: r'r = x^2, at a temperature of 2; a
    turn from 0.2 to 0.4, one to 0.8 that the second does not have, one from 0.6 that the first does not."""
    turns = []

    def equations(point, _):
        turns.append([point.turns[k] for k in "abc"])
        assert point.values == {"e.x": 3.0, "f.x": 7.0}
        if point.x == 3.0:
            raise BadInput("no such drive")
        return SimpleNamespace(segments=[SimpleNamespace(rr=np.array([0.5 * point.x**2] * 2))])

    def moved(point, turns):
        point.turns = turns
        return point

    monkeypatch.setattr(distinct, "Point", Way)
    monkeypatch.setattr(distinct, "replace", moved)
    monkeypatch.setattr(distinct, "normal", equations)
    monkeypatch.setattr(distinct, "coordinates_of", lambda *_: [Coordinate("x", 0.0, 1.0, "linear", ("e.x",))])
    monkeypatch.setattr(distinct, "_cosines", lambda *_: {"e": 0.5})

    def judged(effect, values, turns):
        point = SimpleNamespace(prepared=None, values=values, turns=turns)
        own = SimpleNamespace(point=point, coordinates=[Coordinate("x", 0.0, 1.0, "linear", ("e.x",))])
        return SimpleNamespace(effects=(effect,), fit=own)

    a = judged("e", {"e.x": 3.0, "f.x": 0.0}, {"a": 0.4, "b": 0.8})
    b = judged("f", {"e.x": 1.0, "f.x": 7.0}, {"a": 0.2, "c": 0.6})
    d = SimpleNamespace(
        judged=[a, b], temperature=2.0, ambiguity_set=[SimpleNamespace(effects=j.effects, judged=j) for j in (a, b, a)]
    )
    found = distinct.alike(d)
    shares = np.arange(9) / 8.0
    assert found.share == pytest.approx(shares[:-1])
    assert found.log_likelihood == pytest.approx(-0.25 * ((1.0 + 2.0 * shares[:-1]) ** 2 - 1.0))
    expected = np.array([0.2 + 0.2 * shares, 0.8 * shares, 0.6 * (1.0 - shares)])
    assert np.array(turns) == pytest.approx(expected.T)
