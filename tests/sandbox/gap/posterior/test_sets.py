"""Posterior over sets by algebra, against brute force: every set's evidence by dense Gaussian
integrals, every set of a small library enumerated, and truths drawn from the prior itself, on which
stated chances must hold."""

import itertools
import math
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from scipy.stats import multivariate_normal

from model.effects import library
from sandbox.gap.evidence.algebra import Algebra, Prior
from sandbox.gap.posterior.candidates import Candidate
from sandbox.gap.posterior.linear_model import LinearModel
from sandbox.gap.posterior.sets import SetPosterior, log_prior, possible
from sandbox.gap.settings import Settings

NAMES = [e for e in library.causes() if not possible([e, "saturation"]) or e == "saturation"]
FREE = [e for e in library.causes() if e not in ("saturation", "cross_saturation")]
TRACE = 0.02


def linear(slopes, residual, count, settings, low=-math.inf):
    """A linear model: two ordinary deviations of deviation 1, then `count` effects of one size
    each, wide 1."""
    p = 2 + count
    deviation = np.array([1.0, 1.0] + [TRACE] * count)
    wide = np.ones(p)
    infinite = np.full(p, math.inf)
    bound = np.array([-math.inf] * 2 + [low] * count)
    equations = Algebra(
        slopes.T @ slopes, slopes.T @ residual, float(residual @ residual), np.zeros(p)
    )
    coordinates = tuple(SimpleNamespace(form="linear") for _ in range(p))
    return LinearModel(
        None,
        SimpleNamespace(coordinates=coordinates),
        equations,
        Prior(np.zeros(p), deviation, -infinite, infinite),
        Prior(np.zeros(p), wide, bound, infinite),
        tuple(Candidate(e) for e in FREE[:count]),
        tuple((2 + k,) for k in range(count)),
        np.array([False, False] + [True] * count),
        settings,
    )


def brute(slopes, residual, chosen, sizes):
    """Log evidence of a set: log of the mean over all sizes of N(residual; 0, 1 + J P J')."""
    told = []
    for own in itertools.product(sizes, repeat=len(chosen)):
        deviation = np.array([1.0, 1.0] + [TRACE] * (slopes.shape[1] - 2))
        for k, s in zip(chosen, own, strict=True):
            deviation[2 + k] = math.hypot(TRACE, s)
        covariance = np.eye(len(residual)) + (slopes * deviation**2) @ slopes.T
        told.append(multivariate_normal(np.zeros(len(residual)), covariance).logpdf(residual))
    return float(np.logaddexp.reduce(told) - math.log(len(told)))


@pytest.fixture(scope="module")
def problem():
    """Sixty readings, five effects, two of which are alike (cosine 0.98)."""
    rng = np.random.default_rng(5)
    slopes = 3.0 * rng.standard_normal((60, 7))
    slopes[:, 6] = 0.98 * slopes[:, 5] + 0.2 * slopes[:, 6]
    truth = np.array([0.5, -1.0, 0.0, 0.8, 0.0, 0.6, 0.0])
    return slopes, slopes @ truth + rng.standard_normal(60)


def test_equations_that_rounding_leaves_indefinite_still_weigh_sets(problem):
    """Where the prior's one is lost beside large numbers, a direction may come out as told less
    than by the prior alone: it counts as not told, and the covariance stays the prior's there."""
    slopes, residual = problem
    model = linear(slopes, residual, 5, Settings(sizes=(1.0,)))
    a = np.array(model.equations.a)
    a[0] = a[:, 0] = 0.0
    a[0, 0] = -1.5  # beside a prior deviation of 1
    sets = SetPosterior(replace(model, equations=replace(model.equations, a=a)))
    assert sets.c[0, 0] == pytest.approx(1.0)
    assert math.isfinite(sets.weigh((0, 1)))


def test_evidence_of_every_set_is_that_of_dense_integrals(problem):
    """One size: exact.  The determinant lemma and a 60 x 60 Gaussian agree to rounding."""
    slopes, residual = problem
    sets = SetPosterior(linear(slopes, residual, 5, Settings(sizes=(1.0,))))
    for n in range(6):
        for chosen in itertools.combinations(range(5), n):
            told = sets.weigh(chosen) - sets.weigh(())
            names = sets.names(chosen)
            wanted = brute(slopes, residual, chosen, (1.0,)) - brute(slopes, residual, (), (1.0,))
            assert told == pytest.approx(wanted + log_prior(names) - log_prior(()), abs=1e-7)


def test_sizes_are_averaged_over(problem):
    """Of one effect the mean over sizes is exact; of several, one at a time: within the log of what
    the others' best size can differ by, 0.2 here."""
    slopes, residual = problem
    sizes = (2.0, 0.5, 0.125)
    sets = SetPosterior(linear(slopes, residual, 5, Settings(sizes=sizes)))
    none = brute(slopes, residual, (), sizes)
    for chosen, within in (((1,), 1e-7), ((3,), 1e-7), ((1, 3), 0.2), ((1, 3, 4), 0.4)):
        told = sets.weigh(chosen) - sets.weigh(()) - log_prior(sets.names(chosen)) + log_prior(())
        assert told == pytest.approx(brute(slopes, residual, chosen, sizes) - none, abs=within)


