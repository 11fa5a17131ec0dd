"""Samples of small motors in closed form, and what both plants' tests compare with them."""

import math

import numpy as np
from scipy.optimize import brentq

from sandbox.switched.advance import replay
from tests.sandbox.plant.effect_motors import LINEAR, TS, L, R, U, vector


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


def turned_core(omega, effects):
    """Return flux, excess-loss current and hysteresis current (rotor frame) of the same motor, by
    the sizes of `iron_loss` in place of a resistance.

    The flux held turns behind its own pull at right angles: |psi|^2 = |p|^2 + r^2, q = j r p/|p|,
    so q = j r psi/(|p| + j r).  Both currents are admittances of the flux by its size alone, which
    Brent's method finds: (1/L + s/R + those) psi = phi_m/L.
    """
    rated, s = LINEAR.rated_omega * 0.1, 1j * omega
    lag = s / (1.0 + s * effects["iron_loss.time_constant"])
    reach = 0.1 * effects["iron_loss.hysteresis_reach"]

    def admittances(size):
        held = math.sqrt(size**2 - reach**2)
        excess = effects["iron_loss.excess_current"] / math.sqrt(abs(lag) * size * rated)
        return excess * lag, effects["iron_loss.hysteresis_current"] * 1j / (held + 1j * reach)

    def flux(size):
        return 0.1 / L / (1.0 / L + s / R + sum(admittances(size)))

    size = brentq(lambda x: abs(flux(x)) - x, 1.001 * reach, 0.2, xtol=1e-16)
    psi, (excess, held) = flux(size), admittances(size)
    return psi, excess * psi, held * psi
