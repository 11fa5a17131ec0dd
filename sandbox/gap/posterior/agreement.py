"""Do recordings agree that an effect is there?

What a wrong model leaves can look like an effect in one recording, and like its opposite in
another.  A fit then gives it a size that is many times what noise alone would, and recordings that
contradict each other.  So a size is measured by how recordings scatter about it, where they scatter
more than noise and chance make them: each of them pulls it by its own score (Liang, Zeger,
Biometrika 73 (1986) 13).  With few recordings the scatter itself is
uncertain, so the evidence is that of Student's distribution: of a size x of k numbers with the
covariance V, told by n recordings, against the prior deviations D of the effect or of what is
ordinary (D_0; 0 where nothing is),

    L(D) - L(D_0),  L(D) = -1/2 log |V + D^2| - (n - 1 + k)/2 log(1 + x' (V + D^2)^-1 x / (n - 1)),

the effect's averaged over sizes, and n - 1 larger where a part of V is the noise, which is known.
It only says that an effect is *not* sure: one that all recordings agree on has its whole evidence
(`inference`).
"""

from __future__ import annotations

import math
from collections.abc import Mapping

import numpy as np
from scipy.linalg import eigh

from model.array_types import Array
from sandbox.gap.evidence.algebra import Prior, algebra, between_segments
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
        self.freedom = max(1, len({s.recording for s in n.segments}) - 1)
        self.scatter = between_segments(n, self.x, self.plain)
        self.scores = max(1, len(n.segments) - 1)

    def on(self, effect: str, settings: Settings) -> float:
        """Return the log evidence that an effect is there, as far as recordings agree on it.

        Infinite where they scatter no more than noise makes them, and of one that is nothing but
        shapes; minus infinite of a size at its bound, which is none.
        """
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
        # in prior deviations: parameters may be of any size
        at, unit = np.ix_(own, own), self.prior.deviation[own]
        covariance, scatter = (c[at] / np.outer(unit, unit) for c in (self.plain, self.scatter))
        if not (np.isfinite(covariance).all() and np.isfinite(scatter).all()):
            return math.inf  # a prediction that overflowed: nothing is told of it
        share, vector = eigh(scatter, covariance)
        wider = np.maximum(1.0, share / chance(len(own), self.scores))
        if np.all(wider == 1.0):
            return math.inf
        turned = covariance @ vector
        covariance = (turned * wider) @ turned.T
        # of the part that recordings told (Welch, Satterthwaite); noise is known
        freedom = self.freedom / (1.0 - 1.0 / float(wider.max())) ** 2
        usual = np.array([self.usual.get(self.n.coordinates[k].label, 0.0) for k in own]) / unit
        away = (self.x - self.prior.mean)[own] / unit
        each = [level(away, covariance, np.hypot(usual, w), freedom) for w in settings.sizes]
        there = float(np.logaddexp.reduce(each)) - math.log(len(each))
        return there - level(away, covariance, usual, freedom)


def chance(numbers: int, scores: int) -> float:
    """Return how much wider than the plain one a covariance of so many numbers is by chance along
    its widest direction, told by so many scores: the edge of the spectrum (Marchenko, Pastur, Math.
    USSR Sb. 1 (1967) 457), and CHANCE standard deviations of a variance."""
    return (1.0 + math.sqrt(numbers / scores)) ** 2 + CHANCE * math.sqrt(2.0 / scores)


def level(away: Array, covariance: Array, deviation: Array, freedom: float) -> float:
    """Return the log density (up to a constant) of a size (k,) off its mean, under its covariance
    and a prior's deviations (k,), by Student's distribution with so many degrees of freedom."""
    whole = covariance + np.diag(deviation**2)
    square = float(away @ np.linalg.solve(whole, away))
    tail = 0.5 * (freedom + len(away)) * math.log1p(square / freedom)
    return -tail - 0.5 * float(np.linalg.slogdet(whole)[1])
