"""The plant once more, readable: the paper's equations in NumPy, integrated by SciPy.

Same physics as `sandbox.plant` and none of its code: eqs. (elecd), (elecq), (id), (iq) as printed, each voltage
rotated into the rotor frame at every instant, an adaptive eighth-order method between voltage updates.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.integrate import solve_ivp

from model.parameters import Motor

Array = NDArray[np.float64]


def derivative(t: float, x: Array, motor: Motor, u: Array, load: float, free: bool) -> list[float]:
    """Return dx/dt of x = (phi_d, phi_q, omega, theta) under a stator-frame voltage u = (alpha, beta)."""
    phi_d, phi_q, omega, theta = x
    u_d = np.cos(theta) * u[0] + np.sin(theta) * u[1]
    u_q = -np.sin(theta) * u[0] + np.cos(theta) * u[1]
    i_d = (
        phi_d / motor.inductance_d
        + 3 * motor.alpha_30 * phi_d**2
        + motor.alpha_12 * phi_q**2
        + 4 * motor.alpha_40 * phi_d**3
        + 2 * motor.alpha_22 * phi_d * phi_q**2
    )
    i_q = (
        phi_q / motor.inductance_q
        + 2 * motor.alpha_12 * phi_d * phi_q
        + 2 * motor.alpha_22 * phi_d**2 * phi_q
        + 4 * motor.alpha_04 * phi_q**3
    )
    p = motor.pole_pairs
    torque = 1.5 * p * ((phi_d + motor.magnet_flux) * i_q - phi_q * i_d)
    shaft = (torque - load - motor.viscous_friction * omega / p) / motor.inertia
    return [
        u_d - motor.resistance * i_d + omega * phi_q,
        u_q - motor.resistance * i_q - omega * (phi_d + motor.magnet_flux),
        p * shaft if free else 0.0,
        omega,
    ]


def trajectory(motor: Motor, u: Array, period: float, start: Array, load: float = 0.0, free: bool = True) -> Array:
    """Return the state (n + 1, 4) at the ends of n periods (s) under voltages u (n, 2), each held for one period.

    load: N m against positive rotation; free: whether the shaft turns by torque, otherwise at constant speed.
    """
    states = [np.asarray(start, dtype=float)]
    for held in u:
        part = solve_ivp(
            derivative, (0.0, period), states[-1], "DOP853", args=(motor, held, load, free), rtol=1e-12, atol=1e-13
        )
        states.append(part.y[:, -1])
    return np.array(states)
