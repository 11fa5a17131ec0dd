"""From flux linkage and angle to current and torque, by an energy: i = dH/dpsi, torque = 3/2 p (psi
x i - dH/dtheta).

H is the quartic energy of the project's paper (its equation (EnerSat)), plus the power functions of
Hinkkan et al. (IEEE Trans. Ind. Appl. 53(3), 2017, eqs. (7)-(8)), or a table of currents over
fluxes (measured or finite elements) read by Keys' cubic convolution (IEEE Trans. ASSP 29(6), 1981).
Harmonics of the magnet shift the flux: H(psi - psi_h(theta)); harmonics of the saliency add to H.
"""

import math

import numpy as np
from numba import njit

from .compiled import piece
from .types import Magnetics


@piece
def _keys(x):
    """Weights of the four neighbours at offset x in [0, 1), a = -1/2."""
    x2, x3 = x * x, x * x * x
    return (
        0.5 * (-x + 2 * x2 - x3),
        0.5 * (2 - 5 * x2 + 3 * x3),
        0.5 * (x + 4 * x2 - 3 * x3),
        0.5 * (x3 - x2),
    )


@piece
def lookup(m, psi_d, psi_q):
    """Currents i_d, i_q (A) of the table at a flux; outside the table its edge cell goes on."""
    n, k = m.table_d.shape
    x = (psi_d - m.grid[0]) / m.grid[2]
    y = (psi_q - m.grid[1]) / m.grid[3]
    i = min(max(math.floor(x), 1), n - 3)
    j = min(max(math.floor(y), 1), k - 3)
    a0, a1, a2, a3 = _keys(x - i)
    b0, b1, b2, b3 = _keys(y - j)
    i_d, i_q = 0.0, 0.0
    for r in range(4):
        w = a0 if r == 0 else (a1 if r == 1 else (a2 if r == 2 else a3))
        row_d, row_q = m.table_d[i - 1 + r], m.table_q[i - 1 + r]
        i_d += w * (b0 * row_d[j - 1] + b1 * row_d[j] + b2 * row_d[j + 1] + b3 * row_d[j + 2])
        i_q += w * (b0 * row_q[j - 1] + b1 * row_q[j] + b2 * row_q[j + 1] + b3 * row_q[j + 2])
    return i_d, i_q


@piece
def _quartic(e, f_d, f_q):
    """Equations (id), (iq) of the paper."""
    i_d = (
        e[0] * f_d
        + 3 * e[2] * f_d * f_d
        + e[3] * f_q * f_q
        + 4 * e[4] * f_d**3
        + 2 * e[5] * f_d * f_q * f_q
    )
    i_q = e[1] * f_q + 2 * e[3] * f_d * f_q + 2 * e[5] * f_d * f_d * f_q + 4 * e[6] * f_q**3
    return i_d, i_q


@piece
def _power(w, f_d, f_q):
    """Gradient of a_d |f_d|^(S+2)/(S+2) + a_q |f_q|^(T+2)/(T+2) + a_dq |f_d|^(U+2) |f_q|^(V+2) /
    ((U+2)(V+2))."""
    ad, aq = abs(f_d) + 1e-12, abs(f_q) + 1e-12
    i_d = w[0] * ad ** w[1] * f_d + w[4] / (w[6] + 2) * ad ** w[5] * aq ** (w[6] + 2) * f_d
    i_q = w[2] * aq ** w[3] * f_q + w[4] / (w[5] + 2) * ad ** (w[5] + 2) * aq ** w[6] * f_q
    return i_d, i_q


@piece
def _saliency(g, theta, f_d, f_q):
    """Added currents and -dH/dtheta of harmonics of the saliency.

    H = 1/2 sum_k gamma_k [cos k theta (f_d^2 - f_q^2) + 2 sin k theta f_d f_q] / (1 + f^2/f_s^2),
    k = 6, 12.
    """
    s = 1.0 / (1.0 + g[2] * (f_d * f_d + f_q * f_q))
    i_d, i_q, pull = 0.0, 0.0, 0.0
    for n in range(2):
        order = 6.0 * (n + 1)
        c, z = math.cos(order * theta), math.sin(order * theta)
        half = 0.5 * g[n] * (c * (f_d * f_d - f_q * f_q) + 2 * z * f_d * f_q)
        fall = -2.0 * half * s * s * g[2]
        i_d += g[n] * (c * f_d + z * f_q) * s + fall * f_d
        i_q += g[n] * (z * f_d - c * f_q) * s + fall * f_q
        pull -= 0.5 * g[n] * order * (-z * (f_d * f_d - f_q * f_q) + 2 * c * f_d * f_q) * s
    return i_d, i_q, pull


@njit(cache=True)
def field(m, psi_alpha, psi_beta, theta):
    """Magnetising currents i_alpha, i_beta (A) and torque over 3/2 p (Wb A) at a flux and an
    angle."""
    c, s = math.cos(theta), math.sin(theta)
    psi_d = c * psi_alpha + s * psi_beta
    psi_q = c * psi_beta - s * psi_alpha
    h_d, h_q, s_d, s_q = 0.0, 0.0, 0.0, 0.0
    for n in range(3):
        order = m.harmonics[n][0]
        if order == 0.0:
            break
        a, b = math.cos(order * theta), math.sin(order * theta)
        h_d += m.harmonics[n][1] * a + m.harmonics[n][2] * b
        h_q += m.harmonics[n][3] * a + m.harmonics[n][4] * b
        s_d += order * (m.harmonics[n][2] * a - m.harmonics[n][1] * b)
        s_q += order * (m.harmonics[n][4] * a - m.harmonics[n][3] * b)
    f_d, f_q = psi_d - h_d - m.magnet, psi_q - h_q
    if m.use_table == 1:
        i_d, i_q = lookup(m, psi_d - h_d, f_q)
    else:
        i_d, i_q = _quartic(m.energy, f_d, f_q)
    if m.power[0] != 0.0 or m.power[2] != 0.0 or m.power[4] != 0.0:
        x_d, x_q = _power(m.power, f_d, f_q)
        i_d, i_q = i_d + x_d, i_q + x_q
    pull = 0.0
    if m.saliency[0] != 0.0 or m.saliency[1] != 0.0:
        x_d, x_q, pull = _saliency(m.saliency, theta, f_d, f_q)
        i_d, i_q = i_d + x_d, i_q + x_q
    pull += psi_d * i_q - psi_q * i_d + i_d * s_d + i_q * s_q
    return c * i_d - s * i_q, s * i_d + c * i_q, pull


def neutral() -> Magnetics:
    """A machine without anything but unit inductances."""
    return Magnetics(
        energy=(1.0, 1.0, 0.0, 0.0, 0.0, 0.0, 0.0),
        power=(0.0,) * 7,
        magnet=0.0,
        use_table=0,
        grid=(0.0, 0.0, 1.0, 1.0),
        table_d=np.zeros((4, 4)),
        table_q=np.zeros((4, 4)),
        harmonics=((0.0,) * 5,) * 3,
        saliency=(0.0,) * 3,
    )
