"""A plant of other structure: rotor frame, gates of each leg with their blanking, Runge and Kutta
between switchings.

No code of the project's plants: a motor without saturation, currents from fluxes in the rotor's
frame, a leg's level from its two gates.  What a drive's simulator may hide it is told: which half
of a PWM period a row is, what the link does, how late commands act, to how many counts duties are
rounded.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numba
import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Other:
    """Motor (ohm, H, Wb) and inverter: sampling period (s), double update, dead time (s), delay (s)
    of the voltage, counts of half a PWM period (0: none), half the width (A) in which a current's
    sign goes through zero."""

    resistance: float
    inductance_d: float
    inductance_q: float
    magnet_flux: float
    period: float
    double: bool = False
    dead_time: float = 0.0
    delay: float = 0.0
    counts: int = 0
    soft: float = 1e-9

    def run(self, duty: Array, link: Array, theta: Array) -> Array:
        """Return phase currents (n, 3) in A at t_k: duties (n, 3) from t_k on, link (n,) V at t_k
        and straight between, rotor angle (n,) rad electrical, its speed constant in a period."""
        d = np.round(duty * self.counts) / self.counts if self.counts else duty
        events = self._events(d)
        motor = (self.resistance, self.inductance_d, self.inductance_q, self.magnet_flux)
        n = len(duty)
        return _integrate(n, self.period, *events, motor, self.dead_time, self.soft, link, theta)

    def _events(self, duty: Array) -> tuple[Array, Array, Array]:
        """Return instants (s), legs and levels of the commanded switchings in order of time."""
        out = []
        for k, row in enumerate(duty):
            at = k * self.period + self.delay
            for leg, d in enumerate(row):
                if not self.double:
                    out += [
                        (at + 0.5 * (1 - d) * self.period, leg, 1),
                        (at + 0.5 * (1 + d) * self.period, leg, 0),
                    ]
                elif k % 2 == 0:
                    out.append((at + (1 - d) * self.period, leg, 1))
                else:
                    out.append((at + d * self.period, leg, 0))
        t, leg, level = np.array(sorted(out)).T
        return t, leg.astype(np.int64), level


@numba.njit
def _integrate(n, period, times, legs, levels, motor, blank, soft, link, theta):
    r, l_d, l_q, magnet = motor
    gate = np.zeros(3)  # commanded levels
    since = np.full(3, -1.0)  # when the last command changed
    sign = np.zeros(3)  # of the current then
    d = magnet
    q = 0.0
    out = np.zeros((n, 3))
    ticks = np.sort(np.concatenate((times, times + blank, np.arange(n) * period)))
    m = 0
    k = 0
    for tick in range(len(ticks) - 1):
        t, end = ticks[tick], ticks[tick + 1]
        row = min(int(t / period + 1e-9), n - 1)
        after = min(row + 1, n - 1)
        omega = (theta[after] - theta[row]) / period
        angle = theta[row] + omega * (t - row * period)
        i_d, i_q = (d - magnet) / l_d, q / l_q
        if k < n and t >= k * period - 1e-12:
            for x in range(3):
                out[k, x] = i_d * math.cos(angle - x * 2.0943951023931953) - i_q * math.sin(
                    angle - x * 2.0943951023931953
                )
            k += 1
        while m < len(times) and times[m] <= t + 1e-13:
            x = legs[m]
            i = i_d * math.cos(angle - x * 2.0943951023931953) - i_q * math.sin(
                angle - x * 2.0943951023931953
            )
            gate[x], since[x], sign[x] = levels[m], times[m], min(max(i / soft, -1.0), 1.0)
            m += 1
        if end - t < 1e-13:
            continue
        alpha = beta = 0.0
        for x in range(3):
            level = gate[x]
            if since[x] >= 0.0 and t < since[x] + blank - 1e-13:
                # neither gate is on: a diode conducts
                level = 0.5 * (1.0 - sign[x])
            alpha += level * math.cos(x * 2.0943951023931953) * 2.0 / 3.0
            beta += level * math.sin(x * 2.0943951023931953) * 2.0 / 3.0
        steps = max(1, math.ceil((end - t) / 5e-6))
        h = (end - t) / steps
        for s in range(steps):
            now = angle + omega * s * h
            v = link[row] + (link[after] - link[row]) * (t + s * h - row * period) / period
            k_d = np.zeros(4)
            k_q = np.zeros(4)
            for stage in range(4):
                share = (0.0, 0.5, 0.5, 1.0)[stage]
                x_d = d + (share * h * k_d[stage - 1] if stage else 0.0)
                x_q = q + (share * h * k_q[stage - 1] if stage else 0.0)
                a = now + share * h * omega
                u_d = v * (math.cos(a) * alpha + math.sin(a) * beta)
                u_q = v * (math.cos(a) * beta - math.sin(a) * alpha)
                k_d[stage] = u_d - r * (x_d - magnet) / l_d + omega * x_q
                k_q[stage] = u_q - r * x_q / l_q - omega * x_d
            d += h * (k_d[0] + 2.0 * k_d[1] + 2.0 * k_d[2] + k_d[3]) / 6.0
            q += h * (k_q[0] + 2.0 * k_q[1] + 2.0 * k_q[2] + k_q[3]) / 6.0
    return out
