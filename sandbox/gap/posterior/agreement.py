"""Do recordings agree that an effect is there?

What a wrong model leaves can look like an effect in one recording, and like its opposite in
another.  A fit then gives it a size that is many times what noise alone would, and recordings that
contradict each other.  So a size is measured by how recordings scatter about it, where they scatter
more than noise and chance make them: each of them pulls it by its own score (Liang, Zeger,
Biometrika 73 (1986) 13), and blocks of time do.  With few recordings the scatter itself is
uncertain, so the evidence is that of Student's distribution: of a size x with the covariance V,
told by n recordings, against the prior deviations D of the effect or of what is ordinary (D_0; 0
where nothing is),

    L(D) - L(D_0),  L(D) = -1/2 log |V + D^2| - (n - 1)/2 log(1 + x' (V + D^2)^-1 x / (n - 1)),

the effect's averaged over sizes.  It only says that an effect is *not* sure: one that all
recordings agree on has its whole evidence (`inference`).
"""

from __future__ import annotations

import math
from collections.abc import Mapping

import numpy as np
from scipy.linalg import eigh

from model.array_types import Array
from sandbox.gap.evidence.algebra import Prior, algebra, between_segments, sandwich
from sandbox.gap.evidence.normal import NormalEquations
from sandbox.gap.evidence.priors import STEPS
from sandbox.gap.settings import Settings

# standard deviations of the scatter of so many scores up to which it is chance
CHANCE = 2.0


class Agreement:
    """What recordings say of the effects of a set, from its normal equations and prior; usual:
    deviations of ordinary coordinates by label."""

    def __init__(self, n: NormalEquations, prior: Prior, usual: Mapping[str, float]) -> None:
        equations = algebra(n)
        self.n, self.prior, self.usual = n, prior, usual
        self.x, self.free, _ = equations.most_probable(prior)
        self.plain = equations.covariance(prior)
        self.count = len({s.recording for s in n.segments})
        self.scatters = (
            (between_segments(n, self.x, self.plain), len(n.segments)),
            (sandwich(n, self.x, self.plain), sum(len(s.n) for s in n.segments)),
        )

    def on(self, effect: str, settings: Settings) -> float:
        """Return the log evidence that an effect is there, as far as recordings agree on it;
        infinite of one that is nothing but shapes, and nothing at all of a size at its bound."""
        sizes = [
            k
            for k, c in enumerate(self.n.coordinates)
            if c.effect == effect
            and c.form not in ("log", *STEPS)
            and self.prior.deviation[k] > 0.0
        ]
        own = [k for k in sizes if self.free[k]]
        if not own:
            return -math.inf if sizes else math.inf
        at = np.ix_(own, own)
        covariance = self.plain[at]
        for scatter, scores in self.scatters:
            covariance = widened(covariance, scatter[at], scores)
        narrow = np.array([self.usual.get(self.n.coordinates[k].label, 0.0) for k in own])
        away = (self.x - self.prior.mean)[own]
        wide = [size * self.prior.deviation[own] for size in settings.sizes]
        each = [level(away, covariance, np.hypot(narrow, w), self.count - 1) for w in wide]
        there = float(np.logaddexp.reduce(each)) - math.log(len(each))
        return there - level(away, covariance, narrow, self.count - 1)


def level(away: Array, covariance: Array, deviation: Array, freedom: int) -> float:
    """Return the log density (up to a constant) of a size (k,) off its mean, under its covariance
    and a prior's deviations (k,), by Student's distribution with so many degrees of freedom."""
    whole, freedom = covariance + np.diag(deviation**2), max(1, freedom)
    square = float(away @ np.linalg.solve(whole, away))
    return -0.5 * freedom * math.log1p(square / freedom) - 0.5 * float(np.linalg.slogdet(whole)[1])


def widened(plain: Array, scatter: Array, scores: int) -> Array:
    """Return a covariance (k, k), along each direction as large as scores scatter where that is
    more than the plain one and chance in so many scores."""
    chance = 1.0 + CHANCE * math.sqrt(2.0 / max(1, scores - 1))
    share, vector = eigh(scatter, plain)
    turned = plain @ vector
    return np.asarray((turned * np.maximum(1.0, share / chance)) @ turned.T)
