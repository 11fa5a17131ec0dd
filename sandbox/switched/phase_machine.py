"""The machine in the stationary frame: space vectors are complex numbers alpha + j beta
(amplitude-invariant).

psi is the total flux linkage (Wb), w = psi - m(theta) its part due to currents, z = w exp(-j theta)
the same seen from the rotor.  The paper's energy (eq. EnerSat), with inductance harmonics, is a
harmonic series of z:

    H = g_0/2 |z|^2 + g_2/2 Re z^2 + gamma_6/2 Re(z^2 e^{-6j theta}) + c_1 |z|^2 Re z + c_3 Re z^3
        + q_0 |z|^4 + q_2 |z|^2 Re z^2 + q_4 Re z^4

and at constant w only the Re z^n depend on the angle: d/dtheta Re z^n = n Im z^n.  Current i = 2
dH/dw*, torque = -3/2 p dH/dtheta at constant psi, so energy closes by construction.

    dpsi/dt = v - R i - skin - phases,  i = i_m + i_c + i_h
    i_c = g e + excess e/(|e|^2 + excess_width^2)^(1/4),  tau de/dt = dpsi/dt - e

- hysteresis, a vector play: i_h = grip q, q = psi - psi_held, |q| <= grip_radius, psi_held dragged
  along by q (`pull`).

(skin: one branch, or the modes of layers of conductors, see `layers`.)

What the effect library does not hold, so that something unknown can be asked for:

- short-circuited turns of phase a (share mu, fault resistance R_f, leakage L_f), s = 2/3 mu i_f:
  i_alpha += s, dpsi/dt += R s, tau ds/dt = g (R i_a + dpsi_alpha/dt) - s, g = 2/3 mu^2 / (R_f + mu
  R), tau = L_f / (R_f + mu R); the flux of phase a without its zero sequence;
- a measured flux map (`flux_map`): H(Re z, Im z) in place of the series, dH/dtheta = i_d Im z - i_q
  Re z;
- harmonics of any orders, those of the flux growing with the current where asked for (`harmonics`);
- saturation with a knee: H += knee/3 (|z| - knee_flux)^3 beyond knee_flux;
- a fan, a crank, a load out of true, a load machine that lags (`load_side`);
- current sensors that lose curvature (`simulate.sensor`): reading = gain i (1 - curvature i^2);
- current sensors that remember, phases read one after another (`readers`);
- a resolver (`simulate.encoder`), shapes of the current's sign, a table of the leg's voltage error,
  a device of one direction (`leg`), a resonance of the link (`link`), least pulses and vectors
  (`short_pulses`).
"""

from __future__ import annotations

import math

import numpy as np

from model.compiled import inlined, kernel
from model.parameters import Rotor
from sandbox.switched.flux_map import map_energy, with_map, with_map_stiffness
from sandbox.switched.harmonics import (
    chained,
    chained_stiffness,
    cogging_sum,
    swing_energy,
    with_flux,
    with_swing,
    with_swing_stiffness,
)
from sandbox.switched.layers import Held, heated
from sandbox.switched.layers import dropped as layers_dropped
from sandbox.switched.layers import held as layers_held
from sandbox.switched.leg import device_signs, given, unlisted_drop
from sandbox.switched.link import link_voltage
from sandbox.switched.load_side import (
    crank_inertia,
    drag,
    load_acceleration,
    load_angle,
    shaft_damping,
    wound,
)
from sandbox.switched.machine_state import Moving, Powers

A = complex(-0.5, 0.5 * math.sqrt(3.0))  # exp(2 pi j / 3)
ROOT = math.sqrt(3.0)
LEAST_TORQUE = 1e-300  # N m: friction that has faded divides nothing by zero


@kernel
def sixth(e_1):
    """Return exp(6 j theta) from exp(j theta)."""
    e_2 = e_1 * e_1
    return e_2 * e_2 * e_2


