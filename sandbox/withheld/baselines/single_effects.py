"""A sparse linear method: the sum of single effects on the slopes at the ordinary fit, nothing
fitted anew.

r = J b + e with b = b_1 + ... + b_L, each b_l on one candidate alone (Wang, Sarkar, Carbonetto,
Stephens, J. R. Stat. Soc. B 82 (2020) 1273): candidate k has chance pi_k, b_l ~ N(0, V_k) of all
its columns together.  One at a time is weighed against what the others leave,

    log BF_k = 1/2 g_k' (A_kk + V_k^-1)^-1 g_k - 1/2 log det(1 + V_k A_kk),   alpha_k ~ pi_k BF_k,

until the mean effects stand still.  None of the candidates has log BF 0 and what chance is left.
Ordinary deviations are integrated out first, the noise's variance is what the sum leaves.

Slopes are what limits it: a large effect bends the ordinary fit, at which they are taken (at the
nominal model it was worse: ordinary deviations alone then made it name three effects).
"""

from __future__ import annotations

import math
import time
from collections.abc import Collection, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from scipy.special import softmax

from model.array_types import Array
from sandbox.gap.evidence.algebra import algebra, prior_of
from sandbox.gap.evidence.normal import NormalEquations, counted, normal
from sandbox.gap.evidence.priors import Coordinate
from sandbox.gap.posterior.candidates import candidates
from sandbox.recordings.campaign import read_folder
from sandbox.withheld.baselines import refit as fit
from sandbox.withheld.baselines.answer import Answer, answer
from sandbox.withheld.baselines.screening import columns

SUM = 10  # single effects at most: as many as the largest sets that are drawn
ROUNDS = 100
STILL = 1e-4  # change of a chance that ends them
ONE = 0.5  # chance that a single effect of the sum is any candidate
NEGLIGIBLE = 1e-6  # chance of a set that is not listed


class Equations(NamedTuple):
    """Normal equations of all candidates' columns, in the noise's standard deviations: A (q, q), g
    (q,), r'r and the number of readings; variances (q,) of the prior; columns of each candidate."""

    a: Array
    g: Array
    ssr: float
    n: float
    variance: Array
    of: Sequence[Sequence[int]]


def by_single_effects(folder: Path, exclude: tuple[str, ...] = ()) -> Answer:
    """Answer by a sum of single effects at the fit of ordinary deviations."""
    started, campaign, spent = time.perf_counter(), read_folder(folder), list[float]()
    with counted(spent.append):
        null, raw = fit.nuisances(campaign)
        usual = fit.usual(campaign)
        probes = columns(null.point, usual, candidates(null.point, exclude, left=0.0))
        n = normal(null.point, probes.every).bare()
    found = summed(
        equations(n, {c.label for c in usual}, [list(more.values()) for _, more in probes.own])
    )
    ranked: list[tuple[tuple[str, ...], float, dict[str, Any]]]
    ranked = [
        (s, p, {}) for s, p in likely_sets(found.chances, [probe.effect for probe, _ in probes.own])
    ]
    after = min(null.rms, math.sqrt(max(0.0, found.ssr / fit.readings(n))))
    return answer(campaign, ranked, (raw, null.rms, after), started, round(sum(spent)))


def equations(
    n: NormalEquations, usual: Collection[str], own: Sequence[Sequence[Coordinate]]
) -> Equations:
    """Return the equations of candidates' columns, ordinary deviations (labels) and turns
    integrated out.

    A column may be an ordinary deviation, too: that stays, and the candidate comes on top of it.
    """
    place, whole, prior = (
        {c.label: k for k, c in enumerate(n.coordinates)},
        algebra(n),
        prior_of(n.coordinates),
    )
    wide = {place[c.label]: c.deviation for more in own for c in more}
    asked = sorted(wide)
    rest = [
        k
        for k, c in enumerate(n.coordinates)
        if (c.label in usual or c.of_point) and c.deviation > 0.0
    ]
    held = prior.deviation[rest] ** -2.0
    pull = whole.g[rest] + held * (prior.mean - n.x)[rest]
    across = whole.a[np.ix_(rest, asked)]
    solved = np.linalg.solve(
        whole.a[np.ix_(rest, rest)] + np.diag(held), np.column_stack([across, pull])
    )
    at = {k: j for j, k in enumerate(asked)}
    return Equations(
        whole.a[np.ix_(asked, asked)] - across.T @ solved[:, :-1],
        whole.g[asked] - across.T @ solved[:, -1],
        whole.ssr - float(pull @ solved[:, -1]),
        fit.readings(n),
        np.array([wide[k] ** 2 for k in asked]),
        [[at[place[c.label]] for c in more] for more in own],
    )


class Summed(NamedTuple):
    """Chances (L, k + 1) of each single effect, the last that it is none; r'r that their mean
    leaves."""

    chances: Array
    ssr: float


def summed(e: Equations, most: int = SUM) -> Summed:
    """Return the posterior of a sum of single effects."""
    chances, mean = np.zeros((most, len(e.of) + 1)), np.zeros((most, len(e.g)))
    noise, ssr = max(1.0, e.ssr / e.n), e.ssr
    for _ in range(ROUNDS):
        before = chances.copy()
        for k in range(most):
            chances[k], mean[k] = single(e, e.g - e.a @ (mean.sum(0) - mean[k]), noise)
        b = mean.sum(0)
        ssr = float(e.ssr - 2.0 * b @ e.g + b @ e.a @ b)
        noise = max(1.0, ssr / e.n)
        if np.max(np.abs(chances - before)) < STILL:
            break
    return Summed(chances, ssr)


def single(e: Equations, g: Array, noise: float) -> tuple[Array, Array]:
    """Return the chances (k + 1,) of one effect against what the others leave, and its mean columns
    (q,)."""
    factors, size = np.zeros(len(e.of) + 1), np.zeros((len(e.of), len(e.g)))
    for j, own in enumerate(map(list, e.of)):
        a, v, left = e.a[np.ix_(own, own)] / noise, e.variance[own], g[own] / noise
        size[j, own] = np.linalg.solve(a + np.diag(1.0 / v), left)
        _, stiff = np.linalg.slogdet(np.eye(len(own)) + v[:, None] * a)
        factors[j] = 0.5 * float(left @ size[j, own] - stiff)
    factors[:-1] += math.log(ONE / len(e.of))
    factors[-1] = math.log1p(-ONE)
    chances = softmax(factors)
    return chances, chances[:-1] @ size


def likely_sets(chances: Array, effects: Sequence[str]) -> list[tuple[tuple[str, ...], float]]:
    """Return sets of effects with their chances, the most probable first: single effects are
    independent; chances: a row for each single effect, of the effects and of none of them."""
    sets: dict[frozenset[str], float] = {frozenset(): 1.0}
    for own in chances:
        each: dict[str | None, float] = {None: float(own[-1])}
        for name, p in zip(effects, own[:-1], strict=True):
            each[name] = each.get(name, 0.0) + float(p)
        new: dict[frozenset[str], float] = {}
        for s, p in sets.items():
            for more, q in each.items():
                if p * q > NEGLIGIBLE:
                    key = s if more is None else s | {more}
                    new[key] = new.get(key, 0.0) + p * q
        sets = new
    return sorted(((tuple(sorted(s)), p) for s, p in sets.items()), key=lambda x: (-x[1], x[0]))
