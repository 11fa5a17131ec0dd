"""Samples of small motors in closed form, and what both plants' tests compare with them."""

import math

import numpy as np

from sandbox.switched.advance import replay
from tests.sandbox.plant.effect_motors import TS, L, R, U, vector


def settled(b, u, n=800):
    """Return the sampled current vector of a locked motor after a long time at constant voltage."""
    return vector(replay(b, "locked", np.full(n, u.real), np.full(n, u.imag), U))[-1]


def pulsed(u, r, link=U):
    """Return the exact sample of a linear R-L circuit in periodic steady state under centred
    pulses, along alpha."""
    legs = np.array([u, -u / 2, -u / 2])
    duty, a = 0.5 + (legs - u / 4) / U, r / L
    level = np.exp(-a * 0.5 * (1 - duty) * TS) - np.exp(-a * 0.5 * (1 + duty) * TS)
    return link / r * (2 * level[0] - level[1] - level[2]) / 3 / (1 - math.exp(-a * TS))


def iron(omega, core, tau):
    """Return the flux and terminal current (rotor frame) of a shorted turning motor:
    psi/L - phi_m/L + i_c = i, R i = -j omega psi, i_c = j omega psi/(R_c (1 + j omega tau))."""
    s = 1j * omega
    psi = 0.1 / L / (1.0 / L + s / R + s / (core * (1.0 + s * tau)))
    return psi, -s * psi / R
