"""What may be added to a flux map's energy: a basis of spline energies on the map's own cells, or
on parts of them.

Energies of the same degree and smoothness as the map's (`model.spline`), even in the q flux:
whatever is added, the motor keeps an energy, its inductances have no kink, and L_dq = L_qd.
Checked: gradients against differences of the energy, the finer cells against the coarse ones
(tests/model).
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import BSpline

from model.array_types import Array
from model.spline import DEGREE, SplineEnergy


def refined(e: SplineEnergy, d: int, q: int) -> SplineEnergy:
    """Return the same energy on cells that are d and q times as many along the axes."""
    n, m = e.cells.shape[:2]
    cells = np.einsum("sap,tbq,ijpq->isjtab", _parts(d), _parts(q), e.cells).reshape(
        n * d, m * q, *e.cells.shape[2:]
    )
    return e._replace(cells=np.ascontiguousarray(cells), per_d=d * e.per_d, per_q=q * e.per_q)


def _parts(count: int) -> Array:
    """Return for each part of a cell the matrix (count, 5, 5) from the cell's coefficients to the
    part's."""
    out = np.zeros((count, DEGREE + 1, DEGREE + 1))
    for s in range(count):
        for power in range(DEGREE + 1):
            for a in range(power + 1):
                out[s, a, power] = math.comb(power, a) * (s / count) ** (power - a) / count**a
    return out


