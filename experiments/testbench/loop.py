"""One recording: controller, modulator, legs and sensors around the plant, period by period."""

import math

import numpy as np
from numba import njit

from .compiled import piece
from .plant import (
    ROOT3,
    advance,
    currents,
    rk4,
    switch,
)
from .types import DRIVEN, FLOATING, HIGH, LOCKED, LOW, SPEED, VOLTAGE, World

QUEUE = 12  # pending events of a leg


@piece
def push(times, kinds, count, x, t, kind):
    """Insert an event of leg x in order of time."""
    n = count[x]
    while n > 0 and times[x, n - 1] > t:
        times[x, n] = times[x, n - 1]
        kinds[x, n] = kinds[x, n - 1]
        n -= 1
    times[x, n] = t
    kinds[x, n] = kind
    count[x] += 1


@piece
def pop(times, kinds, count, x):
    """Take the first event of leg x."""
    kind = kinds[x, 0]
    for n in range(1, count[x]):
        times[x, n - 1] = times[x, n]
        kinds[x, n - 1] = kinds[x, n]
    count[x] -= 1
    return kind


@piece
def modulate(inv, start, u_alpha, u_beta, link_read, times, kinds, count):
    """Edges of one period: centred pulses, D = 1/2 + (v + v_0)/u_dc, v_0 by min and max, rounded to
    counter steps."""
    v = (u_alpha, -0.5 * u_alpha + 0.5 * ROOT3 * u_beta, -0.5 * u_alpha - 0.5 * ROOT3 * u_beta)
    zero = -0.5 * (max(v[0], v[1], v[2]) + min(v[0], v[1], v[2]))
    early = max(0.0, -inv.dead_time_ideal)  # an over-compensated edge is decided this much before
    for x in range(3):
        duty = 0.5 + (v[x] + zero) / link_read
        if inv.counts > 0.0:
            duty = math.floor(duty * inv.counts + 0.5) / inv.counts
        duty = min(max(duty, 0.0), 1.0)
        t = start + inv.delay[x] - early
        push(times, kinds, count, x, t + 0.5 * (1.0 - duty) * inv.period, HIGH)
        push(times, kinds, count, x, t + 0.5 * (1.0 + duty) * inv.period, LOW)


CLOSE = 4  # an event kind of CLOSE + HIGH or LOW closes a switch after a dead time or a shift


@piece
def gate(inv, x, kind, t, current, y, legs, times, kinds, count, mag, loss, memory):
    """An event of leg x at time t: a commanded edge, or a switch that closes after its dead
    time."""
    if kind >= CLOSE:
        switch(x, kind - CLOSE, t, y, legs, mag, loss, inv, memory)
        return
    shift = 0.0
    if inv.dead_time_ideal != 0.0:
        s = max(-1.0, min(1.0, current / inv.zone))
        shift = inv.dead_time_ideal * max(s if kind == HIGH else -s, 0.0) + max(
            0.0, -inv.dead_time_ideal
        )
    if inv.dead_time > 0.0:
        if shift > 0.0:
            push(times, kinds, count, x, t + shift + inv.dead_time, CLOSE + kind)
            push(times, kinds, count, x, t + shift, CLOSE + FLOATING)
        else:
            switch(x, FLOATING, t, y, legs, mag, loss, inv, memory)
            push(times, kinds, count, x, t + inv.dead_time, CLOSE + kind)
    elif shift > 0.0:
        push(times, kinds, count, x, t + shift, CLOSE + kind)
    else:
        switch(x, kind, t, y, legs, mag, loss, inv, memory)


@piece
def seen_current(sens, mag, loss, y, memory, x):
    """Phase current x behind the analog filter."""
    if sens.filter[0] > 0.0:
        a, b = y[11], y[12]
    else:
        a, b, _ = currents(mag, loss, y, memory)
    if x == 0:
        return a
    return -0.5 * a + (0.5 if x == 1 else -0.5) * ROOT3 * b


