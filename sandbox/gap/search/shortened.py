"""A campaign cut short, for what would take more memory than there is: the free regressions."""

from __future__ import annotations

from dataclasses import replace

from sandbox.gap.evidence.normal import Point, block_length
from sandbox.replay.inputs import Inputs
from sandbox.replay.smoothing import Motion

SAMPLE = 14e3  # bytes: 198 regressors of two components, made from 99 and from their answers, and copied once


def share(point: Point) -> float:
    """Return the share of a campaign that regressions are made on: 1 where memory allows it."""
    prepared = point.prepared
    return min(1.0, prepared.spare / (SAMPLE * prepared.samples))


def shortened(point: Point) -> Point:
    """Return the point with that share of each recording: its middle, of a free rotor its beginning (a motion that is
    foretold from sample to sample has to begin with it)."""
    part, cut = share(point), block_length(point.prepared)
    if part == 1.0:
        return point
    recordings = []
    for r in point.prepared.recordings:
        length = min(r.samples, max(cut, int(part * r.samples)))
        recordings.append(_between(r, 0 if r.rotor == "free" else (r.samples - length) // 2, length))
    return replace(point, prepared=replace(point.prepared, recordings=tuple(recordings)))


def _between(r: Inputs, first: int, length: int) -> Inputs:
    """Return so many samples of a recording from one on, that starts from the current read there."""
    own = slice(first, first + length)
    motion = Motion(r.motion.angle[own], r.motion.speed[own], r.motion.eccentric)
    return replace(r, track=r.track[own], read=r.read[own], motion=motion, loaded=r.loaded or first > 0)
