"""A flux map's file that holds the energy itself beside its points: what recordings made of a map,
to the last digit.

Any program reads its points.  Where a [flux_map] states no cells, the motor has the energy as it
is, nothing fitted.
"""

from __future__ import annotations

import io
from pathlib import Path

import numpy as np

from model.array_types import Array
from model.arrays import read_arrays
from model.errors import BadInput
from model.fluxmap import MOST_VALUES
from model.map_points import MapPoints
from model.spline import DEGREE, SOLVED, SplineEnergy, currents, flux_newton, hessian
from model.spline_energy import Choice

# arrays: (n_d, n_q, 25) in J; low_d, low_q, per_d, per_q, magnet, choice
ENERGY, SCALES = "energy", "energy_scales"
APART = 1e-6  # of the largest current: a point's current and that of the energy at its flux


def with_stiffness(e: SplineEnergy) -> SplineEnergy:
    """Return an energy that knows its inverse inductances at zero current."""
    dd, _, qq = hessian(e, 0.0, 0.0)
    return e._replace(gamma_d=float(dd), gamma_q=float(qq))


def energy_file(e: SplineEnergy, magnet: float, choice: Choice, i_d: Array, i_q: Array) -> bytes:
    """Return a .npz of an energy of current-induced fluxes, magnet flux (Wb), and its points at
    currents (n,) in A that it reaches; choice: cells and smoothness with which its points may be
    fitted. BadInput where it reaches none."""
    kept = []
    for x, y in zip(i_d.tolist(), i_q.tolist(), strict=True):
        d, q, status = flux_newton(e, x, y, 0.0, 0.0)
        if status == SOLVED:
            kept.append((x, y, d + magnet, q))
    if not kept:
        raise BadInput(
            "the energy has no flux for any current of its map's points; state another map"
        )
    body, points = io.BytesIO(), np.array(kept).T
    scales = np.array([*e[1:5], magnet, *choice[0], choice[1]])
    cells = e.cells.reshape(*e.cells.shape[:2], -1)
    i_d, i_q, psi_d, psi_q = points
    np.savez_compressed(
        body, i_d=i_d, i_q=i_q, psi_d=psi_d, psi_q=psi_q, energy=cells, energy_scales=scales
    )
    return body.getvalue()


def energy_in(path: Path, points: MapPoints) -> tuple[SplineEnergy, float, Choice] | None:
    """Return the energy that a map's file holds, its magnet flux (Wb), and cells and smoothness;
    None where it holds none.  BadInput where it is not that of the file's points."""
    if path.suffix.lower() != ".npz":
        return None
    found, _ = read_arrays(path, (ENERGY, SCALES), MOST_VALUES)
    if ENERGY not in found or SCALES not in found:
        return None
    cells, scales = found[ENERGY], found[SCALES].astype(float).ravel()
    size = DEGREE + 1
    shaped = (
        cells.ndim == 3
        and min(cells.shape) > 0
        and cells.shape[2] == size**2
        and np.isfinite(cells).all()
    )
    if not shaped or len(scales) != 8 or not _possible(scales):
        raise BadInput(
            f"{path.name}: '{ENERGY}' has shape {cells.shape}, no energy of a flux map; {_remedy()}"
        )
    whole = np.ascontiguousarray(cells.reshape(*cells.shape[:2], size, size), dtype=np.float64)
    e = with_stiffness(SplineEnergy(whole, *scales[:4].tolist()))
    mapped = np.array(
        [currents(e, d - scales[4], q) for d, q in zip(points.psi_d, points.psi_q, strict=True)]
    )
    missed = np.max(np.abs(mapped - np.column_stack([points.i_d, points.i_q])), initial=0.0)
    if not missed <= APART * np.max(np.hypot(points.i_d, points.i_q)):
        raise BadInput(
            f"{path.name}: '{ENERGY}' gives currents {missed:.3g} A apart from its "
            f"points'; {_remedy()}"
        )
    return e, float(scales[4]), ((int(scales[5]), int(scales[6])), float(scales[7]))


def _possible(scales: Array) -> bool:
    """Tell whether scales are such as a map's fit has."""
    _, _, per_d, per_q, _, n, m, smooth = scales
    cells = 2 <= min(n, m) <= max(n, m) <= 60
    return bool(
        np.isfinite(scales).all() and min(per_d, per_q) > 0.0 and cells and 0.0 < smooth < 1.0
    )


def _remedy() -> str:
    return f"remove '{ENERGY}' and '{SCALES}' from the file, and its points are fitted"
