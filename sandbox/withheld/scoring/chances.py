"""Effects one by one: how well stated chances say which are there, and whether intervals hold for
each of them."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np
from numpy.typing import ArrayLike

from model.array_types import Array
from model.effects.library import causes
from sandbox.withheld.scoring.judge import UNKNOWN, Judgement
from sandbox.withheld.scoring.limits import (
    NOTHING,
    Figure,
    area,
    bootstrapped,
    mean_share,
    share,
    widened,
)

MANY = 4  # effects from which a campaign asks for the whole list rather than for a cause
NAMED = 0.5  # chance from which an effect counts as named
BINS = 10  # of stated chances, for their calibration
ENOUGH = 10  # values of an effect below which its coverage is not compared with others'


def of_many(judged: Sequence[Judgement]) -> dict[str, Figure]:
    """Return what inclusion chances are worth in campaigns of many effects, every effect of the
    library counted.

    included_f1: mean over campaigns of F1, an effect named where its chance is above NAMED;
    included_auroc: chance that an effect that is there has a larger one than an effect that is not,
    pooled; included_error: `calibration_error`. A failed diagnosis counts as the worst it could
    have said: all that is there absent for sure, all else there.
    """
    many = [j for j in judged if len(j.effects) >= MANY]
    names = sorted({*causes(), *(e for j in many for e in j.effects)} - {UNKNOWN})
    if not many:
        return dict.fromkeys(("included_f1", "included_auroc", "included_error"), NOTHING)
    there = [[e in j.effects for e in names] for j in many]
    stated = [
        [float(not x) for x in t] if j.failed else [j.chances.get(e, 0.0) for e in names]
        for j, t in zip(many, there, strict=True)
    ]
    rows = np.concatenate([np.array(stated), np.array(there, dtype=float)], axis=1)
    return {
        "included_f1": mean_share([f1(*_apart(r[None])) for r in rows]),
        "included_auroc": widened(
            bootstrapped(rows, _of_each(lambda x: _area(*_apart(x)))), len(many)
        ),
        "included_error": widened(
            bootstrapped(rows, _of_each(lambda x: calibration_error(*_apart(x)))), len(many)
        ),
    }


def calibration(judged: Sequence[Judgement]) -> Figure:
    """Return the `calibration_error` of first hypotheses: the chance stated against the share that
    is right.

    A failed diagnosis counts as a name given for sure and wrong.
    """
    stated = [(1.0, 0.0) if j.failed else (j.top_probability, float(j.hit)) for j in judged]
    return widened(
        bootstrapped(stated, _of_each(lambda x: calibration_error(x[:, 0], x[:, 1]))), len(stated)
    )


def calibration_error(chance: ArrayLike, there: ArrayLike) -> float:
    """Return the expected calibration error: the mean over cases of how far the chances of their
    bin are off together (Naeini, Cooper, Hauskrecht, AAAI 2015); BINS of equal width."""
    c, t = np.asarray(chance, dtype=float), np.asarray(there, dtype=float)
    place = np.minimum((BINS * c).astype(int), BINS - 1)
    return float(np.abs(np.bincount(place, c - t, minlength=BINS)).sum() / len(c))


def f1(chance: ArrayLike, there: ArrayLike) -> float:
    """Return the harmonic mean of precision and recall of effects named; chance, there: of one
    shape."""
    named, true = np.asarray(chance) > NAMED, np.asarray(there) > 0.5
    return float(2.0 * np.sum(named & true) / max(int(np.sum(named) + np.sum(true)), 1))


def coverage_by_effect(judged: Sequence[Judgement]) -> dict[str, Figure]:
    """Return by effect the share of its true parameters that lie in their intervals, the least
    first; a failed diagnosis covers none."""
    counts: dict[str, list[bool]] = {}
    for j in judged:
        for effect, (hits, given) in j.parts_of.items():
            counts.setdefault(effect, []).extend([True] * hits + [False] * (given - hits))
    found = {e: share(hits) for e, hits in counts.items() if hits}
    return dict(sorted(found.items(), key=lambda x: (x[1].value or 0.0, x[0])))


def coverage_worst(judged: Sequence[Judgement]) -> Figure:
    """Return the least coverage of an effect with ENOUGH values."""
    return next((f for f in coverage_by_effect(judged).values() if f.n >= ENOUGH), NOTHING)


def _of_each(statistic: Callable[[Array], float]) -> Callable[[Array], Array]:
    """Return a statistic of rows as one of many draws of them (k, n, m)."""
    return lambda draws: np.array([statistic(rows) for rows in draws])


def _apart(rows: Array) -> tuple[Array, Array]:
    """Return chances and truths, pooled."""
    chance, there = np.split(rows, 2, axis=1)
    return chance.ravel(), there.ravel()


def _area(chance: Array, there: Array) -> float:
    return area(chance[there > 0.5], chance[there < 0.5])