@kernel
def magnet(b, e_1):
    """Return e^{j theta}(phi_m + psi_d6 cos 6 theta + j psi_q6 sin 6 theta), the magnet's flux, and
    its slope (Wb)."""
    if b.psi_d6 == 0.0 and b.psi_q6 == 0.0:
        return e_1 * b.magnet_flux, e_1 * complex(0.0, b.magnet_flux)
    e_6 = sixth(e_1)
    m = complex(b.magnet_flux + b.psi_d6 * e_6.real, b.psi_q6 * e_6.imag)
    return e_1 * m, e_1 * complex(
        -m.imag - 6.0 * b.psi_d6 * e_6.imag, m.real + 6.0 * b.psi_q6 * e_6.real
    )


@inlined
def seen_from(b, psi, theta, e_1):
    """Return the magnet's flux and slope (Wb) as `magnet`, with all harmonics, z_0 (Wb), G (1/Wb):
    `harmonics`."""
    m, slope = magnet(b, e_1)
    return with_flux(b.harmonics, b.magnet_flux, psi, theta, e_1, m, slope)


@kernel
def stored_energy(b, psi, theta):
    """Return H (J up to the factor 3/2 of the transformation)."""
    e_1 = complex(math.cos(theta), math.sin(theta))
    z = (psi - seen_from(b, psi, theta, e_1)[0]) * e_1.conjugate()
    z_2 = z * z
    r_2 = z.real * z.real + z.imag * z.imag
    h = 0.5 * (b.g_0 * r_2 + b.g_2 * z_2.real + b.gamma_6 * (z_2 * sixth(e_1).conjugate()).real)
    h += r_2 * b.c_1 * z.real + b.c_3 * (z_2 * z).real
    h += map_energy(b.flux_map, z.real, z.imag) + swing_energy(b.harmonics, z, theta)
    h += b.knee / 3.0 * max(math.sqrt(r_2) - b.knee_flux, 0.0) ** 3
    return h + r_2 * (b.q_0 * r_2 + b.q_2 * z_2.real) + b.q_4 * (z_2 * z_2).real


@inlined
def gradient(b, z, theta, e_1):
    """Return g = 2 dH/dz* (A, rotor frame) and dH/dtheta at constant w = z e^{j theta} (J)."""
    back = z.conjugate()
    z_2 = z * z
    r_2 = z.real * z.real + z.imag * z.imag
    quadratic = b.g_0 + 2.0 * b.c_1 * z.real + 4.0 * b.q_0 * r_2 + 2.0 * b.q_2 * z_2.real
    i = quadratic * z + (b.g_2 + 2.0 * b.q_2 * r_2) * back + b.c_1 * r_2
    i += (3.0 * b.c_3 + 4.0 * b.q_4 * back) * z_2.conjugate()
    turning = (b.g_2 + 2.0 * b.q_2 * r_2) * z_2.imag + b.c_1 * r_2 * z.imag
    turning += 3.0 * b.c_3 * (z_2 * z).imag + 4.0 * b.q_4 * (z_2 * z_2).imag
    i, turning = with_map(b.flux_map, z, i, turning)
    if b.gamma_6 != 0.0:
        e_6 = sixth(e_1)
        i += b.gamma_6 * e_6 * back
        turning += 4.0 * b.gamma_6 * (z_2 * e_6.conjugate()).imag
    i, turning = with_swing(b.harmonics, z, theta, i, turning)
    if b.knee != 0.0 and r_2 > b.knee_flux * b.knee_flux:
        r = math.sqrt(r_2)
        i += b.knee * (r - b.knee_flux) ** 2 / r * z
    return i, turning


@inlined
def current_and_torque(b, psi, theta):
    """Return the magnetising current vector (A) and the air-gap torque (N m)."""
    e_1 = complex(math.cos(theta), math.sin(theta))
    m, slope, z_0, grown = seen_from(b, psi, theta, e_1)
    i, turning = gradient(b, (psi - m) * e_1.conjugate(), theta, e_1)
    i *= e_1
    torque = 1.5 * b.pole_pairs * (i.real * slope.real + i.imag * slope.imag - turning)
    return chained(b.harmonics, i, z_0, grown, e_1), torque


