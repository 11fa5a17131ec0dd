"""How much of the gap each effect explains, and how the gap shrinks as they are added one after the other.

Effects are correlated, so what one explains depends on which are there already: its share is the mean over all orders
of adding (Shapley, Contributions to the Theory of Games II (1953) 307; of a regression: Lindeman, Merenda, Gold 1980),
by algebra on the equations at the best point, everything else refitted; the interval is a bootstrap over recordings.
The waterfall is replayed: one simulation after each effect.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from itertools import combinations

import numpy as np
from numpy.typing import NDArray

from model.effects import library
from model.errors import BadInput
from sandbox.gap.diagnose import Diagnosis
from sandbox.gap.evidence.gap_size import rms, squares
from sandbox.gap.evidence.normal import Point, normal
from sandbox.gap.report.where import held_at_neutral
from sandbox.gap.search.judged import Judged
from sandbox.gap.search.posterior import UNKNOWN

Array = NDArray[np.float64]
EXACT, ORDERS, DRAWS = 7, 24, 400  # effects up to which all orders count; orders drawn else; draws of the bootstrap


@dataclass(frozen=True)
class Shares:
    """Share of the reducible gap and its interval by effect, largest first, and the normalised rms on the recordings
    held out after each is added in this order."""

    of: dict[str, tuple[float, float, float]]
    waterfall: tuple[tuple[str, float], ...]


def shares(d: Diagnosis) -> Shares:
    """Return the shares of the best hypothesis' effects; none where it names none."""
    named = tuple(e for e in d.best.effects if e != UNKNOWN)
    if not named:
        return Shares({}, ())
    j = d.best.judged
    worth = _worths(j, named)
    parts = np.array(shapley(worth, named, np.random.default_rng(0)))
    whole = worth(frozenset(named))
    left = np.zeros(whole.size)
    for s in j.fit.normal.segments:
        left[s.recording] += float(s.rr.sum() - s.n.sum())
    gap = whole + left
    pick = np.random.default_rng(1).integers(whole.size, size=(DRAWS, whole.size))
    with np.errstate(invalid="ignore", divide="ignore"):
        scale = d.remainder.explained * gap.sum() / whole.sum()  # at the point of the best hypothesis, not by algebra
        drawn = scale * parts[:, pick].sum(2) / gap[pick].sum(1)
        value = scale * parts.sum(1) / gap.sum()
    low, high = np.nanpercentile(drawn, [2.5, 97.5], axis=1)
    found = {e: (float(value[k]), float(low[k]), float(high[k])) for k, e in enumerate(named)}
    ranked = dict(sorted(found.items(), key=lambda x: -x[1][0]))
    return Shares(ranked, tuple(_waterfall(d, j, list(ranked))))


def _worths(j: Judged, named: Sequence[str]) -> Callable[[frozenset[str]], Array]:
    """Return what a set of the effects takes off the squares of each recording (r,), by algebra, all else refitted."""
    count = 1 + max(s.recording for s in j.normal.segments)
    known: dict[frozenset[str], Array] = {}
    shapes = {e: _squares(without(j, [e])) - _squares(j.fit.point) for e in named if is_shape_only(j, e)}

    def left(kept: frozenset[str]) -> Array:
        """Return the squares that each recording leaves."""
        if kept not in known:
            gone = [e for e in named if e not in kept]
            shift = j.equations.most_probable(held_at_neutral(j, gone)).x - j.normal.x
            out = np.zeros(count)
            for s in j.normal.segments:
                x = shift[s.places]
                out[s.recording] += s.rr.sum() - 2.0 * x @ s.g.sum(0) + x @ s.a.sum(0) @ x
            known[kept] = out + sum((shapes[e] for e in gone if e in shapes), np.zeros(count))
        return known[kept]

    return lambda kept: left(frozenset()) - left(kept)


def shapley(worth: Callable[[frozenset[str]], Array], names: Sequence[str], rng: np.random.Generator) -> list[Array]:
    """Return the mean over orders of adding of what each name brings; worth: of a set."""
    n = len(names)
    if n <= EXACT:
        out = []
        for name in names:
            others = [e for e in names if e != name]
            part = np.zeros_like(worth(frozenset()))
            for size in range(n):
                weight = 1.0 / (n * math.comb(n - 1, size))
                for chosen in combinations(others, size):
                    part = part + weight * (worth(frozenset((*chosen, name))) - worth(frozenset(chosen)))
            out.append(part)
        return out
    parts = {e: np.zeros_like(worth(frozenset())) for e in names}
    for _ in range(ORDERS // 2):
        order = [str(e) for e in rng.permutation(list(names))]
        for way in (order, order[::-1]):  # an order and its reverse: less variance for the same cost
            for k, e in enumerate(way):
                parts[e] = parts[e] + (worth(frozenset(way[: k + 1])) - worth(frozenset(way[:k]))) / ORDERS
    return [parts[e] for e in names]


def _waterfall(d: Diagnosis, j: Judged, ranked: Sequence[str]) -> list[tuple[str, float]]:
    """Return each effect with the normalised rms once it and those before it are added; the last is the fit's own."""
    chosen = list(d.held_out) or list(range(len(d.start.prepared.recordings)))
    out = []
    for k, effect in enumerate(ranked[:-1]):
        try:
            n = normal(without(j, ranked[k + 1 :]), ())
            out.append((effect, rms(n, chosen)))
        except BadInput:  # extrapolated: none that a drive can have
            out.append((effect, math.nan))
    return [*out, (ranked[-1], d.size.after)]


def is_shape_only(j: Judged, effect: str) -> bool:
    """Return whether an effect has no size that could be taken to neutral on the way (a shaft's stiffness)."""
    return all(j.table.coordinates[k].form == "log" for k in j.table.members[effect])


def without(j: Judged, gone: Sequence[str]) -> Point:
    """Return the point at which effects are missing and all else follows by algebra; shapes at their neutral values."""
    x = j.equations.most_probable(held_at_neutral(j, gone)).x
    moved = [(c, to) for c, to in zip(j.normal.coordinates, x, strict=True) if c.form != "share"]
    point = j.table.point.moved([c for c, _ in moved], np.array([to for _, to in moved]))
    neutral = library.neutral(point.prepared.campaign.drive.motor)
    shapes = tuple(f"{e}." for e in gone if is_shape_only(j, e))
    off = {k: v for k, v in neutral.items() if shapes and k.startswith(shapes)}
    return replace(point, values={**point.values, **off})


def _squares(point: Point) -> Array:
    """Return the squares of each recording's residuals (r,) at a point."""
    n = normal(point, ())
    return np.array([squares(n, [k])[0].sum() for k in range(len(point.prepared.recordings))])
