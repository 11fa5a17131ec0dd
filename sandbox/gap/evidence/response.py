"""The currents that small voltages on top of a recording's own would add: the reverse of
`voltage`."""

from __future__ import annotations

import numpy as np

from model.compiled import kernel
from model.energy import flux_newton, hessian


@kernel
def added_current(m, resistance, period, current, theta, voltage):
    """Return currents (n, c, 2) in A that c small voltages (n, c, 2) in V would add at operating
    points current (n, 2).

    All in the rotor's frame, theta (n,) its angle in rad; a voltage goes linearly from sample to
    sample.  The flux that they link decays with R times the incremental inductances' inverse,
    implicitly, so that no period is too long.
    """
    n, c, _ = voltage.shape
    out = np.empty((n, c, 2))
    psi = np.zeros((c, 2))
    d = q = 0.0
    for k in range(n):
        d, q, _ = flux_newton(m, current[k, 0], current[k, 1], d, q)
        g_dd, g_dq, g_qq = hessian(m, d, q)
        if k > 0:
            turn = theta[k] - theta[k - 1]
            co, si = np.cos(turn), np.sin(turn)
            h = resistance * period
            det = (1.0 + h * g_dd) * (1.0 + h * g_qq) - (h * g_dq) ** 2
            for j in range(c):
                x, y = (
                    psi[j, 0] + 0.5 * period * voltage[k - 1, j, 0],
                    psi[j, 1] + 0.5 * period * voltage[k - 1, j, 1],
                )
                x, y = (
                    co * x + si * y + 0.5 * period * voltage[k, j, 0],
                    co * y - si * x + 0.5 * period * voltage[k, j, 1],
                )
                psi[j, 0] = ((1.0 + h * g_qq) * x - h * g_dq * y) / det
                psi[j, 1] = ((1.0 + h * g_dd) * y - h * g_dq * x) / det
        for j in range(c):
            out[k, j, 0] = g_dd * psi[j, 0] + g_dq * psi[j, 1]
            out[k, j, 1] = g_dq * psi[j, 0] + g_qq * psi[j, 1]
    return out


@kernel
def fluxes(m, current):
    """Return the fluxes (n, 2) in Wb that a motor's energy m has for currents (n, 2) in A."""
    out = np.empty_like(current)
    d = q = 0.0
    for k in range(len(current)):
        d, q, _ = flux_newton(m, current[k, 0], current[k, 1], d, q)
        out[k, 0], out[k, 1] = d, q
    return out
