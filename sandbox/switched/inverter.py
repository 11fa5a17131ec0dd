"""The inverter leg by leg: centred pulses with exact edge times, dead time by the current's sign at
the edge.

State is one float array (`bench_state`); `advance` moves it by one PWM period without allocating.
Between edges the machine is integrated by the classic Runge-Kutta method.  A commanded edge
is *taken* when its time comes (the current's sign there fixes how late it acts) and *acts* at that
later time; a pulse that ends before it begins vanishes.  A late edge may act in the following
period.
"""

from __future__ import annotations

import math

import numpy as np

from model.compiled import inlined, kernel
from sandbox.switched.bench_state import ROOM, SIZE, Slot
from sandbox.switched.gates.modulation import dwelt
from sandbox.switched.gates.short_pulses import kept, no_short, together
from sandbox.switched.layers import CIRCUITS, Held
from sandbox.switched.leg import HARD, TANH, edge_sign, given, reached, table_corner
from sandbox.switched.link import link_step, link_voltage, settled_link, stage
from sandbox.switched.load_side import acting_load
from sandbox.switched.machine_state import Driving, Moving, ahead, mean_rate
from sandbox.switched.phase_machine import (
    A,
    phase_currents,
    powers,
    pull,
    slid,
    slopes,
    vector,
)
from sandbox.switched.readers import channels

NEVER = np.inf
NEAR = 1e-3  # of a step: a corner as near to either end is met as well as it can be
TIE = 1e-13  # s: closer events are one


@kernel
def lag(b, f, start, middle, end, h):
    """Return the first-order lag f after h (s), its input the parabola through three values.

    Exact for any time constant; where the step is short against it, by Simpson's rule (the exact
    form cancels).
    """
    x = h / b.filter_time
    decay = math.exp(-x)
    if x < 0.1:
        return f * decay + x / 6.0 * (start * decay + 4.0 * middle * math.exp(-0.5 * x) + end)
    # input = start + slope s + bend s^2, s = t / time constant
    bend = 2.0 * (start - 2.0 * middle + end) / (x * x)
    slope = (4.0 * middle - 3.0 * start - end) / x
    a = start - slope + 2.0 * bend  # the particular solution at s = 0
    return a + (slope - 2.0 * bend) * x + bend * x * x + (f - a) * decay


@inlined
def corner(b, before, after):
    """Return the share of a step at which the first leg's current reaches a corner of what it
    loses; 1: none does."""
    share, w = 1.0, 0.0 if b.sign_shape == HARD else b.soft_current
    p_a, p_b, p_c = phase_currents(before)
    q_a, q_b, q_c = phase_currents(after)
    for p, q in ((p_a, q_a), (p_b, q_b), (p_c, q_c)):
        if b.threshold != 0.0 and b.sign_shape != TANH:
            share = min(share, reached(p, q, -w), reached(p, q, w))
        share = min(share, table_corner(b.leg_table, p, q))
    return share


@kernel
def integrate(state, b, mode, legs, begin, end, tau, acc):
    """Advance machine and current filter from begin to end (s after t_k) with the legs as they are.

    Runge-Kutta steps end where what a leg loses has a corner (sign of its current, points of its
    table): going over one is of first order.  A step that met one is taken again, up to there.  See
    `steps`.
    """
    if (b.threshold == 0.0 or b.sign_shape == TANH) and not given(b.leg_table):
        steps(state, b, mode, legs, begin, end, tau, acc)
        return
    kept, t = state[len(state) - SIZE :], begin
    while end - t > TIE:
        before, until = complex(state[Slot.I_ALPHA], state[Slot.I_BETA]), min(t + link_step(b), end)
        for k in range(SIZE):
            kept[k] = state[k]
        steps(state, b, mode, legs, t, until, tau, acc)
        share = corner(b, before, complex(state[Slot.I_ALPHA], state[Slot.I_BETA]))
        if NEAR < share < 1.0 - NEAR:
            for k in range(SIZE):
                state[k] = kept[k]
            until = t + share * (until - t)
            steps(state, b, mode, legs, t, until, tau, acc)
        t = until


