"""Numbers of the recommended recording, by hand: chances, lengths, rivals; what an experiment is
expected to bring."""

import math
from types import SimpleNamespace

import numpy as np
import pytest
from scipy.stats import norm

from model.errors import BadInput
from sandbox.gap.evidence.priors import Coordinate
from sandbox.gap.planning import next_recording as following
from sandbox.gap.planning.next_recording import Tried, power
from sandbox.recordings.campaign import Campaign
from tests.sandbox.gap.conftest import DRIVE
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
    assert (t.told, t.apart, t.missed) == (4.0, 8.0, 12.0)


def judged(*effects):
    return SimpleNamespace(effects=effects)


def test_expected_evidence_by_hand(monkeypatch):
    """What b cannot follow, 10, less what a itself cannot, 3; and b's spread 2 less a's 1; what is
    missed, 6, is told at the temperature of 2."""
    found = {"a": (3.0, 1.0), "b": (10.0, 2.0)}
    monkeypatch.setattr(following, "simulate_experiment", lambda *_: (None, None))
    monkeypatch.setattr(following, "_surprise", lambda c, t, j, *_: found[j.effects[0]])
    monkeypatch.setattr(following, "_missed", lambda *_: 6.0)
    whole, apart, missed = following.expected_evidence(None, None, judged("a"), [judged("b")], 2.0)
    assert (whole, apart, missed) == ([8.0], [7.0], 3.0)


def replayed(monkeypatch, n):
    """Equations n stand for a replay; returns the set it is asked at."""
    seen = {}
    monkeypatch.setattr(following, "prepare", lambda found, truth, steps: steps)
    monkeypatch.setattr(following, "as_predicted", lambda steps, truth: steps)
    monkeypatch.setattr(following, "Point", lambda steps, values: seen.update(values, steps=steps))
    monkeypatch.setattr(following, "normal", lambda point, own, workers=1: n)
    return seen


def test_what_a_simulator_misses_by_hand(monkeypatch):
    """Half of 0.012 of each of 1000 readings and 3e-4 of the 20000 that the effects of the truth
    make."""
    n = SimpleNamespace(
        segments=[SimpleNamespace(n=np.array([400.0, 600.0]))],
        summed=lambda: SimpleNamespace(rr=20000.0),
    )
    seen = replayed(monkeypatch, n)
    found = SimpleNamespace(drive=DRIVE)
    truth = {"dead_time.time": 1e-6, "magnet_flux.factor": 0.9}
    assert following._missed(found, truth, judged("dead_time")) == pytest.approx(0.5 * (12.0 + 6.0))
    assert seen["steps"] == 1
    assert seen["dead_time.time"] == 0.0
    assert seen["magnet_flux.factor"] == 0.9


def test_surprise_by_hand(monkeypatch):
    """At a temperature of 2: x is known by 8/2 of its fit and 1/0.5^2 of its prior, a turn by
    1/0.5^2; y, a share, is no belief.

    A = diag(2, 3), g = (2, 0), r'r = 10 after it: 1/2 (10 - 4/10) cannot be followed, and the
    spread is half of ln(10/8 x 7/4) less the shares 2/10 and 3/7."""
    x, y = (
        Coordinate("x", 0.0, 0.5, "linear", ("dead_time.time",)),
        Coordinate("y", 0.0, 0.0, "share", ("y.y",)),
    )
    turn = Coordinate("t", 0.0, 0.5, "turn", ("t.t",))
    n = SimpleNamespace(
        coordinates=(x, turn), summed=lambda: (np.diag([4.0, 6.0]), np.array([4.0, 0.0]), 20.0)
    )
    asked = []
    seen = replayed(monkeypatch, n)
    monkeypatch.setattr(
        following, "normal", lambda point, own, workers: asked.extend(c.label for c in own) or n
    )
    j = SimpleNamespace(
        fit=SimpleNamespace(point=SimpleNamespace(values={})),
        equations=SimpleNamespace(a=np.diag([8.0, 5.0, 1.0])),
        prior=SimpleNamespace(deviation=np.array([0.5, 0.0, 0.5])),
        normal=SimpleNamespace(coordinates=(x, y, turn)),
    )
    found, wide = following._surprise(None, {}, j, 2.0, 1)
    assert (asked, seen) == (["x"], {"steps": 1})
    assert found == pytest.approx(4.8)
    assert wide == pytest.approx(0.5 * (math.log(10.0 / 8.0 * 7.0 / 4.0) - 0.2 - 3.0 / 7.0))


