"""What the inverter delivers: once a period, the mean voltage that brings the plant to the right next sample.

Closed forms of `sandbox/switched/AVERAGING.md` (1 delay, 3 and 4 ripple behind lags, 5 dead time, 6 device drop),
checked against the switched bench; pulses in `model.pulses`.  Currents at the edges are advanced linearly in the
rotor frame from the sample: i(t) = i_k + Gamma (phi(t) - phi_k).
"""

from __future__ import annotations

import math
from typing import NamedTuple

from model.compiled import kernel
from model.effects import dc_link_error, dc_link_ripple, dead_time, device_drop, iron_loss
from model.frames import phases, stationary
from model.pulses import duties, flux_after, mean_deviation, ripple_lag_between
from sandbox.full import CLOCK, CORE_D, CORE_Q, CORE_RIPPLE, DUTY, FILTER_RIPPLE, stator_currents, stiffness
from sandbox.oldplant import OMEGA, PHI_D, PHI_Q, THETA, turn

FAR = 1.0  # s: an edge that has not come yet


class Inverter(NamedTuple):
    """Link, legs and timing."""

    period: float  # s
    read_voltage: float  # V, the link as the controller reads it
    link: float  # V, true mean
    ripple: float  # V
    ripple_rate: float  # rad/s
    ripple_phase: float  # rad
    dead_time: float  # s
    threshold: float  # V
    soft_current: float  # A
    delay: float  # s
    filter_time: float  # s, of the current sensors, whose ripple is kept with the pulses
    core_time: float  # s, of the iron loss, likewise; 0 without
    core_conductance: float  # 1/ohm
    sag: float  # ohm, of the link's supply


@kernel
def late_by(v):
    """Return how late the pattern is on average, s: the delay and half the dead time."""
    return v.delay + 0.5 * abs(v.dead_time)


@kernel
def leg_link(v, clock, duty):
    """Return the true link voltage (V) over a leg's pulse."""
    if v.ripple == 0.0:
        return v.link
    middle = clock + 0.5 * v.period + v.delay
    return v.link + dc_link_ripple.pulse_mean(v.ripple, v.ripple_rate, v.ripple_phase, middle, duty * v.period)


@kernel
def leg_links(v, clock, duty, i_alpha, i_beta):
    """Return the true link voltage (V) over each leg's pulse; the current vector (A) at the sample makes it sag."""
    a, b, c = leg_link(v, clock, duty[0]), leg_link(v, clock, duty[1]), leg_link(v, clock, duty[2])
    if v.sag == 0.0:
        return a, b, c
    lost = v.sag * dc_link_error.drawn(duty[0], duty[1], duty[2], i_alpha, i_beta)
    return a - lost, b - lost, c - lost


@kernel
def pick(k, a, b, c):
    """Return the k-th of three."""
    if k == 0:
        return a
    return b if k == 1 else c


@kernel
def ranked(a, b, c):
    """Return the places of three values, largest first."""
    if a >= b:
        if b >= c:
            return 0, 1, 2
        return (0, 2, 1) if a >= c else (2, 0, 1)
    if a >= c:
        return 1, 0, 2
    return (1, 2, 0) if b >= c else (2, 1, 0)


@kernel
def current_at(t, flux_x, flux_y, core, start, gamma, resistance, omega, magnet_flux, c, s):
    """Return the phase currents (A) t after the sample.

    flux: volt-seconds since, in the rotor frame of the sample; core: iron-loss current by then, stationary frame;
    start: fluxes, terminal and magnetising current at the sample, in the rotor frame.
    """
    d, q, i_d, i_q, m_d, m_q = start
    dd, dq, qq = gamma
    psi_d, psi_q = d + magnet_flux + flux_x - t * resistance * i_d, q + flux_y - t * resistance * i_q
    psi_d, psi_q = turn(psi_d, psi_q, omega * t)
    x, y = psi_d - magnet_flux - d, psi_q - q
    j_d, j_q = m_d + dd * x + dq * y, m_q + dq * x + qq * y
    j_d, j_q = turn(j_d, j_q, -omega * t)
    return phases(c * j_d - s * j_q + core[0], s * j_d + c * j_q + core[1])


@kernel
def put(k, value, three):
    """Return three values, the k-th replaced."""
    return (value if k == 0 else three[0], value if k == 1 else three[1], value if k == 2 else three[2])