@piece
def read_current(sens, x, i, t, noise, remanence):
    """What sensor x gives for a current: gain with a cubic, offset with drift, play, soft limit,
    noise, resolution."""
    if sens.hysteresis > 0.0:
        remanence[x] = min(max(remanence[x], i - sens.hysteresis), i + sens.hysteresis)
        i = remanence[x]
    if sens.clip > 0.0:
        i = i / (1.0 + abs(i / sens.clip) ** 6) ** (1.0 / 6.0)
    r = sens.gain[x] * i * (1.0 + sens.cubic * (i / sens.full_scale) ** 2)
    r += sens.offset[x] + sens.offset_drift[x] * t + noise
    if sens.resolution > 0.0:
        r = math.floor(r / sens.resolution + 0.5) * sens.resolution
    return r


@piece
def read_angle(sens, pole_pairs, y, turned):
    """Electrical angle that the encoder gives."""
    m = y[2] / pole_pairs
    e = sens.eccentricity
    m_read = m + e[0] * math.sin(m + e[1]) + e[2] * math.sin(2 * m + e[3]) + sens.slip * turned
    m_read += sens.angle_offset / pole_pairs - sens.angle_latency * y[3]
    if sens.lines > 0.0:
        step = 2 * math.pi / sens.lines
        m_read = math.floor(m_read / step + 0.5) * step
    return m_read * pole_pairs


@piece
def command(ctl, references, inv, memo, k, i_abc, theta, link_read, ring):
    """Voltage command (alpha, beta) for the next period from what has been read.

    `memo`: integrators d, q, speed integrator, filtered speed, last angle, angle known.
    """
    n = references.mode
    ts = inv.period
    w = (theta - memo[4]) / ts if memo[5] > 0.0 else 0.0
    memo[4], memo[5] = theta, 1.0
    memo[3] += min(1.0, ts * 600.0) * (w - memo[3])
    i_alpha = (2 * i_abc[0] - i_abc[1] - i_abc[2]) / 3.0
    i_beta = (i_abc[1] - i_abc[2]) / ROOT3
    c, s = math.cos(theta), math.sin(theta)
    period = ctl.injection_period if ctl.injection_axis > 0 else 1
    ring[k % period, 0] = c * i_alpha + s * i_beta
    ring[k % period, 1] = c * i_beta - s * i_alpha
    i_d, i_q = 0.0, 0.0
    for j in range(period):
        i_d += ring[j, 0] / period
        i_q += ring[j, 1] / period
    j = min(k + references.before, references.reference_d.size - 1)
    r_d, r_q = references.reference_d[j], references.reference_q[j]
    if n == VOLTAGE:
        u_d, u_q, e_d, e_q = r_d, r_q, 0.0, 0.0
    else:
        if n == SPEED and math.isnan(r_q):
            e = references.speed[j] - memo[3] / memo[6]
            r_q = ctl.speed_bandwidth * ctl.inertia / ctl.torque_constant * e + memo[2]
            held = min(max(r_q, -ctl.limit), ctl.limit)
            if held == r_q:
                memo[2] += (
                    ts * 0.25 * ctl.speed_bandwidth**2 * ctl.inertia / ctl.torque_constant * e
                )
            r_q = held
        b = ctl.bandwidth
        e_d, e_q = r_d - i_d, r_q - i_q
        l_d, l_q = ctl.inductance[0], ctl.inductance[1]
        u_d = b * l_d * e_d + memo[0] - memo[3] * l_q * i_q
        u_q = b * l_q * e_q + memo[1] + memo[3] * (l_d * i_d + ctl.magnet)
    size = math.sqrt(u_d * u_d + u_q * u_q)
    most = 0.93 * link_read / ROOT3 - (ctl.injection if ctl.injection_axis > 0 else 0.0)
    if size > most:
        u_d, u_q = u_d * most / size, u_q * most / size
    elif n != VOLTAGE:
        b = ctl.bandwidth
        memo[0] += ts * b * max(ctl.resistance, 0.3 * b * ctl.inductance[0]) * e_d
        memo[1] += ts * b * max(ctl.resistance, 0.3 * b * ctl.inductance[1]) * e_q
    if ctl.injection_axis > 0:
        sign = 1.0 if (k + 1) % ctl.injection_period < ctl.injection_period // 2 else -1.0
        if ctl.injection_axis == 1:
            u_d += sign * ctl.injection
        else:
            u_q += sign * ctl.injection
    ahead = theta + (1.5 * ts * memo[3] if references.rotor != LOCKED else 0.0)
    c, s = math.cos(ahead), math.sin(ahead)
    return c * u_d - s * u_q, s * u_d + c * u_q


