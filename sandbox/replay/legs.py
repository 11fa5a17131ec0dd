"""The inverter with all its effects for LANES parameter sets at once: what a recorded command delivers.

Duties follow from recorded commands and link voltage, so pulses and the order of their edges are common to all
sets; how late edges act, the drop between them and the ripple that lags keep are each set's own.  Closed forms of
`sandbox/switched/AVERAGING.md`.
"""

from __future__ import annotations

import math

from model.compiled import inlined, kernel
from model.effects.dc_link_error import drawn
from model.pulses import flux_after, mean_deviation
from sandbox.plant import turn
from sandbox.replay.lanes import (
    C_0,
    CLAG_A,
    CLAG_B,
    CORE_INV,
    CORE_KEEP,
    CORE_TIME,
    DELAY,
    GAMMA_6,
    I_A,
    I_B,
    LANES,
    LATE,
    LINK,
    LINK_A,
    LINK_B,
    LINK_C,
    M_A,
    M_B,
    MAGNET,
    MOVED_A,
    MOVED_B,
    PAIRS,
    PATTERN_A,
    PATTERN_B,
    PSI_A,
    PSI_B,
    PSI_D6,
    PSI_Q6,
    PULSE_A,
    PULSE_B,
    PULSE_TORQUE,
    RESISTANCE,
    RIPPLE,
    RIPPLE_PHASE,
    RIPPLE_RATE,
    S_0,
    SAG,
    SAMPLE_A,
    SAMPLE_B,
    SAMPLING,
    SPILL_A,
    SPILL_B,
    U_A,
    U_B,
    fading,
    incremental,
    sine_cosine,
)
from sandbox.replay.machine import full_current, sixth

ROOT = math.sqrt(3.0)


@inlined
def link_mean(w, j, clock, period, duty):
    """Return the true link voltage (V) of lane j over a centred pulse: mean and ripple."""
    rate = w[RIPPLE_RATE * LANES + j]
    x = 0.5 * rate * duty * period
    sine, _ = sine_cosine(rate * (clock + 0.5 * period + w[DELAY * LANES + j]) + w[RIPPLE_PHASE * LANES + j])
    width, _ = sine_cosine(x)
    small = x < 1e-4
    sinc = 1.0 - x * x / 6.0 if small else width / (1.0 if small else x)
    return w[LINK * LANES + j] + w[RIPPLE * LANES + j] * sine * sinc


@kernel
def links(w, clock, period, d_a, d_b, d_c, ripple):
    """Write the link voltage each leg sees."""
    if ripple:
        for j in range(LANES):
            w[LINK_A * LANES + j] = link_mean(w, j, clock, period, d_a)
            w[LINK_B * LANES + j] = link_mean(w, j, clock, period, d_b)
            w[LINK_C * LANES + j] = link_mean(w, j, clock, period, d_c)
    else:
        for j in range(LANES):
            v = w[LINK * LANES + j]
            w[LINK_A * LANES + j], w[LINK_B * LANES + j], w[LINK_C * LANES + j] = v, v, v


@kernel
def sag(w, d_a, d_b, d_c):
    """Take from the link what the period's current makes it sag by (V)."""
    for j in range(LANES):
        lost = w[SAG * LANES + j] * drawn(d_a, d_b, d_c, w[I_A * LANES + j], w[I_B * LANES + j])
        w[LINK_A * LANES + j], w[LINK_B * LANES + j], w[LINK_C * LANES + j] = (
            w[LINK_A * LANES + j] - lost,
            w[LINK_B * LANES + j] - lost,
            w[LINK_C * LANES + j] - lost,
        )


@kernel
def mean_voltage(w, d_a, d_b, d_c, width):
    """Write the mean voltage of the period (V)."""
    for j in range(width):
        a, b, c = d_a * w[LINK_A * LANES + j], d_b * w[LINK_B * LANES + j], d_c * w[LINK_C * LANES + j]
        w[U_A * LANES + j], w[U_B * LANES + j] = (2.0 * a - b - c) * (1.0 / 3.0), (b - c) * (1.0 / ROOT)


@inlined
def spilt(before, late, period):
    """Return how long (s) a leg's pulse of the last period lasts into this one."""
    return min(max(0.5 * (1.0 + before) * period + late - period, 0.0), before * period)


