"""Figures with one-sided 95 % limits: exact for shares and quantiles, bootstrap over campaigns for
the rest.

A bootstrap of equal outcomes has no width, however few they are.  So figures in [0, 1] never have
limits closer than an outcome that n cases did not show allows: its share may be up to 1 -
0.05^(1/n), and it may be worth
0 or 1.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from model.array_types import Array

SIDE = 0.05  # beyond each limit
DRAWS = 2000


@dataclass(frozen=True)
class Figure:
    """A figure, its lower and upper one-sided 95 % limits, and how many cases it rests on; None
    where undefined.

    A limit alone is None where so few cases give none.
    """

    value: float | None
    low: float | None
    high: float | None
    n: int

    def as_json(self) -> dict[str, Any]:
        """Return the four numbers by name."""
        return {"value": self.value, "low": self.low, "high": self.high, "n": self.n}


NOTHING = Figure(None, None, None, 0)


def share(hits: Sequence[bool]) -> Figure:
    """Return the share of hits with the exact binomial limits (Clopper and Pearson, Biometrika 26
    (1934) 404)."""
    from scipy.stats import beta

    n, k = len(hits), int(sum(hits))
    if n == 0:
        return NOTHING
    low = float(beta.ppf(SIDE, k, n - k + 1)) if k > 0 else 0.0
    high = float(beta.ppf(1.0 - SIDE, k + 1, n - k)) if k < n else 1.0
    return Figure(k / n, low, high, n)


def bootstrapped(values: ArrayLike, statistic: Callable[[Array], Array]) -> Figure:
    """Return a statistic of the rows of values with percentile bootstrap limits; rows (n,) or (n,
    m) are drawn.

    statistic: from draws (k, n) or (k, n, m) to their values (k,).
    """
    rows = np.asarray(values, dtype=float)
    n = len(rows)
    if n == 0:
        return NOTHING
    drawn = statistic(rows[np.random.default_rng(0).integers(n, size=(DRAWS, n))])
    low, high = np.quantile(drawn[np.isfinite(drawn)], [SIDE, 1.0 - SIDE])
    return Figure(float(statistic(rows[None])[0]), float(low), float(high), n)


def widened(found: Figure, cases: int) -> Figure:
    """Return a figure in [0, 1] whose limits leave room for an outcome that so many cases did not
    show."""
    if found.value is None or found.low is None or found.high is None:
        return found
    seen = SIDE ** (1.0 / cases)
    low, high = found.value * seen, 1.0 - (1.0 - found.value) * seen
    return Figure(found.value, min(found.low, low), max(found.high, high), found.n)


def mean(values: ArrayLike) -> Figure:
    """Return the mean."""
    return bootstrapped(values, lambda x: np.asarray(np.mean(x, axis=1)))


def mean_share(values: ArrayLike) -> Figure:
    """Return the mean of numbers in [0, 1]."""
    return widened(mean(values), np.size(values))


def quantile(values: ArrayLike, q: float) -> Figure:
    """Return a quantile; limits are order statistics by the binomial distribution, free of any
    other assumption.

    The true quantile lies at or above the k-th smallest of n with the chance of at least k of n
    below it (Thompson, Ann. Math. Stat. 7 (1936) 122); None where even the outermost value is no
    limit.
    """
    from scipy.stats import binom

    x = np.sort(np.asarray(values, dtype=float))
    n = len(x)
    if n == 0:
        return NOTHING
    below = binom.cdf(np.arange(-1, n), n, q)  # of fewer than k = 0 ... n values below the quantile
    low = int(np.flatnonzero(below <= SIDE)[-1])
    high = int(np.flatnonzero(below >= 1.0 - SIDE)[0]) if below[-1] >= 1.0 - SIDE else n + 1
    return Figure(
        float(np.quantile(x, q)),
        float(x[low - 1]) if low > 0 else None,
        float(x[high - 1]) if high <= n else None,
        n,
    )


def ratio(parts: Sequence[tuple[int, int]]) -> Figure:
    """Return sum(hits) / sum(cases) of campaigns that have several cases each; campaigns are drawn,
    n counts cases."""
    known = [p for p in parts if p[1] > 0]
    if not known:
        return NOTHING
    found = widened(bootstrapped(known, _shares), len(known))
    return Figure(found.value, found.low, found.high, sum(p[1] for p in known))


def _shares(parts: Array) -> Array:
    """Return sum(hits) / sum(cases) of each draw of campaigns (k, n, 2)."""
    hits, cases = np.moveaxis(np.sum(parts, axis=1), 1, 0)
    return np.asarray(hits / cases)


def area(positive: ArrayLike, negative: ArrayLike) -> float:
    """Return the area under the ROC: the chance that a positive's score exceeds a negative's, ties
    half; positive: (n,), negative: (m,) scores."""
    return float(np.mean(_exceeds(positive, negative)))


def _exceeds(positive: ArrayLike, negative: ArrayLike) -> Array:
    """Return 1 where a positive's score (rows) exceeds a negative's (columns), 1/2 where they tie,
    else 0."""
    p, n = np.asarray(positive, dtype=float), np.asarray(negative, dtype=float)
    return np.asarray((p[:, None] > n[None, :]) + 0.5 * (p[:, None] == n[None, :]))


def auroc(positive: Sequence[float], negative: Sequence[float]) -> Figure:
    """Return the area under the ROC, both groups drawn anew; n counts the smaller group, which sets
    the least width."""
    if not positive or not negative:
        return NOTHING
    sizes, rng = (len(positive), len(negative)), np.random.default_rng(0)
    times = [
        [np.bincount(rng.integers(n, size=n), minlength=n) for n in sizes] for _ in range(DRAWS)
    ]
    p, n = (np.array(x) for x in zip(*times, strict=True))  # how often each is drawn (draws, each)
    drawn = np.sum((p @ _exceeds(positive, negative)) * n, axis=1) / math.prod(sizes)
    low, high = np.quantile(drawn, [SIDE, 1.0 - SIDE])
    return widened(
        Figure(area(positive, negative), float(low), float(high), min(sizes)), min(sizes)
    )
