"""How near can any reciprocal, any passive motor model come to a flux map?  The least change that
makes it one.

Reciprocal: the flux's circulation around every cell of the grid vanishes (trapezoid rule; psi_d
di_d + psi_q di_q is then the differential of a co-energy).  Passive: flux does not fall along any
step to a neighbour, diagonals included. Both are necessary conditions, so the least change (least
squares; ADMM for the inequalities) bounds from below the error that an energy model leaves over all
points, however flexible it is and however it is fitted.
"""

from __future__ import annotations

import numpy as np
from scipy.sparse import csr_matrix, diags, eye, hstack, kron, vstack
from scipy.sparse.linalg import splu

from experiments.drawing import save, shared
from experiments.flux_maps import MAPS
from model.fluxmap import FluxMap, read_map

ROUNDS, PENALTY = 4000, 3.0


def _step(n: int) -> csr_matrix:
    return diags([-np.ones(n - 1), np.ones(n - 1)], [0, 1], shape=(n - 1, n)).tocsr()


def _mean(n: int) -> csr_matrix:
    return abs(_step(n)) * 0.5


def circulations(m: FluxMap) -> csr_matrix:
    """Return the matrix that gives each cell's circulation (J) from the fluxes (psi_d, then
    psi_q)."""
    n, k = m.psi_d.shape
    along_d = kron(diags(np.diff(m.i_d)) @ _mean(n), -_step(k))
    along_q = kron(_step(n), diags(np.diff(m.i_q)) @ _mean(k))
    return hstack([along_d, along_q]).tocsr()


def rises(m: FluxMap) -> csr_matrix:
    """Return the matrix that gives the rise of flux along every step to a neighbour, Wb."""
    n, k = m.psi_d.shape
    a, b = np.median(np.diff(m.i_d)), np.median(np.diff(m.i_q))
    zero = csr_matrix((n * k, n * k))
    d, q = kron(_step(n), eye(k)), kron(eye(n), _step(k))
    rows = [hstack([d, zero[: d.shape[0]]]), hstack([zero[: q.shape[0]], q])]
    first, last = eye(n, format="csr"), eye(k, format="csr")
    for sign in (1, -1):
        here, there = (last[:-1], last[1:]) if sign > 0 else (last[1:], last[:-1])
        across = kron(first[1:], there) - kron(first[:-1], here)
        rows.append(hstack([a * across, sign * b * across]) / np.hypot(a, b))
    return vstack(rows).tocsr()


def least_change(m: FluxMap, passive: bool) -> np.ndarray:
    """Return the smallest change (2, n, k) of the fluxes, Wb, that makes the map reciprocal (and
    passive)."""
    psi = np.concatenate([m.psi_d.ravel(), m.psi_q.ravel()])
    c, r = circulations(m), rises(m)
    weight = PENALTY if passive else 0.0
    c = diags(1.0 / np.sqrt(np.asarray(c.multiply(c).sum(axis=1)).ravel())) @ c
    kkt = vstack(
        [hstack([eye(psi.size) + weight * r.T @ r, c.T]), hstack([c, -1e-12 * eye(c.shape[0])])],
        format="csc",
    )
    solver, goal = splu(kkt), -(c @ psi)
    slack, dual = np.zeros(r.shape[0]), np.zeros(r.shape[0])
    change = np.zeros(psi.size)
    for _ in range(ROUNDS if passive else 1):
        aim = weight * (r.T @ (slack - dual - r @ psi))
        change = solver.solve(np.concatenate([aim, goal]))[: psi.size]
        level = r @ (psi + change)
        slack = np.maximum(level + dual, 0.0)
        dual += level - slack
    return change.reshape(2, *m.psi_d.shape)


def main() -> None:
    """Write the bounds of every map, as shares of rated flux."""
    folder, numbers = shared("SENSORLESS_DATA", "realdata"), {}
    for name, (file, axis, pairs, rated) in MAPS.items():
        m = read_map(folder / file, axis)
        x, y = np.meshgrid(m.i_d, m.i_q, indexing="ij")
        torque = np.where(
            np.abs(np.hypot(x, y) / rated - 1) < 0.06, pairs * (m.psi_d * y - m.psi_q * x), -np.inf
        )
        flux = float(np.hypot(m.psi_d, m.psi_q).flat[np.argmax(torque)])
        near = np.hypot(x, y) < 0.25 * rated
        numbers[name] = {
            "rated_flux": flux,
            "points": x.size,
            "points_within_a_quarter": int(near.sum()),
        }
        for what, passive in (("reciprocal", False), ("reciprocal_and_passive", True)):
            change = least_change(m, passive)
            size = np.hypot(*change) / flux
            fallen = float(np.min(rises(m) @ (np.array([m.psi_d, m.psi_q]) + change).ravel()))
            numbers[name][what] = {
                "flux_rms": float(np.sqrt(np.mean(size**2))),
                "within_a_quarter": float(np.sqrt(np.mean(size[near] ** 2))),
                "share_of_squares_within_a_quarter": float(
                    np.sum(size[near] ** 2) / np.sum(size**2)
                ),
                "deepest_fall_left": min(fallen, 0.0) / flux,
            }
        print(name, numbers[name])
    save("flux_map_bounds", {"maps": numbers})


if __name__ == "__main__":
    main()
