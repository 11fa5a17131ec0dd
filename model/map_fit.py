"""Fits to scattered points of a flux map, and how far a fit misses points that it has not seen.

Points are held out inside the map and on its edge: i_d = 0, where many maps end, is where a motor
without field weakening works.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import ConvexHull, QhullError

from model.array_types import Array
from model.errors import PhysicsError
from model.map_points import MapPoints
from model.spline import SplineEnergy, currents, hessian
from model.spline_energy import Choice, fit

CHOICES: tuple[Choice, ...] = (  # tried where a grid has holes: smoother ones for a map with noise
    ((6, 6), 1e-1),
    ((6, 6), 1e-2),
    ((10, 8), 1e-1),
    ((10, 8), 3e-3),
    ((10, 8), 1e-3),
    ((14, 12), 1e-3),
)
FOLDS = 4  # one point in so many is held out


class HeldOut(NamedTuple):
    """Rms errors (Wb) of a fit at points that it has not seen: inside the map, and on its edge."""

    inside: float
    edge: float


def choose_for_points(p: MapPoints) -> Choice:
    """Return the cells and the smoothness whose fit to scattered points misses points held out
    least."""
    errors = [math.hypot(*held_out(p, cells, smooth)) for cells, smooth in CHOICES]
    return CHOICES[int(np.argmin(errors))]


def held_out(p: MapPoints, cells: tuple[int, int] = (10, 8), smooth: float = 1e-3) -> HeldOut:
    """Return by how much (Wb rms) a fit misses points that it has not seen, inf where no fit to the
    rest is found: one point in FOLDS, inside the map and on its edge."""
    edge, out = on_edge(p), folds(p) == 0
    try:
        square = _errors_without(p, out, cells, smooth)
    except PhysicsError:
        return HeldOut(math.inf, math.inf)
    return HeldOut(
        *(
            math.sqrt(float(np.mean(square[part[out]]))) if part[out].any() else 0.0
            for part in (~edge, edge)
        )
    )


def left_out(p: MapPoints, cells: tuple[int, int], smooth: float) -> Array:
    """Return the squared flux error (Wb^2, (n,)) of each point in a fit that has not seen it, nor
    one point in FOLDS; nan where no fit to the rest is found."""
    of, square = folds(p), np.full(len(p.i_d), np.nan)
    for k in range(FOLDS):
        try:
            square[of == k] = _errors_without(p, of == k, cells, smooth)
        except PhysicsError:
            continue
    return square


def _errors_without(
    p: MapPoints, out: NDArray[np.bool_], cells: tuple[int, int], smooth: float
) -> Array:
    """Return the squared flux errors (Wb^2) of a fit at the points that are out of it."""
    energy = fit(p.psi_d[~out], p.psi_q[~out], p.i_d[~out], p.i_q[~out], cells, smooth)
    return squared_errors(energy, p)[out]


def folds(p: MapPoints) -> NDArray[np.int64]:
    """Return which of FOLDS parts each point (n,) belongs to: in turn inside the map, and in turn
    along its edge."""
    edge = on_edge(p)
    around = np.arctan2(_scaled(p.i_q), _scaled(p.i_d))
    inside, outside = np.flatnonzero(~edge), np.flatnonzero(edge)
    out = np.empty(len(edge), dtype=np.int64)
    for own in (inside, outside[np.argsort(around[outside], kind="stable")]):
        out[own] = np.arange(len(own)) % FOLDS
    return out


def squared_errors(energy: SplineEnergy, p: MapPoints) -> Array:
    """Return the squared flux errors (Wb^2, (n,)) of a fit at a map's points: the current that it
    gives at the point's flux less the point's own, times its inductance; energy: of total
    fluxes."""
    out = np.empty(len(p.i_d))
    for k, (d, q, i_d, i_q) in enumerate(zip(p.psi_d, p.psi_q, p.i_d, p.i_q, strict=True)):
        own_d, own_q = currents(energy, float(d), float(q))
        dd, dq, qq = hessian(energy, float(d), float(q))
        x, y, det = i_d - own_d, i_q - own_q, dd * qq - dq * dq
        out[k] = ((qq * x - dq * y) ** 2 + (dd * y - dq * x) ** 2) / det**2
    return out


def on_edge(p: MapPoints) -> NDArray[np.bool_]:
    """Tell which points lie on the edge of the currents (n,): within half a usual spacing of their
    convex hull."""
    place = np.column_stack([_scaled(p.i_d), _scaled(p.i_q)])
    try:
        hull = ConvexHull(place)
    except (QhullError, ValueError):  # on one line; a fit refuses them
        return np.zeros(len(place), dtype=bool)
    depth = -np.max(place @ hull.equations[:, :2].T + hull.equations[:, 2], axis=1)
    return np.asarray(depth < 0.5 * math.sqrt(hull.volume / len(place)))


def _scaled(x: Array) -> Array:
    """Return values as parts of their range, 0 in its middle."""
    return np.asarray((x - 0.5 * (np.max(x) + np.min(x))) / (np.ptp(x) or 1.0))
