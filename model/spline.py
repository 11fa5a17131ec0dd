"""A spline energy: one polynomial of degree 4 in each flux per cell of a uniform grid; kernels on
scalars, SI units.

`model.energy` gives these functions and those of `model.quartic` one name each;
`model.spline_energy` fits one to a flux map.  Three times continuously differentiable, even in the
q flux.
Checked: gradient and Hessian against SciPy's BSpline (tests/model/test_spline_energy.py).
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from model.compiled import inlined, kernel
from model.quartic import OUTSIDE, SOLVED

DEGREE = 4
TOLERANCE = 1e-11  # of 1 A and the current's size
STALLED = 1e-7


class SplineEnergy(NamedTuple):
    """Polynomials of each cell: H = sum c[i, j, a, b] x^a y^b, x and y in [0, 1] across the cell;
    fluxes in Wb.

    Fluxes are total ones as fitted, current-induced ones in a motor
    (`model.spline_energy.centred`), which also knows gamma_d and gamma_q (1/H), the inverse
    inductances at zero current.
    """

    cells: NDArray[np.float64]  # (n_d, n_q, 5, 5), J
    low_d: float
    low_q: float
    per_d: float  # cells per Wb
    per_q: float
    gamma_d: float = math.nan
    gamma_q: float = math.nan


@inlined
def polynomial(p):
    """Return a cell's polynomial as rows of numbers, c[a][b]: what a loop over lanes can hold,
    whatever it writes."""
    return (
        (p[0, 0], p[0, 1], p[0, 2], p[0, 3], p[0, 4]),
        (p[1, 0], p[1, 1], p[1, 2], p[1, 3], p[1, 4]),
        (p[2, 0], p[2, 1], p[2, 2], p[2, 3], p[2, 4]),
        (p[3, 0], p[3, 1], p[3, 2], p[3, 3], p[3, 4]),
        (p[4, 0], p[4, 1], p[4, 2], p[4, 3], p[4, 4]),
    )


@inlined
def locate(m, d, q):
    """Return the polynomial at fluxes in Wb and the place in its cell (outside [0, 1] beyond the
    box alone)."""
    x, y = (d - m.low_d) * m.per_d, (q - m.low_q) * m.per_q
    i = min(max(int(x), 0), m.cells.shape[0] - 1)
    j = min(max(int(y), 0), m.cells.shape[1] - 1)
    return polynomial(m.cells[i, j]), x - i, y - j


@kernel
def nearest(m, d, q):
    """Return the fluxes (Wb) inside the box that are nearest."""
    high_d, high_q = m.low_d + m.cells.shape[0] / m.per_d, m.low_q + m.cells.shape[1] / m.per_q
    return min(max(d, m.low_d), high_d), min(max(q, m.low_q), high_q)


@inlined
def values(c, y):
    """Return the sums over b of c[a][b] y^b, a = 1 to 4."""
    yy = y * y  # pairwise sums: a third less latency than Horner's rule
    r1 = (c[1][0] + c[1][1] * y) + yy * ((c[1][2] + c[1][3] * y) + c[1][4] * yy)
    r2 = (c[2][0] + c[2][1] * y) + yy * ((c[2][2] + c[2][3] * y) + c[2][4] * yy)
    r3 = (c[3][0] + c[3][1] * y) + yy * ((c[3][2] + c[3][3] * y) + c[3][4] * yy)
    r4 = (c[4][0] + c[4][1] * y) + yy * ((c[4][2] + c[4][3] * y) + c[4][4] * yy)
    return r1, r2, r3, r4


@inlined
def slopes(c, y):
    """Return the sums over b of b c[a][b] y^(b-1), a = 0 to 4."""
    y2, y3, y4 = 2.0 * y, 3.0 * y * y, 4.0 * y * (y * y)
    g0 = (c[0][1] + c[0][2] * y2) + (c[0][3] * y3 + c[0][4] * y4)
    g1 = (c[1][1] + c[1][2] * y2) + (c[1][3] * y3 + c[1][4] * y4)
    g2 = (c[2][1] + c[2][2] * y2) + (c[2][3] * y3 + c[2][4] * y4)
    g3 = (c[3][1] + c[3][2] * y2) + (c[3][3] * y3 + c[3][4] * y4)
    g4 = (c[4][1] + c[4][2] * y2) + (c[4][3] * y3 + c[4][4] * y4)
    return g0, g1, g2, g3, g4


@inlined
def bends(c, y):
    """Return the sums over b of b (b-1) c[a][b] y^(b-2), a = 0 to 4."""
    y3, y4 = 6.0 * y, 12.0 * y * y
    k0 = 2.0 * c[0][2] + (c[0][3] * y3 + c[0][4] * y4)
    k1 = 2.0 * c[1][2] + (c[1][3] * y3 + c[1][4] * y4)
    k2 = 2.0 * c[2][2] + (c[2][3] * y3 + c[2][4] * y4)
    k3 = 2.0 * c[3][2] + (c[3][3] * y3 + c[3][4] * y4)
    k4 = 2.0 * c[4][2] + (c[4][3] * y3 + c[4][4] * y4)
    return k0, k1, k2, k3, k4


@kernel
def currents(m, d, q):
    """Return i_d, i_q in A at fluxes in Wb; beyond the box they go on with the inductances of its
    edge."""
    x, y = (d - m.low_d) * m.per_d, (q - m.low_q) * m.per_q
    if 0.0 <= x < m.cells.shape[0] and 0.0 <= y < m.cells.shape[1]:
        i, j = int(x), int(y)
        return gradient(m, polynomial(m.cells[i, j]), x - i, y - j)
    return continued(m, d, q)


@kernel
def continued(m, d, q):
    """Return i_d, i_q in A at fluxes (Wb) beyond the box."""
    e_d, e_q = nearest(m, d, q)
    c, x, y = locate(m, e_d, e_q)
    i_d, i_q = gradient(m, c, x, y)
    dd, dq, qq = hessian_inside(m, e_d, e_q)
    return i_d + dd * (d - e_d) + dq * (q - e_q), i_q + dq * (d - e_d) + qq * (q - e_q)


@inlined
def gradient(m, c, x, y):
    """Return i_d, i_q in A of a cell's polynomial at a place in it."""
    r1, r2, r3, r4 = values(c, y)
    g0, g1, g2, g3, g4 = slopes(c, y)
    xx = x * x
    i_d = (r1 + 2.0 * r2 * x) + xx * (3.0 * r3 + 4.0 * r4 * x)
    i_q = (g0 + g1 * x) + xx * ((g2 + g3 * x) + g4 * xx)
    return i_d * m.per_d, i_q * m.per_q


