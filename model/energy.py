"""The saturated motor as one energy function H of the current-induced fluxes (paper, section II).

phi_d, phi_q are flux linkages due to the currents alone (Wb); the magnet's phi_m adds to the d axis
in the voltage and torque equations.  Currents are the gradient of H, the inverse incremental
inductance matrix its Hessian Gamma (1/H), so L_dq = L_qd by construction.  H is the paper's quartic
(`model.quartic`) or a spline fitted to a flux map (`model.spline`): each function below takes
either, numba picks by the type of m when it compiles, and gamma_d, gamma_q of either are the
inverse inductances at zero current.  A function on scalars is compiled; its `.py_func` takes
arrays.

Checked: gradients against automatic differentiation and SymPy, Newton's rate, reciprocity
(tests/model).
Not modelled here: hysteresis, iron loss, position dependence.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from importlib import import_module
from typing import Any

import numpy as np
from numba.extending import overload
from numpy.typing import ArrayLike, NDArray

from model.compiled import inlined, kernel
from model.errors import PhysicsError
from model.quartic import OUTSIDE, SOLVED, Energy, convex_between, min_eigenvalue
from model.spline import SplineEnergy, hessians

__all__ = ["OUTSIDE", "SOLVED", "Energy", "SplineEnergy", "convex_between", "min_eigenvalue"]
AnyEnergy = Energy | SplineEnergy
AT_ONCE = 1000  # lines from zero looked at together, so that memory stays small


def _either(name: str) -> Callable[..., Any]:
    """Return a function (m, x, ...) that is `name` of `model.quartic` or of `model.spline`, by the
    type of m."""
    of_quartic, of_spline = (
        getattr(import_module(f"model.{kind}"), name) for kind in ("quartic", "spline")
    )

    def interpreted(m, *rest):
        """Do it outside kernels, on scalars or arrays of one shape."""
        if not isinstance(m, SplineEnergy):
            return of_quartic.py_func(m, *rest)
        grid = np.broadcast_arrays(*rest)
        if name == "hessian":  # asked along lines, at thousands of places
            out = np.empty((grid[0].size, 3))
            hessians(m, *(np.array(x, dtype=float).ravel() for x in grid), out)
        else:
            out = np.array(
                [of_spline(m, *map(float, at)) for at in zip(*(x.flat for x in grid), strict=True)]
            )
        return (
            tuple(out.T.reshape(-1, *grid[0].shape)) if out.ndim > 1 else out.reshape(grid[0].shape)
        )

    def choose(m, *rest):
        """Give a kernel the one that fits the type of m, while it is compiled."""
        return (of_spline if m.instance_class is SplineEnergy else of_quartic).py_func

    overload(interpreted, strict=False, jit_options={"error_model": "numpy", "nogil": True})(choose)
    return interpreted


_energy, _currents, _hessian = _either("energy"), _either("currents"), _either("hessian")
_flux_newton = _either("flux_newton")


@kernel
def energy(m, d, q):
    """Return H(phi_d, phi_q) in J up to the factor 3/2 of the transformation, eq. (EnerSat)."""
    return _energy(m, d, q)


@inlined
def currents(m, d, q):
    """Return i_d, i_q in A, eqs. (id), (iq)."""
    return _currents(m, d, q)


@inlined
def hessian(m, d, q):
    """Return Gamma_dd, Gamma_dq, Gamma_qq in 1/H: the inverse of the incremental inductance
    matrix."""
    return _hessian(m, d, q)


@kernel
def flux_newton(m, i_d, i_q, d, q):
    """Solve grad H = i by Newton's method from (d, q), staying where H is strictly convex.

    Returns phi_d, phi_q and SOLVED or OUTSIDE.
    """
    return _flux_newton(m, i_d, i_q, d, q)


@kernel
def torque(m, d, q, magnet_flux, pole_pairs):
    """Return the air-gap torque in N m, amplitude-invariant: 3/2 p (psi_d i_q - psi_q i_d)."""
    i_d, i_q = _currents(m, d, q)
    return 1.5 * pole_pairs * ((d + magnet_flux) * i_q - q * i_d)


def is_convex_to(m: AnyEnergy, d: ArrayLike, q: ArrayLike, points: int = 65) -> NDArray[np.bool_]:
    """Tell for each flux whether H is strictly convex on the whole straight line from zero flux to
    it; d, q: Wb, of one shape."""
    s = np.linspace(0.0, 1.0, points).reshape((-1,) + (1,) * np.ndim(d))
    dd, dq, qq = hessian.py_func(m, s * np.asarray(d), s * np.asarray(q))
    return np.asarray(np.all((dd + qq > 0) & (dd * qq > dq * dq), axis=0))


def boundary_on_ray(m: AnyEnergy, i_d: float, i_q: float) -> tuple[float, float, float]:
    """Return the last valid current and its smallest eigenvalue on the straight line from zero to
    (i_d, i_q)."""
    low, high, d, q = 0.0, 1.0, 0.0, 0.0
    while high - low > 1e-12:
        middle = 0.5 * (low + high) if high < 1.0 or low > 0.0 else 0.5
        n_d, n_q, status = flux_newton(m, middle * i_d, middle * i_q, d, q)
        if status == SOLVED and is_convex_to(m, n_d, n_q):
            low, d, q = middle, n_d, n_q
        else:
            high = middle
    return low * i_d, low * i_q, float(min_eigenvalue(*hessian(m, d, q)))


def flux_from_current(
    m: AnyEnergy, i_d: ArrayLike, i_q: ArrayLike
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return phi_d, phi_q (Wb, broadcast shape of the currents in A), exact to rounding.

    Raises PhysicsError where H is not strictly convex between zero flux and the solution, naming
    the point at which convexity ends and the eigenvalue there.
    """
    d, q = flux_or_nan(m, i_d, i_q)
    if np.isnan(d).any():
        a, b = np.broadcast_arrays(np.asarray(i_d, dtype=float), np.asarray(i_q, dtype=float))
        first = np.unravel_index(np.argmax(np.isnan(d)), a.shape)
        raise _outside(m, float(a[first]), float(b[first]))
    return d, q


