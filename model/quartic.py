"""The paper's quartic energy (eq. EnerSat) of the current-induced fluxes: kernels on scalars, in SI
units.

`model.energy` gives these functions and those of `model.spline` one name each.
"""

from __future__ import annotations

import math
from typing import NamedTuple

from model.compiled import kernel

SOLVED, OUTSIDE = 0, 1
NEWTON_STEPS = 60
TOLERANCE = 4e-15  # of the current's size: a few roundings of the cubic in (id), (iq)


class Energy(NamedTuple):
    """Coefficients of eq. (EnerSat): gamma = 1/L in 1/H, third order in A/Wb^2, fourth order in
    A/Wb^3."""

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
    i_d = d * (m.gamma_d + d * (3.0 * m.alpha_30 + 4.0 * m.alpha_40 * d)) + qq * (
        m.alpha_12 + 2.0 * m.alpha_22 * d
    )
    i_q = q * (m.gamma_q + 2.0 * d * (m.alpha_12 + m.alpha_22 * d) + 4.0 * m.alpha_04 * qq)
    return i_d, i_q


@kernel
def hessian(m, d, q):
    """Return Gamma_dd, Gamma_dq, Gamma_qq in 1/H: the inverse of the incremental inductance
    matrix."""
    dd = m.gamma_d + d * (6.0 * m.alpha_30 + 12.0 * m.alpha_40 * d) + 2.0 * m.alpha_22 * q * q
    dq = 2.0 * q * (m.alpha_12 + 2.0 * m.alpha_22 * d)
    qq = m.gamma_q + 2.0 * d * (m.alpha_12 + m.alpha_22 * d) + 12.0 * m.alpha_04 * q * q
    return dd, dq, qq


@kernel
def min_eigenvalue(dd, dq, qq):
    """Return the smaller eigenvalue of a symmetric 2x2 matrix."""
    return 0.5 * (dd + qq) - math.sqrt(0.25 * (dd - qq) ** 2 + dq * dq)


@kernel
def convex_between(m, d, q, n_d, n_q):
    """Tell whether H is strictly convex at the quarter points between two fluxes: no step jumps
    over a gap."""
    for k in (0.25, 0.5, 0.75):
        dd, dq, qq = hessian(m, d + k * (n_d - d), q + k * (n_q - q))
        if not min_eigenvalue(dd, dq, qq) > 0.0:
            return False
    return True


@kernel
def flux_newton(m, i_d, i_q, d, q):
    """Solve grad H = i by Newton's method from (d, q), staying where H is strictly convex.

    Returns phi_d, phi_q, status.  Full steps wherever they reduce the residual (so the rate is
    quadratic), halved otherwise; OUTSIDE when no step inside the convex region reduces it.
    """
    dd, dq, qq = hessian(m, d, q)
    if not min_eigenvalue(dd, dq, qq) > 0.0:  # also catches NaN
        d, q = 0.0, 0.0
        dd, dq, qq = hessian(m, d, q)
    c_d, c_q = currents(m, d, q)
    r_d, r_q = i_d - c_d, i_q - c_q
    residual = math.hypot(r_d, r_q)
    # 0 is a current, too
    goal = TOLERANCE * (math.hypot(i_d, i_q) + abs(m.gamma_d * d) + abs(m.gamma_q * q)) + 1e-290
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
            if (
                trial < residual
                and convex_between(m, d, q, n_d, n_q)
                and min_eigenvalue(dd, dq, qq) > 0.0
            ):
                break
            if trial <= 16.0 * goal and trial >= residual:  # stalled at rounding level
                return d, q, SOLVED
            t *= 0.5
            if t < 1e-9:
                return d, q, OUTSIDE
        d, q, residual = n_d, n_q, trial
    return d, q, OUTSIDE
