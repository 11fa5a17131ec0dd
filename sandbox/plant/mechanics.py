"""The shaft over a step: rigid, or two masses; exact for torques that are constant in it.

Rotor and load together turn like one mass; beside it, twist and slip of a compliant shaft swing
about their rest, and cross the gap of one with backlash (`sandbox.plant.backlash`).
"""

from __future__ import annotations

import math

from model.compiled import inlined, kernel
from model.lanes import fading
from sandbox.plant import additions as add
from sandbox.plant import ports
from sandbox.plant.backlash import swing_across, swung

SHORT_SLIP = 1e-3  # of the bristles' bend: there a series of third order has all digits


@kernel
def step_shaft(w, features, h, load, imposed):
    """Move angle, speed and twist on by h (s) under the torque in w; load: asked of the load
    machine, N m.

    w.turn, w.omega: mechanical angle (rad) and speed (rad/s) of the rotor in the middle of the
    step, for friction and torques bound to position; imposed: rad/s^2 electrical.
    """
    if features & add.RUB:
        for j in range(w.psi_alpha.size):
            w.bound[j] = ports.torque(w, j, w.turn[j], w.omega[j])
        for k in range(w.more_torque):
            for j in range(w.psi_alpha.size):
                w.bound[j] += ports.further_torque(w, k, j, w.turn[j], w.omega[j])
        if features & add.BRISTLES:
            for j in range(w.psi_alpha.size):
                w.bound[j] -= bend(w, j, w.omega[j], h)
    for j in range(w.psi_alpha.size):
        pairs = w.pairs[j]
        taken, net = load * (1.0 + w.load_gain[j]) + w.load_offset[j], w.torque[j]
        if features & add.RUB:
            taken += ports.load(w, j, w.omega[j] - w.slip[j])
            net += w.bound[j] - ports.friction(w, j, w.omega[j])
        a = pairs * w.inertia_inv[j] * (net - taken) + imposed
        w.angle[j] += h * (w.speed[j] + 0.5 * h * a)
        w.speed[j] += h * a
        w.net[j], w.taken[j] = net, taken
    if features & add.TWIST:
        swing(w, features, h)


@inlined
def bend(w, j, omega, h):
    """Return the mean torque (N m) of lane j's bristles over a step of h (s) at a speed (rad/s,
    mechanical), and bend them on.

    Their torque F follows dF/dt = stiffness (omega - |omega| F/level), damping times its rate over
    the stiffness beside it: at one speed it relaxes towards the level with the angle turned.
    """
    stiffness, damping, level, _ = ports.bristles(w, j, omega, 1.0 / w.motor_inv[j])
    there = 1.0 if stiffness > 0.0 else 0.0
    level += 1.0 - there
    slip = stiffness * abs(omega) * h / level
    kept = fading(-slip)
    long = max(slip, SHORT_SLIP)
    series = 1.0 - slip * (0.5 - slip * (1.0 / 6 - slip * (1.0 / 24)))
    mean = (1.0 - kept) / long if slip > SHORT_SLIP else series
    rest = level if omega >= 0.0 else -level
    away = w.bristle[j] - rest
    w.bristle[j] = there * (rest + kept * away)
    return there * (rest + mean * away * (1.0 - damping * abs(omega) / level))


@kernel
def begin_bristles(w, omega):
    """Bend the bristles of all lanes as at a speed (rad/s, mechanical) that nobody knows to have
    lasted."""
    for j in range(w.psi_alpha.size):
        _, _, _, w.bristle[j] = ports.bristles(w, j, omega, 1.0 / w.motor_inv[j])


@kernel
def swing(w, features, h):
    """Move twist and slip (difference of both speeds) on by h: a damped swing about the twist at
    rest, or one across a gap."""
    if features & add.BACKLASH:
        for j in range(w.psi_alpha.size):
            if w.backlash[j] > 0.0 and w.swing_rate[j] > 0.0:
                push = w.net[j] * w.motor_inv[j] + w.taken[j] * w.load_inv[j]
                half, rate, ratio = 0.5 * w.backlash[j], w.swing_rate[j], w.swing_ratio[j]
                w.twist[j], w.slip[j] = swing_across(
                    w.twist[j], w.slip[j], push, half, rate, ratio, h
                )
            else:
                swing_lane(w, j, h)
    else:
        for j in range(w.psi_alpha.size):
            swing_lane(w, j, h)


@inlined
def swing_lane(w, j, h):
    """Do so for lane j without a gap.

    One whose shaft is rigid (swing_rate 0) has neither twist nor slip.
    """
    there = 1.0 if w.swing_rate[j] > 0.0 else 0.0
    rate, ratio = w.swing_rate[j] + (1.0 - there), w.swing_ratio[j]
    root = math.sqrt(1.0 - ratio * ratio)
    rest = (w.net[j] * w.motor_inv[j] + w.taken[j] * w.load_inv[j]) / (rate * rate)
    x, v = swung(w.twist[j] - rest, w.slip[j], rate, ratio, root, h)
    w.twist[j], w.slip[j] = there * (rest + x), there * v


@kernel
def turned_by(w, features, torque, period, parts, angle):
    """Write how the first lane's rotor moves from rest: angle (n,) rad electrical of torque (n,),
    held for a period.

    parts: steps a period, for friction that changes within it.
    """
    h = period / parts
    swing = w.pairs[0] * w.load_share[0]
    for k in range(1, len(torque)):
        for _ in range(parts):
            omega = w.speed[0] + swing * w.slip[0]
            w.turn[0] = (w.angle[0] + swing * w.twist[0] + 0.5 * h * omega) / w.pairs[0]
            w.torque[0], w.omega[0] = torque[k - 1], omega / w.pairs[0]
            step_shaft(w, features, h, 0.0, 0.0)
        angle[k] = w.angle[0] + swing * w.twist[0]
