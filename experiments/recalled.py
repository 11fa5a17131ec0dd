"""Simulations that many diagnoses of one campaign share, made once.

A diagnosis with another constant walks through many of the same points.  `recalled()` keeps the normal equations of
every point that was visited, slopes included, and gives them back where the same point is asked for with the same
coordinates: the answers are those of a diagnosis without it, to the bit.  Kept until LARGEST bytes are full or
another campaign is diagnosed.
"""

from __future__ import annotations

import hashlib
import pickle
import sys
import weakref
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from typing import Any

from sandbox.gap.evidence import normal as equations
from sandbox.gap.evidence.normal import Normal, Point
from sandbox.gap.evidence.priors import Coordinate

LARGEST = 4e9  # bytes of slopes in one process


@dataclass
class Memory:
    """What was computed: equations by point and coordinates, equations on kept slopes by slopes and point."""

    campaign: str = ""
    whole: dict[str, Normal] = field(default_factory=dict)
    moved: dict[tuple[int, str], Normal] = field(default_factory=dict)
    inputs: dict[int, str] = field(default_factory=dict)  # hash by the object's id, as long as the object lives
    size: int = 0
    found: int = 0

    def open(self, campaign: str) -> None:
        """Forget everything if this is another campaign than before."""
        if campaign != self.campaign:
            self.__init__(campaign)  # type: ignore[misc]

    def key(self, point: Point) -> str:
        """Return what tells a point from all others, as a hash: its set, turns, and what drives its recordings."""
        p = point.prepared
        told = (p.steps, p.floor, sorted(p.base.items()), sorted(point.values.items()), sorted(point.turns.items()))
        whole = repr((told, [self.digest(r) for r in p.recordings]))
        return hashlib.blake2b(whole.encode(), digest_size=16).hexdigest()

    def digest(self, inputs: Any) -> str:
        """Return the hash of a recording's inputs, computed once an object."""
        if id(inputs) not in self.inputs:
            self.inputs[id(inputs)] = hashlib.blake2b(pickle.dumps(inputs), digest_size=16).hexdigest()
            weakref.finalize(inputs, self.inputs.pop, id(inputs), None)  # another object may get its id
        return self.inputs[id(inputs)]


MEMORY = Memory()


@contextmanager
def recalled(campaign: str) -> Iterator[Memory]:
    """Let the diagnosis find again what it computed before for this campaign (any name that tells it from others)."""
    MEMORY.open(campaign)
    plain, plain_at = equations.normal, Normal.at_each

    def whole(point: Point, coordinates: Sequence[Coordinate], *, workers: int = 1) -> Normal:
        key = MEMORY.key(point) + repr(tuple(coordinates))
        if key in MEMORY.whole:
            MEMORY.found += 1
            equations.simulated(MEMORY.whole[key].simulations)  # what it would have taken is part of the answer
            return MEMORY.whole[key]
        made = plain(point, coordinates, workers=workers)
        own = sum(r.nbytes for r in made.rows) + sum(s.a.nbytes for s in made.segments)
        if MEMORY.size + own < LARGEST:
            MEMORY.whole[key], MEMORY.size = made, MEMORY.size + own
        return made

    def at_each(self: Normal, points: Sequence[Point], *, workers: int = 1) -> list[Normal]:
        keys = [(id(self.rows), MEMORY.key(p)) for p in points]
        if any(k not in MEMORY.moved for k in keys):
            made = plain_at(self, points, workers=workers)
            kept = any(n.rows is self.rows for n in MEMORY.whole.values())
            if not kept:  # its slopes may go, and other slopes may come to stand in their place
                return made
            own = sum(s.g.nbytes + s.rr.nbytes for n in made for s in n.segments)
            if MEMORY.size + own >= LARGEST:
                return made
            MEMORY.moved |= dict(zip(keys, made, strict=True))
            MEMORY.size += own
        else:
            MEMORY.found += len(keys)
            equations.simulated(float(len(keys)))
        return [MEMORY.moved[k] for k in keys]

    holders = [m for m in list(sys.modules.values()) if getattr(m, "normal", None) is plain]
    try:
        for m in holders:
            m.normal = whole  # type: ignore[attr-defined]
        Normal.at_each = at_each  # type: ignore[method-assign]
        yield MEMORY
    finally:
        for m in holders:
            m.normal = plain  # type: ignore[attr-defined]
        Normal.at_each = plain_at  # type: ignore[method-assign]
