"""A magnetic energy beyond the quartic: a tensor-product spline of total flux, fitted to a flux
map.

H(psi_d, psi_q) is of degree 4 in each flux on a uniform grid of cells (so three times continuously
differentiable: inductances have no staircase and no kink), even in psi_q, strictly convex on its
whole box.  Currents are its gradient, hence reciprocal; the magnet flux is where the gradient
vanishes.

Fit: linear least squares on grad H(psi) = i, each row weighted by the incremental inductance so
that flux errors count; a light penalty on third differences fills cells without data; convexity is
a set of linear inequalities (curvature along the worst direction at several points a cell), added
until none is violated.

Checked: gradient and Hessian against SciPy's BSpline, planted motors, symmetry, convexity
(tests/model).
"""

from __future__ import annotations

import math
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import ArrayLike
from scipy.interpolate import BSpline
from scipy.linalg import cho_solve, solve_triangular
from scipy.optimize import nnls

from model.array_types import Array
from model.errors import BadInput, PhysicsError
from model.fluxmap import FluxMap
from model.spline import DEGREE, SplineEnergy, flux_newton, hessian

MARGIN = 0.03  # of the flux range: the box reaches beyond the data
FLOOR = 0.1  # of the smallest curvature in the data: least curvature anywhere in the box
Choice = tuple[tuple[int, int], float]  # number of cells along d and along |q|, smoothness
CHOICES: list[Choice] = [
    (c, s)
    for c in ((10, 8), (14, 12), (20, 16), (28, 16), (40, 16))
    for s in (1e-4, 3e-4, 1e-3, 3e-3)
]
FOLDS = 5
TOLERATED = 1.2  # of the least squared error: the smoothest choice within it is taken
SECOND = ((2, 0), (1, 1), (0, 2))  # orders of the second derivatives
ROUNDS = 60
MOST_BYTES = 0.95e9  # of a fit: 30 x 30 cells on 40 x 40 points, 20 x 16 cells on 19 000 points
# numbers kept for each unknown by a point and by a cell; a test measures them
AT_POINTS, AT_CELLS = 13, 110
# inequalities kept: more than twice what any measured map needed; beyond, a fit has no end
MOST_PLANES = 800


def flux_from_current(m: SplineEnergy, i_d: ArrayLike, i_q: ArrayLike) -> tuple[Array, Array]:
    """Return total psi_d, psi_q (Wb) at currents (A); PhysicsError names a current whose flux is
    outside the box."""
    a, b = np.broadcast_arrays(np.asarray(i_d, dtype=float), np.asarray(i_q, dtype=float))
    d, q = np.empty(a.shape), np.empty(a.shape)
    middle = m.low_d + 0.5 * m.cells.shape[0] / m.per_d
    for k in np.ndindex(a.shape):
        d[k], q[k], outside = flux_newton(m, float(a[k]), float(b[k]), middle, 0.0)
        if outside:
            raise PhysicsError(
                f"current i_d = {a[k]:.4g} A, i_q = {b[k]:.4g} A lies outside the flux map (psi_d "
                f"in {m.low_d:.3g} to {m.low_d + m.cells.shape[0] / m.per_d:.3g} Wb, |psi_q| up to "
                f"{-m.low_q:.3g} Wb); stay inside it"
            )
    return d, q


def magnet_flux(m: SplineEnergy) -> float:
    """Return the flux at zero current, Wb."""
    return float(flux_from_current(m, 0.0, 0.0)[0])


def centred(m: SplineEnergy) -> tuple[SplineEnergy, float]:
    """Return the energy of the current-induced fluxes, as a motor has it, and the magnet flux (Wb)
    taken off."""
    magnet = magnet_flux(m)
    gamma_d, _, gamma_q = hessian(m, magnet, 0.0)
    return m._replace(
        low_d=m.low_d - magnet, gamma_d=float(gamma_d), gamma_q=float(gamma_q)
    ), magnet


def inductances(m: SplineEnergy, i_d: ArrayLike, i_q: ArrayLike) -> tuple[Array, Array, Array]:
    """Return the incremental L_dd, L_dq, L_qq (H) at currents (A)."""
    g = np.array(
        [
            hessian(m, float(x), float(y))
            for x, y in zip(*map(np.ravel, flux_from_current(m, i_d, i_q)), strict=True)
        ]
    )
    det = g[:, 0] * g[:, 2] - g[:, 1] ** 2
    shape = np.broadcast(i_d, i_q).shape
    return (
        (g[:, 2] / det).reshape(shape),
        (-g[:, 1] / det).reshape(shape),
        (g[:, 0] / det).reshape(shape),
    )


