"""Sets of effects by algebra: spike and slab on one point's normal equations, searched by adding, dropping, exchanging.

Every set of effects is a choice of priors on the same equations: wide (slab) for its effects, narrow (spike) for all
others.  A Gaussian's log evidence without bounds is one Cholesky factor, a thousand sets take a tenth of a second; the
few best of every neighbourhood are weighed as hypotheses are (bounds, sizes averaged over), and the search climbs until
no neighbour is better (George, McCulloch, J. Am. Stat. Assoc. 88 (1993) 881; Hans, Dobra, West, ibid. 102 (2007) 507).
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import solve_triangular

from model.effects import library
from sandbox.gap.evidence.algebra import Algebra, Prior
from sandbox.gap.evidence.spike_slab import Table

Array = NDArray[np.float64]
Set = tuple[str, ...]
WEIGHED = 5  # of a neighbourhood, as hypotheses are
MOVES = 60  # of one climb at the most
STILL = 0.3  # log evidence: less is no step upwards
NUMBER = (0.57, 0.2565, 0.095, 0.0285)  # prior probability of 0, 1, 2, 3 effects
MORE, THINS = 0.05, 0.8  # of more than three together; each number over the one before


def log_prior(effects: Sequence[str]) -> float:
    """Return the log prior of a set of effects: all sets of one size alike."""
    n, whole = len(effects), len(library.effect_names())
    if n < len(NUMBER):
        chance = NUMBER[n]
    else:
        rest = whole - len(NUMBER) + 1
        chance = MORE * (1.0 - THINS) / (1.0 - THINS**rest) * THINS ** (n - len(NUMBER))
    return math.log(chance / math.comb(whole, n))


def contained(effect: str) -> frozenset[str]:
    """Return the effects whose parameters are part of an effect's own: never claimed together with it."""
    whole = {own.partition(".")[0]: double.partition(".")[0] for double, own in library.same_numbers().items()}
    return frozenset({whole[effect]} if effect in whole else ())


def possible(effects: Iterable[str]) -> bool:
    """Return whether no effect of a set is part of another of it."""
    chosen = set(effects)
    return not any(contained(e) & chosen for e in chosen)


@dataclass
class Subsets:
    """The sets of effects at one point: table, temperature, whether others leave traces; known: log posterior of those
    weighed so far (up to one constant)."""

    table: Table
    temperature: float
    alone: bool = False
    known: dict[Set, float] = field(default_factory=dict)

    def weigh(self, effects: Iterable[str]) -> float:
        """Return the log posterior of a set, as hypotheses are weighed."""
        key = tuple(sorted(effects))
        if key not in self.known:
            told = self.table.log_evidence(key, alone=self.alone, temperature=self.temperature)
            self.known[key] = told + log_prior(key)
        return self.known[key]

    def glance(self, sets: Sequence[Set]) -> Array:
        """Return the log posterior of sets, sizes with their wide priors, traces of other effects without bounds."""
        equations = self.table.equations.scaled(self.temperature)
        return np.array([self._glance(equations, s) for s in sets])

    def climb(self, start: Iterable[str] = (), kept: Iterable[str] = ()) -> tuple[Set, float]:
        """Return the best set that steps from one lead to, and its log posterior; kept: effects that stay in."""
        here, fixed = tuple(sorted(start)), frozenset(kept)
        best = self.weigh(here)
        for _ in range(MOVES):
            near = [s for s in self.neighbours(here) if fixed <= set(s)]
            told = self.glance(near)
            first = [near[k] for k in np.argsort(-told)[:WEIGHED]]
            new = max(first, key=self.weigh)
            if self.weigh(new) < best + STILL:
                break
            here, best = new, self.weigh(new)
        return here, best

    def neighbours(self, effects: Set) -> list[Set]:
        """Return the sets with one effect more, one fewer, or one exchanged."""
        others = [e for e in self.table.members if e not in effects]
        out = [(*effects, e) for e in others]
        for gone in effects:
            rest = tuple(e for e in effects if e != gone)
            out += [rest, *((*rest, e) for e in others)]
        return [tuple(sorted(s)) for s in out if possible(s)]

    def _glance(self, equations: Algebra, effects: Set) -> float:
        """Return what `glance` says of one set: bounds of its own effects count where a size would leave them."""
        prior = self.table.prior(effects, alone=self.alone)
        x, told = _unbounded(equations, prior)
        claimed = np.zeros(len(x), dtype=bool)
        claimed[[k for e in effects for k in self.table.members[e]]] = True
        if np.any(claimed & (prior.deviation > 0.0) & ((x < prior.low) | (x > prior.high))):
            low, high = np.where(claimed, prior.low, -np.inf), np.where(claimed, prior.high, np.inf)
            told = equations.log_evidence(replace(prior, low=low, high=high))
        return told + log_prior(effects)


def _unbounded(equations: Algebra, prior: Prior) -> tuple[Array, float]:
    """Return the most probable values (p,) without bounds, and the log evidence."""
    free = np.flatnonzero(prior.deviation > 0.0)
    size, x = prior.deviation[free], np.clip(prior.mean, prior.low, prior.high)
    shift = x - equations.x
    pull = size * (equations.g - equations.a @ shift)[free]
    factor = np.linalg.cholesky(size[:, None] * equations.a[np.ix_(free, free)] * size + np.eye(len(free)))
    half = solve_triangular(factor, pull, lower=True, check_finite=False)
    level = equations.rr - 2.0 * shift @ equations.g + shift @ equations.a @ shift
    x[free] += size * solve_triangular(factor, half, lower=True, trans=1, check_finite=False)
    return x, float(0.5 * (half @ half - level) - np.sum(np.log(np.diag(factor))))