@kernel
def late_voltage(w, d_a, d_b, d_c, b_a, b_b, b_c, omega, period):
    """Write the voltage of a late pattern: its volt-seconds, R Gamma of the mean flux it moves (1); and its torque."""
    half = 0.5 * period
    for j in range(LANES):
        late, r = w[LATE * LANES + j], w[RESISTANCE * LANES + j]
        v_a, v_b, v_c = w[LINK_A * LANES + j], w[LINK_B * LANES + j], w[LINK_C * LANES + j]
        x = v_a / period * flux_after(d_a, b_a, period, late, period)
        y = v_b / period * flux_after(d_b, b_b, period, late, period)
        z = v_c / period * flux_after(d_c, b_c, period, late, period)
        u_a, u_b = (2.0 * x - y - z) * (1.0 / 3.0), (y - z) * (1.0 / ROOT)
        w[PATTERN_A * LANES + j], w[PATTERN_B * LANES + j] = u_a, u_b
        x = v_a * mean_deviation(d_a, b_a, period, late)
        y = v_b * mean_deviation(d_b, b_b, period, late)
        z = v_c * mean_deviation(d_c, b_c, period, late)
        rho_a, rho_b = (2.0 * x - y - z) * (1.0 / 3.0), (y - z) * (1.0 / ROOT)
        w[MOVED_A * LANES + j], w[MOVED_B * LANES + j] = rho_a, rho_b
        x, y = v_a * spilt(b_a, w[DELAY * LANES + j], period), v_b * spilt(b_b, w[DELAY * LANES + j], period)
        z = v_c * spilt(b_c, w[DELAY * LANES + j], period)
        w[SPILL_A * LANES + j], w[SPILL_B * LANES + j] = (2.0 * x - y - z) * (1.0 / 3.0), (y - z) * (1.0 / ROOT)
        c, s = turn(w[C_0 * LANES + j], w[S_0 * LANES + j], -half * omega)  # the frame in the middle of the period
        a = w[PSI_A * LANES + j] + half * (u_a - r * w[I_A * LANES + j])
        b = w[PSI_B * LANES + j] + half * (u_b - r * w[I_B * LANES + j])
        c_6, s_6 = sixth(c, s)
        d = c * a + s * b - w[MAGNET * LANES + j] - w[PSI_D6 * LANES + j] * c_6
        q = c * b - s * a - w[PSI_Q6 * LANES + j] * s_6
        dd, dq, qq = incremental(w, j, d, q)
        g = w[GAMMA_6 * LANES + j]
        r_d, r_q = c * rho_a + s * rho_b, c * rho_b - s * rho_a
        g_d = (dd + g * c_6) * r_d + (dq + g * s_6) * r_q
        g_q = (dq + g * s_6) * r_d + (qq - g * c_6) * r_q
        g_a, g_b = c * g_d - s * g_q, s * g_d + c * g_q  # mean current beside the samples' straight line
        w[U_A * LANES + j], w[U_B * LANES + j] = u_a - r * g_a, u_b - r * g_b
        pull = a * g_b - b * g_a + rho_a * w[I_B * LANES + j] - rho_b * w[I_A * LANES + j]
        w[PULSE_TORQUE * LANES + j] = 1.5 * w[PAIRS * LANES + j] * pull


@inlined
def lagged(duty, before, period, late, tau, inverse):
    """Return `model.pulses.ripple_lag` of one leg, vectorisable; inverse: 1/tau, large where tau is 0."""
    rise, fall = min(0.5 * (1.0 - duty) * period + late, period), min(0.5 * (1.0 + duty) * period + late, period)
    on, left = fall - rise, fading((fall - period) * inverse) - fading((rise - period) * inverse)
    rise, fall = 0.5 * (1.0 - before) * period + late - period, 0.5 * (1.0 + before) * period + late - period
    rise, fall = max(rise, 0.0), max(fall, 0.0)
    on, left = on + fall - rise, left + fading((fall - period) * inverse) - fading((rise - period) * inverse)
    return tau * (on / period * (1.0 - fading(-period * inverse)) - left)


@inlined
def lagged_vector(w, j, tau, inverse, d_a, d_b, d_c, b_a, b_b, b_c, period):
    """Return the vector of what this period's flux ripple leaves in a lag (V s) at its end (3)."""
    late = w[LATE * LANES + j]
    a = w[LINK_A * LANES + j] * lagged(d_a, b_a, period, late, tau, inverse)
    b = w[LINK_B * LANES + j] * lagged(d_b, b_b, period, late, tau, inverse)
    c = w[LINK_C * LANES + j] * lagged(d_c, b_c, period, late, tau, inverse)
    return (2.0 * a - b - c) * (1.0 / 3.0), (b - c) * (1.0 / ROOT)


@kernel
def keep_core_ripple(w, d_a, d_b, d_c, b_a, b_b, b_c, period):
    """Move the iron-loss current's share of flux ripple on by one period."""
    for j in range(LANES):
        tau, inverse, keep = w[CORE_TIME * LANES + j], w[CORE_INV * LANES + j], w[CORE_KEEP * LANES + j]
        a, b = lagged_vector(w, j, tau, inverse, d_a, d_b, d_c, b_a, b_b, b_c, period)
        w[CLAG_A * LANES + j] = keep * w[CLAG_A * LANES + j] + a
        w[CLAG_B * LANES + j] = keep * w[CLAG_B * LANES + j] + b


@kernel
def shifted_sample(w, d_a, d_b, d_c, b_a, b_b, b_c, omega, period):
    """Write what sampling beside t_k adds to the current (A): no voltage acts in the zero vector, pulses beyond (2)."""
    for j in range(LANES):
        late, s, r = w[LATE * LANES + j], w[SAMPLING * LANES + j], w[RESISTANCE * LANES + j]
        x = w[LINK_A * LANES + j] * flux_after(d_a, b_a, period, late, s)
        y = w[LINK_B * LANES + j] * flux_after(d_b, b_b, period, late, s)
        z = w[LINK_C * LANES + j] * flux_after(d_c, b_c, period, late, s)
        f_a, f_b, per = (2.0 * x - y - z) * (1.0 / 3.0), (y - z) * (1.0 / ROOT), 1.0 / (s if s != 0.0 else 1.0)
        w[PULSE_A * LANES + j], w[PULSE_B * LANES + j] = per * f_a, per * f_b
        a = w[PSI_A * LANES + j] + f_a - s * r * w[I_A * LANES + j]
        b = w[PSI_B * LANES + j] + f_b - s * r * w[I_B * LANES + j]
        c, n = turn(w[C_0 * LANES + j], w[S_0 * LANES + j], -omega * s)
        i_a, i_b = full_current(w, j, c, n, a, b)
        w[SAMPLE_A * LANES + j], w[SAMPLE_B * LANES + j] = i_a - w[M_A * LANES + j], i_b - w[M_B * LANES + j]
