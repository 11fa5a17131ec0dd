"""Centred pulses of one leg within a PWM period, as an averaged plant needs them; link voltage 1, times in s.

A leg of duty D is high from (1 - D) T/2 to (1 + D) T/2, its instant of sampling in the zero vector between.  A
delayed pattern carries what did not fit into the last period (duty `before`) over into this one.
Derivations: sandbox/switched/AVERAGING.md.
"""

from __future__ import annotations

import math

from model.compiled import kernel


@kernel
def duties(u_alpha, u_beta, u_dc):
    """Return the duties of three legs for a voltage (V): common part centred, limited to what a leg can do."""
    side = 0.8660254037844386 * u_beta
    b, c = -0.5 * u_alpha + side, -0.5 * u_alpha - side
    middle = 0.5 * (max(u_alpha, b, c) + min(u_alpha, b, c))
    scale = 1.0 / u_dc
    d_a, d_b, d_c = 0.5 + scale * (u_alpha - middle), 0.5 + scale * (b - middle), 0.5 + scale * (c - middle)
    return min(max(d_a, 0.0), 1.0), min(max(d_b, 0.0), 1.0), min(max(d_c, 0.0), 1.0)


@kernel
def on_time(duty, period, t):
    """Return for how long the leg has been high t after the period began."""
    return min(max(t - 0.5 * (1.0 - duty) * period, 0.0), duty * period)


@kernel
def on_area(duty, period, t):
    """Return the integral of `on_time` from 0 to t, s^2."""
    since_rise = max(t - 0.5 * (1.0 - duty) * period, 0.0)
    since_fall = max(t - 0.5 * (1.0 + duty) * period, 0.0)
    return 0.5 * (since_rise * since_rise - since_fall * since_fall)


@kernel
def flux_after(duty, before, period, delay, t):
    """Return the volt-seconds of the delayed pattern from t_k to t_k + t; t may be negative (AVERAGING 1, 2)."""
    carried = on_time(before, period, min(period - delay + t, period)) - on_time(before, period, period - delay)
    return carried + on_time(duty, period, t - delay)


@kernel
def mean_deviation(duty, before, period, delay):
    """Return the mean over the period of the flux less its straight line: -delay x duty up to the zero vector."""
    late = on_time(before, period, period - delay)
    carried = before * period - late
    area = on_area(before, period, period) - on_area(before, period, period - delay) - delay * late
    area += (period - delay) * carried + on_area(duty, period, period - delay)
    return area / period - 0.5 * (carried + on_time(duty, period, period - delay))


@kernel
def ripple_lag(duty, before, period, delay, tau):
    """Return what the flux ripple of one period leaves in a first-order lag tau at its end (AVERAGING 3)."""
    rise, fall = 0.5 * (1.0 - duty) * period + delay, 0.5 * (1.0 + duty) * period + delay
    return ripple_lag_between(rise, fall, before, period, delay, tau)


@kernel
def ripple_lag_between(rise, fall, before, period, delay, tau):
    """Return the same for a pulse from rise to fall (s after the period began), wherever they are."""
    rise, fall = min(rise, period), min(fall, period)
    on = fall - rise
    left = math.exp((fall - period) / tau) - math.exp((rise - period) / tau)
    rise, fall = 0.5 * (1.0 - before) * period + delay - period, 0.5 * (1.0 + before) * period + delay - period
    if fall > 0.0:
        rise = max(rise, 0.0)
        on += fall - rise
        left += math.exp((fall - period) / tau) - math.exp((rise - period) / tau)
    return tau * (on / period * (1.0 - math.exp(-period / tau)) - left)
