"""Numbers of the recommended recording, by hand: chances, lengths, rivals; what an experiment is
expected to bring."""

import math

import numpy as np
import pytest
from scipy.stats import norm

from sandbox.gap.planning.next_recording import Tried, power
from tests.sandbox.gap.entries import named

SURE_OF_TWO = math.log(19.0)  # log evidence that leaves 0.95 to one of two: 0.95 / 0.05


def tried(told, apart=0.0, missed=0.0, name="x", seconds=1.0, n=2):
    """What an entry brings for the first hypothesis; the others never stand alone if they are
    true."""
    rows = np.full((n, n), -1000.0)
    rows[0] = told
    np.fill_diagonal(rows, np.inf)
    apart = apart * (1.0 - np.eye(n)) if isinstance(apart, float) else np.array(apart)
    return Tried(named(name, seconds), rows, apart, np.full(n, missed))


def even(n):
    return [(1.0 / n, None)] * n


@pytest.mark.parametrize(("told", "alone"), [(-0.05, 0.0), (0.05, 1.0)])
def test_one_stands_alone_from_95_of_100(told, alone):
    """Among two at ln 19, among three at ln 38 from both; half and a third of the cases have the
    first be true."""
    assert power(even(2), tried(SURE_OF_TWO + told)) == pytest.approx(alone / 2.0)
    assert power(even(3), tried(SURE_OF_TWO + math.log(2.0) + told, n=3)) == pytest.approx(
        alone / 3.0
    )


@pytest.mark.parametrize(("told", "alone"), [(-0.05, 0.0), (0.05, 1.0)])
def test_what_was_probable_before_counts(told, alone):
    """Twice as probable: ln 2 less is needed; true in two of three cases."""
    rivals = [(0.6, None), (0.3, None)]
    assert power(rivals, tried(SURE_OF_TWO - math.log(2.0) + told)) == pytest.approx(
        alone * 2.0 / 3.0
    )


DRAWN = 4.0 * math.sqrt(0.25 / 4000.0)  # four standard deviations of a share of the draws


@pytest.mark.parametrize(("missed", "apart"), [(0.0, 2.0), (50.0 / 9.0, 1.0)])
def test_what_a_simulator_misses_leans_by_three_tenths(missed, apart):
    """Variance 2 x 2 = 4; or 2 (1 + 2 x 0.09 x 50/9) x 1 = 4: one deviation, 2, above ln 19, the
    first stands alone in 84 of the 100 cases in which it is true."""
    found = power(even(2), tried(SURE_OF_TWO + 2.0, apart, missed))
    assert found == pytest.approx(0.5 * norm.cdf(1.0), abs=0.5 * DRAWN)


@pytest.mark.parametrize(("between", "sides"), [(0.0, 1.0), (8.0, -1.0), (4.0, 0.0)])
def test_rivals_on_one_side_go_together(between, sides):
    """Both are 2 from the truth, so deviations of 2; 0, 4 or 8 from each other: the same,
    independent or opposite.  In the mean each is as far behind as both together may be: half of the
    cases, fewer, none."""
    found, away = (
        SURE_OF_TWO + math.log(2.0),
        np.array([[0.0, 2.0, 2.0], [2.0, 0.0, between], [2.0, between, 0.0]]),
    )
    a, b = 2.0 * np.random.default_rng(5).standard_normal((2, 400_000))
    b = sides * a if sides else b
    alone = np.mean(np.exp(-a) + np.exp(-b) <= 2.0)
    assert power(even(3), tried(found, away, n=3)) == pytest.approx(alone / 3.0, abs=DRAWN / 3.0)


def test_a_longer_recording_brings_as_much_more():
    t = Tried(named(), np.array([[1.0]]), np.array([[2.0]]), np.array([3.0])).longer(4.0)
    assert (t.evidence, t.apart, t.missed) == (4.0, 8.0, 12.0)
