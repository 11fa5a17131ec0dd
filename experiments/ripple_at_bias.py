"""Ripple of a drive at a bias current: exact, and by the paper's eqs. (tid), (tiq); no recording in
between."""

from __future__ import annotations

import math

import numpy as np

from model.energy import Energy, flux_from_current
from model.errors import PhysicsError
from model.parameters import Drive
from model.ripple import flux_ripple, periodic, slopes
from sandbox.recordings.injection import carrier


def true_slopes(drive: Drive, i_d: float, i_q: float, axis: str) -> tuple[float, float]:
    """Return the slopes (1/H) that demodulation reads at a bias current (A); PhysicsError outside
    the valid domain."""
    flux_from_current(drive.motor.energy, i_d, i_q)  # raises outside the convex domain around zero
    h = drive.converter.sampling_period
    shape = drive.injection.amplitude * carrier(drive.injection, drive.converter).waveform
    v = np.zeros((len(shape), 2))
    v[:, "dq".index(axis)] = shape
    out = np.empty_like(v)
    _, _, status = periodic(
        drive.motor.energy, drive.motor.resistance, 0.0, 1.0, 0.0, v, h, 0.0, i_d, i_q, out
    )
    if status:
        raise PhysicsError(
            f"no valid periodic solution of '{drive.name}' at i_d = {i_d:.3g} A, i_q = {i_q:.3g} A"
        )
    return slopes(out, flux_ripple(shape, h))


def formula_slopes(
    m: Energy, i_d: np.ndarray, i_q: np.ndarray, axis: str
) -> tuple[np.ndarray, np.ndarray]:
    """Return Omega i~/u~ (1/H) by eqs. (tid), (tiq), which replace the flux by L i in the
    Hessian."""
    d, q = np.asarray(i_d) / m.gamma_d, np.asarray(i_q) / m.gamma_q
    cross = 2 * q * (m.alpha_12 + 2 * m.alpha_22 * d)
    if axis == "d":
        return (
            m.gamma_d + 6 * m.alpha_30 * d + 12 * m.alpha_40 * d**2 + 2 * m.alpha_22 * q**2,
            cross,
        )
    return cross, m.gamma_q + 2 * m.alpha_12 * d + 2 * m.alpha_22 * d**2 + 12 * m.alpha_04 * q**2


def ripple_scale(drive: Drive) -> float:
    """Return u~ / Omega (V s): what turns a slope into the amplitude i~ of i~ F(Omega t)."""
    return drive.injection.amplitude / (2 * math.pi * drive.injection.frequency)
