"""The voltage that would explain a current residual: where in the circuit a gap lies reads off
it."""

from __future__ import annotations

import math
from collections.abc import Mapping

import numpy as np

from model.array_types import Array
from model.compiled import kernel
from model.effects.library import true_motor
from model.energy import flux_newton, hessian
from sandbox.replay.inputs import LEGS
from sandbox.replay.replay import Prepared


def stationary_residual(current: Array, noise_std: float) -> Array:
    """Return alpha and beta (n, 2) in A of a current residual (n, 3, 1) over the noise's standard
    deviation (A)."""
    return np.asarray((2.0 / 3.0) * noise_std * current[:, :, 0] @ LEGS)


def voltage_residual(
    prepared: Prepared, values: Mapping[str, float], recording: int, current: Array
) -> Array:
    """Return the stationary voltage (n - 1, 2) in V that would explain a current residual (n, 3, 1)
    over the noise's standard deviation.

    u = d(L i)/dt + R i with the incremental inductances of the set's own model at the current as
    read.
    """
    r, drive = prepared.recordings[recording], prepared.campaign.drive
    motor = true_motor(drive.motor, dict(values), keep_map=True)
    i = stationary_residual(current, prepared.noise_std)
    read = (2.0 / 3.0) * r.read @ LEGS
    psi = linked(motor.energy, read, i, r.motion.angle)
    period = drive.converter.sampling_period
    return np.asarray(np.diff(psi, axis=0) / period + 0.5 * motor.resistance * (i[1:] + i[:-1]))


@kernel
def linked(m, read, i, theta):
    """Return the flux (n, 2) that small currents i (n, 2) link on top of those read (n, 2),
    stationary frame."""
    out = np.empty_like(i)
    d = q = 0.0
    for k in range(len(i)):
        c, s = math.cos(theta[k]), math.sin(theta[k])
        d, q, _ = flux_newton(
            m, c * read[k, 0] + s * read[k, 1], c * read[k, 1] - s * read[k, 0], d, q
        )
        g_dd, g_dq, g_qq = hessian(m, d, q)
        x, y = c * i[k, 0] + s * i[k, 1], c * i[k, 1] - s * i[k, 0]
        det = g_dd * g_qq - g_dq * g_dq
        p_d, p_q = (g_qq * x - g_dq * y) / det, (g_dd * y - g_dq * x) / det
        out[k, 0], out[k, 1] = c * p_d - s * p_q, s * p_d + c * p_q
    return out
