"""The menu's currents where a motor's flux map has an end: cut to what the map holds, as a bench
would have to."""

from __future__ import annotations

import numpy as np

from model.array_types import Array
from model.energy import SOLVED, AnyEnergy, flux_newton
from model.spline import SplineEnergy, currents

PLACES = 101  # along an edge of the map
INSIDE = 0.02  # of the map's flux on each axis: as near to its edge a current is not asked for
HALVINGS = 30


def held(
    i_d: Array, i_q: Array, energy: AnyEnergy, swing: tuple[float, float]
) -> tuple[Array, Array]:
    """Return currents (n,) in A cut to a motor's flux map, as they are where it has none.

    swing: Wb on d and q that an injection adds to both sides.
    """
    if not isinstance(energy, SplineEnergy):
        return i_d, i_q
    low, high = _range(energy.low_d, energy.cells.shape[0] / energy.per_d, abs(swing[0]))
    low_q, high_q = _range(energy.low_q, energy.cells.shape[1] / energy.per_q, abs(swing[1]))
    along_d, along_q = np.linspace(low, high, PLACES), np.linspace(low_q, high_q, PLACES)
    for _ in range(2):  # the edge of each axis depends a little on the other's current
        i_q = _between(i_q, i_d, _edge(energy, along_d, low_q), _edge(energy, along_d, high_q))
        i_d = _between(i_d, i_q, *(_edge(energy, x, along_q)[::-1] for x in (low, high)))
    return i_d, i_q


def furthest_d(energy: AnyEnergy, wanted: float) -> float:
    """Return the largest i_d (A) up to a wanted one, at i_q = 0, that a motor's magnetic model
    holds."""
    if flux_newton(energy, wanted, 0.0, 0.0, 0.0)[2] == SOLVED:
        return wanted
    low, high = 0.0, wanted
    for _ in range(HALVINGS):
        middle = 0.5 * (low + high)
        solved = flux_newton(energy, middle, 0.0, 0.0, 0.0)[2] == SOLVED
        low, high = (middle, high) if solved else (low, middle)
    return low


def _range(start: float, span: float, swing: float) -> tuple[float, float]:
    """Return between which fluxes (Wb) of an axis currents may be asked for; 0, no current, is
    always among them."""
    margin = INSIDE * span + swing
    return min(start + margin, 0.0), max(start + span - margin, 0.0)


def _edge(energy: SplineEnergy, d: Array | float, q: Array | float) -> tuple[Array, Array]:
    """Return i_d, i_q (A) along a line of fluxes (Wb)."""
    pairs = zip(*np.broadcast_arrays(d, q), strict=True)
    both = np.array([currents(energy, float(x), float(y)) for x, y in pairs])
    return both[:, 0], both[:, 1]


def _between(
    values: Array, other: Array, least: tuple[Array, Array], most: tuple[Array, Array]
) -> Array:
    """Return values (n,) cut between two edges, each given as (the other axis' current, this axis'
    current)."""
    low, high = (np.interp(other, *_sorted(edge)) for edge in (least, most))
    return np.asarray(np.clip(values, np.minimum(low, 0.0), np.maximum(high, 0.0)))


def _sorted(edge: tuple[Array, Array]) -> tuple[Array, Array]:
    order = np.argsort(edge[0])
    return edge[0][order], edge[1][order]
