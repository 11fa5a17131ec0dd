"""A campaign cut short, for what would take more memory than there is: the free regressions."""

from __future__ import annotations

from dataclasses import replace

from sandbox.gap.evidence.normal import ParameterPoint, block_length

# bytes: 198 regressors of two components, made from 99 and from their answers, and copied once
SAMPLE = 14e3


def share(point: ParameterPoint) -> float:
    """Return the share of a campaign that regressions are made on: 1 where memory allows it."""
    prepared = point.prepared
    return min(1.0, prepared.spare / (SAMPLE * prepared.samples))


def shortened(point: ParameterPoint) -> ParameterPoint:
    """Return the point with that share of each recording: its middle, of a free rotor its beginning
    (a motion that is predicted from sample to sample has to begin with it)."""
    part, cut = share(point), block_length(point.prepared)
    if part == 1.0:
        return point
    recordings = []
    for r in point.prepared.recordings:
        length = min(r.samples, max(cut, int(part * r.samples)))
        first = 0 if r.rotor == "free" else (r.samples - length) // 2
        recordings.append(r.cut(first, first + length))
    return replace(point, prepared=replace(point.prepared, recordings=tuple(recordings)))
