"""A simulated shaft under speed control, logged as a small drive does."""

import math

import numpy as np
from numba import njit

from sandbox.recordings.motion_log import MotionCampaign, MotionRecording

CONSTANT, INERTIA, COUNT = 0.05, 2e-4, math.tau / 8192
ORDERS = {7: (0.02, 1.0), 12: (0.012, -2.0), 36: (0.006, 0.3)}  # N m, rad


@njit
def _turned(goal, h, inertia, friction, teeth, lag):
    """Return angle (rad) and shown current (A) at each step; friction: dry (N m), viscous, of a
    fan; teeth: order, N m, rad, a row each."""
    steps = len(goal)
    theta, shown = np.zeros(steps), np.zeros(steps)
    angle, omega, total, late = 0.3, 0.0, 0.0, 0.0
    dry, viscous, fan = friction
    for k in range(steps):
        total += h * (goal[k] - omega)
        i = 0.4 * (goal[k] - omega) + 8.0 * total
        late += h / lag * (i - late) if lag else i - late
        theta[k], shown[k] = angle, late
        torque = (
            CONSTANT * i - dry * math.tanh(omega / 0.2) - viscous * omega - fan * omega * abs(omega)
        )
        for n, size, phase in teeth:
            torque += size * math.sin(n * angle + phase)
        omega += h * torque / inertia
        angle += h * omega
    return theta, shown


def shaft(
    seed,
    run,
    *,
    inertia=INERTIA,
    dry=0.0,
    viscous=0.0,
    orders=(),
    fan=0.0,
    lag=0.0,
    noise=0.02,
    seconds=6.0,
):
    """A speed-controlled run (its course in rad/s over time), 20 kHz Euler steps, logged unevenly
    by counts."""
    rng, h = np.random.default_rng(seed), 5e-5
    steps = round(seconds / h)
    t = np.arange(steps) * h
    teeth = np.array([(n, *ORDERS[n]) for n in orders], float).reshape(-1, 3)
    theta, shown = _turned(run(t), h, inertia, np.array([dry, viscous, fan]), teeth, lag)
    at = np.unique(np.round(np.cumsum(rng.uniform(1.5e-3, 3e-3, steps // 20)) / h).astype(int))
    at = at[at < steps]
    read = shown[at] + noise * rng.standard_normal(len(at))
    counted = COUNT * np.round(theta[at] / COUNT)
    return MotionRecording(f"run{seed}", t[at], counted, CONSTANT * read, np.zeros(len(at)))


def thrown(seed, rows, count, *, scatter=0.0, dry=0.02, viscous=1e-4, noise=0.05):
    """A throttle thrown to and fro for some 1200 rows, ramps of 2.5 rows; stamps scatter by up to
    some seconds."""
    rng, h = np.random.default_rng(seed), rows / 40.0
    steps, hold = 1200 * 40, 30.0 * rows + 0.2
    goal, k, sign = np.zeros(steps), 0, 1.0
    while k < steps:
        held = int(rng.uniform(0.5, 1.4) * hold / h)
        goal[k : k + held] = sign * rng.uniform(0.6, 1.6)
        k, sign = k + held, -sign
    current = np.convolve(goal, np.full(100, 0.01))[:steps]
    theta = _thrown(current, h, INERTIA, dry, viscous)
    at = np.round(np.cumsum(rng.uniform(36.0, 44.0, 1400))).astype(int)
    at = at[at < steps - 40]
    late = np.round(rng.uniform(-scatter, scatter, len(at)) / h).astype(int)
    place = np.clip(at + late, 0, steps - 1)
    torque = CONSTANT * (current[place] + noise * rng.standard_normal(len(at)))
    counted = count * np.round(theta[place] / count)
    return MotionRecording(f"thrown{seed}", at * h, counted, torque, np.zeros(len(at)))


@njit
def _thrown(current, h, inertia, dry, viscous):
    """Return the angle (rad) that a current (A) makes, Euler steps."""
    theta = np.zeros(len(current))
    angle, omega = 0.3, 0.0
    for k in range(len(current)):
        theta[k] = angle
        braked = dry * math.tanh(omega / 0.2) + viscous * omega
        omega += h * (CONSTANT * current[k] - braked) / inertia
        angle += h * omega
    return theta


def campaign(*recordings, inertia=INERTIA, count=COUNT):
    return MotionCampaign(
        "bench", CONSTANT, inertia, 0.0, {}, None, count, recordings, (), "no voltages"
    )


def both_ways(t):
    return 6.0 * np.sin(2.0 * t) + 3.0 * np.sign(np.sin(0.9 * t))
