"""The plant with every effect of machine and shaft: the terms that `sandbox.oldplant` leaves out, in one kernel.

State and equations are those of `sandbox.oldplant`, phi_d, phi_q the flux linkage less the constant magnet flux phi_m,
and beside them iron-loss current and slow part of the current (rotor frame), the load's speed and the shaft's
twist.  With h(theta) the magnet's harmonics, current is the gradient of H at phi - h, torque
3/2 p (psi_d i_q - psi_q i_d - dH/dtheta).  Each term is the kernel of its effect's file in `model/effects`.
"""

from __future__ import annotations

import math
from typing import NamedTuple

from model.compiled import inlined, kernel
from model.effects import (
    coulomb_friction,
    current_filter,
    flux_harmonics,
    inductance_harmonics,
    iron_loss,
    shaft_compliance,
    skin_effect,
    winding_asymmetry,
)
from model.effects.cogging_torque import torque as cogging
from model.energy import currents, hessian
from model.frames import rotate
from sandbox.oldplant import OMEGA, PHI_D, PHI_Q, THETA, turn

CORE_D, CORE_Q, SLOW_D, SLOW_Q, LOAD_OMEGA, TWIST = range(4, 10)  # A, A, rad/s electrical, rad mechanical
FILTER_ALPHA, FILTER_BETA, FILTER_RIPPLE, CORE_RIPPLE = 10, 11, 12, 14  # A, and two vectors of V s
DUTY, CLOCK = 16, 19  # duties of the last period (three), s since the run began
SIZE = 20


class Machine(NamedTuple):
    """What the machine has beside `sandbox.oldplant`."""

    psi_d6: float  # Wb
    psi_q6: float
    gamma_6: float  # 1/H
    core_conductance: float  # 1/ohm
    core_time: float  # s
    skin_resistance: float  # ohm
    skin_time: float  # s
    delta_a: float  # ohm
    delta_b: float
    on_resistance: float  # ohm, of the inverter's devices: in series with the winding


class Shaft(NamedTuple):
    """What the shaft has beside `sandbox.oldplant`; stiffness 0: rigid."""

    coulomb: float  # N m
    width: float  # rad/s, mechanical
    stribeck: float  # N m
    stribeck_speed: float  # rad/s, mechanical
    cogging: float  # N m
    cogging_order: float
    cogging_phase: float  # rad
    stiffness: float  # N m/rad
    damping: float  # N m s/rad
    load_acceleration: float  # p / J_load, rad/s^2 electrical per N m


@kernel
def sixth(c, s):
    """Return cos and sin of six times the angle of cos c and sin s."""
    c_2, s_2 = c * c - s * s, 2.0 * c * s
    c_4, s_4 = c_2 * c_2 - s_2 * s_2, 2.0 * c_2 * s_2
    return c_4 * c_2 - s_4 * s_2, s_4 * c_2 + c_4 * s_2


@inlined
def magnetic(p, m, c, s, d, q):
    """Return magnetising i_d, i_q (A) and torque (N m) at rotor-frame fluxes and the angle of cos c, sin s."""
    psi_d, psi_q = d + p.magnet_flux, q
    if m.psi_d6 == 0.0 and m.psi_q6 == 0.0 and m.gamma_6 == 0.0:
        i_d, i_q = currents(p.energy, d, q)
        return i_d, i_q, 1.5 * p.pole_pairs * (psi_d * i_q - psi_q * i_d)
    c_6, s_6 = sixth(c, s)
    h_d, h_q = flux_harmonics.flux(m.psi_d6, m.psi_q6, c_6, s_6)
    d, q = d - h_d, q - h_q
    i_d, i_q = currents(p.energy, d, q)
    g_d, g_q = inductance_harmonics.current(m.gamma_6, c_6, s_6, d, q)
    i_d, i_q = i_d + g_d, i_q + g_q
    t_d, t_q = flux_harmonics.slope(m.psi_d6, m.psi_q6, c_6, s_6)
    turning = inductance_harmonics.slope(m.gamma_6, c_6, s_6, d, q) - t_d * i_d - t_q * i_q  # dH/dtheta
    return i_d, i_q, 1.5 * p.pole_pairs * (psi_d * i_q - psi_q * i_d - turning)


