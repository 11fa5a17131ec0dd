"""A motion told by sixths of a turn, at the changes alone: there the angle is known, between them
it is drawn smoothly.

A window of the motion's equation (`sandbox.gap.motion.windows`) that lies within a sixth would see
the drawing's own acceleration.  From change to change torques are averaged over the rows nearer to
one than to any other, so that the integrals of a window, which weigh each row with its gaps, are
those of all rows.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from model.array_types import Array


def at_changes(
    t: Array, angle: Array, values: Mapping[str, Array], step: float, zero: float
) -> tuple[Array, Array, dict[str, Array]]:
    """Return stamps (s), angles and mean values (n,) at an angle's changes from sixth to sixth,
    half way between rows.

    step: of a sixth, zero: of a change, in the angle's unit; empty where nothing changes.
    """
    rows = np.flatnonzero(np.diff(np.floor((angle - zero) / step)))
    at, place = 0.5 * (t[rows] + t[rows + 1]), 0.5 * (angle[rows] + angle[rows + 1])
    if not rows.size:
        return at, place, {name: x[:0] for name, x in values.items()}
    first = np.concatenate([[0], np.searchsorted(t, 0.5 * (at[1:] + at[:-1]))])
    return at, place, {name: means(x, first) for name, x in values.items()}


def means(x: Array, first: NDArray[np.int64]) -> Array:
    """Return the means of the parts of x (n,) that begin at the rows `first` (rising, at least one
    row each)."""
    return np.asarray(np.add.reduceat(x, first) / np.diff(np.append(first, len(x))))
