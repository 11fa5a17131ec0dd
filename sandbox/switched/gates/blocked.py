"""Blocked gates on the bench, event by event: which diodes conduct, until a current ends or a
voltage turns one on.

Legs that conduct stand at a rail, by their current's sign; a leg without current floats where its
current stays zero, which a few trial steps find (secants).  A step in which a conducting leg's
current would change its sign ends there; a floating leg that would go beyond a rail conducts from
the step's start on.  Apart from `sandbox.plant.gates.blocked`, which knows no events.
"""

from __future__ import annotations

import numpy as np

from model.compiled import kernel
from sandbox.switched.bench_state import SIZE, Slot
from sandbox.switched.inverter import steps
from sandbox.switched.link import link_voltage
from sandbox.switched.load_side import acting_load
from sandbox.switched.phase_machine import phase_currents, vector

LOW, FLOATS, HIGH = 0.0, 0.5, 1.0
PARTS = 128  # steps of a period, events aside
NOTHING = 1e-9  # of the sign's width: no current
TURNS = 40  # changes of what conducts in a step
TRIAL = 1e-3  # of the link


@kernel
def legs_of(held, level):
    """Return the vector of three legs: held at a rail, or floating at a level."""
    a = held[0] if held[0] != FLOATS else level
    b = held[1] if held[1] != FLOATS else level
    return vector(a, b, held[2] if held[2] != FLOATS else level)


@kernel
def tried(state, b, mode, legs, begin, end, tau, acc, kept):
    """Step from the state kept and return the current at the end."""
    for k in range(SIZE):
        state[k] = kept[k]
    steps(state, b, mode, legs, begin, end, tau, acc)
    return complex(state[Slot.I_ALPHA], state[Slot.I_BETA])


@kernel
def floating(state, b, mode, begin, end, tau, acc, kept):
    """Step with no current in any leg; return the vector of the legs that keeps it so."""
    legs = complex(0.0, 0.0)
    for _ in range(3):
        i = tried(state, b, mode, legs, begin, end, tau, acc, kept)
        x = (tried(state, b, mode, legs + TRIAL, begin, end, tau, acc, kept) - i) / TRIAL
        y = (tried(state, b, mode, legs + 1j * TRIAL, begin, end, tau, acc, kept) - i) / TRIAL
        det = x.real * y.imag - x.imag * y.real
        legs -= complex(i.real * y.imag - i.imag * y.real, x.real * i.imag - x.imag * i.real) / det
    tried(state, b, mode, legs, begin, end, tau, acc, kept)
    return legs


@kernel
def one_floats(state, b, mode, held, leg, begin, end, tau, acc, kept):
    """Step with two legs at rails; return the level of the third, whose current stays zero."""
    level, other = 0.5, 0.5 + TRIAL
    miss = phase_currents(tried(state, b, mode, legs_of(held, level), begin, end, tau, acc, kept))[
        leg
    ]
    for _ in range(4):
        far = phase_currents(
            tried(state, b, mode, legs_of(held, other), begin, end, tau, acc, kept)
        )[leg]
        if far == miss:
            break
        level, other, miss = other, other - far * (other - level) / (far - miss), far
    tried(state, b, mode, legs_of(held, other), begin, end, tau, acc, kept)
    return other


@kernel
def settle_diodes(b, state, held):
    """Write at which rail each leg stands for its current, or that it floats."""
    i = phase_currents(complex(state[Slot.I_ALPHA], state[Slot.I_BETA]))
    for leg in range(3):
        held[leg] = (
            FLOATS if abs(i[leg]) <= NOTHING * b.soft_current else (LOW if i[leg] > 0.0 else HIGH)
        )


@kernel
def count(held):
    """Return how many legs float, and the last of them."""
    n, last = 0, 0
    for leg in range(3):
        if held[leg] == FLOATS:
            n, last = n + 1, leg
    return n, last


@kernel
def one_step(state, b, mode, held, begin, end, tau, acc, kept):
    """Step from begin towards end (s); return where it ended and the vector of the legs.

    held: three legs' rails, renewed where something begins or stops to conduct.
    """
    legs = complex(0.0, 0.0)
    for _ in range(TURNS):
        n, leg = count(held)
        if n >= 2:
            legs = floating(state, b, mode, begin, end, tau, acc, kept)
            p = phase_currents(legs)  # the same projection on three axes
            top, bottom = max(p[0], p[1], p[2]), min(p[0], p[1], p[2])
            if top - bottom <= 1.0:
                return end, legs
            for k in range(3):
                held[k] = HIGH if p[k] == top else (LOW if p[k] == bottom else FLOATS)
            continue
        if n == 1:
            level = one_floats(state, b, mode, held, leg, begin, end, tau, acc, kept)
            if not 0.0 <= level <= 1.0:
                held[leg] = LOW if level < 0.0 else HIGH
                continue
            legs = legs_of(held, level)
        else:
            legs = legs_of(held, 0.0)
            tried(state, b, mode, legs, begin, end, tau, acc, kept)
        before = phase_currents(complex(kept[Slot.I_ALPHA], kept[Slot.I_BETA]))
        after = phase_currents(complex(state[Slot.I_ALPHA], state[Slot.I_BETA]))
        share, ends = 1.0, -1
        for k in range(3):
            wrong = (held[k] == LOW and after[k] < 0.0) or (held[k] == HIGH and after[k] > 0.0)
            if wrong and before[k] != after[k]:
                at = before[k] / (before[k] - after[k])
                share, ends = (at, k) if at < share else (share, ends)
        if ends < 0:
            return end, legs
        if share * (end - begin) < 1e-13:
            held[ends] = FLOATS
            continue
        end = begin + share * (end - begin)
        if abs(after[ends]) <= 1e-6 * b.soft_current:
            held[ends] = FLOATS
            return end, legs
    return end, legs


@kernel
def coast(state, b, mode, load_torque, acceleration):
    """Advance the bench by one PWM period in place with all gates blocked; return the legs' mean
    voltage (V).

    Arguments as `inverter.advance`.
    """
    kept, held, delivered = state[2 * SIZE :], np.zeros(3), complex(0.0, 0.0)
    tau = acting_load(b, state[Slot.LOAD], load_torque)
    for leg in range(3):
        state[Slot.LEVEL + leg] = state[Slot.WANTED + leg] = 0.0
        state[Slot.CARRIED + leg] = state[Slot.LAST_DUTY + leg] = 0.0
    state[Slot.LINK_SAG], t = 0.0, 0.0
    settle_diodes(b, state, held)
    while t < b.period * (1.0 - 1e-12):
        for k in range(SIZE):
            kept[k] = state[k]
        until, legs = one_step(
            state, b, mode, held, t, min(t + b.period / PARTS, b.period), tau, acceleration, kept
        )
        delivered += legs * link_voltage(b, state[Slot.TIME] + 0.5 * (t + until), 0.0) * (until - t)
        t = until
    state[Slot.TIME] += b.period
    state[Slot.LOAD] = acting_load(b, state[Slot.LOAD], load_torque)
    return delivered / b.period
