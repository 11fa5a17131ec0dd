"""The flux at a recording's first sample, which nobody has read.

A replay starts from the current as read there, or from none; the current is known to the noise of
one reading.  What it is off by stays as long as L/R lasts, and in a rotor that turns it comes round
to the axis of the smaller inductance: of a saliency of six a reading's noise along q becomes six
times as much along d.

Both components are integrated out, Gaussian, with the deviation P of a reading's noise.  With C
the readings' answers (in units of their noise's standard deviation) to one deviation each,
residuals have the covariance I + C P C'.  Residuals and slopes are whitened by its root: along each
of two orthonormal shapes, a share 1 - 1/sqrt(1 + s^2) is taken off, s the singular value there.  It
is one for all sets (of the nominal model), so evidences miss no determinant.
Checked: tests/sandbox/replay/test_unread_start.py.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from model.array_types import Array
from model.effects.library import true_motor
from model.energy import flux_newton, hessian
from sandbox.plant.sets import complete
from sandbox.replay.inputs import Inputs, Start
from sandbox.replay.replay import Prepared, block_of
from sandbox.replay.walking import Running

LASTING = 5.0  # time constants L/R of the slowest axis that are looked at: 0.7 % is left then
OF_VECTOR = math.sqrt(2.0 / 3.0)  # noise of a vector's component over that of one phase


def with_starts(prepared: Prepared, values: Mapping[str, float] | None = None) -> Prepared:
    """Return a campaign that knows how its readings answer to the flux at each first sample;
    values: the set whose plant answers, nominal by default."""
    drive = prepared.campaign.drive
    own = complete(drive.motor, drive.converter, dict(values or {}))
    recordings = tuple(replace(r, start=start_of(prepared, r, own)) for r in prepared.recordings)
    return replace(prepared, recordings=recordings)


def with_starts_of(prepared: Prepared, other: Prepared) -> Prepared:
    """Return a campaign that knows the starts of another one, recording by recording."""
    pairs = zip(prepared.recordings, other.recordings, strict=True)
    own = tuple(replace(r, start=o.start, hold=o.hold) for r, o in pairs)
    return replace(prepared, recordings=own)


def start_of(prepared: Prepared, r: Inputs, values: Mapping[str, float]) -> Start | None:
    """Return the shapes that the unread start of a recording adds to its readings, and the shares
    that whitening takes off them; None where the set predicts nothing finite."""
    answer = answers(prepared, r, values) / prepared.noise_std
    if not np.all(np.isfinite(answer)):
        return None
    q, s, _ = np.linalg.svd(answer.reshape(-1, 2), full_matrices=False)
    return Start(q.reshape(answer.shape), 1.0 - 1.0 / np.sqrt(1.0 + s**2))


def answers(prepared: Prepared, r: Inputs, values: Mapping[str, float]) -> Array:
    """Return how readings (m, 3, 2) in A answer to a current at the start that is one deviation
    off, along d and along q."""
    drive = prepared.campaign.drive
    running = Running.begun(
        drive, prepared.steps, r, block_of(prepared, [0, 0, 0], [values]), settled=False
    )
    displace(running, flux_off(prepared, r.settling or r, values))
    running.settle()
    slowest = max(drive.motor.inductance_d, drive.motor.inductance_q) / drive.motor.resistance
    lasting = math.ceil(LASTING * slowest / drive.converter.sampling_period)
    m = min(r.samples, max(2, lasting))
    ahead, lanes = m < r.samples, running.lanes
    out = np.empty((m + ahead, 3, lanes))
    running.on(m, out, np.empty((m, lanes) if r.rotor == "free" else (1, lanes)))
    answer = out[:m, :, 1:3] - out[:m, :, :1]
    if r.settling is None and r.loaded:
        answer[0] = 0.0  # there the current is what was read
    return answer


def flux_off(prepared: Prepared, r: Inputs, values: Mapping[str, float]) -> Array:
    """Return the flux (2, 2) in Wb, stationary frame, of one deviation of the first current along d
    and along q (columns).

    A reading under current is off by its noise.  A start that counts as one without current may
    have what was read.
    """
    motor = true_motor(prepared.campaign.drive.motor, dict(values), keep_map=True)
    c, s = math.cos(r.motion.angle[0]), math.sin(r.motion.angle[0])
    read = r.first_current()
    i_d, i_q = (c * read[0] + s * read[1], c * read[1] - s * read[0]) if r.loaded else (0.0, 0.0)
    noise = OF_VECTOR * prepared.noise_std
    size = noise if r.loaded else max(noise, math.hypot(*read))
    d, q, _ = flux_newton(motor.energy, i_d, i_q, 0.0, 0.0)
    dd, dq, qq = hessian(motor.energy, d, q)
    turn = np.array([[c, -s], [s, c]])
    return np.asarray(size * turn @ np.linalg.inv([[dd, dq], [dq, qq]]))


def displace(running: Running, flux: Array) -> None:
    """Move the flux of the second and the third lane by columns of flux (2, 2) in Wb."""
    for k in range(2):
        running.batch["psi_alpha"][1 + k] += flux[0, k]
        running.batch["psi_beta"][1 + k] += flux[1, k]