@kernel
def hessian(m, d, q):
    """Return Gamma_dd, Gamma_dq, Gamma_qq in 1/H at fluxes in Wb; beyond the box those of its
    nearest point."""
    e_d, e_q = nearest(m, d, q)
    return hessian_inside(m, e_d, e_q)


@kernel
def hessians(m, d, q, out):
    """Fill rows (n, 3) with `hessian` at fluxes (n,) in Wb: a call from Python for each takes
    thirty times as long."""
    for k in range(len(d)):
        out[k, 0], out[k, 1], out[k, 2] = hessian(m, d[k], q[k])


@kernel
def hessian_inside(m, d, q):
    """Return Gamma_dd, Gamma_dq, Gamma_qq in 1/H at fluxes (Wb) inside the box."""
    c, x, y = locate(m, d, q)
    return bending(m, c, x, y)


@inlined
def bending(m, c, x, y):
    """Return Gamma_dd, Gamma_dq, Gamma_qq in 1/H of a cell's polynomial at a place in it."""
    _, r2, r3, r4 = values(c, y)
    _, g1, g2, g3, g4 = slopes(c, y)
    k0, k1, k2, k3, k4 = bends(c, y)
    xx = x * x
    dd = 2.0 * r2 + (6.0 * r3 * x + 12.0 * r4 * xx)
    dq = (g1 + 2.0 * g2 * x) + xx * (3.0 * g3 + 4.0 * g4 * x)
    qq = (k0 + k1 * x) + xx * ((k2 + k3 * x) + k4 * xx)
    return dd * m.per_d**2, dq * m.per_d * m.per_q, qq * m.per_q**2


@kernel
def energy(m, d, q):
    """Return H in J, up to the factor 3/2 of the transformation and a constant."""
    c, x, y = locate(m, d, q)
    h = 0.0
    for row in (c[4], c[3], c[2], c[1], c[0]):
        h = h * x + (row[0] + y * (row[1] + y * (row[2] + y * (row[3] + y * row[4]))))
    return h


@kernel
def flux_newton(m, i_d, i_q, d, q):
    """Solve grad H = i inside the box by damped Newton steps from (d, q); return flux and SOLVED or
    OUTSIDE."""
    high_d, high_q = m.low_d + m.cells.shape[0] / m.per_d, m.low_q + m.cells.shape[1] / m.per_q
    d, q = nearest(m, d, q)
    c_d, c_q = currents(m, d, q)
    left, size = math.hypot(i_d - c_d, i_q - c_q), 1.0 + math.hypot(i_d, i_q)
    for _ in range(100):
        if left <= TOLERANCE * size:
            return d, q, SOLVED
        dd, dq, qq = hessian(m, d, q)
        det = dd * qq - dq * dq
        s_d = (qq * (i_d - c_d) - dq * (i_q - c_q)) / det
        s_q = (dd * (i_q - c_q) - dq * (i_d - c_d)) / det
        t = 1.0
        while t > 1e-9:
            x, y = min(max(d + t * s_d, m.low_d), high_d), min(max(q + t * s_q, m.low_q), high_q)
            c_d, c_q = currents(m, x, y)
            new = math.hypot(i_d - c_d, i_q - c_q)
            if new < left:
                break
            t *= 0.5
        else:
            return d, q, SOLVED if left <= STALLED * size else OUTSIDE
        d, q, left = x, y, new
    return d, q, SOLVED if left <= STALLED * size else OUTSIDE
