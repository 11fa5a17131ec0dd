"""What the machine remembers, what acts on it, and how far a Runge-Kutta step takes it."""

from __future__ import annotations

from typing import NamedTuple

from model.compiled import inlined
from sandbox.switched.layers import Held, along


class Moving(NamedTuple):
    """What the machine remembers, or by how much it changes in a second."""

    psi: complex  # flux, Wb
    core: complex  # current of eddy currents, A (excess loss alone: over a branch of 1 ohm)
    skin: complex  # slow part of the current (skin effect), A
    theta: float  # rad electrical
    speed: float  # rad/s mechanical
    load_speed: float
    twist: float  # rad mechanical
    loop: float  # what short-circuited turns take of phase a's current, A
    modes: Held = Held()  # slow parts of the current in layers of conductors, A


class Driving(NamedTuple):
    """What acts on it: vector of the legs' states (0/1), which times the link's voltage is the
    voltage; V by which the link sags; load torque (N m); flux that hysteresis holds, and flux,
    where a step begins (see `pull`); how the rotor moves: LOCKED, DRIVEN with a mechanical
    acceleration (rad/s^2), or FREE; and the angle (rad) by which bristles are bent (constant
    between steps, see `slid`)."""

    legs: complex
    link_sag: float
    load_torque: float
    held: complex
    begun: complex
    mode: int
    acceleration: float
    bent: float = 0.0


class Powers(NamedTuple):
    """Power (W) from the DC link, all losses, that given to the load, lost in the devices, and what
    the link would give if the legs stood as commanded (without dead time)."""

    supply: float
    loss: float
    output: float
    devices: float
    commanded: float


@inlined
def ahead(x, h, rate):
    """Return the state h (s) after x at a rate."""
    return Moving(
        x.psi + h * rate.psi,
        x.core + h * rate.core,
        x.skin + h * rate.skin,
        x.theta + h * rate.theta,
        x.speed + h * rate.speed,
        x.load_speed + h * rate.load_speed,
        x.twist + h * rate.twist,
        x.loop + h * rate.loop,
        along(x.modes, h, rate.modes),
    )


@inlined
def mean_rate(a, b, c, d):
    """Return six times the mean of four stages' rates, as the classic Runge-Kutta method weighs
    them."""
    return Moving(
        a.psi + 2.0 * (b.psi + c.psi) + d.psi,
        a.core + 2.0 * (b.core + c.core) + d.core,
        a.skin + 2.0 * (b.skin + c.skin) + d.skin,
        a.theta + 2.0 * (b.theta + c.theta) + d.theta,
        a.speed + 2.0 * (b.speed + c.speed) + d.speed,
        a.load_speed + 2.0 * (b.load_speed + c.load_speed) + d.load_speed,
        a.twist + 2.0 * (b.twist + c.twist) + d.twist,
        a.loop + 2.0 * (b.loop + c.loop) + d.loop,
        along(along(along(a.modes, 2.0, b.modes), 2.0, c.modes), 1.0, d.modes),
    )