@kernel
def lost_at_legs(v, links, duty, drop, core, start, gamma, resistance, omega, magnet_flux, c, s):
    """Return what dead time and device drop take on average over the period, and when the legs really switch.

    Two vectors (V, stationary frame), three rising and three falling edges (s).  drop: resistive voltage (V)
    and core: iron-loss current (A) at the sample.
    """
    period, width = v.period, v.soft_current
    first, second, third = ranked(duty[0], duty[1], duty[2])
    rise, fall = (FAR, FAR, FAR), (FAR, FAR, FAR)
    drop_a = drop_b = drop_c = t = x_before = y_before = 0.0
    before = current_at(0.0, 0.0, 0.0, core, start, gamma, resistance, omega, magnet_flux, c, s)
    for k in range(7):  # three legs rise, the widest pulse first, and fall the other way round; then the end
        leg = pick(k if k < 3 else 5 - k, first, second, third)
        d_leg = pick(leg, duty[0], duty[1], duty[2])
        edge = 0.5 * period * (1.0 - d_leg if k < 3 else 1.0 + d_leg) + v.delay if k < 6 else period
        x, y = stationary(
            links[0] * (max(edge - rise[0], 0.0) - max(edge - fall[0], 0.0)),
            links[1] * (max(edge - rise[1], 0.0) - max(edge - fall[1], 0.0)),
            links[2] * (max(edge - rise[2], 0.0) - max(edge - fall[2], 0.0)),
        )
        if v.core_time > 0.0 and edge > t:
            decay, gain = math.exp((t - edge) / v.core_time), v.core_conductance
            core = (
                core[0] * decay + gain * (1.0 - decay) * ((x - x_before) / (edge - t) - drop[0]),
                core[1] * decay + gain * (1.0 - decay) * ((y - y_before) / (edge - t) - drop[1]),
            )
            x_before, y_before = x, y
        flux_d, flux_q = c * x + s * y, c * y - s * x
        now = current_at(edge, flux_d, flux_q, core, start, gamma, resistance, omega, magnet_flux, c, s)
        if v.threshold != 0.0:
            share = (edge - t) / period
            drop_a += share * device_drop.mean_sign(before[0] / width, now[0] / width)
            drop_b += share * device_drop.mean_sign(before[1] / width, now[1] / width)
            drop_c += share * device_drop.mean_sign(before[2] / width, now[2] / width)
        t, before = edge, now
        sign = dead_time.soft_sign(pick(leg, now[0], now[1], now[2]), width)
        late_rise, late_fall = dead_time.lateness(v.dead_time, sign)
        if k < 3:
            rise = put(leg, edge + late_rise, rise)
        elif k < 6:
            end = max(edge + late_fall, pick(leg, rise[0], rise[1], rise[2]))  # a pulse cannot be negative
            fall = put(leg, end, fall)
    lost_a = links[0] * (duty[0] - (fall[0] - rise[0]) / period)
    lost_b = links[1] * (duty[1] - (fall[1] - rise[1]) / period)
    lost_c = links[2] * (duty[2] - (fall[2] - rise[2]) / period)
    devices = stationary(v.threshold * drop_a, v.threshold * drop_b, v.threshold * drop_c)
    return stationary(lost_a, lost_b, lost_c), devices, rise, fall


@kernel
def delayed(v, links, duty, last, x, p, m, start, resistance, c, s):
    """Return the voltage (V) of a delayed pattern: its volt-seconds in the period, less R Gamma of the mean flux."""
    late, t_s = late_by(v), v.period
    u_alpha, u_beta = stationary(
        links[0] / t_s * flux_after(duty[0], last[0], t_s, late, t_s),
        links[1] / t_s * flux_after(duty[1], last[1], t_s, late, t_s),
        links[2] / t_s * flux_after(duty[2], last[2], t_s, late, t_s),
    )
    r_alpha, r_beta = stationary(
        links[0] * mean_deviation(duty[0], last[0], t_s, late),
        links[1] * mean_deviation(duty[1], last[1], t_s, late),
        links[2] * mean_deviation(duty[2], last[2], t_s, late),
    )
    d, q, i_d, i_q, _, _ = start
    half = 0.5 * t_s
    psi_d = d + p.magnet_flux + half * (c * u_alpha + s * u_beta - resistance * i_d)
    psi_q = q + half * (c * u_beta - s * u_alpha - resistance * i_q)
    c, s = turn(c, s, -half * x[OMEGA])  # the frame in the middle of the period
    psi_d, psi_q = turn(psi_d, psi_q, half * x[OMEGA])
    dd, dq, qq = stiffness(p, m, c, s, psi_d - p.magnet_flux, psi_q)
    r_d, r_q = c * r_alpha + s * r_beta, c * r_beta - s * r_alpha
    g_d, g_q = dd * r_d + dq * r_q, dq * r_d + qq * r_q
    return u_alpha - resistance * (c * g_d - s * g_q), u_beta - resistance * (s * g_d + c * g_q)


