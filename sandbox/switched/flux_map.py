"""A measured flux map as the bench evaluates it: its own code, only the coefficients are the
motor's.

A motor's map is a polynomial of degree 4 in each flux per cell of a uniform grid, H = sum c[a, b]
x^a y^b with x and y from 0 to 1 across the cell.  Here each is expanded once around the middle of
its cell,

    H = sum C[m, n] u^m v^n,  u = x - 1/2, v = y - 1/2,  C = T' c T,  T[a, m] = binomial(a, m) /
    2^(a - m),

and read by Horner's rule: rows along v, then the rows' values and slopes along u (all derivatives:
repeated steps). Beyond the map currents go on with the inductances of its edge.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from model.compiled import inlined, kernel

ORDER = 5  # coefficients in each direction


class FluxMap(NamedTuple):
    """Polynomials around the middles of cells, J, and the grid in Wb of current-induced flux."""

    cells: NDArray[np.float64]  # (n_d, n_q, 5, 5)
    low_d: float
    low_q: float
    high_d: float
    high_q: float
    per_d: float  # cells per Wb
    per_q: float
    stiffness: float  # 1/H along q at zero current, to begin a search with


def flux_map_of(energy: Any) -> FluxMap | None:
    """Return the bench's map of a motor's energy: data alone (cells, low_d, low_q, per_d, per_q,
    gamma_q) are read; None for an energy without cells."""
    if not hasattr(energy, "cells"):
        return None
    cells = np.asarray(energy.cells, dtype=float)
    shift = np.array(
        [
            [math.comb(a, m) * 0.5 ** (a - m) if m <= a else 0.0 for m in range(ORDER)]
            for a in range(ORDER)
        ]
    )
    centred = np.ascontiguousarray(shift.T @ cells @ shift)
    low_d, low_q, per_d, per_q = (
        float(x) for x in (energy.low_d, energy.low_q, energy.per_d, energy.per_q)
    )
    high_d, high_q = low_d + cells.shape[0] / per_d, low_q + cells.shape[1] / per_q
    return FluxMap(centred, low_d, low_q, high_d, high_q, per_d, per_q, float(energy.gamma_q))


@inlined
def place(m, d, q):
    """Return the indices of the cell that holds fluxes (Wb) inside the map, and the way from its
    middle in cells."""
    x, y = (d - m.low_d) * m.per_d, (q - m.low_q) * m.per_q
    i = min(max(math.floor(x), 0), m.cells.shape[0] - 1)
    j = min(max(math.floor(y), 0), m.cells.shape[1] - 1)
    return i, j, x - i - 0.5, y - j - 0.5


@inlined
def row(c, k, v):
    """Return the k-th row's polynomial at v and its slope."""
    c_1, c_2, c_3, c_4 = c[k, 1], c[k, 2], c[k, 3], c[k, 4]
    value = (((c_4 * v + c_3) * v + c_2) * v + c_1) * v + c[k, 0]
    return value, ((4.0 * c_4 * v + 3.0 * c_3) * v + 2.0 * c_2) * v + c_1


@inlined
def slopes_at(c, u, v):
    """Return dH/du and dH/dv of a cell's polynomial."""
    across_0 = row(c, 0, v)[1]
    along_1, across_1 = row(c, 1, v)
    along_2, across_2 = row(c, 2, v)
    along_3, across_3 = row(c, 3, v)
    along_4, across_4 = row(c, 4, v)
    along = ((4.0 * along_4 * u + 3.0 * along_3) * u + 2.0 * along_2) * u + along_1
    return along, (((across_4 * u + across_3) * u + across_2) * u + across_1) * u + across_0


@kernel
def expansion(c, u, v):
    """Return H, dH/du, dH/dv, and the second derivatives uu, uv, vv of a cell's polynomial."""
    h = h_u = half_uu = h_v = h_uv = half_vv = 0.0
    for m in (4, 3, 2, 1, 0):
        value, slope, half_bend = c[m, 4], 0.0, 0.0
        for n in (3, 2, 1, 0):
            half_bend = half_bend * v + slope
            slope = slope * v + value
            value = value * v + c[m, n]
        half_uu = half_uu * u + h_u
        h_u, h_uv = h_u * u + h, h_uv * u + h_v
        h, h_v, half_vv = h * u + value, h_v * u + slope, half_vv * u + half_bend
    return h, h_u, h_v, 2.0 * half_uu, h_uv, 2.0 * half_vv


@kernel
def edge(m, d, q):
    """Return the fluxes (Wb) of the map that are nearest, and how far (Wb) the given ones lie
    beyond."""
    e_d, e_q = min(max(d, m.low_d), m.high_d), min(max(q, m.low_q), m.high_q)
    return e_d, e_q, d - e_d, q - e_q


@inlined
def map_currents(m, d, q):
    """Return i_d, i_q (A) at current-induced fluxes in Wb."""
    if m.low_d <= d <= m.high_d and m.low_q <= q <= m.high_q:
        i, j, u, v = place(m, d, q)
        i_d, i_q = slopes_at(m.cells[i, j], u, v)
        return i_d * m.per_d, i_q * m.per_q
    return beyond(m, d, q)


@kernel
def beyond(m, d, q):
    """Return i_d, i_q (A) at fluxes (Wb) beyond the map: straight on from its edge."""
    e_d, e_q, x, y = edge(m, d, q)
    i, j, u, v = place(m, e_d, e_q)
    _, h_u, h_v, uu, uv, vv = expansion(m.cells[i, j], u, v)
    x, y = x * m.per_d, y * m.per_q
    return (h_u + uu * x + uv * y) * m.per_d, (h_v + uv * x + vv * y) * m.per_q


@inlined
def with_map(m, z, i, turning):
    """Return a current (A) and dH/dtheta (J, `machine.gradient`) with those of a map added, at flux
    z (Wb)."""
    if m is None:
        return i, turning
    i_d, i_q = map_currents(m, z.real, z.imag)
    return i + complex(i_d, i_q), turning + (i_d * z.imag - i_q * z.real)


@kernel
def with_map_stiffness(m, z, a, c):
    """Return a, c of di = a dz + c dz* (1/H) with those of a map added."""
    if m is None:
        return a, c
    dd, dq, qq = map_stiffness(m, z.real, z.imag)
    return a + 0.5 * (dd + qq), c + complex(0.5 * (dd - qq), dq)


@kernel
def map_stiffness(m, d, q):
    """Return the second derivatives dd, dq, qq of H (1/H); beyond the map those of its nearest
    point."""
    e_d, e_q, _, _ = edge(m, d, q)
    i, j, u, v = place(m, e_d, e_q)
    _, _, _, uu, uv, vv = expansion(m.cells[i, j], u, v)
    return uu * m.per_d * m.per_d, uv * m.per_d * m.per_q, vv * m.per_q * m.per_q


@kernel
def map_energy(m, d, q):
    """Return H (J up to the factor 3/2 of the transformation); beyond the map to second order from
    its edge."""
    if m is None:
        return 0.0
    e_d, e_q, x, y = edge(m, d, q)
    i, j, u, v = place(m, e_d, e_q)
    h, h_u, h_v, uu, uv, vv = expansion(m.cells[i, j], u, v)
    x, y = x * m.per_d, y * m.per_q
    return h + h_u * x + h_v * y + 0.5 * (uu * x * x + vv * y * y) + uv * x * y