@kernel
def steps(state, b, mode, legs, begin, end, tau, acc):
    """Advance machine and current filter from begin to end (s after t_k) with the legs as they are.

    legs: vector of the legs' levels; tau: load torque, N m; acc: imposed acceleration, rad/s^2.
    """
    count = math.ceil((end - begin - TIE) / link_step(b))
    if count < 1:
        return
    h = (end - begin) / count
    k, sixth = 0.5 * h, (end - begin) / count / 6.0
    x, f = moving(state), complex(state[Slot.FILTER_ALPHA], state[Slot.FILTER_BETA])
    held, begun = complex(state[Slot.HELD_ALPHA], state[Slot.HELD_BETA]), x.psi
    bent = state[Slot.BENT]
    t = state[Slot.TIME] + begin
    link_sag, link = state[Slot.LINK_SAG], complex(state[Slot.LINK_DIP], state[Slot.LINK_FEED])
    by = Driving(legs, link_sag + link.real, tau, held, begun, mode, acc, bent)
    r1, i1 = slopes(b, t, by, x)
    for _ in range(count):
        if b.bristle_stiffness != 0.0:
            bent = slid(b, bent, x.speed, k)
            by = Driving(legs, link_sag + link.real, tau, held, begun, mode, acc, bent)
            r1, i1 = slopes(b, t, by, x)
        x2, link2 = ahead(x, k, r1), stage(b, legs, i1, link, link, k)
        by2 = Driving(legs, link_sag + link2.real, tau, held, begun, mode, acc, bent)
        r2, i2 = slopes(b, t + k, by2, x2)
        x3, link3 = ahead(x, k, r2), stage(b, legs, i2, link2, link, k)
        by3 = Driving(legs, link_sag + link3.real, tau, held, begun, mode, acc, bent)
        r3, i3 = slopes(b, t + k, by3, x3)
        x4, link4 = ahead(x, h, r3), stage(b, legs, i3, link3, link, h)
        by4 = Driving(legs, link_sag + link4.real, tau, held, begun, mode, acc, bent)
        r4, i4 = slopes(b, t + h, by4, x4)
        if b.audit != 0.0:
            audit(state, b, t, by, sixth, x)
            audit(state, b, t + k, by2, 2.0 * sixth, x2)
            audit(state, b, t + k, by3, 2.0 * sixth, x3)
            audit(state, b, t + h, by4, sixth, x4)
        x = ahead(x, sixth, mean_rate(r1, r2, r3, r4))
        link = settled_link(b, legs, i4, link, (link2, link3, link4), h)
        if b.bristle_stiffness != 0.0:
            bent = slid(b, bent, x.speed, k)
        if b.grip != 0.0:
            held = x.psi - pull(b, begun, x.psi, held)
        begun = x.psi
        t += h
        before = i1
        by = Driving(legs, link_sag + link.real, tau, held, begun, mode, acc, bent)
        r1, i1 = slopes(b, t, by, x)
        if b.filter_time > 0.0:
            f = lag(b, f, before, 0.5 * (i2 + i3), i1, h)
    keep_moving(state, x)
    state[Slot.FILTER_ALPHA], state[Slot.FILTER_BETA] = f.real, f.imag
    state[Slot.HELD_ALPHA], state[Slot.HELD_BETA] = held.real, held.imag
    state[Slot.BENT] = bent
    state[Slot.I_ALPHA], state[Slot.I_BETA] = i1.real, i1.imag
    state[Slot.LINK_DIP], state[Slot.LINK_FEED] = link.real, link.imag


@inlined
def moving(state):
    """Return what the machine remembers."""
    return Moving(
        complex(state[Slot.PSI_ALPHA], state[Slot.PSI_BETA]),
        complex(state[Slot.CORE_ALPHA], state[Slot.CORE_BETA]),
        complex(state[Slot.SKIN_ALPHA], state[Slot.SKIN_BETA]),
        state[Slot.THETA],
        state[Slot.SPEED],
        state[Slot.LOAD_SPEED],
        state[Slot.TWIST],
        state[Slot.LOOP],
        Held(
            complex(state[Slot.MODES], state[Slot.MODES + 1]),
            complex(state[Slot.MODES + 2], state[Slot.MODES + 3]),
            complex(state[Slot.MODES + 4], state[Slot.MODES + 5]),
            complex(state[Slot.MODES + 6], state[Slot.MODES + 7]),
            complex(state[Slot.MODES + 8], state[Slot.MODES + 9]),
            complex(state[Slot.MODES + 10], state[Slot.MODES + 11]),
            complex(state[Slot.MODES + 12], state[Slot.MODES + 13]),
        ),
    )