@kernel
def least_stiffness(b, psi, theta):
    """Return the smaller eigenvalue of the energy's second derivatives (1/H); from 0 on, current is
    not unique.

    di = a dz + c dz* in the rotor frame (a real), so the eigenvalues are a +- |c|.
    """
    e_1 = complex(math.cos(theta), math.sin(theta))
    m, _, z_0, grown = seen_from(b, psi, theta, e_1)
    z = (psi - m) * e_1.conjugate()
    back, z_2 = z.conjugate(), z * z
    r_2 = z.real * z.real + z.imag * z.imag
    a = b.g_0 + 4.0 * b.c_1 * z.real + 8.0 * b.q_0 * r_2 + 6.0 * b.q_2 * z_2.real
    c = b.g_2 + 2.0 * b.c_1 * z + 6.0 * b.c_3 * back + 4.0 * b.q_0 * z_2 + 6.0 * b.q_2 * r_2
    c += 12.0 * b.q_4 * back * back
    a, c = with_map_stiffness(b.flux_map, z, a, c)
    if b.gamma_6 != 0.0:
        c += b.gamma_6 * sixth(e_1)
    a, c = with_swing_stiffness(b.harmonics, z, theta, a, c)
    if grown != 0.0:
        i, _ = gradient(b, z, theta, e_1)
        a, c = chained_stiffness(a, c, z_0, grown, i.real * grown.real + i.imag * grown.imag)
    return a - abs(c)


@kernel
def pull(b, begun, psi, held):
    """Return by how much the flux psi (Wb) is ahead of what hysteresis holds, grip_radius r at
    most, after it went straight from `begun`, where this was `held`.

    Seen from the way, w = q/r is a number on the unit circle while it drags: 2 r dw/ds = 1 - w^2,
    whose solution is w = (w_0 + tanh(s/2r))/(1 + w_0 tanh(s/2r)).
    """
    ahead, gone = begun - held, psi - begun
    length = abs(gone)
    if length == 0.0:
        return ahead
    way, r = gone / length, b.grip_radius
    w = ahead * way.conjugate()
    free = max(math.sqrt(max(r * r - w.imag * w.imag, 0.0)) - w.real, 0.0)
    if length <= free:
        return ahead + gone
    w = (w + free) / r
    turn = math.tanh(0.5 * (length - free) / r)
    return r * way * (w + turn) / (1.0 + w * turn)


@inlined
def lagged_slope(b, core):
    """Return the slope of the flux behind the iron's lag (V) and what excess loss takes by it
    (1/ohm); core: A through the branch that the state has."""
    e = core / b.core_branch
    return e, b.excess / math.sqrt(math.sqrt(abs(e) ** 2 + b.excess_width**2))


@inlined
def core_current(b, core):
    """Return the current (A) of eddy currents and excess loss."""
    if b.excess == 0.0:
        return core
    e, more = lagged_slope(b, core)
    return (b.core_conductance + more) * e


@inlined
def core_loss(b, core):
    """Return what they lose, and the energy in their lag, up to the factor 3/2 (W, J)."""
    if b.core_branch == 0.0:
        return 0.0, 0.0
    e, more = lagged_slope(b, core)
    square = abs(e) ** 2
    within = (square + b.excess_width**2) ** 0.75 - b.excess_width**1.5
    stored = 0.5 * b.core_conductance * square + (2.0 / 3.0) * b.excess * within
    return (b.core_conductance + more) * square, b.core_time * stored


@kernel
def phase_currents(i):
    """Return i_a, i_b, i_c of a current vector without zero sequence."""
    half, side = -0.5 * i.real, 0.5 * ROOT * i.imag
    return i.real, half + side, half - side


@kernel
def vector(a, b, c):
    """Return the space vector of three phase quantities, amplitude-invariant: i_alpha = (2a-b-c)/3,
    ..."""
    return complex((2.0 * a - b - c) / 3.0, (b - c) / ROOT)


