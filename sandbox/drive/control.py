"""Current and speed control of the drive, compiled; gains come from `sandbox.drive.design`.

The current controller sees the average over one injection period, so that it neither fights the
injection nor is disturbed by it; its voltage leaves room for what is injected.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numba

from estimators.contract import MAX_PERIOD
from model.compiled import kernel
from model.frames import rotate


class Slots(NamedTuple):
    """Places in the controller's state."""

    INTEGRAL_D: int = 0
    INTEGRAL_Q: int = 1
    INTEGRAL_SPEED: int = 2
    CURSOR: int = 3
    FRAME: int = 4
    RING_D: int = 5  # currents of the last period of injection
    RING_Q: int = 5 + MAX_PERIOD


Slot = Slots()  # no enum: before 0.68 numba takes none as an index
SIZE = Slot.RING_Q + MAX_PERIOD
# rad/s: a count of 2 pi p/4096 blurs the speed by 0.3 rad/s (p = 6), lag 11 degrees at 50
ENCODER_BANDWIDTH = 500.0
JUMP = 0.1  # sine of half the angle: 0.2 rad, more than tracking corrects in a sample


class Control(NamedTuple):
    """Gains and limits of the drive's controllers, and the injection."""

    period: int  # samples averaged: one injection period
    sampling_period: float  # s
    kp_d: float  # V/A
    kp_q: float
    ki_d: float  # V/(A s)
    ki_q: float
    magnet_flux: float  # Wb, back-EMF feed-forward
    speed_kp: float  # A/(rad/s), electrical
    speed_ki: float  # A/rad
    current_limit: float  # A
    voltage_limit: float  # V, amplitude
    amplitude: float  # V injected


CONTROL = numba.typeof(Control(0, *11 * (0.0,)))


@kernel
def rest(s):
    """Forget what the integrators hold, as a drive does whose gates are blocked."""
    s[Slot.INTEGRAL_D] = s[Slot.INTEGRAL_Q] = s[Slot.INTEGRAL_SPEED] = 0.0


@kernel
def average(s, i_d, i_q, n):
    """Take one current sample in the control frame; return the average over the last n."""
    j = int(s[Slot.CURSOR])
    s[Slot.RING_D + j], s[Slot.RING_Q + j] = i_d, i_q
    s[Slot.CURSOR] = (j + 1) % n
    d = q = 0.0
    for k in range(n):
        d += s[Slot.RING_D + k]
        q += s[Slot.RING_Q + k]
    return d / n, q / n


@kernel
def speed_control(s, c, omega_ref, omega, feed_forward):
    """Return the q current reference (A): PI with clamped output and conditional integration."""
    error = omega_ref - omega
    wanted = c.speed_kp * error + s[Slot.INTEGRAL_SPEED] + feed_forward
    i_q = min(max(wanted, -c.current_limit), c.current_limit)
    if wanted == i_q or wanted * error < 0.0:
        s[Slot.INTEGRAL_SPEED] += c.sampling_period * c.speed_ki * error
    return i_q


@kernel
def current_control(s, c, i_d, i_q, i_d_ref, i_q_ref, omega_ref, injected):
    """Return u_d, u_q (V) for averaged currents: PI with back-EMF feed-forward, limited in
    amplitude; injected: V that come on top.

    The feed-forward takes the speed asked for: the estimated one would close a loop through the
    magnet flux.
    """
    e_d, e_q = i_d_ref - i_d, i_q_ref - i_q
    u_d = c.kp_d * e_d + s[Slot.INTEGRAL_D]
    u_q = c.kp_q * e_q + s[Slot.INTEGRAL_Q] + omega_ref * c.magnet_flux
    limit = c.voltage_limit - injected
    size = math.hypot(u_d, u_q)
    excess = limit / size if size > limit else 1.0
    back_d, back_q = u_d * (excess - 1.0), u_q * (excess - 1.0)  # back-calculation
    s[Slot.INTEGRAL_D] += c.sampling_period * c.ki_d * (e_d + back_d / c.kp_d)
    s[Slot.INTEGRAL_Q] += c.sampling_period * c.ki_q * (e_q + back_q / c.kp_q)
    return u_d + back_d, u_q + back_q


@kernel
def reorient(s, angle, turned):
    """Keep the integrators' voltage and the averaged currents where they are when the control frame
    jumps.

    turned: rad that the frame should have turned by since the last sample; a jump is what goes
    beyond that.
    """
    change = angle - s[Slot.FRAME] - turned
    if abs(math.sin(0.5 * change)) > JUMP:
        s[Slot.INTEGRAL_D], s[Slot.INTEGRAL_Q] = rotate(
            s[Slot.INTEGRAL_D], s[Slot.INTEGRAL_Q], -change
        )
        for k in range(MAX_PERIOD):
            s[Slot.RING_D + k], s[Slot.RING_Q + k] = rotate(
                s[Slot.RING_D + k], s[Slot.RING_Q + k], -change
            )
    s[Slot.FRAME] = angle


@kernel
def speed_from(memory, first, angle, slope, step, period):
    """Return the speed (rad/s, electrical) that a drive makes of its encoder's angle;
    memory[first:first + 3] its own.

    With counts (step, rad) by a critically damped tracking loop of ENCODER_BANDWIDTH, as drives do;
    without, the slope.
    """
    if step == 0.0:
        return slope
    if memory[first] == 0.0:
        memory[first], memory[first + 1], memory[first + 2] = 1.0, angle, 0.0
        return 0.0
    keep = math.exp(-ENCODER_BANDWIDTH * period)
    predicted = memory[first + 1] + period * memory[first + 2]
    miss = angle - predicted
    memory[first + 1] = predicted + (1.0 - keep * keep) * miss
    memory[first + 2] += (1.0 - keep) ** 2 / period * miss
    return memory[first + 2]
