"""Cycles as in the practice recordings: staircases upwards, steps along the axes, steps of speed
and load."""

from __future__ import annotations

import numpy as np
from numpy.random import Generator

from sandbox.withheld.making.cycles import (
    CURRENT,
    SPEED,
    VOLTAGE,
    Cycle,
    Scale,
    between,
    cycle,
    held,
)

GRID = (
    (-1.0, 0.0),
    (-1.0, 0.7),
    (0.0, 0.7),
    (0.0, 0.7),
    (0.0, -0.7),
    (-0.7, -1.0),
    (0.0, 1.2),
    (0.0, 0.0),
)


def all_cycles(s: Scale, rng: Generator) -> list[Cycle]:
    """Return the twelve cycles."""
    return [*_locked(s, rng), *_free(s, rng), *_driven(s, rng)]


def _locked(s: Scale, rng: Generator) -> list[Cycle]:
    n, top = s.samples(1.8), s.current * rng.uniform(1.45, 1.65)
    stairs = held(n, np.linspace(-top, top, 9))
    volts = s.resistance * s.current * rng.uniform(1.35, 1.55)
    d = np.array([0, 1, -1, 0.5, -0.5, 0, 0, 0, 0, 0, 0, 0, 0.7, -0.7, 0.35, -0.35, 0, 0])
    q = np.array([0, 0, 0, 0, 0, 0, 1, -1, 0.5, -0.5, 0, 0, -0.7, 0.7, -0.35, 0.35, 0, 0])
    m = s.samples(1.44)
    k = s.samples(1.5)
    turn = 2.0 * np.pi * 3.0 * np.arange(k) / k
    low = s.resistance * s.current * 0.12 * rng.uniform(0.8, 1.2)
    return [
        cycle("locked_d", "locked", "d", CURRENT, stairs),
        cycle("locked_q_inject_d", "locked", "d", CURRENT, np.zeros(n), stairs),
        cycle("locked_q_inject_q", "locked", "q", CURRENT, np.zeros(n), stairs),
        cycle("locked_steps", "locked", "none", VOLTAGE, volts * held(m, d), volts * held(m, q)),
        cycle(
            "locked_low_current",
            "locked",
            "none",
            VOLTAGE,
            low * np.sin(turn),
            0.5 * low * np.sin(turn - 2.4),
        ),
    ]


def _free(s: Scale, rng: Generator) -> list[Cycle]:
    wide = rng.uniform(0.85, 1.15)
    n = s.samples(2.5)
    slow = 0.09 * wide * s.speed * held(n, np.array([0.2, 0.2, 0.7, 1.0, 0.3, 0.3, -0.7, -0.3]))
    n_fast = s.samples(2.4)
    fast = (
        wide
        * s.speed
        * between(
            n_fast,
            np.array([0.0, 0.1, 0.35, 0.45, 0.65, 0.8, 0.82, 1.0]),
            np.array([0.0, 0.3, 0.35, 0.55, 0.85, 0.85, 0.5, 0.5]),
        )
    )
    n_back = s.samples(1.8)
    back = 0.3 * wide * s.speed * held(n_back, np.array([1.0, -1.0, 1.0]))
    n_coast = s.samples(1.2)
    kind = np.where(np.arange(n_coast) < 0.42 * n_coast, SPEED, CURRENT)
    coast = np.where(kind == SPEED, 0.55 * wide * s.speed, 0.0)
    load = s.torque * np.array([0.0, 0.4, 0.8, 0.4, 0.0, 0.4, 0.8, 0.2, 0.4, 0.0])
    brisk = s.torque * np.array([0.0, 0.45, 0.2, 0.45, 0.0, 0.45, 0.0, 0.3])
    return [
        cycle("run_slow", "free", "d", SPEED, slow, load=held(n, load)),
        cycle("run_fast", "free", "none", SPEED, fast, load=held(n_fast, brisk)),
        cycle("reversal", "free", "none", SPEED, back, load=0.2 * s.torque),
        cycle("coast_down", "free", "none", kind, coast),
    ]


def _driven(s: Scale, rng: Generator) -> list[Cycle]:
    n = s.samples(2.0)
    grid = s.current * rng.uniform(1.1, 1.25) * held(n, np.array(GRID))
    speed = s.speed * rng.uniform(0.22, 0.3)
    m = s.samples(1.0)
    idle = s.idle_speed * between(
        m, np.array([0.0, 0.09, 0.5, 0.64, 1.0]), np.array([0.0, 0.85, 0.85, -0.5, -0.5])
    )
    return [
        cycle("driven_grid", "driven", "none", CURRENT, grid[:, 0], grid[:, 1], speed=speed),
        cycle(
            "driven_grid_slow",
            "driven",
            "none",
            CURRENT,
            grid[:, 0],
            grid[:, 1],
            speed=-0.28 * speed,
        ),
        cycle("driven_idle", "driven", "none", CURRENT, np.zeros(m), speed=idle),
    ]
