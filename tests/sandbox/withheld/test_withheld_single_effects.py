"""The sum of single effects against brute-force evidence, and on columns that cannot be told apart."""

import itertools

import numpy as np
import pytest

from sandbox.withheld.baselines.single_effects import ONE, Equations, likely_sets, single, summed


def problem(x, y, variance):
    """Equations of single columns in noise of variance 1."""
    return Equations(x.T @ x, x.T @ y, float(y @ y), float(len(y)), variance, [[k] for k in range(x.shape[1])])


def log_marginal(x, y, variance):
    """log N(y; 0, 1 + x V x') by the covariance itself, not by normal equations."""
    s = np.eye(len(y)) + (x * variance) @ x.T
    return float(-0.5 * (np.linalg.slogdet(s)[1] + y @ np.linalg.solve(s, y)))


def test_chances_of_one_effect_are_those_of_marginal_likelihoods():
    rng = np.random.default_rng(1)
    x, y, v = rng.standard_normal((40, 5)), rng.standard_normal(40), np.array([1.0, 0.5, 2.0, 1.0, 0.1])
    told = [log_marginal(x[:, [k]], y, v[[k]]) + np.log(ONE / 5) for k in range(5)]
    told.append(log_marginal(x[:, :0], y, v[:0]) + np.log(1 - ONE))
    chances, _ = single(problem(x, y, v), x.T @ y, 1.0)
    assert chances == pytest.approx(np.exp(told) / np.sum(np.exp(told)), rel=1e-9)


def test_effects_that_are_orthogonal_are_found_as_by_enumeration():
    """On orthogonal columns the evidence of all 2^4 sets is known; its most probable set is that of the sum."""
    rng = np.random.default_rng(2)
    x = np.linalg.qr(rng.standard_normal((60, 4)))[0] * 10.0
    y = x @ np.array([1.0, 0.0, -0.7, 0.0]) + rng.standard_normal(60)
    v = np.ones(4)
    sets = [s for n in range(5) for s in itertools.combinations(range(4), n)]
    best = max(sets, key=lambda s: log_marginal(x[:, list(s)], y, v[list(s)]) + len(s) * np.log(ONE / 4 / (1 - ONE)))
    found = summed(problem(x, y, v))
    first, p = likely_sets(found.chances, ["a", "b", "c", "d"])[0]
    assert first == tuple("abcd"[k] for k in best)
    assert first == ("a", "c")
    assert p > 0.5


def test_columns_that_are_alike_share_their_chance():
    rng = np.random.default_rng(3)
    a = rng.standard_normal(50)
    x = np.column_stack([a, a, rng.standard_normal(50)])
    found = summed(problem(x, 3.0 * a + rng.standard_normal(50), np.ones(3)), most=1)
    assert found.chances[0] == pytest.approx([0.5, 0.5, 0.0, 0.0], abs=1e-6)


def test_two_candidates_of_one_effect_are_one_name():
    sets = likely_sets(np.array([[0.5, 0.3, 0.2], [0.0, 0.1, 0.9]]), ["delay", "delay"])
    assert [s for s, _ in sets] == [("delay",), ()]
    assert [p for _, p in sets] == pytest.approx([0.82, 0.18])