def fit(
    psi_d: Array,
    psi_q: Array,
    i_d: Array,
    i_q: Array,
    cells: tuple[int, int] = (14, 12),
    smooth: float = 1e-3,
) -> SplineEnergy:
    """Fit a strictly convex spline energy, even in psi_q, to points of a flux map (all shape (n,),
    Wb and A).

    `cells`: number along d and along |q|; `smooth`: weight of a cell's bend against a data point.
    Raises PhysicsError if no convex energy is found.
    """
    if len(psi_d) < 12 or np.ptp(i_d) == 0 or np.ptp(i_q) == 0:
        raise BadInput(
            f"{len(psi_d)} points of a flux map do not span both axes; give a map over i_d and i_q"
        )
    box = Box(psi_d, psi_q, cells)
    needed = bytes_taken(box, len(psi_d))
    if needed > MOST_BYTES:
        raise BadInput(
            f"{cells[0]} x {cells[1]} cells on {len(psi_d)} points of a flux map take "
            f"{needed / 1e9:.1f} GB; at most "
            f"{MOST_BYTES / 1e9:g} are used: take fewer cells, or every second line of the map"
        )
    grad_d, grad_q = box.rows(psi_d, psi_q, 1, 0), box.rows(psi_d, psi_q, 0, 1)
    points = box.check_points()
    curvature = [box.rows(*points, *order) for order in SECOND]
    at_data = [box.rows(psi_d, psi_q, *order) for order in SECOND]
    linear = np.polyfit(psi_d, i_d, 1)[0], float(psi_q @ i_q / (psi_q @ psi_q))
    weight = np.tile(np.array([1 / linear[0], 0.0, 1 / linear[1]]), (len(psi_d), 1))
    if not min(linear) > 0.0:
        raise BadInput(
            "currents of a flux map do not rise with the fluxes; check its units, signs "
            "and magnet axis"
        )
    lowest = FLOOR * min(linear)
    c: Array | None = None
    for _ in range(4):  # the weights depend on the solution
        rows = np.concatenate(
            [
                weight[:, :1] * grad_d + weight[:, 1:2] * grad_q,
                weight[:, 1:2] * grad_d + weight[:, 2:] * grad_q,
            ]
        )
        goal = np.concatenate(
            [weight[:, 0] * i_d + weight[:, 1] * i_q, weight[:, 1] * i_d + weight[:, 2] * i_q]
        )
        size = float(np.sqrt(np.mean(goal**2)))
        rough = smooth / size * box.roughness(c, lowest, linear) * len(goal) ** 0.5
        c = _convex_least_squares(
            np.concatenate([rows / size, rough]), goal / size, box, curvature, lowest
        )
        g = [r @ c for r in at_data]
        det = g[0] * g[2] - g[1] ** 2
        weight = np.column_stack([g[2] / det, -g[1] / det, g[0] / det])
    assert c is not None
    return box.spline(c)


def fit_map(m: FluxMap) -> SplineEnergy:
    """Fit a map with cells and smoothness chosen by cross-validation."""
    return fit(*m.points(), *choose_for_map(m))


def choose_for_map(m: FluxMap) -> Choice:
    """Return cells and smoothness chosen by cross-validation over FOLDS groups of a map's inner
    points."""
    data = m.points()
    a, b = np.meshgrid(np.arange(len(m.i_d)), np.arange(len(m.i_q)), indexing="ij")
    # always fitted: the box must hold the rest
    border = (a == 0) | (b == 0) | (a == a[-1, 0]) | (b == b[0, -1])
    group = np.where(border, -1, (a + 2 * b) % FOLDS).ravel()
    errors: list[float] = []
    choices = affordable(data[0], data[1])
    for cells, smooth in choices:
        # beyond it a choice is not taken: no more folds
        error, most = 0.0, TOLERATED * min(errors, default=np.inf)
        for fold in range(FOLDS):
            out = group == fold
            try:
                kept = [x[~out] for x in data]
                s = fit(kept[0], kept[1], kept[2], kept[3], cells, smooth)
                d, q = flux_from_current(s, data[2][out], data[3][out])
                error += float(np.sum((d - data[0][out]) ** 2 + (q - data[1][out]) ** 2))
            except PhysicsError:  # this choice does not reach every point of the map
                error = np.inf
            if error > most:
                break
        errors.append(error)
    good = [k for k, e in enumerate(errors) if e <= TOLERATED * min(errors)]
    return choices[max(good, key=lambda k: (choices[k][1], -choices[k][0][0]))]


def affordable(psi_d: Array, psi_q: Array) -> list[Choice]:
    """Return the choices of cells and smoothness whose fit to so many points takes no more memory
    than is used; psi_d, psi_q: (n,) Wb."""
    return [c for c in CHOICES if bytes_taken(Box(psi_d, psi_q, c[0]), len(psi_d)) <= MOST_BYTES]