def test_enumeration_finds_what_brute_force_does(problem):
    slopes, residual = problem
    sets = SetPosterior(linear(slopes, residual, 5, Settings()))
    found = dict(sets.enumerate())
    every = {c: sets.weigh(c) for n in range(6) for c in itertools.combinations(range(5), n)}
    total = np.logaddexp.reduce(list(every.values()))
    missing = [v for k, v in every.items() if k not in found]
    assert sets.best() == max(every, key=every.get) == (1, 3)
    assert not missing or np.exp(np.logaddexp.reduce(missing) - total) < 1e-4


def test_a_size_with_a_sign_is_half_a_gaussian(problem):
    """The same integral by quadrature over a size that is only positive; it points to -0.3."""
    slopes, residual = problem
    residual = residual - slopes[:, 3] * 1.1
    own = SetPosterior(linear(slopes, residual, 5, Settings(sizes=(1.0,)), low=0.0))
    told = own.weigh((1,)) - own.weigh(()) - log_prior(own.names((1,))) + log_prior(())
    deviation = np.array([1.0, 1.0, TRACE, 0.0, TRACE, TRACE, TRACE])
    covariance = np.eye(60) + (slopes * deviation**2) @ slopes.T
    step = np.linspace(0.0, 5.0, 20001)
    density = multivariate_normal(np.zeros(60), covariance)
    inverse = np.linalg.inv(covariance)
    j = slopes[:, 3]
    log = -0.5 * (step**2 * (j @ inverse @ j) - 2.0 * step * (j @ inverse @ residual))
    wide = math.hypot(TRACE, 1.0)
    half = log - 0.5 * (step / wide) ** 2 + math.log(2.0 / (wide * math.sqrt(math.tau)))
    exact = (
        density.logpdf(residual)
        + np.log(np.trapezoid(np.exp(half - half.max()), step))
        + half.max()
    )
    assert told == pytest.approx(exact - brute(slopes, residual, (), (1.0,)), abs=1e-3)


def test_chances_hold_on_truths_drawn_from_the_prior():
    """400 truths drawn from the model's own prior (number, effects, sizes, traces, ordinary
    deviations): of stated chances of single effects the mean error is within three binomial
    standard deviations, in each fifth."""
    rng = np.random.default_rng(2)
    settings, stated, true = Settings(more=0.3), [], []
    for _ in range(400):
        slopes = 2.0 * rng.standard_normal((40, 8))
        slopes[:, 7] = 0.95 * slopes[:, 6] + 0.3 * slopes[:, 7]
        chance = np.array(
            [math.exp(log_prior(FREE[:n], settings)) * math.comb(6, n) for n in range(7)]
        )
        n = rng.choice(7, p=chance / chance.sum())
        chosen = rng.choice(6, size=n, replace=False)
        x = np.concatenate([rng.standard_normal(2), TRACE * rng.standard_normal(6)])
        for k in chosen:
            x[2 + k] += rng.choice(settings.sizes) * rng.standard_normal()
        sets = SetPosterior(linear(slopes, slopes @ x + rng.standard_normal(40), 6, settings))
        sets.enumerate()
        known = np.array(list(sets.known.values()))
        weight = np.exp(known - np.logaddexp.reduce(known))
        for k in range(6):
            stated.append(sum(w for s, w in zip(sets.known, weight, strict=True) if k in s))
            true.append(k in chosen)
    stated, true = np.array(stated), np.array(true)
    for low in (0.0, 0.2, 0.4, 0.6, 0.8):
        own = (stated >= low) & (stated <= low + 0.2)
        if own.sum() >= 20:
            p = stated[own].mean()
            assert true[own].mean() == pytest.approx(
                p, abs=3.0 * math.sqrt(p * (1.0 - p) / own.sum()) + 0.01
            )


def test_a_doubled_candidate_changes_no_chance(problem):
    """Two candidates of one effect with the same column share its prior: the chance of the effect
    stays."""
    slopes, residual = problem
    one = SetPosterior(linear(slopes, residual, 5, Settings()))
    both = linear(np.column_stack([slopes, slopes[:, 3]]), residual, 6, Settings())
    alike = np.isin(np.arange(8), [3, 7])
    doubled = SetPosterior(
        LinearModel(
            both.point,
            both.normal,
            both.equations,
            both.narrow.with_deviation(
                np.where(alike, TRACE / math.sqrt(2.0), both.narrow.deviation)
            ),
            both.wide,
            (*both.candidates[:5], Candidate(FREE[1], {"x": 1.0})),
            both.places,
            both.of_effects,
            Settings(),
        )
    )
    chances = []
    for sets in (one, doubled):
        sets.enumerate()
        told = sets.by_name()
        total = np.logaddexp.reduce(list(told.values()))
        chances.append(
            {e: sum(math.exp(v - total) for k, v in told.items() if e in k) for e in FREE[:5]}
        )
    for e in FREE[:5]:
        assert chances[0][e] == pytest.approx(chances[1][e], abs=0.01)
