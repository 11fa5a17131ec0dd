"""The saturated motor as one energy function H of the current-induced fluxes (paper, section II).

phi_d, phi_q are flux linkages due to the currents alone (Wb); the magnet's phi_m adds to the d axis in the
voltage and torque equations.  Currents are the gradient of H, the inverse incremental inductance matrix its
Hessian Gamma (1/H), so L_dq = L_qd by construction.  A function on scalars is compiled; its `.py_func` is plain
arithmetic and takes arrays.

Checked: gradients against automatic differentiation and SymPy, Newton's rate, reciprocity (tests/model).
Not modelled here: hysteresis, iron loss, position dependence.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from model.compiled import kernel
from model.errors import PhysicsError

SOLVED, OUTSIDE = 0, 1
NEWTON_STEPS = 60
TOLERANCE = 4e-15  # of the current's size: a few roundings of the cubic in (id), (iq)


class Energy(NamedTuple):
    """Coefficients of eq. (EnerSat): gamma = 1/L in 1/H, third order in A/Wb^2, fourth order in A/Wb^3."""

    gamma_d: float
    gamma_q: float
    alpha_30: float
    alpha_12: float
    alpha_40: float
    alpha_22: float
    alpha_04: float


@kernel
def energy(m, d, q):
    """Return H(phi_d, phi_q) in J up to the factor 3/2 of the transformation, eq. (EnerSat)."""
    quadratic = 0.5 * (m.gamma_d * d * d + m.gamma_q * q * q)
    cubic = m.alpha_30 * d * d * d + m.alpha_12 * d * q * q
    return quadratic + cubic + m.alpha_40 * d**4 + m.alpha_22 * d * d * q * q + m.alpha_04 * q**4


@kernel
def currents(m, d, q):
    """Return i_d, i_q in A, eqs. (id), (iq)."""
    qq = q * q
    i_d = d * (m.gamma_d + d * (3.0 * m.alpha_30 + 4.0 * m.alpha_40 * d)) + qq * (m.alpha_12 + 2.0 * m.alpha_22 * d)
    i_q = q * (m.gamma_q + 2.0 * d * (m.alpha_12 + m.alpha_22 * d) + 4.0 * m.alpha_04 * qq)
    return i_d, i_q


@kernel
def hessian(m, d, q):
    """Return Gamma_dd, Gamma_dq, Gamma_qq in 1/H: the inverse of the incremental inductance matrix."""
    dd = m.gamma_d + d * (6.0 * m.alpha_30 + 12.0 * m.alpha_40 * d) + 2.0 * m.alpha_22 * q * q
    dq = 2.0 * q * (m.alpha_12 + 2.0 * m.alpha_22 * d)
    qq = m.gamma_q + 2.0 * d * (m.alpha_12 + m.alpha_22 * d) + 12.0 * m.alpha_04 * q * q
    return dd, dq, qq


@kernel
def min_eigenvalue(dd, dq, qq):
    """Return the smaller eigenvalue of a symmetric 2x2 matrix."""
    return 0.5 * (dd + qq) - math.sqrt(0.25 * (dd - qq) ** 2 + dq * dq)


@kernel
def torque(m, d, q, magnet_flux, pole_pairs):
    """Return the air-gap torque in N m, amplitude-invariant: 3/2 p (psi_d i_q - psi_q i_d)."""
    i_d, i_q = currents(m, d, q)
    return 1.5 * pole_pairs * ((d + magnet_flux) * i_q - q * i_d)


@kernel
def convex_between(m, d, q, n_d, n_q):
    """Tell whether H is strictly convex at the quarter points between two fluxes: no step jumps over a gap."""
    for k in (0.25, 0.5, 0.75):
        dd, dq, qq = hessian(m, d + k * (n_d - d), q + k * (n_q - q))
        if not min_eigenvalue(dd, dq, qq) > 0.0:
            return False
    return True


@kernel
def flux_newton(m, i_d, i_q, d, q):
    """Solve grad H = i by Newton's method from (d, q), staying where H is strictly convex.

    Returns phi_d, phi_q, status.  Full steps wherever they reduce the residual (so the rate is quadratic),
    halved otherwise; OUTSIDE when no step inside the convex region reduces it.
    """
    dd, dq, qq = hessian(m, d, q)
    if not min_eigenvalue(dd, dq, qq) > 0.0:  # also catches NaN
        d, q = 0.0, 0.0
        dd, dq, qq = hessian(m, d, q)
    c_d, c_q = currents(m, d, q)
    r_d, r_q = i_d - c_d, i_q - c_q
    residual = math.hypot(r_d, r_q)
    goal = TOLERANCE * (math.hypot(i_d, i_q) + abs(m.gamma_d * d) + abs(m.gamma_q * q)) + 1e-290  # 0 is a current, too
    for _ in range(NEWTON_STEPS):
        if residual <= goal:
            return d, q, SOLVED
        det = dd * qq - dq * dq
        s_d = (qq * r_d - dq * r_q) / det
        s_q = (dd * r_q - dq * r_d) / det
        t = 1.0
        while True:
            n_d, n_q = d + t * s_d, q + t * s_q
            dd, dq, qq = hessian(m, n_d, n_q)
            c_d, c_q = currents(m, n_d, n_q)
            r_d, r_q = i_d - c_d, i_q - c_q
            trial = math.hypot(r_d, r_q)
            if trial < residual and convex_between(m, d, q, n_d, n_q) and min_eigenvalue(dd, dq, qq) > 0.0:
                break
            if trial <= 16.0 * goal and trial >= residual:  # stalled at rounding level
                return d, q, SOLVED
            t *= 0.5
            if t < 1e-9:
                return d, q, OUTSIDE
        d, q, residual = n_d, n_q, trial
    return d, q, OUTSIDE


def is_convex_to(m: Energy, d: ArrayLike, q: ArrayLike, points: int = 65) -> NDArray[np.bool_]:
    """Tell for each flux whether H is strictly convex on the whole straight line from zero flux to it."""
    s = np.linspace(0.0, 1.0, points).reshape((-1,) + (1,) * np.ndim(d))
    dd, dq, qq = hessian.py_func(m, s * np.asarray(d), s * np.asarray(q))
    return np.asarray(np.all((dd + qq > 0) & (dd * qq > dq * dq), axis=0))


def boundary_on_ray(m: Energy, i_d: float, i_q: float) -> tuple[float, float, float]:
    """Return the last valid current and its smallest eigenvalue on the straight line from zero to (i_d, i_q)."""
    low, high, d, q = 0.0, 1.0, 0.0, 0.0
    while high - low > 1e-12:
        middle = 0.5 * (low + high) if high < 1.0 or low > 0.0 else 0.5
        n_d, n_q, status = flux_newton(m, middle * i_d, middle * i_q, d, q)
        if status == SOLVED and is_convex_to(m, n_d, n_q):
            low, d, q = middle, n_d, n_q
        else:
            high = middle
    return low * i_d, low * i_q, float(min_eigenvalue(*hessian(m, d, q)))


def flux_from_current(m: Energy, i_d: ArrayLike, i_q: ArrayLike) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return phi_d, phi_q (Wb, broadcast shape of the currents in A), exact to rounding.

    Raises PhysicsError where H is not strictly convex between zero flux and the solution, naming the point at
    which convexity ends and the eigenvalue there.
    """
    a, b = np.broadcast_arrays(np.asarray(i_d, dtype=float), np.asarray(i_q, dtype=float))
    d, q = np.empty(a.shape), np.empty(a.shape)
    for k in np.ndindex(a.shape):
        x, y, status = flux_newton(m, float(a[k]), float(b[k]), 0.0, 0.0)
        if status != SOLVED or not is_convex_to(m, x, y):
            raise _outside(m, float(a[k]), float(b[k]))
        d[k], q[k] = x, y
    return d, q