@njit(cache=True)
def run(mag, loss, inv, mech, sens, ctl, references, y, step, out):
    """Run a recording from state y.

    `out` (n, 12): u_alpha, u_beta, i_a, i_b, i_c, theta, u_dc, load; then the truth: i_alpha,
    i_beta, speed, torque.
    """
    ts = inv.period
    n_total = references.reference_d.size
    times = np.zeros((3, QUEUE))
    kinds = np.zeros((3, QUEUE), dtype=np.int64)
    count = np.zeros(3, dtype=np.int64)
    legs = np.zeros((2, 3), dtype=np.int64)
    size = y.size
    work = (np.zeros(size), np.zeros(size), np.zeros(size), np.zeros(size), np.zeros(size))
    trial = np.zeros(size)
    memory, remanence, memo = np.zeros(3), np.zeros(3), np.zeros(7)
    memory[1], memory[2] = y[0], y[1]
    memo[6] = mech.pole_pairs
    ring = np.zeros((64, 2))
    i_abc, read, done = np.zeros(3), np.zeros(3), np.zeros(3, dtype=np.bool_)
    u_alpha, u_beta = 0.0, 0.0
    start_angle = y[2]
    for n in range(n_total):
        k = n - references.before
        t0 = k * ts
        link_read = inv.link + references.link_noise[n]
        slope = (references.speed[min(n + 1, n_total - 1)] - references.speed[n]) / ts
        world = World(
            references.rotor,
            references.load[n] + references.load_error[n],
            references.speed[n],
            slope,
            t0,
            references.uneven,
        )
        if references.rotor == DRIVEN:
            y[3] = references.speed[n]
        theta = read_angle(sens, mech.pole_pairs, y, (y[2] - start_angle) / mech.pole_pairs)
        a, b, torque = currents(mag, loss, y, memory)
        if k >= 0:
            out[k, 0], out[k, 1] = u_alpha, u_beta
            out[k, 5], out[k, 6], out[k, 7] = theta, link_read, references.load[n]
            out[k, 8], out[k, 9], out[k, 10] = a, b, y[3]
            out[k, 11] = 1.5 * mech.pole_pairs * torque
        modulate(inv, t0, u_alpha, u_beta, link_read, times, kinds, count)
        done[:] = False
        t = t0
        while True:
            stop, leg, sample = t0 + ts, -1, -1
            for x in range(3):
                if count[x] > 0 and times[x, 0] < stop:
                    stop, leg, sample = times[x, 0], x, -1
                if not done[x] and t0 + sens.delay[x] < stop:
                    stop, leg, sample = t0 + sens.delay[x], -1, x
            if stop > t:
                advance(
                    t, stop, y, step, work, trial, legs, mag, loss, inv, mech, sens, world, memory
                )
                t = stop
            if sample >= 0:
                done[sample] = True
                h = references.jitter[n]
                if h != 0.0:
                    rk4(t, y, h, trial, work, legs, mag, loss, inv, mech, sens, world, memory)
                    i = seen_current(sens, mag, loss, trial, memory, sample)
                else:
                    i = seen_current(sens, mag, loss, y, memory, sample)
                read[sample] = read_current(
                    sens, sample, i, t, references.noise[n, sample], remanence
                )
            elif leg >= 0:
                kind = pop(times, kinds, count, leg)
                i = a if leg == 0 else 0.0
                if inv.dead_time_ideal != 0.0 and kind < CLOSE:
                    ia, ib, _ = currents(mag, loss, y, memory)
                    i = ia if leg == 0 else -0.5 * ia + (0.5 if leg == 1 else -0.5) * ROOT3 * ib
                gate(inv, leg, kind, t, i, y, legs, times, kinds, count, mag, loss, memory)
            else:
                break
        i_abc[:] = read
        if k >= 0:
            out[k, 2], out[k, 3], out[k, 4] = i_abc[0], i_abc[1], i_abc[2]
        for i in range(size):
            if not math.isfinite(y[i]):
                return k
        u_alpha, u_beta = command(ctl, references, inv, memo, k, i_abc, theta, link_read, ring)
    return n_total
