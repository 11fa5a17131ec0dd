"""What a trace shows beside the runs themselves: lines over time, bars, lines in a plane."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from model.array_types import Array

Colour = tuple[int, int, int]
# lines (n, 2), their colour, a label each or none
Strips = tuple[Sequence[Array], Colour, Sequence[str]]
GREY: Colour = (170, 170, 170)
# Readable on white paper and on the viewer's dark ground, and apart for colour-blind eyes.
COLOURS: dict[str, Colour] = {"saturated": (46, 134, 222), "linear": (222, 98, 16)}


@dataclass(frozen=True)
class Plot:
    """Lines, or bars, over a common x (n,): s of lines, any number of bars; a colour each.

    width: of bars that stand side by side from x on; without it all have width 1, one before the
    other.
    """

    title: str
    x: Array
    lines: Mapping[str, Array]
    colours: Sequence[Colour]
    bars: bool = False
    width: float | None = None


@dataclass(frozen=True)
class Sheet:
    """Lines in a plane, seen from above: x to the right, y downwards as a viewer of pictures has
    it."""

    title: str
    strips: Mapping[str, Strips]


def pale(colour: Colour) -> Colour:
    """Return a colour mixed with white, for what belongs to a belief without being its estimate."""
    red, green, blue = (round(0.35 * c + 0.65 * 255) for c in colour)
    return red, green, blue


def upright(x: Array, y: Array) -> list[Array]:
    """Return a line (n, 2) for a sheet on which y points upwards, broken where a point is
    undefined."""
    points = np.column_stack([x, -y])
    known = np.isfinite(points).all(axis=1)
    parts = np.split(points, np.flatnonzero(np.diff(known)) + 1)
    return [part for part in parts if len(part) > 1 and np.isfinite(part).all()]
