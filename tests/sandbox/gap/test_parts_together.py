"""Orders that only together close half of a gap: by hand on separate columns, and the slots of a bench."""

import math
from types import SimpleNamespace

import numpy as np
import pytest

from model.effects import library
from sandbox.gap.evidence.algebra import Prior
from sandbox.gap.evidence.normal import Sums
from sandbox.gap.evidence.priors import of_part
from sandbox.gap.search.parts import together as parts_together
from sandbox.gap.search.parts.together import Screened, Start, greedy, joined, together
from sandbox.plant.sets import complete
from tests.sandbox.gap.conftest import DRIVE

EFFECT = "flux_harmonics"
DEVIATION, STIFF = 2.0, 400.0


def gain(pull):
    """Return what a column of its own brings, in log evidence (Gaussian integral): size STIFF, slope `pull`."""
    return 0.5 * pull**2 / (STIFF + DEVIATION**-2) - 0.5 * math.log(1.0 + STIFF * DEVIATION**2)


def screened(pulls, rotors=("driven",), weights=None, squares=500.0):
    """Return the equations of one column a start, on the first of some recordings, and the starts."""
    n, names = len(pulls), [f"{EFFECT}.2.psi_d"] * len(pulls)
    coordinates = [SimpleNamespace(label=f"{names[k]}@{k}", deviation=DEVIATION) for k in range(n)]
    unit = np.full(n, DEVIATION)
    segment = SimpleNamespace(recording=0, channel="current", rr=np.array([squares + 100.0]), n=np.array([100.0]))

    def summed(weights):
        """Return sums of the one recording, nothing where it does not count."""
        w = weights.get((0, "current"), 0.0)
        return Sums(w * STIFF * np.eye(n), w * np.array(pulls), w * squares)

    equations = SimpleNamespace(coordinates=coordinates, x=np.zeros(n), summed=summed, segments=(segment,))
    prior = Prior(np.zeros(n), np.zeros(n), np.full(n, -np.inf), np.full(n, np.inf))
    own = SimpleNamespace(label=f"{EFFECT}.2.psi_d", deviation=unit[0])
    tried = [Start(EFFECT, {f"{EFFECT}.2.order": 6.0 * (k + 1)}, (own,)) for k in range(n)]
    found = Screened(equations, prior, weights or {(k, "current"): 1.0 for k in range(len(rotors))})
    recordings = tuple(SimpleNamespace(rotor=x) for x in rotors)
    fit = SimpleNamespace(point=SimpleNamespace(prepared=SimpleNamespace(recordings=recordings)))
    return SimpleNamespace(effects=("dead_time",), fit=fit), tried, found


def test_orders_are_taken_by_what_they_bring():
    """Columns that share nothing: each brings what it brings alone; the one that is not worth 5 ends it."""
    _, tried, found = screened([100.0, 300.0, 60.0, 200.0])
    chosen, total = greedy(found, dict(enumerate(tried)), 5.0)
    assert gain(60.0) < 5.0 < gain(100.0)
    assert chosen == [1, 3, 0]
    assert total == pytest.approx(gain(300.0) + gain(200.0) + gain(100.0), rel=1e-9)


def test_no_more_orders_than_an_effect_has_places():
    _, tried, found = screened([200.0 + k for k in range(8)])
    chosen, _ = greedy(found, dict(enumerate(tried)), 5.0)
    assert len(chosen) == library.load_effect(EFFECT).repeats - 1


@pytest.mark.parametrize(("rotors", "squares", "count"), [
    (("driven",), 1.9, 1), (("driven",), 2.1, 0), (("locked",), 1.9, 0), (("free",), 1.9, 1)])  # fmt: skip
def test_together_they_have_to_promise_half_of_what_turning_rotors_show(rotors, squares, count):
    """The gap is `squares` times what the orders promise, a gain being half of the squares that it takes away: half
    of it is reached up to two of these."""
    pulls = [300.0, 200.0]
    promised = sum(gain(p) for p in pulls)
    best, tried, found = screened(pulls, rotors, squares=squares * 2.0 * promised)
    told = together(best, tried, found, 5.0)
    assert len(told) == count
    for promise, start in told:
        assert promise == pytest.approx(promised, rel=1e-9)
        assert (start.effect, start.parts) == (EFFECT, 2)
        assert start.begun == {f"{EFFECT}.2.order": 6.0, f"{EFFECT}.3.order": 12.0}


def test_one_order_is_no_start_of_several_nor_are_those_of_an_effect_of_the_set():
    best, tried, found = screened([300.0, 10.0], squares=1.0)
    assert together(best, tried, found, 5.0) == []
    best, tried, found = screened([300.0, 200.0], squares=1.0)
    best.effects = (EFFECT,)
    assert together(best, tried, found, 5.0) == []


def test_joined_parts_stand_one_behind_the_other():
    starts = [Start(EFFECT, {f"{EFFECT}.3.order": n, f"{EFFECT}.3.psi_d": 1.0}, (), 3) for n in (18.0, 6.0)]
    assert joined(starts).begun == {
        f"{EFFECT}.3.order": 18.0, f"{EFFECT}.3.psi_d": 1.0, f"{EFFECT}.4.order": 6.0, f"{EFFECT}.4.psi_d": 1.0,
    }  # fmt: skip


def test_a_part_where_the_first_stands_leaves_that_one_s_numbers_to_it():
    """Order 6 with phase 0: gamma would be gamma_6 once more; with another phase it is not."""
    card, neutral = library.load_effect("inductance_harmonics"), complete(DRIVE.motor, DRIVE.converter)
    sixth = {**neutral, "inductance_harmonics.2.order": 6.0}

    def moved(values):
        """Return the parameters of the second part that a fit moves."""
        return {c.names[0].rpartition(".")[2] for c in of_part(card, 2, DRIVE, values)}

    assert moved(neutral) - moved(sixth) == {"gamma"}
    assert moved({**sixth, "inductance_harmonics.2.phase": 1.0}) == moved(neutral)
    assert parts_together.CLOSES[0] == 0.5  # as the numbers above take it
