"""What the plant's step leaves out of a flux map, by its equation: H'''[S z', S z']/24 of the mean
current.

Over a segment of length S the flux z in the rotor's frame goes straight on with slope z', so its
mean current exceeds the current at its mean by H'''[S z', S z']/24.  A map's step leaves this out
(a quartic's takes it, `electrical.bend`), and with it a drop R H'''[S z', S z']/24.  Here it is
added up along a recording of the bench, segment by segment, and what comes of it in the flux: d
x/dt = -(R G + j omega) x + what is missing, G the inverse
inductance there.  The skin effect's resistance counts as the winding's: within a segment the
current behind its lag stays.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from scipy.linalg import expm

from model.energy import flux_from_current
from model.parameters import Drive
from model.spline import SplineEnergy, hessian
from sandbox.plant.edges import LEG_X, LEG_Y, duties
from sandbox.plant.sets import batch_of, complete
from sandbox.recordings.campaign import CampaignRecording
from sandbox.replay.motion.smoothing import Motion

LEGS = np.array(LEG_X) + 1j * np.array(LEG_Y)
APART = 1e-3  # of the magnet's flux: between the places at which third derivatives are taken
TURNED = np.array([[0.0, -1.0], [1.0, 0.0]])


def inverse_inductance(m: SplineEnergy, z: complex) -> np.ndarray:
    """Return the Hessian of a map's energy (1/H) at a flux (Wb)."""
    a, b, c = hessian(m, z.real, z.imag)
    return np.array([[a, b], [b, c]])


def bent(m: SplineEnergy, z: complex, change: complex, apart: float) -> complex:
    """Return H'''[change, change] (A): the Hessian's slope along a change of flux (Wb), by central
    differences."""
    if change == 0.0:
        return 0j
    h = apart * change / abs(change)
    slope = (
        (inverse_inductance(m, z + h) - inverse_inductance(m, z - h)) * abs(change) / (2.0 * apart)
    )
    return complex(*(slope @ (change.real, change.imag)))


def left_out(
    drive: Drive,
    recording: CampaignRecording,
    motion: Motion,
    effects: Mapping[str, float],
    settled: int,
) -> float:
    """Return the rms of the current that comes of what a map's step leaves out, over rated current.

    recording: locked or driven; one step a period, so segments are those between edges, half a
    period at most.
    """
    motor, period = drive.motor, drive.converter.sampling_period
    m, rows = (
        motor.energy,
        batch_of(motor, drive.converter, [complete(motor, drive.converter, effects)], 1),
    )
    assert isinstance(m, SplineEnergy)
    resistance, magnet, link = (float(rows[name][0]) for name in ("resistance", "magnet", "supply"))
    apart, x, found = APART * motor.magnet_flux, np.zeros(2), []
    for k in range(len(recording.t)):
        theta, omega = motion.angle[k], motion.speed[k]
        phases = np.array([recording.i_a[k], recording.i_b[k], recording.i_c[k]])
        i = (2.0 / 3.0) * (phases @ LEGS) * np.exp(-1j * theta)
        z = complex(*(float(y) for y in flux_from_current(m, i.real, i.imag)))
        found.append(inverse_inductance(m, z) @ x)
        flux, missing = (z + magnet) * np.exp(1j * theta), 0j
        duty = np.array(duties(recording.u_alpha[k], recording.u_beta[k], link))
        rise, fall = 0.5 * (1.0 - duty) * period, 0.5 * (1.0 + duty) * period
        corners = np.unique([0.0, period, *rise, *fall])
        halves = 0.5 * (corners[:-1] + corners[1:])[np.diff(corners) > 0.5 * period]
        corners = np.sort([*corners, *halves])
        for t, span in zip(corners[:-1], np.diff(corners), strict=True):
            on = (rise <= t) & (t < fall)
            u, back = (
                link * (2.0 / 3.0) * complex(on @ LEGS),
                np.exp(-1j * (theta + omega * (t + 0.5 * span))),
            )
            seen = (flux + 0.5 * span * u) * back
            change = span * (u * back - 1j * omega * seen)
            missing += (
                span
                / period
                * (resistance + rows["skin_r"])
                / 24.0
                * bent(m, seen - magnet, change, apart)
            )
            flux += span * u
        rate = resistance * inverse_inductance(m, z) + omega * TURNED
        rest = np.linalg.solve(rate + 1e-9 * np.eye(2), (missing.real, missing.imag))
        x = rest + expm(-period * rate) @ (x - rest)
    return (
        float(np.sqrt(np.mean(np.sum(np.array(found[settled:]) ** 2, axis=1))))
        / motor.rated_current
    )
