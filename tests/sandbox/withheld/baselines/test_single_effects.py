"""The sum of single effects against brute-force evidence, and on columns that cannot be told
apart."""

import itertools

import numpy as np
import pytest

from sandbox.gap.evidence.normal import NormalEquations
from sandbox.gap.evidence.priors import Coordinate
from sandbox.replay.segments import Segment
from sandbox.withheld.baselines.single_effects import (
    ONE,
    Equations,
    equations,
    likely_sets,
    single,
    summed,
)


def problem(x, y, variance):
    """Equations of single columns in noise of variance 1."""
    return Equations(
        x.T @ x, x.T @ y, float(y @ y), float(len(y)), variance, [[k] for k in range(x.shape[1])]
    )


def log_marginal(x, y, variance):
    """log N(y; 0, 1 + x V x') by the covariance itself, not by normal equations."""
    s = np.eye(len(y)) + (x * variance) @ x.T
    return float(-0.5 * (np.linalg.slogdet(s)[1] + y @ np.linalg.solve(s, y)))


def test_chances_of_one_effect_are_those_of_marginal_likelihoods():
    rng = np.random.default_rng(1)
    x, y, v = (
        rng.standard_normal((40, 5)),
        rng.standard_normal(40),
        np.array([1.0, 0.5, 2.0, 1.0, 0.1]),
    )
    found = [log_marginal(x[:, [k]], y, v[[k]]) + np.log(ONE / 5) for k in range(5)]
    found.append(log_marginal(x[:, :0], y, v[:0]) + np.log(1 - ONE))
    chances, _ = single(problem(x, y, v), x.T @ y, 1.0)
    assert chances == pytest.approx(np.exp(found) / np.sum(np.exp(found)), rel=1e-9)


def test_ordinary_deviations_are_integrated_out():
    """Two ordinary deviations, the second of them a candidate, too, at a point x beside their
    means, and one candidate of its own: the odds of the candidates are those of y + J x in the
    covariance of all that may
    move."""
    rng = np.random.default_rng(4)
    j, y, x = rng.standard_normal((50, 3)), rng.standard_normal(50), np.array([0.3, -0.2, 0.0])
    y = y + 0.8 * j[:, 1]
    sizes = [0.4, 0.5, 1.0]
    found = [
        Coordinate(c, 0.1 if c == "a" else 0.0, s, "linear", (c,))
        for c, s in zip("abc", sizes, strict=True)
    ]
    segment = Segment(
        0,
        "current",
        np.arange(3),
        (j.T @ j)[None],
        (j.T @ y)[None],
        np.array([y @ y]),
        np.array([50.0]),
    )
    n = NormalEquations(tuple(found), x, (segment,), 0.0)
    wide = Coordinate("b", 0.0, 2.0, "linear", ("b",))
    e = equations(n, {"a", "b"}, [[wide], [found[2]]])
    at_means = y + j[:, :2] @ (x[:2] - np.array([0.1, 0.0]))
    own, v = j[:, :2], np.array([0.16, 0.25])
    log = [
        log_marginal(np.column_stack([own, more]), at_means, np.append(v, s))
        for more, s in ((j[:, 1], 4.0), (j[:, 2], 1.0))
    ]
    log = [x + np.log(ONE / 2) for x in log] + [log_marginal(own, at_means, v) + np.log(1 - ONE)]
    chances, _ = single(e, e.g, 1.0)
    assert chances == pytest.approx(np.exp(log) / np.sum(np.exp(log)), rel=1e-9)


def test_effects_that_are_orthogonal_are_found_as_by_enumeration():
    """On orthogonal columns the evidence of all 2^4 sets is known; its most probable set is that of
    the sum."""
    rng = np.random.default_rng(2)
    x = np.linalg.qr(rng.standard_normal((60, 4)))[0] * 10.0
    y = x @ np.array([1.0, 0.0, -0.7, 0.0]) + rng.standard_normal(60)
    v = np.ones(4)
    sets = [s for n in range(5) for s in itertools.combinations(range(4), n)]
    best = max(
        sets,
        key=lambda s: (
            log_marginal(x[:, list(s)], y, v[list(s)]) + len(s) * np.log(ONE / 4 / (1 - ONE))
        ),
    )
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