@kernel
def keep_ripple(x, place, links, rise, fall, last, period, late, tau):
    """Move the lagged flux ripple at x[place], x[place + 1] (V s) on by one period."""
    decay = math.exp(-period / tau)
    r_alpha, r_beta = stationary(
        links[0] * ripple_lag_between(rise[0], fall[0], last[0], period, late, tau),
        links[1] * ripple_lag_between(rise[1], fall[1], last[1], period, late, tau),
        links[2] * ripple_lag_between(rise[2], fall[2], last[2], period, late, tau),
    )
    x[place], x[place + 1] = decay * x[place] + r_alpha, decay * x[place + 1] + r_beta


@kernel
def deliver(x, p, m, v, u_alpha, u_beta):
    """Return the voltage (V, stationary frame) to hold over the coming period for a command; keep its pulses in x."""
    duty = duties(u_alpha, u_beta, v.read_voltage)
    last = (x[DUTY], x[DUTY + 1], x[DUTY + 2])
    clock, late = x[CLOCK], late_by(v)
    i_alpha = i_beta = i_d = i_q = 0.0
    if late != 0.0 or v.threshold != 0.0 or v.sag != 0.0:
        i_alpha, i_beta, i_d, i_q = stator_currents(x, p, m)
    links = leg_links(v, clock, duty, i_alpha, i_beta)
    w_alpha, w_beta = stationary(links[0] * duty[0], links[1] * duty[1], links[2] * duty[2])
    begin, end = 0.5 * v.period + v.delay, 0.5 * v.period
    rise = (begin - end * duty[0], begin - end * duty[1], begin - end * duty[2])
    fall = (begin + end * duty[0], begin + end * duty[1], begin + end * duty[2])
    if late != 0.0 or v.threshold != 0.0:
        m_d, m_q = i_d - x[CORE_D], i_q - x[CORE_Q]
        start = (x[PHI_D], x[PHI_Q], i_d, i_q, m_d, m_q)
        c, s = math.cos(x[THETA]), math.sin(x[THETA])
        resistance = p.resistance + m.on_resistance
        if late != 0.0:
            w_alpha, w_beta = delayed(v, links, duty, last, x, p, m, start, resistance, c, s)
        if v.dead_time != 0.0 or v.threshold != 0.0:
            gamma = stiffness(p, m, c, s, start[0], start[1])
            core = (0.0, 0.0)
            if v.core_time > 0.0:
                core = (
                    i_alpha - (c * m_d - s * m_q) + iron_loss.reading(v.core_conductance, v.core_time, x[CORE_RIPPLE]),
                    i_beta
                    - (s * m_d + c * m_q)
                    + iron_loss.reading(v.core_conductance, v.core_time, x[CORE_RIPPLE + 1]),
                )
            drop = (resistance * i_alpha, resistance * i_beta)
            lost, devices, rise, fall = lost_at_legs(
                v, links, duty, drop, core, start, gamma, resistance, x[OMEGA], p.magnet_flux, c, s
            )
            dd, dq, qq = gamma  # what dead time takes is late like the rest of the pattern
            r_d, r_q = c * lost[0] + s * lost[1], c * lost[1] - s * lost[0]
            g_d, g_q = dd * r_d + dq * r_q, dq * r_d + qq * r_q
            moved = late * resistance
            w_alpha -= lost[0] + devices[0] + moved * (c * g_d - s * g_q)
            w_beta -= lost[1] + devices[1] + moved * (s * g_d + c * g_q)
    if v.filter_time > 0.0:
        keep_ripple(x, FILTER_RIPPLE, links, rise, fall, last, v.period, late, v.filter_time)
    if v.core_time > 0.0:
        keep_ripple(x, CORE_RIPPLE, links, rise, fall, last, v.period, late, v.core_time)
    x[DUTY], x[DUTY + 1], x[DUTY + 2] = duty
    x[CLOCK] = clock + v.period
    return w_alpha, w_beta
