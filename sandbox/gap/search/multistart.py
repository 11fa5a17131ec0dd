"""Starts away from neutral: what an effect of a given size would explain, where slopes at neutral do not tell.

A delay of a third of a period, say, changes readings otherwise than its slope at zero promises, and a fit from there
ends in a minimum of its own.  So sizes are tried one by one: a replay each, ordinary deviations following by algebra.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from model.errors import BadInput
from sandbox.gap.evidence.algebra import Prior, algebra
from sandbox.gap.evidence.fit import Fit, Weights
from sandbox.gap.evidence.normal import Normal, Point
from sandbox.gap.evidence.priors import WIDE, Coordinate, of_effect
from sandbox.gap.evidence.probes import Probe
from sandbox.plant.sets import complete

TRIED_SIZES = (-4.0, -2.0, 2.0, 4.0)  # typical sizes; nearer to neutral slopes tell enough
MOST = 2  # sizes an effect may have: more are many small ones, for which slopes do


def trials(point: Point, probe: Probe, sizes: Sequence[float] = TRIED_SIZES) -> list[dict[str, float]]:
    """Return the effect's values with one size at a multiple of its typical one, as far as a drive can have them."""
    drive = point.prepared.campaign.drive
    values = {**point.values, **probe.start}
    own = [c for c in of_effect(probe.effect, drive, values) if is_size(c, probe)]
    out = []
    for c in own if len(own) <= MOST else []:
        low, high = replace(c, within=math.inf).bounds()
        for to in (c.mean + s * c.deviation / WIDE for s in sizes):
            if low <= to <= high and to != c.mean:
                moved = {**probe.start, **c.changes(values, to)}
                try:
                    complete(drive.motor, drive.converter, {**values, **moved})
                except BadInput:
                    continue
                out.append(moved)
    return out


def is_size(c: Coordinate, probe: Probe) -> bool:
    """Return whether a coordinate is a size with a sign or without, no amplitude of a phase."""
    return c.form in ("linear", "reciprocal") and c.names[0] not in probe.start


def _replayed(n: Normal, points: Sequence[Point], workers: int) -> list[Normal | None]:
    """Return the equations at points side by side; one by one where some point is none a drive can have (None)."""
    try:
        return list(n.at_each(points, workers=workers))
    except BadInput:
        out: list[Normal | None] = []
        for point in points:
            try:
                out.append(n.at(point, workers=workers))
            except BadInput:
                out.append(None)
        return out


def held(prior: Prior, n: Normal, names: set[str]) -> Prior:
    """Return a prior that leaves the coordinates of some parameters where they are."""
    own = np.array([not names.isdisjoint(c.names) for c in n.coordinates])
    return Prior(
        np.where(own, n.x, prior.mean), np.where(own, 0.0, prior.deviation),
        np.where(own, -np.inf, prior.low), np.where(own, np.inf, prior.high),
    )  # fmt: skip


def with_sizes(
    found: Fit, probes: Sequence[Probe], n: Normal, prior: Prior, weights: Weights, workers: int
) -> tuple[list[Probe], float]:
    """Return the probes with the best size to start from and half of what the objective falls by; and simulations.

    n: equations at the fit's point with slopes; prior: of the fit's own coordinates, all others held.
    """
    moves = [trials(found.point, p) for p in probes]
    flat = [replace(found.point, values={**found.point.values, **m}) for own in moves for m in own]
    if not flat:
        return list(probes), 0.0
    level = algebra(n, weights).most_probable(prior).objective
    named = [set(m) for own in moves for m in own]
    reached = [
        math.inf if x is None else algebra(x, weights).most_probable(held(prior, x, names)).objective
        for x, names in zip(_replayed(n, flat, workers), named, strict=True)
    ]
    gains = iter([0.5 * (level - x) if np.isfinite(x) else -np.inf for x in reached])
    out = []
    for probe, own in zip(probes, moves, strict=True):
        gain, k = max(((next(gains), j) for j in range(len(own))), default=(0.0, 0))
        out.append(replace(probe, sized=own[k], gain=gain) if gain > 0.0 else probe)
    farther = [_farther(found, p, n, prior, level, weights, workers) for p in out]
    return [p for p, _ in farther], len(flat) + sum(cost for _, cost in farther)


def _farther(
    found: Fit, probe: Probe, n: Normal, prior: Prior, level: float, weights: Weights, workers: int
) -> tuple[Probe, float]:
    """Return a probe whose best size was the farthest one that was tried with one still farther, as long as that gains;
    and simulations."""
    cost, far = 0.0, max(TRIED_SIZES)
    while probe.sized in trials(found.point, probe, (-far, far)):
        far *= 2.0
        moves = trials(found.point, probe, (-far, far))
        points = [replace(found.point, values={**found.point.values, **m}) for m in moves]
        reached = _replayed(n, points, workers) if points else []
        cost += len(points)
        for x, move in zip(reached, moves, strict=True):
            gain = (
                -np.inf
                if x is None
                else 0.5 * (level - algebra(x, weights).most_probable(held(prior, x, set(move))).objective)
            )
            if gain > probe.gain:
                probe = replace(probe, sized=move, gain=float(gain))
    return probe, cost