@kernel
def stiffness(p, m, c, s, d, q):
    """Return Gamma_dd, Gamma_dq, Gamma_qq (1/H) there: the inverse incremental inductance."""
    if m.psi_d6 == 0.0 and m.psi_q6 == 0.0 and m.gamma_6 == 0.0:
        return hessian(p.energy, d, q)
    c_6, s_6 = sixth(c, s)
    h_d, h_q = flux_harmonics.flux(m.psi_d6, m.psi_q6, c_6, s_6)
    dd, dq, qq = hessian(p.energy, d - h_d, q - h_q)
    return dd + m.gamma_6 * c_6, dq + m.gamma_6 * s_6, qq - m.gamma_6 * c_6


@kernel
def drag(f, theta, omega, pole_pairs):
    """Return friction less cogging (N m): what the shaft takes beside the viscous part."""
    lost = 0.0
    if f.coulomb != 0.0 or f.stribeck != 0.0:
        lost += coulomb_friction.drag(f.coulomb, f.width, f.stribeck, f.stribeck_speed, omega / pole_pairs)
    if f.cogging != 0.0:
        lost -= cogging(f.cogging, f.cogging_order, f.cogging_phase, theta / pole_pairs)
    return lost


@inlined
def rates(p, m, shaft, c, n, y, u_alpha, u_beta, resisting, load, imposed):
    """Return the derivatives of y = (phi_d, phi_q, omega, core, slow part, load's speed, twist); c, n: exp(-j theta).

    shaft: stiffness, damping and load_acceleration; resisting: `drag` of the step, N m.
    """
    d, q, w, core_d, core_q, slow_d, slow_q, w_load, twist = y
    i_d, i_q, torque = magnetic(p, m, c, -n, d, q)
    i_d, i_q = i_d + core_d, i_q + core_q
    r = p.resistance + m.on_resistance
    e_d = c * u_alpha - n * u_beta - r * i_d
    e_q = c * u_beta + n * u_alpha - r * i_q
    x_d = x_q = k_d = k_q = a_load = 0.0
    if m.delta_a != 0.0 or m.delta_b != 0.0:
        v_alpha, v_beta = winding_asymmetry.drop(m.delta_a, m.delta_b, c * i_d + n * i_q, c * i_q - n * i_d)
        e_d, e_q = e_d - (c * v_alpha - n * v_beta), e_q - (c * v_beta + n * v_alpha)
    if m.skin_resistance != 0.0:
        e_d, e_q = e_d - m.skin_resistance * (i_d - slow_d), e_q - m.skin_resistance * (i_q - slow_q)
        x_d, x_q = skin_effect.slope(m.skin_time, i_d, i_q, slow_d, slow_q, w)
    if m.core_conductance != 0.0:
        k_d, k_q = iron_loss.slope(m.core_conductance, m.core_time, e_d, e_q, core_d, core_q, w)
    net, difference, taken = torque - p.viscous * w / p.pole_pairs - resisting, 0.0, load
    if shaft[0] != 0.0:
        difference = (w - w_load) / p.pole_pairs
        taken = shaft_compliance.shaft_torque(shaft[0], shaft[1], twist, difference)
        a_load = shaft[2] * (taken - load) + imposed
    a = p.acceleration * (net - taken) + imposed
    return (e_d + w * q, e_q - w * (d + p.magnet_flux), a, k_d, k_q, x_d, x_q, a_load, difference)


@inlined
def moved(y, k, h):
    """Return y + h k."""
    return (
        y[0] + h * k[0], y[1] + h * k[1], y[2] + h * k[2], y[3] + h * k[3], y[4] + h * k[4],
        y[5] + h * k[5], y[6] + h * k[6], y[7] + h * k[7], y[8] + h * k[8],
    )  # fmt: skip


