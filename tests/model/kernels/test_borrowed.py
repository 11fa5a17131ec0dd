"""Borrowed arrays: the same numbers, no count."""

from __future__ import annotations

import sys
from typing import NamedTuple

import numpy as np
import pytest
from numba import types
from numba.core import cgutils
from numba.core.errors import TypingError
from numba.extending import intrinsic

from model.compiled import kernel
from model.kernels.borrowed import borrowed


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


@intrinsic
def counted(typing, values):
    """Return whether an array is counted."""

    def write(context, builder, signature, args):
        """Compare its count with none."""
        array = cgutils.create_struct_proxy(values)(context, builder, args[0])
        return cgutils.is_not_null(builder, array.meminfo)

    return types.boolean(values), write


@kernel
def are_counted(cells):
    """Return whether the array is counted as handed in, and as borrowed."""
    return counted(cells.values), counted(borrowed(cells).values)


def test_a_borrowed_array_is_not_counted():
    assert are_counted(Cells(np.ones(2), 1.0)) == (True, False)


def test_only_arrays_and_numbers_can_be_borrowed():
    """Anything else would be given up once more than it was taken."""
    with pytest.raises(TypingError, match="holds more than arrays and numbers"):
        total(Cells(np.ones(2), Cells(np.ones(2), 1.0)))


def test_anything_else_stays_as_it_is():
    cells = Cells(np.ones(2), 1.0)
    assert without(None)
    assert borrowed(cells) is cells
