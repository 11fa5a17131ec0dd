"""Evidence by algebra: what a hypothesis reaches from one point's normal equations, and how far
they can be trusted.

Priors are Gaussian, cut off at a parameter's bounds: where the most probable value would lie
beyond, it is held there.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import cho_factor, cho_solve, solve_triangular
from scipy.optimize import lsq_linear
from scipy.special import erfcx, log_ndtr, ndtri_exp

from model.array_types import Array
from sandbox.gap.evidence.normal import NormalEquations, Segment
from sandbox.gap.evidence.priors import Coordinate

EXCHANGES = 20  # of values between free and held: a handful is usual


@dataclass(frozen=True)
class Prior:
    """Means, deviations (0: held at the mean) and bounds, each (p,)."""

    mean: Array
    deviation: Array
    low: Array
    high: Array

    def with_deviation(self, deviation: Array) -> Prior:
        """Return the same with other deviations."""
        return Prior(self.mean, deviation, self.low, self.high)


def prior_of(coordinates: Sequence[Coordinate]) -> Prior:
    """Return the priors that coordinates carry."""
    bounds = [c.bounds() for c in coordinates]
    return Prior(
        np.array([c.mean for c in coordinates]),
        np.array([c.deviation for c in coordinates]),
        np.array([b[0] for b in bounds]),
        np.array([b[1] for b in bounds]),
    )


class MostProbable(NamedTuple):
    """The most probable values (p,), which of them are free (inside their bounds), and the
    objective there."""

    x: Array
    free: NDArray[np.bool_]
    objective: float


@dataclass(frozen=True)
class Algebra:
    """Normal equations of all coordinates: A (p, p), g (p,), r'r at the values x (p,)."""

    a: Array
    g: Array
    ssr: float
    x: Array

    def damped(self, share: float) -> Algebra:
        """Return the same with steps from x held back: that share of A's diagonal on top (Marquardt
        1963)."""
        return Algebra(self.a + share * np.diag(np.diag(self.a)), self.g, self.ssr, self.x)

    def scaled(self, noise: float) -> Algebra:
        """Return the same for a noise variance so many times larger."""
        return Algebra(self.a / noise, self.g / noise, self.ssr / noise, self.x)

    def most_probable(self, prior: Prior) -> MostProbable:
        """Return the most probable values under a prior.

        Least squares within bounds, in prior deviations.  Where a prediction overflowed, or comes
        so near it that rounding leaves no positive curvature, nothing is probable: the objective is
        infinite.
        """
        movable = prior.deviation > 0.0
        if not (
            np.isfinite(self.a).all() and np.isfinite(self.g).all() and math.isfinite(self.ssr)
        ):
            return MostProbable(self.x, movable, math.inf)
        size = prior.deviation[movable]
        x = np.clip(prior.mean, prior.low, prior.high)
        start = x[movable]
        hessian = size[:, None] * self.a[np.ix_(movable, movable)] * size + np.eye(len(size))
        pull = (
            size * (self.g + self.a @ (self.x - x))[movable] + (prior.mean[movable] - start) / size
        )
        low, high = (prior.low[movable] - start) / size, (prior.high[movable] - start) / size
        try:
            step, inside = within_bounds(hessian, pull, low, high)
        except np.linalg.LinAlgError:
            return MostProbable(self.x, movable, math.inf)
        free = movable.copy()
        free[movable] = inside
        x[movable] = start + size * step
        return MostProbable(x, free, self.objective(x, prior))

    def objective(self, x: Array, prior: Prior) -> float:
        """Return r'r predicted at x (p,) and the squared deviations from the prior's means
        together."""
        shift, free = x - self.x, prior.deviation > 0.0
        away = (x - prior.mean)[free] / prior.deviation[free]
        return float(self.ssr - 2.0 * shift @ self.g + shift @ self.a @ shift + np.sum(away**2))

    def log_evidence(self, prior: Prior) -> float:
        """Return the log evidence (Laplace) under a prior.

        A size that can only be positive has half a Gaussian as its prior: where the most probable
        value lies at the bound the posterior is its tail, where it is free the part beyond the
        bound is missing.  The same tail where any other value is held at a bound.  The free values
        follow each held one along its tail; of several held ones each has its own.
        """
        x, free, objective = self.most_probable(prior)
        if not math.isfinite(objective):
            return -math.inf
        moves = prior.deviation > 0.0
        halved = moves & ((prior.low == prior.mean) | (prior.high == prior.mean))
        inner, outer = halved & free, moves & ~free
        sd = prior.deviation[free]
        factor = cho_factor(
            sd[:, None] * self.a[np.ix_(free, free)] * sd + np.eye(len(sd)), check_finite=False
        )
        out = -0.5 * objective - np.sum(np.log(np.diag(factor[0])))
        if inner.any():
            spread = sd * np.sqrt(np.diag(cho_solve(factor, np.eye(len(sd)), check_finite=False)))
            out += np.sum(
                np.log(2.0) + log_ndtr(np.abs(x - prior.mean)[inner] / spread[inner[free]])
            )
        if outer.any():
            slope, curve = self._pushed(x, free, np.flatnonzero(outer), prior)
            # a whole Gaussian has half its weight on either side
            half = np.where(halved[outer], 1.0, 0.5)
            out += np.sum(
                np.log(
                    half
                    * erfcx(slope / np.sqrt(2.0 * curve))
                    / (prior.deviation[outer] * np.sqrt(curve))
                )
            )
        return float(out)

    def _pushed(
        self, x: Array, free: NDArray[np.bool_], held: NDArray[np.int64], prior: Prior
    ) -> tuple[Array, Array]:
        """Return how hard values held at bounds are pushed there (h,), and the curvature that each
        sees (h,) while the free ones follow and the other held ones stay."""
        sd, own = prior.deviation[held], prior.deviation[free]
        slope = np.abs((self.g - self.a @ (x - self.x))[held] - (x - prior.mean)[held] * sd**-2)
        across = own[:, None] * self.a[np.ix_(free, held)]
        scaled = own[:, None] * self.a[np.ix_(free, free)] * own + np.eye(len(own))
        follows = cho_solve(cho_factor(scaled, check_finite=False), across, check_finite=False)
        return slope, np.diag(self.a)[held] + sd**-2 - np.sum(across * follows, axis=0)

    def covariance(self, prior: Prior) -> Array:
        """Return the covariance (p, p) of all coordinates under a prior; zero where held."""
        _, free, _ = self.most_probable(prior)
        out = np.zeros_like(self.a)
        own = np.ix_(free, free)
        out[own] = np.linalg.inv(self.a[own] + np.diag(prior.deviation[free] ** -2))
        return out

    def tails(self, prior: Prior, share: float = 0.05) -> Array:
        """Return how far (p,) from its bound a value that is held there may lie: all but `share` of
        its posterior.

        The posterior is the tail of a Gaussian whose slope at the bound pushes outwards, the others
        following; zero where free.
        """
        x, free, _ = self.most_probable(prior)
        out, held = np.zeros_like(x), np.flatnonzero((prior.deviation > 0.0) & ~free)
        slope, curve = self._pushed(x, free, held, prior)
        beyond = slope / np.sqrt(curve)
        out[held] = (-ndtri_exp(math.log(share) + log_ndtr(-beyond)) - beyond) / np.sqrt(curve)
        return out


