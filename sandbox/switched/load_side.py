"""What the load does beside the torque it is told: a fan, a crank, a load out of true, a load
machine that lags.

All act on the load's side of the shaft, at its mechanical angle (the motor's less the twist) and
speed omega:

- fan: torque fan omega |omega|;
- crank: its inertia is J + crank cos(x), x = 2 angle + crank_phase, as a mass on a crank makes it
  (a long rod: half of m r^2 is mean, half swings).  d/dt (J(angle) omega) - omega^2/2
  dJ/dangle = torque, so a torque of crank sin(x) omega^2 drives beside; kinetic energy J(angle)
  omega^2/2 is kept;
- lobe: torque lobe sin(angle / lobe_turns + lobe_phase), of a wheel out of true behind a belt or a
  gear;
- load_lag: the torque follows what it is told by a first-order lag, period by period, from none at
  the start.

What joins it to the motor stands here, too: a spring, and a damper beside it, on either end of a
gap.
"""

from __future__ import annotations

import math

from model.compiled import inlined, kernel


@inlined
def load_angle(b, theta, twist):
    """Return the load's mechanical angle (rad); theta: rad electrical, of the motor."""
    return theta / b.pole_pairs - twist


@inlined
def wound(b, twist):
    """Return by how much (rad) a shaft is twisted beyond the ends of its gap; 0 inside."""
    return twist - min(max(twist, -0.5 * b.backlash), 0.5 * b.backlash)


@inlined
def shaft_damping(b, twist):
    """Return what damps a shaft (N m s/rad): nothing inside its gap."""
    return 0.0 if b.backlash > 0.0 and wound(b, twist) == 0.0 else b.damping


@inlined
def drag(b, angle, speed):
    """Return the torque (N m) that fan and lobe take beside what the load is told."""
    taken = 0.0
    if b.fan != 0.0:
        taken += b.fan * speed * abs(speed)
    if b.lobe != 0.0:
        taken += b.lobe * math.sin(angle / b.lobe_turns + b.lobe_phase)
    return taken


@kernel
def crank_inertia(b, angle):
    """Return what a crank adds to the load's inertia at an angle (kg m^2)."""
    return b.crank * math.cos(2.0 * angle + b.crank_phase)


@kernel
def load_acceleration(b, inertia, torque, angle, speed):
    """Return the load's acceleration (rad/s^2) under a torque (N m); inertia: its mean one, kg
    m^2."""
    if b.crank == 0.0:
        return torque / inertia
    torque += b.crank * math.sin(2.0 * angle + b.crank_phase) * speed * speed
    return torque / (inertia + crank_inertia(b, angle))


@inlined
def acting_load(b, before, asked):
    """Return the load torque (N m) that acts in a period, after that of the last one."""
    return (
        asked if b.load_lag == 0.0 else asked + (before - asked) * math.exp(-b.period / b.load_lag)
    )