@inlined
def keep_moving(state, x):
    """Write it."""
    state[Slot.PSI_ALPHA], state[Slot.PSI_BETA] = x.psi.real, x.psi.imag
    state[Slot.CORE_ALPHA], state[Slot.CORE_BETA] = x.core.real, x.core.imag
    state[Slot.SKIN_ALPHA], state[Slot.SKIN_BETA] = x.skin.real, x.skin.imag
    state[Slot.THETA], state[Slot.SPEED], state[Slot.LOAD_SPEED], state[Slot.TWIST] = (
        x.theta,
        x.speed,
        x.load_speed,
        x.twist,
    )
    state[Slot.LOOP] = x.loop
    for k in range(CIRCUITS):
        mode = x.modes[k]
        state[Slot.MODES + 2 * k], state[Slot.MODES + 2 * k + 1] = mode.real, mode.imag


@kernel
def audit(state, b, t, by, weight, x):
    """Add the powers at one Runge-Kutta stage to the audited energies."""
    p = powers(
        b, t, by, vector(state[Slot.WANTED], state[Slot.WANTED + 1], state[Slot.WANTED + 2]), x
    )
    state[Slot.INPUT] += weight * p.supply
    state[Slot.LOSS] += weight * p.loss
    state[Slot.OUTPUT] += weight * p.output
    state[Slot.DEVICES] += weight * p.devices
    state[Slot.COMMANDED] += weight * p.commanded


@kernel
def duties(u_alpha, u_beta, u_dc):
    """Return the legs' duties D = 1/2 + (v_leg + v_0)/u_dc, v_0 = -(max + min)/2, limited to what a
    leg can do."""
    side = 0.5 * math.sqrt(3.0) * u_beta
    v_a, v_b, v_c = u_alpha, -0.5 * u_alpha + side, -0.5 * u_alpha - side
    v_0 = -0.5 * (max(v_a, v_b, v_c) + min(v_a, v_b, v_c))
    d_a, d_b, d_c = 0.5 + (v_a + v_0) / u_dc, 0.5 + (v_b + v_0) / u_dc, 0.5 + (v_c + v_0) / u_dc
    return min(max(d_a, 0.0), 1.0), min(max(d_b, 0.0), 1.0), min(max(d_c, 0.0), 1.0)


@kernel
def leg_duties(b, u_alpha, u_beta, u_dc):
    """Return the legs' duties as the drive knows them, `modulation` and its own least pulse
    included."""
    if b.pattern == 0 and b.beyond == 0:
        d_a, d_b, d_c = duties(u_alpha, u_beta, u_dc)
    else:
        d_a, d_b, d_c = dwelt(b, u_alpha, u_beta, u_dc)
    if b.drive_least_pulse == 0.0:
        return d_a, d_b, d_c
    least = b.drive_least_pulse
    return no_short(b, least, d_a), no_short(b, least, d_b), no_short(b, least, d_c)


@kernel
def pulse(b, duty, shift):
    """Return a leg's commanded rising and falling edge (s after the start of its period); NEVER
    without a pulse.

    shift: s by which it is late, as far as it stays within its period.
    """
    if duty <= 0.0:
        return NEVER, NEVER
    late = b.pwm_delay + within(0.5 * (1.0 - duty) * b.period, shift)
    return 0.5 * (1.0 - duty) * b.period + late, 0.5 * (1.0 + duty) * b.period + late


@kernel
def within(room, shift):
    """Return a pulse's shift (s), limited to the room on either side of it."""
    return min(max(shift, -room), room)


@kernel
def append(state, leg, n, edge):
    """Add a commanded edge to a leg's list, cancelling it with a last commanded one at the same
    instant."""
    base = Slot.EDGES + ROOM * leg
    if n > int(state[Slot.CARRIED + leg]) and abs(state[base + n - 1] - edge) < TIE:
        return n - 1
    state[base + n] = edge
    return n + 1


@kernel
def schedule(state, b, leg, duty):
    """Write a leg's commanded edges of the coming period, delayed ones of the last pulse first;
    return their number."""
    n = int(state[Slot.CARRIED + leg])
    rise, fall = pulse(b, state[Slot.LAST_DUTY + leg], state[Slot.LAST_SHIFT + leg])
    if rise != NEVER and rise - b.period >= 0.0:
        n = append(state, leg, n, rise - b.period)
    if fall != NEVER and fall - b.period >= 0.0:
        n = append(state, leg, n, fall - b.period)
    rise, fall = pulse(b, duty, state[Slot.SHIFT + leg])
    if rise < b.period:
        n = append(state, leg, n, rise)
    if fall < b.period:
        n = append(state, leg, n, fall)
    state[Slot.LAST_DUTY + leg], state[Slot.LAST_SHIFT + leg] = duty, state[Slot.SHIFT + leg]
    return n


