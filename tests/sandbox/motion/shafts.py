"""A simulated shaft under speed control, logged as a small drive does."""

import math

import numpy as np

from sandbox.recordings.motion_log import MotionCampaign, MotionRecording

CONSTANT, INERTIA, COUNT = 0.05, 2e-4, math.tau / 8192
ORDERS = {7: (0.02, 1.0), 12: (0.012, -2.0), 36: (0.006, 0.3)}  # N m, rad


def shaft(seed, run, *, inertia=INERTIA, dry=0.0, viscous=0.0, orders=(), fan=0.0, lag=0.0, noise=0.02, seconds=6.0):
    """A speed-controlled run (its course in rad/s over time), 20 kHz Euler steps, logged unevenly by counts."""
    rng, h = np.random.default_rng(seed), 5e-5
    steps = round(seconds / h)
    t = np.arange(steps) * h
    goal = run(t)
    theta, omega, total, late = np.zeros(steps), 0.0, 0.0, 0.0
    shown = np.zeros(steps)
    angle = 0.3
    for k in range(steps):
        total += h * (goal[k] - omega)
        i = 0.4 * (goal[k] - omega) + 8.0 * total
        late += h / lag * (i - late) if lag else i - late
        theta[k], shown[k] = angle, late
        torque = CONSTANT * i - dry * math.tanh(omega / 0.2) - viscous * omega - fan * omega * abs(omega)
        for n in orders:
            size, phase = ORDERS[n]
            torque += size * math.sin(n * angle + phase)
        omega += h * torque / inertia
        angle += h * omega
    at = np.unique(np.round(np.cumsum(rng.uniform(1.5e-3, 3e-3, steps // 20)) / h).astype(int))
    at = at[at < steps]
    read = shown[at] + noise * rng.standard_normal(len(at))
    counted = COUNT * np.round(theta[at] / COUNT)
    return MotionRecording(f"run{seed}", t[at], counted, CONSTANT * read, np.zeros(len(at)))


def campaign(*recordings, inertia=INERTIA):
    return MotionCampaign("bench", CONSTANT, inertia, 0.0, {}, None, COUNT, recordings, (), "no voltages")


def both_ways(t):
    return 6.0 * np.sin(2.0 * t) + 3.0 * np.sign(np.sin(0.9 * t))
