"""Stepwise selection on a table of criteria; the Gaussian process against closed forms."""

import math

import numpy as np
import pytest
from scipy.stats import multivariate_normal

from sandbox.gap.evidence.algebra import Algebra, Prior
from sandbox.withheld.baselines import discrepancy_process as gp
from sandbox.withheld.baselines.stepwise import Search, ranked, searched

TABLE = {
    "": 100.0,
    "a": 50.0,
    "b": 60.0,
    "c": 70.0,
    "ab": 40.0,
    "ac": 45.0,
    "bc": 20.0,
    "abc": 30.0,
}


def test_effects_join_and_leave_until_the_criterion_does_not_fall(on_a_table):
    """a, b and c join (50, 40, 30), then a leaves (20): the best pair, which no way up comes
    through.  What promises less than is reached (b and c alone) is not fitted on the way up, and
    nothing is fitted twice."""
    search, (none, fitted) = Search((), lambda: False), on_a_table(TABLE)
    best = searched(search, none)
    assert best.effects == ("b", "c")
    found = ["".join(sorted(effects)) for effects in fitted]
    assert found[:3] == ["a", "ab", "abc"]
    assert sorted(found) == sorted({*TABLE} - {""})
    weights = {"".join(e): w for e, w, _ in ranked(search.seen.values())}
    assert weights["abc"] / weights["bc"] == pytest.approx(math.exp(-5.0), rel=1e-12)
    assert next(iter(weights)) == "bc"


def test_excluded_effects_do_not_join_and_a_spent_walk_stops(on_a_table):
    none, fitted = on_a_table(TABLE)
    assert searched(Search(("a",), lambda: False), none).effects == ("b", "c")
    assert not any("a" in effects for effects in fitted)
    assert searched(Search((), lambda: True), none).effects == ()


def test_a_discrepancy_is_integrated_out_exactly():
    """Evidence of 60 readings of two components against the density of their joint Gaussian, whose
    covariance is J S J' + s^2 phi phi' (each component its own) + 1; equal but for rounding (1e-9
    of some hundred)."""
    rng, drawn = np.random.default_rng(1), gp.frequencies(2)[:5]
    scales = gp.Scales(0.8, 2.5, 0.5, 0.7, 0.9)
    mean, deviation, x = (
        np.array([0.3, -1.0, 0.0]),
        np.array([0.5, 2.0, 0.1]),
        np.array([0.1, 0.2, -0.3]),
    )
    parts = [
        gp.Component(
            "d",
            np.array([0, 2]),
            rng.normal(size=(40, 2)),
            rng.normal(size=40),
            rng.normal(size=(40, 5)),
        ),
        gp.Component(
            "motion",
            np.array([0, 1, 2]),
            rng.normal(size=(20, 3)),
            rng.normal(size=20),
            rng.normal(size=(20, 5)),
        ),
    ]
    plain = Algebra(*gp.equations(parts, 3), x)
    found, more = gp.marginal(plain, gp.grams_of(parts, 3, scales, drawn), scales)
    free = np.full(3, np.inf)
    got = found.log_evidence(Prior(mean, deviation, -free, free)) + more
    j, covariance, at = np.zeros((60, 3)), np.eye(60), 0
    for part, s in zip(parts, (0.8, 2.5), strict=True):
        own = slice(at, at + len(part.y))
        j[own, part.places] = part.j
        phi = gp.features(part.z, scales, drawn)
        covariance[own, own] += s**2 * phi @ phi.T
        at = own.stop
    covariance += j @ np.diag(deviation**2) @ j.T
    y = np.concatenate([p.y for p in parts])
    wanted = multivariate_normal.logpdf(y, j @ (mean - x), covariance) + 30.0 * math.log(
        2.0 * math.pi
    )
    assert got == pytest.approx(wanted, abs=1e-9 * abs(wanted) + 1e-9)


def test_features_are_a_squared_exponential_in_the_mean():
    """Over many frequencies: cos(w d) has variance (1 - exp(-d^2))^2 / 2, so its mean is known to 4
    sd of that."""
    drawn = np.random.default_rng(3).standard_normal((200_000, 5))
    scales = gp.Scales(1.0, 1.0, 0.5, 0.7, 0.9)
    z = np.array([[0.0, 0.0, 0.0, 1.0, 0.0], [0.2, -0.1, 0.3, math.cos(0.4), math.sin(0.4)]])
    d2 = (0.2**2 + 0.1**2) / 0.5**2 + 0.3**2 / 0.7**2 + (2.0 * math.sin(0.2)) ** 2 / 0.9**2
    phi = gp.features(z, scales, drawn)
    spread = (1.0 - math.exp(-d2)) / math.sqrt(2.0 * len(drawn))
    assert phi[0] @ phi[1] == pytest.approx(math.exp(-0.5 * d2), abs=4.0 * spread)
    assert phi[0] @ phi[0] == pytest.approx(1.0, rel=1e-12)


def test_scales_that_made_readings_are_learnt():
    """Readings drawn with an amplitude of 3 floors over known lengths: the amplitude is found to 40
    % (it rests on some ten independent stretches: 1/sqrt(2 10) = 0.22, two of them), and none where
    there is none."""
    rng, drawn = np.random.default_rng(5), gp.frequencies()
    z = np.column_stack([rng.uniform(-1.0, 1.0, (600, 3)), np.ones(600), np.zeros(600)])
    true = gp.Scales(3.0, 1.0, 0.7, 0.7, 1.0)
    weights = rng.normal(size=2 * len(drawn))
    prior = Prior(np.zeros(1), np.ones(1), np.array([-np.inf]), np.array([np.inf]))
    for amplitude in (3.0, 0.0):
        y = amplitude * gp.features(z, true, drawn) @ weights + rng.normal(size=600)
        parts = [gp.Component("d", np.array([0]), rng.normal(size=(600, 1)), y, z)]
        found = gp.learnt(parts, np.zeros(1), prior, drawn, gp.Scales(1.0, 1.0, 0.5, 0.5, 0.7), 60)
        if amplitude:
            assert found.currents == pytest.approx(3.0, rel=0.44)
        else:
            assert found.currents < 0.3
