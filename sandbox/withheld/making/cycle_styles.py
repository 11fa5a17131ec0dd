"""Styles of operating cycles, by name."""

from __future__ import annotations

from collections.abc import Callable

from numpy.random import Generator

from model.errors import unknown
from model.parameters import Drive
from sandbox.withheld.making import cycles_practice, cycles_scored
from sandbox.withheld.making.cycles import Cycle, Scale, scale_of

STYLES = ("practice", "scored")


def cycles(style: str, drive: Drive, rng: Generator, share: float = 1.0) -> list[Cycle]:
    """Return the twelve cycles of a campaign; share: of the usual length.  BadInput for an unknown
    style."""
    if style not in STYLES:
        raise unknown("style of cycles", style, STYLES)

    makers: dict[str, Callable[[Scale, Generator], list[Cycle]]] = {
        "practice": cycles_practice.all_cycles,
        "scored": cycles_scored.all_cycles,
    }
    return makers[style](scale_of(drive, share), rng)
