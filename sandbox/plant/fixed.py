"""What effects fix once for a batch: resistance, link, lags, delays, and the two masses of a shaft.

Each has a port whose equations say it in a few numbers, asked for when a batch is made.  A lag of
first order is fully given by its gain and its time constant, two masses by their inertias and the
swing between them: the plant solves both exactly (`lags`, `mechanics`), so nothing else of such an
equation could enter while it runs.  But for one: a swing that is damped more than MOST_DAMPED says
is taken as damped so much (the library's has
at most 1).
"""

from __future__ import annotations

import math

from model.compiled import inlined, kernel
from sandbox.plant import ports
from sandbox.plant.layers import spread

FASTEST = 1e12  # 1/s
ALIKE = 1e-8  # rad: both ends of a swing are one, to rounding (q^2/6)
# of the rated slope of the flux: within it the excess-loss current goes through zero as across a
# resistance, where its root would begin upright; off from the root by 0.26 sqrt(SLOPE_WIDTH), a
# quarter of a percent, of the current at the rated slope, at most
SLOPE_WIDTH = 1e-4
MOST_DAMPED = 0.999  # of critical damping: the plant's solution is that of a shaft that swings


@inlined
def rate_of(time_constant):
    """Return a lag's rate (1/s); one without time constant (s) has forgotten everything at once.
    Of what is no time constant, less than 0."""
    if time_constant > 0.0:
        return min(1.0 / time_constant, FASTEST)
    return FASTEST if time_constant == 0.0 else -1.0


@inlined
def swing(turned, damping):
    """Return what is left of a swing of second order, and of its slope, once its undamped one has
    turned by an angle (rad): exp(-D x) cos q x and exp(-D x) sin(q x)/q, q = sqrt(1 - D^2)."""
    square = 1.0 - damping * damping
    q = math.sqrt(abs(square)) * turned
    if q < ALIKE:
        left = math.exp(-damping * turned)
        return left, left * turned
    if square > 0.0:
        left = math.exp(-damping * turned)
        return left * math.cos(q), left * math.sin(q) * turned / q
    slow, fast = math.exp(q - damping * turned), math.exp(-q - damping * turned)
    return 0.5 * (slow + fast), 0.5 * (slow - fast) * turned / q


@kernel
def fix(w, nominal, period):
    """Write a batch's rows `FIXED`, its effects' parameters and the rows `PLANT` known; nominal:
    the link's voltage; period: of the voltage's update, s."""
    for j in range(w.psi_alpha.size):
        w.resistance[j] = w.winding[j] + ports.resistance(w, j)
        w.supply[j] = (1.0 + ports.supply(w, j)) * nominal
        w.source_rate[j], w.source_ohm[j], damping = ports.source(w, j)
        w.source_damping[j] = damping
        w.source_cos[j], w.source_sin[j] = swing(0.5 * period * w.source_rate[j], damping)
        w.core_g[j], lag = ports.iron(w, j)
        w.core_rate[j] = rate_of(lag)
        w.core_stiff[j] = w.core_g[j] * w.core_rate[j]
        w.excess[j] = ports.excess(w, j, w.rated_slope[j])
        w.slope_width[j] = SLOPE_WIDTH * w.rated_slope[j]
        w.play[j], w.play_reach[j] = ports.play(w, j, w.rated_flux[j])
        w.skin_r[j], lag = ports.skin(w, j)
        w.skin_rate[j] = rate_of(lag)
        even, odd, lag = ports.layers(w, j)
        spread(w, j, odd, even, rate_of(lag))
        w.filter_rate[j] = rate_of(ports.filter(w, j))
        w.delay[j], w.offset[j] = ports.delay(w, j), ports.offset(w, j)
        w.latency[j], w.channel_lag[j] = ports.latency(w, j), ports.channels(w, j)
        late, variance = ports.instant(w, j)
        w.sample[j], w.jitter[j] = late - w.delay[j], math.sqrt(variance)
        inertia = w.masses[j]
        load, rate, ratio = ports.shaft(w, j, inertia)
        w.inertia_inv[j] = 1.0 / inertia
        w.motor_inv[j] = 1.0 / (inertia - load) if load < inertia else math.inf  # refused
        w.load_inv[j] = 1.0 / load if load > 0.0 else 0.0
        w.load_share[j], w.swing_rate[j] = load / inertia, rate
        w.swing_ratio[j] = MOST_DAMPED if ratio > MOST_DAMPED else ratio
        w.backlash[j] = ports.backlash(w, j)