def flux_or_nan(
    m: AnyEnergy, i_d: ArrayLike, i_q: ArrayLike
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return the same, not a number where `flux_from_current` raises."""
    a, b = np.broadcast_arrays(np.asarray(i_d, dtype=float), np.asarray(i_q, dtype=float))
    d, q, inside = np.empty(a.shape), np.empty(a.shape), np.empty(a.shape, dtype=bool)
    for at in np.ndindex(a.shape):
        d[at], q[at], status = flux_newton(m, float(a[at]), float(b[at]), 0.0, 0.0)
        inside[at] = status == SOLVED
    solved = np.flatnonzero(inside)
    for k in range(0, len(solved), AT_ONCE):
        some = solved[k : k + AT_ONCE]
        inside.flat[some] = is_convex_to(m, d.flat[some], q.flat[some])
    d[~inside] = q[~inside] = np.nan
    return d, q


def _outside(m: AnyEnergy, i_d: float, i_q: float) -> PhysicsError:
    if not (math.isfinite(i_d) and math.isfinite(i_q)):
        return PhysicsError(f"current ({i_d}, {i_q}) A is not finite; give finite currents")
    e_d, e_q, eigenvalue = boundary_on_ray(m, i_d, i_q)
    if isinstance(m, SplineEnergy):
        return PhysicsError(
            f"operating point i_d = {i_d:.4g} A, i_q = {i_q:.4g} A is outside the motor's flux "
            f"map: going there from zero, the map ends at i_d = {e_d:.4g} A, i_q = {e_q:.4g} A; "
            "stay inside or give a larger map"
        )
    return PhysicsError(
        f"operating point i_d = {i_d:.4g} A, i_q = {i_q:.4g} A is outside the model's valid "
        f"domain: going there from zero, the energy stops being convex at i_d = {e_d:.4g} A, i_q = "
        f"{e_q:.4g} A (smallest eigenvalue of its Hessian {eigenvalue:.2g} 1/H, must be > 0); stay "
        "inside or use another parameter set"
    )


def inductances(
    m: AnyEnergy, i_d: ArrayLike, i_q: ArrayLike
) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
    """Return the incremental L_dd, L_dq, L_qq in H at the given currents (A): the inverse Hessian,
    exact."""
    dd, dq, qq = hessian.py_func(m, *flux_from_current(m, i_d, i_q))
    det = dd * qq - dq * dq
    return qq / det, -dq / det, dd / det
