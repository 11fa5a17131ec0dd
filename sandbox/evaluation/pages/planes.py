"""Runs in the planes of current and flux: their paths, and what injection sees there."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from model.array_types import Array
from model.energy import flux_newton, hessian, is_convex_to
from model.parameters import Drive
from model.saliency import LEAST_SALIENCY, null_angle
from sandbox.drive.recording import Recording
from sandbox.output.looks import means

POINTS = 1500  # of a path: more than a page shows
GRID = 41  # points a side of the plane of currents
SLOWEST_TURN = 2.0  # s: a turn that takes longer is none to draw


class Plane(NamedTuple):
    """What injection sees over the plane of currents: NaN where the model is not valid."""

    current: Array  # (n,) A, of both axes
    # (n, n) degrees over i_d (first axis) and i_q: error of a linear belief where the encoder
    # controls
    angle: Array
    gain: Array  # (n, n) slope of the null relative to zero current


def plane(drive: Drive, reach: float) -> Plane | None:
    """Return the saliency over currents up to `reach` (A) on both axes; None for a motor without
    saliency."""
    m, i = drive.motor.energy, np.linspace(-reach, reach, GRID)
    zero = abs(m.gamma_d - m.gamma_q)
    if zero < LEAST_SALIENCY * max(m.gamma_d, m.gamma_q):
        return None
    angle, gain = np.full((2, GRID, GRID), np.nan)
    sign = math.copysign(1.0, m.gamma_d - m.gamma_q)
    for k in np.ndindex(angle.shape):
        d, q, outside = flux_newton(m, float(i[k[0]]), float(i[k[1]]), 0.0, 0.0)
        if not outside and is_convex_to(m, d, q):
            dd, dq, qq = hessian(m, d, q)
            angle[k] = math.degrees(null_angle(dd, dq, qq, sign))
            gain[k] = math.hypot(dd - qq, 2.0 * dq) / zero
    return Plane(i, angle, gain)


def currents(drive: Drive, recording: Recording) -> tuple[Array, Array]:
    """Return a run's way through the plane of currents (i_d, i_q in A), means over whole injection
    periods."""
    width = _injected(drive) * max(2, math.ceil(len(recording) / (_injected(drive) * POINTS)))
    return means(recording.i_d, width), means(recording.i_q, width)


def hodograph(drive: Drive, recording: Recording, ends: Sequence[float]) -> tuple[Array, Array]:
    """Return the flux linkage (Wb) in the stator's frame, by the nominal model at the currents of a
    run.

    Of a rotor that turns: the last electrical turn before each of the `ends` (s), NaN between them,
    as all turns would hide each other; else the whole way. NaN outside the model's domain, too.
    """
    turn = 2.0 * math.pi
    if len(recording) == 0 or np.ptp(recording.theta) < turn:
        return _flux(
            drive,
            recording,
            _injected(drive) * max(1, math.ceil(len(recording) / (_injected(drive) * POINTS))),
        )
    parts = []
    for end in ends:
        before = recording.between(-math.inf, end)
        away = (
            np.flatnonzero(np.abs(before.theta - before.theta[-1]) > turn)
            if len(before)
            else np.array([])
        )
        if away.size and before.t[-1] - before.t[away[-1]] < SLOWEST_TURN:
            parts.append(
                _flux(drive, recording.between(float(before.t[away[-1]]), end), _injected(drive))
            )
    gap = np.array([np.nan])
    pair = [
        np.concatenate([x for part in parts for x in (part[k], gap)]) if parts else gap
        for k in (0, 1)
    ]
    return pair[0], pair[1]


def _flux(drive: Drive, recording: Recording, width: int) -> tuple[Array, Array]:
    """Return the flux in the stator's frame, block by block."""
    i_d, i_q = means(recording.i_d, width), means(recording.i_q, width)
    way = means(np.exp(1j * recording.theta), width)
    psi = np.full(i_d.size, np.nan + 0j)
    for k, (x, y) in enumerate(zip(i_d, i_q, strict=True)):
        d, q, outside = flux_newton(drive.motor.energy, float(x), float(y), 0.0, 0.0)
        if not outside and is_convex_to(drive.motor.energy, d, q):
            psi[k] = (drive.motor.magnet_flux + d + 1j * q) * way[k] / abs(way[k])
    return psi.real, psi.imag


def _injected(drive: Drive) -> int:
    """Return the samples of an injection period."""
    return max(1, round(1.0 / (drive.injection.frequency * drive.converter.sampling_period)))