@pytest.mark.parametrize(
    ("worst", "kept"), [(1.0, True), (math.inf, False), (math.nan, False), (BadInput("no"), False)]
)
def test_what_an_entry_brings_is_told_row_by_row(monkeypatch, worst, kept):
    """Row: the true one; 10 times it and the other; kept where all numbers are finite."""

    def brought(campaign, entry, a, others, temperature, workers):
        if isinstance(worst, BadInput):
            raise worst
        own = np.array([10.0 * a.effects[0] + j.effects[0] for j in others])
        return own * (worst if a.effects[0] == 2 else 1.0), -own, 5.0 + a.effects[0]

    monkeypatch.setattr(following, "expected_evidence", brought)
    found = following._tried(None, named(), [(0.3, judged(k)) for k in range(3)], 1.0, 1)
    assert (found is not None) == kept
    if kept:
        assert found.told.tolist() == [
            [math.inf, 1.0, 2.0],
            [10.0, math.inf, 12.0],
            [20.0, 21.0, math.inf],
        ]
        assert found.apart.tolist() == [[0.0, -1.0, -2.0], [-10.0, 0.0, -12.0], [-20.0, -21.0, 0.0]]
        assert found.missed.tolist() == [5.0, 6.0, 7.0]


@pytest.fixture
def recommending(monkeypatch):
    """Return a function that recommends for rivals where powers are told by (entry, seconds); a
    second usually takes 0.5 s; `asked` holds what was looked at."""
    asked = SimpleNamespace(menus=[], tried=[])

    def recommend(powers, rivals=2, missed=None):
        names = list(dict.fromkeys(name for name, _ in powers))

        def allowed(drive, limits, seconds=0.5):
            asked.menus.append(seconds)
            return [named(n, seconds) for n in names]

        def once(campaign, entry, own, temperature, workers):
            asked.tried.append((entry.name, len(own)))
            found = powers.get((entry.name, entry.seconds))
            away = (missed or {}).get(entry.name, 0.0)
            return (
                None
                if found is None
                else tried(found, 0.0, away, entry.name, entry.seconds, len(own))
            )

        def chance(own, x):
            assert len(own) == len(x.told)
            return float(x.told[0, 1])

        monkeypatch.setattr(following, "allowed", allowed)
        monkeypatch.setattr(following, "usual_seconds", lambda drive: 0.5)
        monkeypatch.setattr(following, "settings", lambda entry, drive: "")
        monkeypatch.setattr(following, "_tried", once)
        monkeypatch.setattr(following, "power", chance)
        campaign = Campaign("own", DRIVE, (), {}, {}, False)
        return following.recommend(
            campaign, [(1.0 / rivals, judged(str(k))) for k in range(rivals)], 1.0
        )

    return recommend, asked


@pytest.mark.parametrize(("chance", "menus"), [(0.96, [0.5]), (0.94, [0.5, 1.0, 2.0])])
def test_twice_and_four_times_as_long_is_tried_where_nothing_is_sure(recommending, chance, menus):
    """Powers are told here, so all lengths promise what the first has: 2 x and 4 x of it."""
    recommend, asked = recommending
    recommend({("x", 0.5): chance, ("x", 1.0): 0.6, ("x", 2.0): 0.6})
    assert asked.menus == menus


@pytest.mark.parametrize(
    ("chance", "menus"), [(0.24, [0.5, 2.0]), (0.26, [0.5, 1.0, 2.0]), (0.12, [0.5])]
)
def test_a_longer_recording_is_tried_where_it_promises_an_even_chance(recommending, chance, menus):
    recommend, asked = recommending
    recommend({("x", 0.5): chance})
    assert asked.menus == menus


def test_the_longest_that_is_sure_ends_it(recommending):
    found = recommending[0]({("x", 0.5): 0.6, ("x", 1.0): 0.96})
    assert found.seconds == 1.0
    assert recommending[1].menus == [0.5, 1.0]


def test_of_equal_chances_the_shorter_is_taken(recommending):
    assert recommending[0]({("x", 0.5): 0.8, ("x", 1.0): 0.8}).seconds == 0.5


@pytest.mark.parametrize(("count", "looked_at"), [(3, 3), (4, 4), (5, 4), (6, 4)])
def test_four_rivals_are_looked_at_on_three_entries(recommending, count, looked_at):
    """Five entries on the first two, the best three on all."""
    recommend, asked = recommending
    found = recommend(
        {(name, 0.5): 0.96 + 0.001 * k for k, name in enumerate("abcde")}, rivals=count
    )
    assert len(found.separates) == looked_at
    assert asked.tried == [(n, 2) for n in "abcde"] + [(n, looked_at) for n in "edc"]
