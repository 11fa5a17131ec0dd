"""Borrowed arrays: the same numbers, no count."""

from __future__ import annotations

import sys
from typing import NamedTuple

import numpy as np

from model.borrowed import borrowed
from model.compiled import kernel


class Cells(NamedTuple):
    """An array and a number beside it."""

    values: np.ndarray
    scale: float


@kernel
def total(cells):
    """Return the scaled sum, read through a borrowed array a thousand times."""
    own, out = borrowed(cells), 0.0
    for _ in range(1000):
        out += part(own)
    return out


@kernel
def part(cells):
    """Return a thousandth of it."""
    return 1e-3 * cells.scale * cells.values.sum()


@kernel
def without(cells):
    """Return whether nothing was handed on."""
    return borrowed(cells) is None


def test_numbers_are_the_same_and_nobody_is_left_who_holds_the_array():
    cells = Cells(np.arange(6.0).reshape(2, 3), 2.0)
    assert abs(total(cells) - 30.0) < 1e-12
    before = sys.getrefcount(cells.values)
    for _ in range(10):
        total(cells)
    after = sys.getrefcount(cells.values)
    assert after == before
    assert cells.values.sum() == 15.0


def test_anything_else_stays_as_it_is():
    cells = Cells(np.ones(2), 1.0)
    assert without(None)
    assert borrowed(cells) is cells
