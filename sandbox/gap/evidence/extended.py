"""Equations of more coordinates at a point where those of others are known: what is simulated there
is the new ones alone.

With slopes S of the known and T of the new coordinates the matrix has the blocks S'S, S'T and T'T.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from model.array_types import Array
from sandbox.gap.evidence.normal import NormalEquations, ParameterPoint, normal
from sandbox.gap.evidence.priors import Coordinate
from sandbox.replay.segments import Segment

Columns = NDArray[np.int64]


@dataclass(frozen=True)
class Joined:
    """Slopes (rows, columns) that stand in two arrays, of each of which some columns count; order:
    of theirs, side by side.  Sliced like one array."""

    parts: tuple[tuple[Any, Columns], tuple[Any, Columns]]
    order: Columns

    def __getitem__(self, rows: slice) -> Array:
        """Return some rows (n, q)."""
        own = [slopes[rows][:, columns] for slopes, columns in self.parts]
        return np.concatenate(own, axis=1)[:, self.order]

    def products(self, r: Array, rows: slice) -> Array:
        """Return the products (q,) of residuals (n,) with the slopes of some rows: no copy is made
        of these."""
        own = [(r @ slopes[rows])[columns] for slopes, columns in self.parts]
        return np.asarray(np.concatenate(own)[self.order])

    def __array__(self, dtype: object = None, copy: bool | None = None) -> Array:
        """Return all of them."""
        return self[:]

    def reshape(self, *shape: int) -> Array:
        """Return all of them in another shape."""
        return self[:].reshape(*shape)

    def of(self, columns: Columns) -> Joined:
        """Return some of the columns."""
        return replace(self, order=self.order[columns])


def extended(
    known: NormalEquations | None,
    point: ParameterPoint,
    coordinates: Sequence[Coordinate],
    *,
    workers: int = 1,
) -> NormalEquations:
    """Return the normal equations of a campaign at a point for the coordinates and all of the
    point's own; known: equations that were taken there, of some of them and of others."""
    if known is None or not known.rows:
        return normal(point, coordinates, workers=workers)
    if (same := known.of(coordinates)) is not None:
        return same
    own = [k for k, c in enumerate(known.coordinates) if c.of_point]
    places = {known.move(c): k for k, c in enumerate(known.coordinates) if not c.of_point}
    # the same plant, whose map's modes have columns already
    bare = replace(point, prepared=replace(point.prepared, map_error=None))
    more = normal(bare, [c for c in coordinates if known.move(c) not in places], workers=workers)
    new = {more.move(c): k for k, c in enumerate(more.coordinates) if not c.of_point}
    moves = [known.move(c) for c in coordinates]
    old = {places[m]: j for j, m in enumerate(moves) if m in places}
    old |= {k: len(moves) + j for j, k in enumerate(own)}
    parts = (old, {new[m]: j for j, m in enumerate(moves) if m in new})
    joined = [
        _side_by_side((a, b), (s, t), parts)
        for a, b, s, t in zip(known.segments, more.segments, known.rows, more.rows, strict=True)
    ]
    x = np.empty(len(moves) + len(own))
    for n, part in zip((known, more), parts, strict=True):
        x[list(part.values())] = n.x[list(part)]
    return replace(
        more,
        coordinates=(*coordinates, *(known.coordinates[k] for k in own)),
        x=x,
        segments=tuple(segment for segment, _ in joined),
        rows=tuple(rows for _, rows in joined),
    )


def _side_by_side(
    segments: tuple[Segment, Segment],
    slopes: tuple[Any, Any],
    parts: tuple[dict[int, int], dict[int, int]],
) -> tuple[Segment, Joined]:
    """Return a channel's segment of columns that come from two, and its slopes; parts: by place of
    a coordinate in each of the two, its place in the whole."""
    found = []
    for s, part in zip(segments, parts, strict=True):
        columns = np.array([m for m, k in enumerate(s.places) if int(k) in part], dtype=np.int64)
        found.append((columns, [part[int(s.places[m])] for m in columns]))
    (c, old), (d, new) = found
    (a, b), p = segments, len(c)
    squares = np.empty((len(a.ssr), p + len(d), p + len(d)))
    squares[:, :p, :p] = a.a[:, c][:, :, c]
    squares[:, p:, p:] = b.a[:, d][:, :, d]
    ends = np.cumsum(a.n).astype(np.int64)
    for k, (first, last) in enumerate(zip([0, *ends[:-1]], ends, strict=True)):
        block = slopes[0][first:last][:, c].T @ slopes[1][first:last][:, d]
        squares[k, :p, p:], squares[k, p:, :p] = block, block.T
    g = np.concatenate([a.g[:, c], b.g[:, d]], axis=1)
    whole = replace(a, places=np.array([*old, *new], dtype=np.int64), a=squares, g=g)
    return whole, Joined(((slopes[0], c), (slopes[1], d)), np.arange(p + len(d)))
