"""The current ripple of a locked motor under a pulsating voltage: the exact periodic solution, and
what is read of it.

  dphi/dt = u_bar + v(t) - R i(phi) - e(i),     i = grad H(phi)       eqs. (dynaved), (dynaveq)

with v any zero-mean voltage of period T held over each sampling interval, e the inverter's voltage
error (threshold times a saturated sign of each phase current).  The paper keeps the term of order
1/Omega, i = i_bar + Gamma (flux ripple); here the periodic solution is found to rounding by
successive substitution, its contraction being about R Gamma T / 2 pi, so every order in 1/Omega is
in it.

A slope S (1/H) is the projection of the sampled current on the sampled flux ripple, the zero-mean
primitive of v on the sampling grid: to first order a column of the Hessian, whatever the waveform.

Checked against the compiled plant, SciPy's Radau and the order of its remainder
(tests/model/test_ripple.py).
"""

from __future__ import annotations

import math

import numpy as np

from model.array_types import Array
from model.compiled import kernel
from model.energy import currents, flux_newton, hessian
from model.frames import phases, rotate, stationary

ROUNDS = 60
TOLERANCE = 1e-12  # of the flux ripple
_ROOT = math.sqrt(0.2)
# Lobatto, in units of an interval
NODES = np.array([0.0, 0.5 - 0.5 * _ROOT, 0.5 + 0.5 * _ROOT, 1.0])


def _integrals() -> Array:
    """Return A with A[j, k] the integral of the k-th Lagrange polynomial from 0 to node j."""
    powers = np.vander(NODES, 4, increasing=True)
    primitives = NODES[:, None] ** np.arange(1, 5) / np.arange(1, 5)
    return np.ascontiguousarray(primitives @ np.linalg.inv(powers))


WEIGHTS = _integrals()


def flux_ripple(v: Array, h: float) -> Array:
    """Return the flux ripple (V s, zero mean over the samples) at the samples of a voltage (N,) or
    (N, 2) in V.

    The voltage is held for h seconds from its sample on; its own mean is removed.
    """
    v = v - v.mean(axis=0)
    psi = np.concatenate([np.zeros_like(v[:1]), np.cumsum(v, axis=0)[:-1]]) * h
    return np.asarray(psi - psi.mean(axis=0))


@kernel
def voltage_error(i_d, i_q, angle, threshold, width):
    """Return the voltage the inverter fails to deliver (V, rotor frame): threshold x saturated sign
    per phase."""
    a, b = rotate(i_d, i_q, angle)
    x, y, z = phases(a, b)
    x = min(max(x / width, -1.0), 1.0)
    y = min(max(y / width, -1.0), 1.0)
    z = min(max(z / width, -1.0), 1.0)
    a, b = stationary(x, y, z)
    a, b = rotate(a, b, -angle)
    return threshold * a, threshold * b


@kernel
def periodic(m, resistance, threshold, width, angle, v, h, delay, mean_d, mean_q, out):
    """Find the periodic solution whose sampled current has a given mean (A); v (N, 2) V in the
    rotor frame.

    `delay` (s): by how much pulses come after the reading that should stand amid their zero vector,
    where current falls by its own voltage drop: what is read is i + delay x Gamma (R i + e).

    Fills out (N, 2) with the sampled current less that mean; returns the mean voltage u_bar (d, q)
    that goes with it, and 0 or 1 (outside the convex domain, or not converged).
    """
    n = v.shape[0]
    x, y, outside = flux_newton(m, mean_d, mean_q, 0.0, 0.0)
    if outside:
        return 0.0, 0.0, 1
    a, b = np.zeros((n, 4)), np.zeros((n, 4))  # flux less (x, y) at the nodes
    r, s = np.zeros((n, 4)), np.zeros((n, 4))  # voltage lost there
    v_d, v_q = v[:, 0].mean(), v[:, 1].mean()
    size = 1e-300
    for k in range(n):
        size += h * (abs(v[k, 0] - v_d) + abs(v[k, 1] - v_q))
    u_d, u_q, goal = 0.0, 0.0, TOLERANCE * size
    for turn in range(ROUNDS):
        u_d = u_q = c_d = c_q = 0.0
        for k in range(n):
            for j in range(4):
                i_d, i_q = currents(m, x + a[k, j], y + b[k, j])
                e_d = e_q = 0.0
                if threshold != 0.0:
                    e_d, e_q = voltage_error(i_d, i_q, angle, threshold, width)
                r[k, j], s[k, j] = resistance * i_d + e_d, resistance * i_q + e_q
                if j == 0:
                    if delay != 0.0:
                        dd, dq, qq = hessian(m, x + a[k, j], y + b[k, j])
                        i_d += delay * (dd * r[k, j] + dq * s[k, j])
                        i_q += delay * (dq * r[k, j] + qq * s[k, j])
                    out[k, 0], out[k, 1] = i_d - mean_d, i_q - mean_q
                    c_d, c_q = c_d + out[k, 0] / n, c_q + out[k, 1] / n
                u_d += WEIGHTS[3, j] * r[k, j] / n
                u_q += WEIGHTS[3, j] * s[k, j] / n
        dd, dq, qq = hessian(m, x, y)
        det = dd * qq - dq * dq
        if not (det > 0.0 and dd + qq > 0.0):
            return u_d, u_q, 1
        x -= (qq * c_d - dq * c_q) / det
        y -= (dd * c_q - dq * c_d) / det
        start_d = start_q = change = centre_d = centre_q = 0.0
        for k in range(n):
            for j in range(4):
                p, q = start_d, start_q
                for i in range(4):
                    p += h * WEIGHTS[j, i] * (v[k, 0] - v_d - (r[k, i] - u_d))
                    q += h * WEIGHTS[j, i] * (v[k, 1] - v_q - (s[k, i] - u_q))
                if j == 0:
                    centre_d, centre_q = centre_d + p / n, centre_q + q / n
                change = max(change, abs(p - a[k, j]) + abs(q - b[k, j]))
                a[k, j], b[k, j] = p, q
            start_d, start_q = a[k, 3], b[k, 3]
        if (
            turn
            and change <= goal
            and abs(c_d) + abs(c_q) <= 1e-13 + 1e-11 * (abs(dd) + abs(qq)) * size
        ):
            return u_d, u_q, 0
        if turn == 0:  # later the flux is measured from the start of the period
            x, y = x - centre_d, y - centre_q
    return u_d, u_q, 2


@kernel
def slopes(current, psi):
    """Return the projections (1/H) of sampled currents (N, 2) in A on a flux ripple (N,) in V s."""
    d = q = square = 0.0
    for k in range(psi.shape[0]):
        d += current[k, 0] * psi[k]
        q += current[k, 1] * psi[k]
        square += psi[k] * psi[k]
    return d / square, q / square