@kernel
def settle(state, b, leg, acted, taken, n, t, current):
    """Take and let act every edge of a leg that is due at t; return the new acted, taken, n.

    Edges [acted, taken) of the list are late ones that have not acted yet, [taken, n) not yet
    commanded.
    """
    base = Slot.EDGES + ROOM * leg
    while True:
        if acted < taken and state[base + acted] <= t + TIE:
            state[Slot.LEVEL + leg] = (
                state[Slot.WANTED + leg] if b.capacitance > 0.0 else 1.0 - state[Slot.LEVEL + leg]
            )
            acted += 1
        elif taken < n and state[base + taken] <= t + TIE:
            rising = state[Slot.WANTED + leg] == 0.0
            state[Slot.WANTED + leg] = 1.0 - state[Slot.WANTED + leg]
            if b.capacitance > 0.0:  # both switches off; one that was to turn on does not
                state[base + taken] += abs(b.dead_time)
                acted, taken = taken, taken + 1
                continue
            if b.dead_time != 0.0:
                sign = edge_sign(b, current if rising else -current)
                state[base + taken] += 0.5 * (abs(b.dead_time) + b.dead_time * sign)
            if acted < taken and state[base + taken] <= state[base + taken - 1]:
                # the pulse vanishes
                for j in range(taken + 1, n):
                    state[base + j - 2] = state[base + j]
                n -= 2
                taken -= 1
            else:
                taken += 1
        else:
            return acted, taken, n


@inlined
def slewed(b, level, current, span, link):
    """Return a leg's level after a span (s) between its switches: i/(2 C) moves it as far as a
    diode lets it."""
    return min(max(level - current * span / (2.0 * b.capacitance * link), 0.0), 1.0)


@kernel
def slice_of(state, b, off, i_a, i_b, i_c):
    """Return the step (s) while legs are off: a small one, or as long as no diode's current can
    come to zero."""
    step, current = NEVER, (i_a, i_b, i_c)
    link = link_voltage(b, state[Slot.TIME], state[Slot.LINK_SAG] + state[Slot.LINK_DIP])
    for leg in range(3):
        if off[leg]:
            level, i = state[Slot.LEVEL + leg], current[leg]
            kept = (level <= 0.0 and i > 0.0) or (level >= 1.0 and i < 0.0)
            step = min(step, 0.5 * abs(i) * b.reluctant / link if kept else 0.0)
    return max(step, b.dead_time / b.slices)


@kernel
def slew(state, b, mode, begin, end, tau, acc, off):
    """Advance from begin to end while legs are off (three of 0 or 1): their levels by the mean
    current of the step."""
    link = link_voltage(b, state[Slot.TIME] + begin, state[Slot.LINK_SAG] + state[Slot.LINK_DIP])
    levels = (state[Slot.LEVEL], state[Slot.LEVEL + 1], state[Slot.LEVEL + 2])
    before = phase_currents(complex(state[Slot.I_ALPHA], state[Slot.I_BETA]))
    for leg in range(3):
        if off[leg]:
            state[Slot.LEVEL + leg] = slewed(b, levels[leg], before[leg], 0.5 * (end - begin), link)
    integrate(state, b, mode, switch_vector(state), begin, end, tau, acc)
    after = phase_currents(complex(state[Slot.I_ALPHA], state[Slot.I_BETA]))
    for leg in range(3):
        if off[leg]:
            state[Slot.LEVEL + leg] = slewed(
                b, levels[leg], 0.5 * (before[leg] + after[leg]), end - begin, link
            )


@kernel
def due(state, leg, acted, taken, n):
    """Return the time of a leg's next event."""
    base = Slot.EDGES + ROOM * leg
    late = state[base + acted] if acted < taken else NEVER
    return min(late, state[base + taken] if taken < n else NEVER)


@kernel
def carry(state, b, leg, acted, taken):
    """Keep a leg's late edges that act after the period; return their number."""
    base = Slot.EDGES + ROOM * leg
    for j in range(acted, taken):
        state[base + j - acted] = state[base + j] - b.period
    state[Slot.CARRIED + leg] = taken - acted


@kernel
def switch_vector(state):
    """Return the vector of the legs' levels (0/1): zero in both zero vectors."""
    a, b, c = state[Slot.LEVEL], state[Slot.LEVEL + 1], state[Slot.LEVEL + 2]
    return (2.0 / 3.0) * (a + b * A + c * A.conjugate())


