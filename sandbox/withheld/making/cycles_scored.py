"""Cycles for scoring: levels in random order, vectors in random directions, ramps and sines; other
lengths, too."""

from __future__ import annotations

import numpy as np
from numpy.random import Generator

from sandbox.withheld.making.cycles import (
    CURRENT,
    SPEED,
    VOLTAGE,
    Array,
    Cycle,
    Scale,
    between,
    cycle,
    held,
)


def all_cycles(s: Scale, rng: Generator) -> list[Cycle]:
    """Return the twelve cycles."""
    return [*_locked(s, rng), *_free(s, rng), *_driven(s, rng)]


def _levels(n: int, top: float, rng: Generator) -> Array:
    """Levels over [-top, top] in random order, each reached once."""
    count = int(rng.integers(6, 11))
    return held(n, rng.permutation(np.linspace(-top, top, count)))


def _vectors(n: int, count: int, top: float, rng: Generator) -> tuple[Array, Array]:
    """Vectors of random length up to `top` in random directions, held for unequal times."""
    ends = np.sort(rng.uniform(0.0, 1.0, count - 1))
    which = np.searchsorted(ends, np.arange(n) / n)
    size, angle = top * np.sqrt(rng.uniform(0.05, 1.0, count)), rng.uniform(0.0, 2.0 * np.pi, count)
    size[0] = 0.0
    return (size * np.cos(angle))[which], (size * np.sin(angle))[which]


def _locked(s: Scale, rng: Generator) -> list[Cycle]:
    top = s.current * rng.uniform(1.3, 1.7)
    sizes = [s.samples(t) for t in rng.uniform(1.5, 2.0, 3)]
    steps = _vectors(
        s.samples(rng.uniform(1.3, 1.7)), 20, s.resistance * s.current * rng.uniform(1.3, 1.6), rng
    )
    k = s.samples(rng.uniform(1.3, 1.7))
    phase = np.cumsum(rng.uniform(1.0, 2.0) + rng.uniform(0.5, 2.0) * np.arange(k) / k) / s.rate
    triangle = 2.0 / np.pi * np.arcsin(np.sin(2.0 * np.pi * phase))
    low, way = s.resistance * s.current * rng.uniform(0.06, 0.15), rng.uniform(0.0, 2.0 * np.pi)
    swing = low * np.cos(2.0 * np.pi * 0.37 * phase)
    return [
        cycle("locked_d", "locked", "d", CURRENT, _levels(sizes[0], top, rng)),
        cycle(
            "locked_q_inject_d",
            "locked",
            "d",
            CURRENT,
            np.zeros(sizes[1]),
            _levels(sizes[1], top, rng),
        ),
        cycle(
            "locked_q_inject_q",
            "locked",
            "q",
            CURRENT,
            np.zeros(sizes[2]),
            _levels(sizes[2], top, rng),
        ),
        cycle("locked_steps", "locked", "none", VOLTAGE, *steps),
        cycle(
            "locked_low_current",
            "locked",
            "none",
            VOLTAGE,
            low * triangle * np.cos(way),
            swing * np.sin(way + 0.6),
        ),
    ]


def _corners(rng: Generator, count: int) -> Array:
    """Shares of the whole at which something changes, no two closer than a third of the mean
    distance."""
    gaps = rng.uniform(0.5, 1.5, count + 1)
    return np.cumsum(gaps)[:-1] / gaps.sum()


def _free(s: Scale, rng: Generator) -> list[Cycle]:
    n, n_fast, n_back, n_coast = (
        s.samples(t * rng.uniform(0.9, 1.1)) for t in (2.5, 2.4, 1.8, 1.2)
    )
    places = np.concatenate([[0.0], _corners(rng, 5), [1.0]])
    slow = s.speed * between(n, places, np.concatenate([[0.0], rng.uniform(-0.1, 0.1, 6)]))
    load = s.torque * held(n, np.concatenate([[0.0], rng.uniform(-0.1, 0.85, 6)]))
    climb = s.speed * between(
        n_fast,
        np.concatenate([[0.0], _corners(rng, 4), [1.0]]),
        np.concatenate([[0.0], rng.uniform(0.25, 0.95, 5)]),
    )
    brisk = s.torque * between(
        n_fast,
        np.array([0.0, 0.2, 0.25, 0.5, 0.55, 0.75, 0.8, 1.0]),
        np.repeat(np.concatenate([[0.0], rng.uniform(0.0, 0.5, 3)]), 2),
    )
    way = float(rng.choice([-1.0, 1.0]))
    waves = rng.uniform(1.0, 1.6)
    back = (
        way
        * s.speed
        * rng.uniform(0.25, 0.4)
        * np.sin(2.0 * np.pi * waves * np.arange(n_back) / n_back)
    )
    cut = rng.uniform(0.35, 0.5)
    kind = np.where(np.arange(n_coast) < cut * n_coast, SPEED, CURRENT)
    coast = np.where(kind == SPEED, -way * s.speed * rng.uniform(0.35, 0.7), 0.0)
    return [
        cycle("run_slow", "free", "d", SPEED, slow, load=load),
        cycle("run_fast", "free", "none", SPEED, way * climb, load=way * brisk),
        cycle("reversal", "free", "none", SPEED, back, load=s.torque * rng.uniform(-0.2, 0.2)),
        cycle("coast_down", "free", "none", kind, coast),
    ]


def _driven(s: Scale, rng: Generator) -> list[Cycle]:
    n, n_slow, m = (s.samples(t * rng.uniform(0.9, 1.1)) for t in (2.0, 2.0, 1.0))
    way = float(rng.choice([-1.0, 1.0]))
    fast, slow = _vectors(n, 9, 1.4 * s.current, rng), _vectors(n_slow, 9, 1.4 * s.current, rng)
    times = np.concatenate([[0.0], _corners(rng, 3), [1.0]])
    idle = (
        way
        * s.idle_speed
        * between(m, times, np.array([0.0, -0.6, -0.6, 0.9, 0.9]) * rng.uniform(0.8, 1.0))
    )
    return [
        cycle(
            "driven_grid",
            "driven",
            "none",
            CURRENT,
            *fast,
            speed=way * s.speed * rng.uniform(0.2, 0.4),
        ),
        cycle(
            "driven_grid_slow",
            "driven",
            "none",
            CURRENT,
            *slow,
            speed=-way * s.speed * rng.uniform(0.05, 0.12),
        ),
        cycle("driven_idle", "driven", "none", CURRENT, np.zeros(m), speed=idle),
    ]
