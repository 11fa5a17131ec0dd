"""The plant: saturated motor and shaft, flux linkages as state, fourth-order Runge-Kutta at a fixed step.

  dphi_d/dt = u_d - R i_d + omega phi_q                  eq. (elecd)
  dphi_q/dt = u_q - R i_q - omega (phi_d + phi_m)        eq. (elecq)
  domega/dt = p/J (torque - load - B omega/p) + imposed acceleration,   dtheta/dt = omega

The inverter holds its voltage in the stator frame, so in the rotor frame it turns by -(theta - theta_0) inside
a step: an exact rotation, taken by a short series in the small angle (error < 1e-13 up to LARGEST_TURN).
Readable twin: `sandbox.reference`.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numba

from model.compiled import inlined, kernel
from model.energy import AnyEnergy, Energy, currents
from model.frames import rotate

PHI_D, PHI_Q, OMEGA, THETA = range(4)
LARGEST_TURN = 0.1  # rad a step


class Plant(NamedTuple):
    """The true motor and shaft; p/J is zero where the rotor is locked or driven."""

    energy: AnyEnergy
    magnet_flux: float  # Wb
    resistance: float  # ohm
    pole_pairs: float
    acceleration: float  # p / J, rad/s^2 electrical per N m
    viscous: float  # N m s/rad, mechanical
    step: float  # s


PLANT = numba.typeof(Plant(Energy(*7 * (0.0,)), *6 * (0.0,)))


@kernel
def turn(x, y, angle):
    """Return (x, y) turned by -angle, a small angle in rad."""
    a = angle * angle
    c = 1.0 - a * (0.5 - a * (1.0 / 24.0 - a * (1.0 / 720.0)))
    s = angle * (1.0 - a * (1.0 / 6.0 - a * (1.0 / 120.0 - a * (1.0 / 5040.0))))
    return c * x + s * y, c * y - s * x


@inlined
def rates(p, phi_d, phi_q, omega, u_d, u_q, load, imposed):
    """Return the time derivatives of phi_d, phi_q and omega."""
    i_d, i_q = currents(p.energy, phi_d, phi_q)
    psi_d = phi_d + p.magnet_flux
    torque = 1.5 * p.pole_pairs * (psi_d * i_q - phi_q * i_d)
    return (
        u_d - p.resistance * i_d + omega * phi_q,
        u_q - p.resistance * i_q - omega * psi_d,
        p.acceleration * (torque - load - p.viscous * omega / p.pole_pairs) + imposed,
    )


@inlined
def rk4(p, d, q, w, theta, u_d, u_q, load, imposed):
    """Return state and rotor-frame voltage one step later."""
    h, half = p.step, 0.5 * p.step
    a_d, a_q, a_w = rates(p, d, q, w, u_d, u_q, load, imposed)
    v_d, v_q = turn(u_d, u_q, half * w)
    w_b = w + half * a_w
    b_d, b_q, b_w = rates(p, d + half * a_d, q + half * a_q, w_b, v_d, v_q, load, imposed)
    v_d, v_q = turn(u_d, u_q, half * w_b)
    w_c = w + half * b_w
    c_d, c_q, c_w = rates(p, d + half * b_d, q + half * b_q, w_c, v_d, v_q, load, imposed)
    v_d, v_q = turn(u_d, u_q, h * w_c)
    w_e = w + h * c_w
    e_d, e_q, e_w = rates(p, d + h * c_d, q + h * c_q, w_e, v_d, v_q, load, imposed)
    sixth = h / 6.0
    swept = sixth * (w + 2.0 * (w_b + w_c) + w_e)
    u_d, u_q = turn(u_d, u_q, swept)
    return (
        d + sixth * (a_d + 2.0 * (b_d + c_d) + e_d),
        q + sixth * (a_q + 2.0 * (b_q + c_q) + e_q),
        w + sixth * (a_w + 2.0 * (b_w + c_w) + e_w),
        theta + swept,
        u_d,
        u_q,
    )


@kernel
def advance(x, p, u_alpha, u_beta, load, imposed, steps):
    """Advance the state x (4,) in place by `steps` steps under a voltage held in the stator frame (V).

    load: N m against positive rotation; imposed: rad/s^2 electrical, of a driven rotor.
    """
    d, q, w, theta = x[PHI_D], x[PHI_Q], x[OMEGA], x[THETA]
    u_d, u_q = rotate(u_alpha, u_beta, -theta)
    for _ in range(steps):
        d, q, w, theta, u_d, u_q = rk4(p, d, q, w, theta, u_d, u_q, load, imposed)
    x[PHI_D], x[PHI_Q], x[OMEGA], x[THETA] = d, q, w, theta


@kernel
def stator_currents(x, p):
    """Return i_alpha, i_beta, i_d, i_q in A."""
    i_d, i_q = currents(p.energy, x[PHI_D], x[PHI_Q])
    i_alpha, i_beta = rotate(i_d, i_q, x[THETA])
    return i_alpha, i_beta, i_d, i_q


def steps_per_period(sampling_period: float, plant_step: float, top_omega: float) -> int:
    """Return the number of plant steps in a sampling period: at most `plant_step` s and LARGEST_TURN rad each."""
    longest = min(plant_step, LARGEST_TURN / top_omega) if top_omega > 0 else plant_step
    return max(1, math.ceil(sampling_period / longest - 1e-9))