@kernel
def reading_due(state, b, j):
    """Return when (s after t_k) the j-th reading inside the period is taken; NEVER after the
    last."""
    n = state[Slot.READINGS]
    return min(max((j + 0.5) * b.period / n + b.sampling_delay, 0.0), b.period) if j < n else NEVER


@kernel
def early_due(state, b, j):
    """Return when (s after t_k) the j-th channel is read for t_k+1 if that is before it; NEVER for
    others."""
    at = state[Slot.OFFSET] + j * b.channel_lag
    return b.period + at if j < channels(b) and at < 0.0 else NEVER


@kernel
def early_slot(j):
    """Return where the j-th channel's early sample is kept."""
    return Slot.SAMPLES + 2 * j


@kernel
def hold(state, b, first):
    """Write the current vector that a sensor sees now to two slots."""
    state[first], state[first + 1] = state[Slot.I_ALPHA], state[Slot.I_BETA]
    if b.filter_time > 0.0:
        state[first], state[first + 1] = state[Slot.FILTER_ALPHA], state[Slot.FILTER_BETA]


@kernel
def travel(state, b, mode, u_alpha, u_beta, u_dc, load_torque, acceleration, end):
    """Switch and integrate from t_k to t_k + end; edges beyond stay undone (see `advance`,
    `simulate.measure`)."""
    d_a, d_b, d_c = leg_duties(b, u_alpha, u_beta, u_dc)
    d_a, d_b, d_c = together(b, kept(b, d_a), kept(b, d_b), kept(b, d_c))
    pattern = b.pwm_delay if b.sag != 0.0 else NEVER  # from then on these duties draw from the link
    t_a, t_b, t_c = (
        int(state[Slot.CARRIED]),
        int(state[Slot.CARRIED + 1]),
        int(state[Slot.CARRIED + 2]),
    )
    n_a, n_b, n_c = (
        schedule(state, b, 0, d_a),
        schedule(state, b, 1, d_b),
        schedule(state, b, 2, d_c),
    )
    a_a = a_b = a_c = 0
    early_j, early = 0, early_due(state, b, 0)
    j, inside = 0, reading_due(state, b, 0)
    load_torque = acting_load(b, state[Slot.LOAD], load_torque)
    t = 0.0
    while True:
        i_a, i_b, i_c = phase_currents(complex(state[Slot.I_ALPHA], state[Slot.I_BETA]))
        if t >= pattern - TIE:
            state[Slot.LINK_SAG], pattern = b.sag * (d_a * i_a + d_b * i_b + d_c * i_c), NEVER
        a_a, t_a, n_a = settle(state, b, 0, a_a, t_a, n_a, t, i_a)
        a_b, t_b, n_b = settle(state, b, 1, a_b, t_b, n_b, t, i_b)
        a_c, t_c, n_c = settle(state, b, 2, a_c, t_c, n_c, t, i_c)
        while t >= early:
            hold(state, b, early_slot(early_j))
            early_j += 1
            early = early_due(state, b, early_j)
        while t >= inside:
            hold(state, b, Slot.READINGS + 1 + 2 * j)
            j += 1
            inside = reading_due(state, b, j)
        if t >= end:
            break
        until = min(
            due(state, 0, a_a, t_a, n_a), due(state, 1, a_b, t_b, n_b), due(state, 2, a_c, t_c, n_c)
        )
        until = min(until, early, inside, pattern, end)
        off = (a_a < t_a, a_b < t_b, a_c < t_c)
        if b.capacitance > 0.0 and (off[0] or off[1] or off[2]):
            until = min(until, t + slice_of(state, b, off, i_a, i_b, i_c))
            slew(state, b, mode, t, until, load_torque, acceleration, off)
        else:
            integrate(state, b, mode, switch_vector(state), t, until, load_torque, acceleration)
        t = until
    carry(state, b, 0, a_a, t_a)
    carry(state, b, 1, a_b, t_b)
    carry(state, b, 2, a_c, t_c)


@kernel
def advance(state, b, mode, u_alpha, u_beta, u_dc, load_torque, acceleration):
    """Advance the bench by one PWM period in place, from t_k to t_k+1.

    u_alpha, u_beta: commanded voltage (V); u_dc: link voltage as read (V), by which the controller
    divides;
    load_torque: N m (FREE); acceleration: mechanical rad/s^2 (DRIVEN).  mode: LOCKED, DRIVEN or
    FREE.
    """
    travel(state, b, mode, u_alpha, u_beta, u_dc, load_torque, acceleration, b.period)
    state[Slot.TIME] += b.period
    state[Slot.LOAD] = acting_load(b, state[Slot.LOAD], load_torque)