def within_bounds(
    hessian: Array, pull: Array, low: Array, high: Array
) -> tuple[Array, NDArray[np.bool_]]:
    """Return the x (p,) in [low, high] with the least x'Hx/2 - pull'x, and which of its values are
    free.

    Values beyond a bound are held there and those freed that would leave theirs inwards, all at
    once, until none is left (Hintermueller, Ito, Kunisch, SIAM J. Optim. 13 (2002) 865); should
    that go round in circles, one at a time (Stark, Parker, Comput. Stat. 10 (1995) 129).
    """
    below = above = np.zeros(len(pull), dtype=bool)
    for _ in range(EXCHANGES):
        free = ~(below | above)
        x = np.where(below, low, np.where(above, high, 0.0))
        if free.any():
            rest = pull[free] - hessian[np.ix_(free, ~free)] @ x[~free]
            x[free] = cho_solve(
                cho_factor(hessian[np.ix_(free, free)], check_finite=False),
                rest,
                check_finite=False,
            )
        outwards = pull - hessian @ x
        under, over = (
            (x < low) | (below & (outwards <= 0.0)),
            (x > high) | (above & (outwards >= 0.0)),
        )
        if (under == below).all() and (over == above).all():
            return x, free
        below, above = under, over
    factor = np.linalg.cholesky(hessian)
    found = lsq_linear(
        factor.T, solve_triangular(factor, pull, lower=True), (low, high), method="bvls"
    )
    return found.x, found.active_mask == 0


def algebra(n: NormalEquations, weights=None) -> Algebra:
    """Return the summed normal equations of a point."""
    a, g, ssr = n.summed(weights)
    return Algebra(a, g, ssr, n.x)


def sandwich(n: NormalEquations, x: Array, covariance: Array) -> Array:
    """Return the covariance (p, p) of estimates x that allows for residuals alike within a block.

    Sum over blocks of score times score between two plain covariances (Huber 1967; White,
    Econometrica 48 (1980) 817); the priors' part of the plain covariance is kept.
    """
    v, a = np.zeros_like(covariance), np.zeros_like(covariance)
    for s in n.segments:
        own = np.ix_(s.places, s.places)
        score = _scores(n, s, x)
        v[own] += score.T @ score
        a[own] += s.a.sum(0)
    return np.asarray(covariance + covariance @ (v - a) @ covariance)


def between_segments(n: NormalEquations, x: Array, covariance: Array) -> Array:
    """Return the covariance (p, p) of estimates x told by how segments disagree: one score each, as
    clusters.

    What is alike over a whole recording, encoder counts that beat with the samples for instance,
    shows here only (Liang, Zeger, Biometrika 73 (1986) 13, with k/(k - 1) for k segments).
    """
    v = np.zeros_like(covariance)
    for s in n.segments:
        score = _scores(n, s, x).sum(0)
        v[np.ix_(s.places, s.places)] += np.outer(score, score)
    k = len(n.segments)
    return np.asarray(covariance @ v @ covariance * (k / max(1, k - 1)))


def _scores(n: NormalEquations, s: Segment, x: Array) -> Array:
    """Return the slope of each block's squares at x (b, p)."""
    return np.asarray(s.g - s.a @ (x - n.x)[s.places])
