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


def campaign(*recordings, inertia=INERTIA):
    return MotionCampaign(
        "bench", CONSTANT, inertia, 0.0, {}, None, COUNT, recordings, (), "no voltages"
    )


def both_ways(t):
    return 6.0 * np.sin(2.0 * t) + 3.0 * np.sign(np.sin(0.9 * t))
