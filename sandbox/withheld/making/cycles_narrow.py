"""Narrow cycles: two recordings of one kind, on which the effects of a pair look alike.

What a drive would record that has no time for a campaign: one speed, one current, one link voltage.
Beside ordinary deviations one of the two is nearly contained in the other (cosine 0.86 and more at
medium size: resistance and dead time in a device's drop, magnet flux in the link, sampling in a
filter), or both are as alike as 0.5 to 0.7 (delays).
"""

from __future__ import annotations

from collections.abc import Callable, Mapping

import numpy as np
from numpy.random import Generator

from model.array_types import Array
from model.errors import unknown
from sandbox.withheld.making.cycles import CURRENT, Cycle, Scale, cycle, held

SECONDS = 0.6
Maker = Callable[[Scale, Generator], list[Cycle]]


def _sign(rng: Generator) -> float:
    return float(rng.choice([-1.0, 1.0]))


def _one_current(s: Scale, rng: Generator) -> list[Cycle]:
    """A locked rotor under one current, along d and along q, reversed once."""
    n, size = s.samples(SECONDS), s.current * rng.uniform(0.6, 1.1)
    turn = np.where(np.arange(n) < rng.uniform(0.35, 0.65) * n, size, -size)
    return [
        cycle("locked_d", "locked", "none", CURRENT, turn),
        cycle("locked_q", "locked", "none", CURRENT, np.zeros(n), turn),
    ]


def _one_link(s: Scale, rng: Generator) -> list[Cycle]:
    """Turned slowly with a few currents, all at one link voltage."""
    n = s.samples(SECONDS)
    sizes = s.current * rng.uniform(0.3, 1.2, (2, 4)) * rng.choice([-1.0, 1.0], (2, 4))
    speed = _sign(rng) * s.speed * rng.uniform(0.05, 0.12)
    return [
        cycle("slow_d", "driven", "none", CURRENT, held(n, sizes[0]), speed=speed),
        cycle("slow_q", "driven", "none", CURRENT, np.zeros(n), held(n, sizes[1]), speed=speed),
    ]


def _one_speed(s: Scale, rng: Generator) -> list[Cycle]:
    """Turned at one speed, without current and with one."""
    n, speed = s.samples(SECONDS), _sign(rng) * s.speed * rng.uniform(0.6, 0.95)
    d, q = s.current * rng.uniform(-0.5, 0.0), _sign(rng) * s.current * rng.uniform(0.4, 0.8)
    idle: Array = np.zeros(n)
    return [
        cycle("idle", "driven", "none", CURRENT, idle, speed=speed),
        cycle("loaded", "driven", "none", CURRENT, idle + d, idle + q, speed=speed),
    ]


PAIRS: Mapping[str, tuple[tuple[str, ...], Maker]] = {
    "one_current": (("stator_resistance", "device_drop"), _one_current),
    "one_link": (("dead_time", "device_drop"), _one_link),
    "one_voltage": (("magnet_flux", "dc_link_error"), _one_speed),
    "one_rate": (("current_filter", "current_sampling"), _one_speed),
    "one_speed": (("pwm_delay", "current_sampling"), _one_speed),
}


def all_cycles(pair: str, s: Scale, rng: Generator) -> list[Cycle]:
    """Return a pair's two cycles; BadInput for an unknown pair."""
    if pair not in PAIRS:
        raise unknown("pair", pair, PAIRS)
    return PAIRS[pair][1](s, rng)