@inlined
def phase_drop(b, i):
    """Return the vector of what the phases lose one by one (V): legs and winding asymmetry."""
    more = b.one_sided != 0.0 or given(b.leg_table)
    if (
        b.threshold == 0.0
        and b.on_resistance == 0.0
        and b.delta_a == 0.0
        and b.delta_b == 0.0
        and not more
    ):
        return complex(0.0, 0.0)
    i_a, i_b, i_c = phase_currents(i)
    sign_a, sign_b, sign_c = device_signs(b, i_a, i_b, i_c)
    v_a = b.threshold * sign_a + (b.on_resistance + b.delta_a) * i_a
    v_b = b.threshold * sign_b + (b.on_resistance + b.delta_b) * i_b
    v_c = b.threshold * sign_c + b.on_resistance * i_c
    if not more:
        return vector(v_a, v_b, v_c)
    return vector(
        v_a + unlisted_drop(b, i_a), v_b + unlisted_drop(b, i_b), v_c + unlisted_drop(b, i_c)
    )


@kernel
def device_loss(b, i):
    """Return the power (W) that the inverter's devices take, leg by leg."""
    lost, (i_a, i_b, i_c) = 0.0, phase_currents(i)
    signs = device_signs(b, i_a, i_b, i_c)
    for current, sign in ((i_a, signs[0]), (i_b, signs[1]), (i_c, signs[2])):
        lost += (b.threshold * sign + b.on_resistance * current) * current
        lost += unlisted_drop(b, current) * current
    return lost


@kernel
def slid(b, bent, omega_mech, h):
    """Return the angle (rad) by which bristles are bent h (s) later: what is beyond the bend of
    sliding is lost in proportion to the angle turned."""
    most = math.copysign(sliding(b, omega_mech) / b.bristle_stiffness, omega_mech)
    return most + (bent - most) * math.exp(-abs(omega_mech * h / most))


@kernel
def sliding(b, omega_mech):
    """Return Coulomb's torque with Stribeck's part (N m) of what slides."""
    return max(
        b.coulomb + b.stribeck * math.exp(-((omega_mech / b.stribeck_speed) ** 2)), LEAST_TORQUE
    )


@kernel
def friction(b, omega_mech, bent=0.0):
    """Return Coulomb (with Stribeck) and viscous torque on the motor's side, and that of a curve
    (N m); bent: angle (rad) of bristles, if dry friction has them."""
    drag = b.viscous * omega_mech
    if b.rubbing_speed.size > 1:
        more = np.interp(abs(omega_mech), b.rubbing_speed, b.rubbing_torque)
        drag += math.copysign(more, omega_mech)
    if b.coulomb == 0.0 and b.stribeck == 0.0:
        return drag
    level = sliding(b, omega_mech)
    if b.bristle_stiffness != 0.0:
        spring = b.bristle_stiffness * bent
        return drag + spring + b.bristle_damping * (omega_mech - abs(omega_mech) * spring / level)
    return drag + level * math.tanh(omega_mech / b.coulomb_width)


@kernel
def accelerations(b, torque, load_torque, theta, speed, load_speed, twist, bent=0.0):
    """Return the mechanical accelerations of motor and load (rad/s^2); the load torque acts on the
    load's side."""
    net = torque - friction(b, speed, bent)
    if b.cogging != 0.0:
        net += b.cogging * math.sin(b.cogging_order * theta / b.pole_pairs + b.cogging_phase)
    net += cogging_sum(b.harmonics, theta / b.pole_pairs)[0]
    angle = load_angle(b, theta, twist)
    load_torque += drag(b, angle, load_speed)
    if b.load_inertia == 0.0:
        a = load_acceleration(b, b.inertia, net - load_torque, angle, load_speed)
        return a, a
    shaft = b.stiffness * wound(b, twist) + shaft_damping(b, twist) * (speed - load_speed)
    return (net - shaft) / b.inertia, load_acceleration(
        b, b.load_inertia, shaft - load_torque, angle, load_speed
    )