class Basis(NamedTuple):
    """B-splines over the cells of an energy, n_d along d times `half` along |q|: energies even in
    q, of size 1 J."""

    of: SplineEnergy

    @property
    def half(self) -> int:
        """B-splines along q, each with its mirror."""
        return (self.of.cells.shape[1] + DEGREE + 1) // 2

    @property
    def size(self) -> int:
        """Number of energies."""
        return (self.of.cells.shape[0] + DEGREE) * self.half

    def gradients(self, flux: Array, chosen: NDArray[np.int64]) -> Array:
        """Return the currents (n, c, 2) in A of chosen energies (c,) at fluxes (n, 2) in Wb, of a
        flux beyond the box those of its edge."""
        u, v = np.divmod(chosen, self.half)
        (a, a_1), (b, b_1) = (
            [self._along(axis, flux[:, axis], k) for k in (0, 1)] for axis in (0, 1)
        )
        return np.stack([a_1[:, u] * b[:, v], a[:, u] * b_1[:, v]], axis=2)

    def places(self, axis: int) -> Array:
        """Return fluxes (Wb) of an axis, two in each cell, that tell all energies apart."""
        knots, per = self._axis(axis)
        low, high = knots[DEGREE], knots[-DEGREE - 1]
        return np.linspace(low, high, 2 * round((high - low) * per) + 2 * DEGREE + 1)

    def grid(self) -> Array:
        """Return the fluxes (n, 2) in Wb of all places, along q from 0 on."""
        d, q = self._grid()
        return np.stack([x.ravel() for x in np.meshgrid(d, q, indexing="ij")], axis=1)

    def _grid(self) -> tuple[Array, Array]:
        d, q = (self.places(axis) for axis in (0, 1))
        return d, q[q >= 0.0]

    def sizes(self, energy: Array) -> Array:
        """Return the sizes (size, k) in J of all energies whose sums come nearest to energies
        (n, k) in J on the grid."""
        places = self._grid()
        a, b = (np.linalg.pinv(self._along(axis, places[axis], 0)) for axis in (0, 1))
        on = energy.reshape(len(places[0]), len(places[1]), -1)
        return np.einsum("am,mnk,bn->abk", a, on, b, optimize=True).reshape(self.size, -1)

    def there(self, flux: Array) -> NDArray[np.int64]:
        """Return the energies that are not zero all around fluxes (n, 2): those of their cells."""
        n, m = self.of.cells.shape[:2]
        i = np.clip(np.floor((flux[:, 0] - self.of.low_d) * self.of.per_d).astype(int), 0, n - 1)
        j = np.clip(
            np.floor((np.abs(flux[:, 1]) - self.of.low_q) * self.of.per_q).astype(int), 0, m - 1
        )
        near = np.zeros((n + DEGREE, self.half), dtype=bool)
        for x, y in {*zip(i.tolist(), j.tolist(), strict=True)}:
            own = np.arange(y, y + DEGREE + 1)
            near[x : x + DEGREE + 1, np.minimum(own, m + DEGREE - 1 - own)] = True
        return np.flatnonzero(near)

    def cells(self, sizes: Array) -> Array:
        """Return the cells (n_d, n_q, 5, 5, k) of sums of all energies, sizes (k, size) in J: all
        sums of a cell side by side, as they are asked for together."""
        n, m = self.of.cells.shape[:2]
        full = sizes.reshape(len(sizes), n + DEGREE, self.half) @ self._fold.T
        a, b = (self._taylor(axis, count) for axis, count in ((0, n), (1, m)))
        return np.ascontiguousarray(np.einsum("ian,jbm,knm->ijabk", a, b, full, optimize=True))

    @property
    def _fold(self) -> Array:
        """Matrix from B-splines with their mirrors to those along q."""
        m = self.of.cells.shape[1] + DEGREE
        out = np.zeros((m, self.half))
        out[np.arange(m), np.minimum(np.arange(m), m - 1 - np.arange(m))] = 1.0
        return out

    def _axis(self, axis: int) -> tuple[Array, float]:
        """Return knots (Wb) and cells a Wb of an axis."""
        low, per = (self.of.low_d, self.of.low_q)[axis], (self.of.per_d, self.of.per_q)[axis]
        return low + np.arange(-DEGREE, self.of.cells.shape[axis] + DEGREE + 1) / per, per

    def _along(self, axis: int, x: Array, order: int) -> Array:
        """Return a derivative of an axis' B-splines (n, b) at fluxes x (n,)."""
        knots, _ = self._axis(axis)
        inside = np.clip(x, knots[DEGREE], np.nextafter(knots[-DEGREE - 1], -np.inf))
        values = np.asarray(
            BSpline(knots, np.eye(len(knots) - DEGREE - 1), DEGREE)(inside, nu=order)
        )
        return values @ self._fold if axis == 1 else values

    def _taylor(self, axis: int, cells: int) -> Array:
        """Return coefficients (cell, power, b) of an axis' B-splines about each cell's corner, in
        cells."""
        knots, per = self._axis(axis)
        basis = BSpline(knots, np.eye(len(knots) - DEGREE - 1), DEGREE)
        middle = knots[DEGREE : DEGREE + cells] + 0.5 / per
        at = np.stack(
            [basis(middle, nu=k) / (per**k * math.factorial(k)) for k in range(DEGREE + 1)]
        )
        shift = [
            [math.comb(k, a) * (-0.5) ** (k - a) if k >= a else 0.0 for k in range(DEGREE + 1)]
            for a in range(DEGREE + 1)
        ]
        return np.einsum("ak,kcn->can", np.array(shift), at)


@dataclass(frozen=True)
class MapError:
    """The energy that a map states, on fine cells; energies `modes` (n_d, n_q, 5, 5, k) in J that
    may be added to it, each as large as a size of 1 is likely to be; their sizes x (k,); beyond:
    mean square of current readings, over the noise's, that what is off beside these is likely to
    leave."""

    stated: SplineEnergy
    modes: Array
    x: Array
    beyond: float = 0.0

    def energy(self) -> SplineEnergy:
        """Return the map's energy with what is added."""
        return self.stated._replace(cells=self.stated.cells + self.modes @ self.x)

    @property
    def cells(self) -> tuple[float, float, float, float]:
        """Where its cells begin (Wb), and how many there are a Wb, along d and q."""
        e = self.stated
        return e.low_d, e.low_q, e.per_d, e.per_q

    def moved(self, sizes: Mapping[int, float]) -> MapError:
        """Return the same with some modes of another size."""
        x = self.x.copy()
        x[list(sizes)] = list(sizes.values())
        return replace(self, x=x)
