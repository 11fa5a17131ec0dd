"""Layers of conductors in the machine's winding: the eddy currents' modes of Dowell's formula.

Across a conductor of height h, between two faces where the field is known, eddy currents have modes
of n half-waves, each a circuit of its own: drop = R w_n (i - x_n), (tau/n^2) dx_n/dt = i - x_n, tau
= mu sigma (h/pi)^2.  Even modes see the difference of the fields at the faces, which is the layer's
own current: w = 2.  Odd modes see their sum: of layer k of m it is 2 k - 1 times that difference,
and the mean of the squares is (4 m^2 - 1)/3: w = 2/3 (4 m^2 - 1).

Modes up to n = 5 are circuits; all higher ones of either kind are one more, which has their sums of
w tau and w tau^2 from 1/1 + 1/9 + 1/25 + ... = pi^2/8, 1 + 1/81 + ... = pi^4/96, and of even n
pi^2/24 and pi^4/1440.  What was left at 0 is the current itself: at rest nothing is dropped.
"""

from __future__ import annotations

import math
from typing import NamedTuple

from model.compiled import inlined

ODD, EVEN = (1, 3, 5), (2, 4)
CIRCUITS = 7


class Held(NamedTuple):
    """Slow part of the current in each mode's circuit (A), and in those of all higher ones; or by
    how much it changes in a second."""

    n_1: complex = 0j
    n_3: complex = 0j
    n_5: complex = 0j
    higher_odd: complex = 0j
    n_2: complex = 0j
    n_4: complex = 0j
    higher_even: complex = 0j


class Modes(NamedTuple):
    """Resistance (ohm) and time constant (s) of each mode's circuit; all 0 where there are none."""

    ohms: tuple[float, ...] = (0.0,) * CIRCUITS
    times: tuple[float, ...] = (1.0,) * CIRCUITS


def modes(resistance: float, layers: float, time_constant: float) -> Modes:
    """Return the circuits of a winding in so many layers (from 1/2 on), of a resistance (ohm) at
    rest and a time constant (s) of the slowest one."""
    ohms, times = [], []
    for orders, weight, sums in (
        (ODD, 2.0 / 3.0 * (4.0 * layers * layers - 1.0), (math.pi**2 / 8.0, math.pi**4 / 96.0)),
        (EVEN, 2.0, (math.pi**2 / 24.0, math.pi**4 / 1440.0)),
    ):
        first, second = (
            total - sum(n**-power for n in orders)
            for total, power in zip(sums, (2, 4), strict=True)
        )
        ohms += [weight * resistance] * len(orders) + [weight * resistance * first**2 / second]
        times += [time_constant / n**2 for n in orders] + [time_constant * second / first]
    return Modes(tuple(ohms), tuple(times))


@inlined
def along(x, h, y):
    """Return x + h y of seven numbers each."""
    return Held(
        x[0] + h * y[0],
        x[1] + h * y[1],
        x[2] + h * y[2],
        x[3] + h * y[3],
        x[4] + h * y[4],
        x[5] + h * y[5],
        x[6] + h * y[6],
    )


@inlined
def dropped(m, x, i):
    """Return what a current (A) drops across the circuits (V), and the rates of what they hold."""
    volts, t = complex(0.0, 0.0), m.times
    for k in range(CIRCUITS):
        volts += m.ohms[k] * (i - x[k])
    return volts, Held(
        (i - x[0]) / t[0],
        (i - x[1]) / t[1],
        (i - x[2]) / t[2],
        (i - x[3]) / t[3],
        (i - x[4]) / t[4],
        (i - x[5]) / t[5],
        (i - x[6]) / t[6],
    )


@inlined
def heated(m, x, i):
    """Return what the circuits turn into heat (V A, amplitudes)."""
    lost = 0.0
    for k in range(CIRCUITS):
        lost += m.ohms[k] * abs(i - x[k]) ** 2
    return lost


@inlined
def held(m, x):
    """Return the energy (V A s, amplitudes) that the circuits hold."""
    stored = 0.0
    for k in range(CIRCUITS):
        stored += 0.5 * m.ohms[k] * m.times[k] * abs(x[k]) ** 2
    return stored