@kernel
def slopes(b, t, by, x):
    """Return the rate of the state x at t (s) under what acts on it, and the terminal current
    (A)."""
    magnetising, torque = current_and_torque(b, x.psi, x.theta)
    i = magnetising + core_current(b, x.core) + x.loop
    if b.grip != 0.0:
        i += b.grip * pull(b, by.begun, x.psi, by.held)
    d_psi = (
        by.legs * link_voltage(b, t, by.link_sag) - b.resistance * (i - x.loop) - phase_drop(b, i)
    )
    d_core = d_skin = complex(0.0, 0.0)
    d_loop, d_modes = 0.0, Held(0j, 0j, 0j, 0j, 0j, 0j, 0j)
    if b.modes.ohms[0] != 0.0 or b.modes.ohms[-1] != 0.0:
        volts, d_modes = layers_dropped(b.modes, x.modes, i)
        d_psi -= volts
    if b.skin_resistance != 0.0:
        fast = i - x.skin
        d_psi -= b.skin_resistance * fast
        d_skin = fast / b.skin_time
    if b.core_branch != 0.0:
        d_core = (d_psi * b.core_branch - x.core) / b.core_time
    if b.short_conductance != 0.0:
        d_loop = (
            b.short_conductance * (d_psi.real + b.resistance * i.real) - x.loop
        ) / b.short_time
    if by.mode == Rotor.LOCKED:
        return Moving(d_psi, d_core, d_skin, 0.0, 0.0, 0.0, 0.0, d_loop, d_modes), i
    turning, a = b.pole_pairs * x.speed, by.acceleration
    if by.mode == Rotor.DRIVEN:
        return Moving(d_psi, d_core, d_skin, turning, a, a, 0.0, d_loop, d_modes), i
    a, a_load = accelerations(
        b, torque, by.load_torque, x.theta, x.speed, x.load_speed, x.twist, by.bent
    )
    wound_by = x.speed - x.load_speed
    return Moving(d_psi, d_core, d_skin, turning, a, a_load, wound_by, d_loop, d_modes), i


@kernel
def powers(b, t, by, wanted, x):
    """Return the powers at t (s) in a state x; wanted: vector of the legs' states as commanded."""
    magnetising, _ = current_and_torque(b, x.psi, x.theta)
    i = magnetising + core_current(b, x.core)
    link = link_voltage(b, t, by.link_sag)
    v, ideal = by.legs * link, wanted * link
    drop = phase_drop(b, i)
    loss = b.resistance * abs(i) ** 2 + drop.real * i.real + drop.imag * i.imag
    loss += b.skin_resistance * abs(i - x.skin) ** 2 + heated(b.modes, x.modes, i)
    loss += core_loss(b, x.core)[0]
    rubbing = friction(b, x.speed, by.bent) * x.speed
    if b.load_inertia != 0.0:
        rubbing += shaft_damping(b, x.twist) * (x.speed - x.load_speed) ** 2
    supply, commanded = v.real * i.real + v.imag * i.imag, ideal.real * i.real + ideal.imag * i.imag
    output = (
        by.load_torque + drag(b, load_angle(b, x.theta, x.twist), x.load_speed)
    ) * x.load_speed
    return Powers(1.5 * supply, 1.5 * loss + rubbing, output, device_loss(b, i), 1.5 * commanded)


@kernel
def reservoir(b, psi, core, skin, modes, theta, speed, load_speed, twist):
    """Return all stored energy (J): magnetic, core, skin and layers, kinetic, shaft and cogging
    potential."""
    stored = stored_energy(b, psi, theta) + 0.5 * b.skin_resistance * b.skin_time * abs(skin) ** 2
    stored += layers_held(b.modes, modes)
    stored += core_loss(b, core)[1]
    total = 1.5 * stored + 0.5 * (
        b.inertia * speed**2 + b.load_inertia * load_speed**2 + b.stiffness * wound(b, twist) ** 2
    )
    total += 0.5 * crank_inertia(b, load_angle(b, theta, twist)) * load_speed**2
    if b.cogging != 0.0:
        angle = b.cogging_order * theta / b.pole_pairs + b.cogging_phase
        total += b.cogging / b.cogging_order * math.cos(angle)
    return total + cogging_sum(b.harmonics, theta / b.pole_pairs)[1]