@kernel
def rk4(p, m, shaft, c, n, theta, y, u_alpha, u_beta, resisting, load, imposed):
    """Return exp(-j theta) as (c, n), the angle and y one step later (classic Runge-Kutta)."""
    h, half = p.step, 0.5 * p.step
    k_a = rates(p, m, shaft, c, n, y, u_alpha, u_beta, resisting, load, imposed)
    c_b, n_b = turn(c, n, half * y[2])
    y_b = moved(y, k_a, half)
    k_b = rates(p, m, shaft, c_b, n_b, y_b, u_alpha, u_beta, resisting, load, imposed)
    c_c, n_c = turn(c, n, half * y_b[2])
    y_c = moved(y, k_b, half)
    k_c = rates(p, m, shaft, c_c, n_c, y_c, u_alpha, u_beta, resisting, load, imposed)
    c_e, n_e = turn(c, n, h * y_c[2])
    y_e = moved(y, k_c, h)
    k_e = rates(p, m, shaft, c_e, n_e, y_e, u_alpha, u_beta, resisting, load, imposed)
    part = h / 6.0
    swept = part * (y[2] + 2.0 * (y_b[2] + y_c[2]) + y_e[2])
    c, n = turn(c, n, swept)
    y = moved(moved(y, k_a, part), moved(k_b, k_c, 1.0), 2.0 * part)
    return c, n, theta + swept, moved(y, k_e, part)


@kernel
def terminal(p, m, c, n, y):
    """Return the terminal current (A) in the stationary frame; c, n: exp(-j theta)."""
    i_d, i_q, _ = magnetic(p, m, c, -n, y[0], y[1])
    i_d, i_q = i_d + y[3], i_q + y[4]
    return c * i_d + n * i_q, c * i_q - n * i_d


@kernel
def advance(x, p, m, f, filter_time, u_alpha, u_beta, load, imposed, steps):
    """Advance the state x (SIZE,) in place by `steps` steps under a voltage held in the stator frame (V).

    Friction and cogging are taken once a step, in its middle (speed extrapolated): second order in the step.
    """
    y = (x[0], x[1], x[2], x[4], x[5], x[6], x[7], x[8], x[9])
    theta = x[THETA]
    c, n = math.cos(theta), -math.sin(theta)
    decay, old, new = (1.0, 0.0, 0.0)
    i_alpha = i_beta = 0.0
    if filter_time > 0.0:
        decay, old, new = current_filter.lag_weights(p.step, filter_time)
        i_alpha, i_beta = terminal(p, m, c, n, y)
    shaft, before = (f.stiffness, f.damping, f.load_acceleration), y[2]
    for _ in range(steps):
        middle = y[2] + 0.5 * (y[2] - before)
        resisting = drag(f, theta + 0.5 * p.step * middle, middle, p.pole_pairs)
        before = y[2]
        c, n, theta, y = rk4(p, m, shaft, c, n, theta, y, u_alpha, u_beta, resisting, load, imposed)
        if filter_time > 0.0:
            j_alpha, j_beta = terminal(p, m, c, n, y)
            x[FILTER_ALPHA] = decay * x[FILTER_ALPHA] + old * i_alpha + new * j_alpha
            x[FILTER_BETA] = decay * x[FILTER_BETA] + old * i_beta + new * j_beta
            i_alpha, i_beta = j_alpha, j_beta
    x[PHI_D], x[PHI_Q], x[OMEGA], x[THETA] = y[0], y[1], y[2], theta
    x[CORE_D], x[CORE_Q], x[SLOW_D], x[SLOW_Q] = y[3], y[4], y[5], y[6]
    x[LOAD_OMEGA], x[TWIST] = y[7], y[8]


@kernel
def stator_currents(x, p, m):
    """Return the terminal current's i_alpha, i_beta, i_d, i_q in A, iron loss included (averaged)."""
    i_d, i_q, _ = magnetic(p, m, math.cos(x[THETA]), math.sin(x[THETA]), x[PHI_D], x[PHI_Q])
    i_d, i_q = i_d + x[CORE_D], i_q + x[CORE_Q]
    i_alpha, i_beta = rotate(i_d, i_q, x[THETA])
    return i_alpha, i_beta, i_d, i_q
