"""The bench's own twelve recordings: what the controller is asked, sample by sample.

Staircases, steps and crossings with a locked rotor; grids and idling at an imposed speed; load
steps, a reversal and a coast-down with a free rotor.  Levels and times are drawn anew for each
campaign.
"""

from typing import NamedTuple

import numpy as np

from .types import CURRENT, DRIVEN, FREE, LOCKED, SPEED, VOLTAGE

ROTORS = {LOCKED: "locked", DRIVEN: "driven", FREE: "free"}


# samples of a change of level, so that a loop with two samples of delay follows without overshoot
EDGE = 60


class Plan(NamedTuple):
    """A recording before it is run: references over `n` samples at the period of the drive."""

    name: str
    rotor: int
    mode: int
    injection: int
    reference_d: np.ndarray
    reference_q: np.ndarray
    speed: np.ndarray
    load: np.ndarray


def stairs(n: int, levels: list[float]) -> np.ndarray:
    """n samples divided evenly among levels; from one to the next in EDGE samples."""
    k = np.arange(n)
    at = np.minimum(k * len(levels) // n, len(levels) - 1)
    before = np.maximum(at - 1, 0)
    share = np.minimum((k - at * n / len(levels)) / EDGE, 1.0)
    v = np.asarray(levels, float)
    return v[before] + np.maximum(share, 0.0) * (v[at] - v[before])


def ramp(n: int, points: list[float]) -> np.ndarray:
    """Straight lines through evenly spaced points."""
    return np.interp(np.arange(n), np.linspace(0, n - 1, len(points)), points)


class Scale(NamedTuple):
    """What the cycles are scaled by."""

    period: float
    current: float  # A
    bias: float  # i_d over the current under load
    speed: float  # mech rad/s
    torque: float  # N m
    resistance: float
    pulse: float  # V that moves half the rated current within four periods
    least_bias: float  # lowest i_d / current that is safe


def locked_cycles(s: Scale, n: int, rng: np.random.Generator) -> list[Plan]:
    """Return the runs with a locked rotor."""
    i, zero = s.current, np.zeros(n)
    j = rng.uniform(0.9, 1.1)
    levels = [0.0, 0.4 * j, 0.8 * j, 1.15 * j, 0.6 * j, -0.3 * j, -0.7 * j, -1.0 * j, -0.2 * j]
    d = stairs(n, [i * max(v, s.least_bias) for v in levels])
    q = stairs(
        n,
        [i * v for v in (0.0, 0.5 * j, 1.0 * j, 1.3 * j, 0.25 * j, -0.25 * j, -0.75 * j, -1.2 * j)],
    )
    q2 = stairs(n, [i * v for v in (0.15, 0.45 * j, 0.9 * j, 1.25 * j, -0.6 * j, -1.1 * j, -0.1)])
    d2 = stairs(n, [i * s.bias * v for v in (0.0, 0.5, 1.0, 1.0, 0.5, 1.0, 0.0)])
    hold = n // 24
    pulses_d, pulses_q = np.zeros(n), np.zeros(n)
    for k in range(24):
        at = slice(k * hold, k * hold + hold)
        a = rng.choice([0.0, 0.7, -0.7]) if k % 3 else 0.0
        b = rng.uniform(-1.1, 1.1) if k else 0.0
        pulses_d[at], pulses_q[at] = a * s.resistance * i, b * s.resistance * i
        kick = slice(k * hold, k * hold + 4)
        pulses_d[kick] += np.sign(pulses_d[k * hold] - pulses_d[k * hold - 1]) * s.pulse
        pulses_q[kick] += np.sign(pulses_q[k * hold] - pulses_q[k * hold - 1]) * s.pulse
    slow = 0.09 * i
    cross_d = np.concatenate([ramp(n // 2, [0, slow, -slow, slow, 0]), np.zeros(n - n // 2)])
    cross_q = np.concatenate([np.zeros(n // 2), ramp(n - n // 2, [0, slow, -slow, slow, -slow])])
    return [
        Plan("stand_d", LOCKED, CURRENT, 1, d, zero, zero, zero),
        Plan("stand_q_on_d", LOCKED, CURRENT, 1, d2 * 0, q, zero, zero),
        Plan("stand_q_on_q", LOCKED, CURRENT, 2, d2, q2, zero, zero),
        Plan("stand_pulses", LOCKED, VOLTAGE, 0, pulses_d, pulses_q, zero, zero),
        Plan("stand_crossings", LOCKED, CURRENT, 0, cross_d, cross_q, zero, zero),
    ]


def driven_cycles(s: Scale, n: int, rng: np.random.Generator) -> list[Plan]:
    """Return the runs with a driven rotor."""
    i, zero = s.current, np.zeros(n)
    a, b = rng.uniform(0.45, 0.6), rng.uniform(0.08, 0.13)
    grid_d = [
        i * s.bias * v + i * w
        for v in (0, 1, 0.5)
        for w in (0.0, max(-0.3, s.least_bias), 0.25, 0.0)
    ]
    grid_q = [i * v for v in (0.0, 0.5, 1.0, -0.6, 0.3, 0.8, -1.1, 1.2, -0.2, 0.6, -0.9, 0.1)]
    order = rng.permutation(12)
    d, q = [grid_d[k] for k in order], [grid_q[k] for k in order]
    w_slow = stairs(n, [1.0, -1.0]) * b * s.speed
    back = [d[k] for k in rng.permutation(12)]
    return [
        Plan(
            "turned_fast",
            DRIVEN,
            CURRENT,
            0,
            stairs(n, d),
            stairs(n, q),
            np.full(n, a * s.speed),
            zero,
        ),
        Plan("turned_slow", DRIVEN, CURRENT, 0, stairs(n, back), stairs(n, q), w_slow, zero),
        Plan(
            "turned_idle",
            DRIVEN,
            CURRENT,
            0,
            zero,
            zero,
            ramp(n, [0.0, 0.6, 0.1, -0.6, 0.0]) * s.speed,
            zero,
        ),
    ]


def free_cycles(s: Scale, n: int, rng: np.random.Generator) -> list[Plan]:
    """Return the runs with a free rotor."""
    zero = np.zeros(n)
    d = np.full(n, 0.6 * s.bias * s.current)
    a = rng.uniform(0.8, 1.0)
    steps = stairs(
        n, [0.0, 0.5 * a * s.torque, 0.25 * a * s.torque, -0.35 * a * s.torque, 0.1 * s.torque]
    )
    fast = stairs(n, [0.1 * s.torque, 0.8 * a * s.torque, 0.0, -0.6 * a * s.torque, 0.4 * s.torque])
    w_fast = np.minimum(ramp(n, [0.1, 0.55, 0.55, 0.55, 0.55, 0.35]), 0.55) * s.speed
    turn = ramp(n, [0.0, 0.3, 0.3, -0.3, -0.3, 0.05, -0.05, 0.05]) * s.speed
    run = n // 4
    gone = np.concatenate([ramp(run, [0.2, 0.5]), np.full(n - run, 0.5)]) * s.speed
    coast = np.where(np.arange(n) < run, np.nan, 0.0)
    follow = np.full(n, np.nan)  # the speed controller asks for i_q
    return [
        Plan(
            "run_slow",
            FREE,
            SPEED,
            1,
            d,
            follow,
            np.full(n, rng.uniform(0.06, 0.1) * s.speed),
            steps,
        ),
        Plan("run_fast", FREE, SPEED, 0, d, follow, w_fast, fast),
        Plan(
            "turn_round",
            FREE,
            SPEED,
            0,
            d * 0.5,
            follow,
            turn,
            np.full(n, 0.12 * s.torque) * np.sign(turn),
        ),
        Plan("let_go", FREE, SPEED, 0, zero, coast, gone, zero),
    ]


def plans(s: Scale, rng: np.random.Generator) -> list[Plan]:
    """Twelve recordings of 1 to 2.2 s."""
    n = max(8000, round(1.0 / s.period))
    return locked_cycles(s, n, rng) + driven_cycles(s, n, rng) + free_cycles(s, int(n * 1.2), rng)
