"""The DC link: error, sag and ripple of the effect library, and a resonance of its own.

Resonance: a stiff source behind an inductance and the link's capacitance.  x is the link's dip
below the source (V), y = Z i_L the inductance's current times Z = sqrt(L/C); the inverter draws
i_dc, the sum of legs' levels times currents:

    dx/dt = w (Z i_dc - y),   dy/dt = w (x - 2 D y),   w = 1/sqrt(L C),   D = R/(2 Z)

At a steady draw the link stays 2 D Z i_dc low; a step of the draw rings with w sqrt(1 - D^2), for
D = 0 by Z i_dc.
"""

from __future__ import annotations

import math

from model.compiled import inlined, kernel

RESOLVED = 0.2  # rad of the resonance, the longest step


@kernel
def link_voltage(b, t, link_sag):
    """Return the true DC-link voltage (V) at time t from the recording's start; link_sag: by the
    load (V)."""
    if b.ripple_amplitude == 0.0:
        return b.link_voltage - link_sag
    return (
        b.link_voltage
        - link_sag
        + b.ripple_amplitude * math.sin(b.ripple_rate * t + b.ripple_phase)
    )


@kernel
def link_slope(b, legs, i, link):
    """Return the time derivative of link = x + j y (V); legs: vector of the legs' levels, i:
    terminal current (A)."""
    drawn = 1.5 * (legs.real * i.real + legs.imag * i.imag)
    swing = complex(-link.imag, link.real - 2.0 * b.link_damping * link.imag)
    return b.link_rate * (swing + b.link_impedance * drawn)


@inlined
def stage(b, legs, i, at, start, h):
    """Return the link h (s) after `start`, with its slope at a Runge-Kutta stage's current and link
    `at`."""
    return start if b.link_rate == 0.0 else start + h * link_slope(b, legs, i, at)


@inlined
def settled_link(b, legs, i, before, stages, h):
    """Return the link after a Runge-Kutta step; before: at its begin, stages: the three behind it,
    i at the last.

    With those at y + h/2 s1, y + h/2 s2, y + h s3: y + h/6 (s1 + 2 s2 + 2 s3 + s4) in their terms.
    """
    if b.link_rate == 0.0:
        return before
    two, three, four = stages
    return (two + 2.0 * three + four - before) / 3.0 + h / 6.0 * link_slope(b, legs, i, four)


@inlined
def link_step(b):
    """Return the longest integration step (s), short enough for the resonance, however the bench
    came to have it."""
    return min(b.step, RESOLVED / b.link_rate) if b.link_rate > 0.0 else b.step