def _outside(m: Energy, i_d: float, i_q: float) -> PhysicsError:
    if not (math.isfinite(i_d) and math.isfinite(i_q)):
        return PhysicsError(f"current ({i_d}, {i_q}) A is not finite; give finite currents")
    e_d, e_q, eigenvalue = boundary_on_ray(m, i_d, i_q)
    return PhysicsError(
        f"operating point i_d = {i_d:.4g} A, i_q = {i_q:.4g} A is outside the model's valid domain: going there "
        f"from zero, the energy stops being convex at i_d = {e_d:.4g} A, i_q = {e_q:.4g} A (smallest eigenvalue "
        f"of its Hessian {eigenvalue:.2g} 1/H, must be > 0); stay inside or use another parameter set"
    )


def inductances(
    m: Energy, i_d: ArrayLike, i_q: ArrayLike
) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
    """Return the incremental L_dd, L_dq, L_qq in H at the given currents (A): the inverse Hessian, exact."""
    dd, dq, qq = hessian.py_func(m, *flux_from_current(m, i_d, i_q))
    det = dd * qq - dq * dq
    return qq / det, -dq / det, dd / det


def co_energy(m: Energy, i_d: ArrayLike, i_q: ArrayLike) -> NDArray[np.float64]:
    """Return the Legendre transform phi . i - H (J up to the factor 3/2); its gradient by current is the flux."""
    d, q = flux_from_current(m, i_d, i_q)
    return np.asarray(d * np.asarray(i_d) + q * np.asarray(i_q) - energy.py_func(m, d, q))
