"""A motion in closed form: angle, speed and acceleration are exact, the current is what the shaft's
equation asks for."""

import math

import numpy as np

CONSTANT, INERTIA, DRY, VISCOUS, PAIRS, FLUX, R = 0.04, 2e-4, 0.01, 1e-4, 7, 0.04 / 10.5, 0.05
MOTOR = (
    f"[motor]\npole_pairs = {PAIRS}\nmagnet_flux = {FLUX}\nresistance = {R}\ninertia = {INERTIA}\n"
)


def motion(n=2500, step=2e-3, seed=0):
    """Columns t (s), angle (turns of the shaft), speed (turns/s), i_q (A), u_q (V)."""
    t = np.arange(n) * step
    angle = 12.0 * np.sin(3.0 * t) + 5.0 * np.sin(7.3 * t)
    speed = 36.0 * np.cos(3.0 * t) + 36.5 * np.cos(7.3 * t)
    torque = INERTIA * (-108.0 * np.sin(3.0 * t) - 266.45 * np.sin(7.3 * t))
    torque += DRY * np.tanh(speed / 0.2) + VISCOUS * speed
    current = torque / CONSTANT + 0.01 * np.random.default_rng(seed).standard_normal(n)
    volts = R * current + PAIRS * speed * FLUX
    return {
        "t": t,
        "angle": angle / math.tau,
        "speed": speed / math.tau,
        "iq": current,
        "uq": volts,
    }