def bytes_taken(box: Box, points: int) -> float:
    """Return what a fit takes."""
    return 8.0 * box.unknowns * (AT_POINTS * points + AT_CELLS * box.n_d * box.n_q / 2)


class Box:
    """The cells over the data, and the map from free coefficients (even in q) to values and
    derivatives."""

    def __init__(self, psi_d: Array, psi_q: Array, cells: tuple[int, int]) -> None:
        self.n_d, self.n_q = cells[0], 2 * cells[1]
        low, high = float(np.min(psi_d)), float(np.max(psi_d))
        self.low_d, self.high_d = low - MARGIN * (high - low), high + MARGIN * (high - low)
        self.high_q = float(np.max(np.abs(psi_q))) * (1 + MARGIN)
        self.knots_d = self.low_d + (self.high_d - self.low_d) / self.n_d * np.arange(
            -DEGREE, self.n_d + DEGREE + 1
        )
        self.knots_q = self.high_q * (2 / self.n_q * np.arange(-DEGREE, self.n_q + DEGREE + 1) - 1)
        m_q = self.n_q + DEGREE
        self.half = (m_q + 1) // 2
        # even in q: coefficient j equals coefficient m_q - 1 - j
        self.fold = np.zeros((m_q, self.half))
        for j in range(m_q):
            self.fold[j, min(j, m_q - 1 - j)] = 1.0
        self.unknowns = (self.n_d + DEGREE) * self.half

    def _basis(self, knots: Any, x: Any, order: int) -> Array:
        b = BSpline(knots, np.eye(len(knots) - DEGREE - 1), DEGREE)
        return np.asarray(b(x, nu=order))

    def rows(self, d: Array, q: Array, order_d: int, order_q: int) -> Array:
        """Return the matrix (points, unknowns) of a mixed derivative of H."""
        a = self._basis(self.knots_d, d, order_d)
        b = self._basis(self.knots_q, q, order_q) @ self.fold
        return np.asarray(np.einsum("pi,pj->pij", a, b).reshape(len(d), -1))

    def check_points(self) -> tuple[Array, Array]:
        """Return the points of the box (upper half) at which convexity is imposed."""
        d = np.linspace(self.low_d, self.high_d, 3 * self.n_d + 1)
        q = np.linspace(0.0, self.high_q, 3 * self.n_q // 2 + 1)
        x, y = np.meshgrid(d, q, indexing="ij")
        return x.ravel(), y.ravel()

    @cached_property
    def differences(self) -> tuple[Array, Array, Array]:
        """Third differences of H along d, along q, and mixed, by the free coefficients; not yet
        weighted."""
        m_d, m_q = self.n_d + DEGREE, self.n_q + DEGREE
        along_d = np.kron(np.diff(np.eye(m_d), 3, axis=0), self.fold)
        along_q = np.kron(np.eye(m_d), np.diff(np.eye(m_q), 3, axis=0) @ self.fold)
        mixed = np.kron(
            np.diff(np.eye(m_d), 2, axis=0), np.diff(np.eye(m_q), 2, axis=0) @ self.fold
        )
        return np.asarray(along_d), np.asarray(along_q), np.asarray(mixed)

    @cached_property
    def at_coefficients(self) -> tuple[Array, Array]:
        """Matrices of H_dd and H_qq where each coefficient counts most (inside the box)."""
        m_d, m_q = self.n_d + DEGREE, self.n_q + DEGREE
        step_d, step_q = self.knots_d[1] - self.knots_d[0], self.knots_q[1] - self.knots_q[0]
        x = np.clip(
            self.low_d + step_d * (np.arange(m_d) + 0.5 - 0.5 * DEGREE), self.low_d, self.high_d
        )
        y = np.clip(step_q * (np.arange(m_q) + 0.5 - 0.5 * m_q), -self.high_q, self.high_q)
        a, b = (z.ravel() for z in np.meshgrid(x, y, indexing="ij"))
        return self.rows(a, b, 2, 0), self.rows(a, b, 0, 2)

    def roughness(self, c: Array | None, lowest: float, start: tuple[float, float]) -> Array:
        """Return the third differences of H along both axes as flux errors (Wb), by the free
        coefficients.

        A bend of the current over one cell counts by the inductance there, as data do; `c`: the
        solution so far.
        """
        m_d, m_q = self.n_d + DEGREE, self.n_q + DEGREE
        step_d, step_q = self.knots_d[1] - self.knots_d[0], self.knots_q[1] - self.knots_q[0]
        l_d, l_q = np.full((m_d, m_q), 1 / start[0]), np.full((m_d, m_q), 1 / start[1])
        if c is not None:
            l_d, l_q = (
                (1 / np.maximum(rows @ c, lowest)).reshape(m_d, m_q)
                for rows in self.at_coefficients
            )
        along_d, along_q, mixed = self.differences
        along_d = along_d * (l_d[1:-2].ravel() / step_d)[:, None]
        along_q = along_q * (l_q[:, 1:-2].ravel() / step_q)[:, None]
        mixed = mixed * (np.sqrt(l_d * l_q)[1:-1, 1:-1].ravel() / np.sqrt(step_d * step_q))[:, None]
        return np.concatenate([along_d, along_q, mixed])

    def spline(self, c: Array) -> SplineEnergy:
        """Return the cells' polynomials, by Taylor series at each cell's corner."""
        full = c.reshape(self.n_d + DEGREE, self.half) @ self.fold.T
        corner_d, corner_q = (
            self.knots_d[DEGREE : DEGREE + self.n_d],
            self.knots_q[DEGREE : DEGREE + self.n_q],
        )
        step_d, step_q = self.knots_d[1] - self.knots_d[0], self.knots_q[1] - self.knots_q[0]

        def taylor(knots: Any, corner: Any, step: float) -> Array:
            """Return coefficients (power, cell, spline) of an axis' splines, in steps from each
            cell's corner."""
            # derivatives at the middle, shifted: safe from the corner's side
            inside = corner + 0.5 * step
            at = [
                self._basis(knots, inside, k) * step**k / math.factorial(k)
                for k in range(DEGREE + 1)
            ]
            shift = [
                [math.comb(k, a) * (-0.5) ** (k - a) if k >= a else 0.0 for k in range(DEGREE + 1)]
                for a in range(DEGREE + 1)
            ]
            return np.einsum("ak,kcn->can", np.array(shift), np.array(at))

        a = taylor(self.knots_d, corner_d, float(step_d))
        b = taylor(self.knots_q, corner_q, float(step_q))
        cells = np.einsum("ian,jbm,nm->ijab", a, b, full)
        return SplineEnergy(
            np.ascontiguousarray(cells),
            self.low_d,
            -self.high_q,
            1 / float(step_d),
            1 / float(step_q),
        )


def _convex_least_squares(
    rows: Array, goal: Array, box: Box, curvature: list[Array], lowest: float
) -> Array:
    """Return coefficients of least squares whose Hessian's smaller eigenvalue is at least `lowest`
    at every point.

    Cutting planes: where the eigenvalue is too small, its eigenvector's curvature becomes a linear
    inequality; each quadratic programme is a least-distance problem solved by NNLS (Lawson and
    Hanson, ch. 23).
    """
    span = (box.high_d - box.low_d, 2 * box.high_q)
    dd, dq, qq = (
        curvature[0] * span[0] ** 2,
        curvature[1] * span[0] * span[1],
        curvature[2] * span[1] ** 2,
    )
    least = lowest * min(span) ** 2
    normal = rows.T @ rows
    normal += 1e-13 * np.trace(normal) / box.unknowns * np.eye(box.unknowns)
    low = np.linalg.cholesky(normal)
    best = c = cho_solve((low, True), rows[: len(goal)].T @ goal)
    planes = np.zeros((0, box.unknowns))
    for _ in range(ROUNDS):
        a, b, d = dd @ c, dq @ c, qq @ c
        smallest = 0.5 * (a + d) - np.sqrt(0.25 * (a - d) ** 2 + b**2)
        short = np.flatnonzero(smallest < 0.5 * least)
        if short.size == 0:
            return c
        # of the smaller eigenvalue
        angle = 0.5 * np.arctan2(2 * b[short], a[short] - d[short]) + 0.5 * np.pi
        cos, sin = np.cos(angle)[:, None], np.sin(angle)[:, None]
        new = dd[short] * cos**2 + 2 * dq[short] * cos * sin + qq[short] * sin**2
        planes = np.concatenate([planes, new])
        if len(planes) > MOST_PLANES:
            break
        g = solve_triangular(low, planes.T, lower=True)
        h = least - planes @ best
        size = np.linalg.norm(g, axis=0)
        e = np.vstack([g / size, h / size])
        dual, _ = nnls(e, np.append(np.zeros(box.unknowns), 1.0), maxiter=30 * e.shape[1])
        r = e @ dual
        r[-1] -= 1.0
        c = best + solve_triangular(low.T, -r[:-1] / r[-1], lower=False)
        keep = (dual > 0) | (np.arange(len(dual)) >= len(dual) - len(new))
        planes = planes[keep]
    raise PhysicsError(
        f"no strictly convex spline energy found for this map ({len(short)} places where its "
        f"smallest curvature, {float(smallest.min()):.2g}, should be {least:.2g}); use fewer "
        "cells, check the magnet's axis, or remove points that contradict each other"
    )
