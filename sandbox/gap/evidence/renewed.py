"""Equations at another point, slopes of a few coordinates taken there and those of the others kept.

Ordinary deviations act nearly in proportion; an effect's size, time or order, and how a current's sign goes through
zero, do not.  Their displaced sets run beside the one that a step has to replay anyway, in lanes that would be empty.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from sandbox.gap.evidence.normal import Normal, Point, block_length, slopes_at
from sandbox.gap.evidence.priors import Coordinate
from sandbox.replay.segments import Segment, Squared, blocks


def renewed(n: Normal, point: Point, some: Sequence[Coordinate], workers: int) -> Normal:
    """Return the equations at a point: slopes of some coordinates, and of turns, are taken there, the others are n's.

    BadInput where the point is none a drive can have.  What is returned has no slopes of its own (`Normal.rows`).
    """
    told = slopes_at(point, some, workers)
    place = {c.label: k for k, c in enumerate(n.coordinates)}
    at = np.array([place[c.label] for c in told.coordinates])
    cut = block_length(point.prepared)
    segments = [
        _merged(old, rows, own._replace(segment=replace(own.segment, places=at[own.segment.places])), at, cut)
        for old, rows, own in zip(n.segments, n.rows, told.parts, strict=True)
    ]
    return Normal(n.coordinates, n.at_point(point), tuple(segments), told.cost)


def _merged(old: Segment, rows: Any, new: Squared, renewed: np.ndarray, cut: int) -> Segment:
    """Return a segment with its kept slopes (n c, q) and new ones beside them, squared block by block."""
    keep = np.flatnonzero(~np.isin(old.places, renewed))
    p, q, own = len(keep), len(keep) + len(new.segment.places), new.segment
    a, g = np.empty((len(own.rr), q, q)), np.empty((len(own.rr), q))
    a[:, :p, :p], a[:, p:, p:] = old.a[:, keep[:, None], keep], own.a
    g[:, p:] = own.g
    wide = new.residuals.shape[1]
    for b, (first, last) in enumerate(blocks(len(new.residuals), cut)):
        kept, part = rows[first * wide : last * wide], slice(first * wide, last * wide)
        with np.errstate(over="ignore", invalid="ignore"):  # of an absurd set: nothing is probable there
            a[b, :p, p:] = (kept.T @ new.rows[part])[keep]
            g[b, :p] = (new.residuals[first:last].ravel() @ kept)[keep]
    a[:, p:, :p] = a[:, :p, p:].transpose(0, 2, 1)
    return replace(own, places=np.concatenate([old.places[keep], own.places]), a=a, g=g)
