"""The shaft's equation averaged over windows of samples, without differentiating anything and on
uneven stamps.

In each window the quadratic fitted to the angle gives the mean acceleration sum(w theta).  Since
sum(w) = sum(w t) = 0,

    sum_k w_k theta(t_k) = integral of K(t) theta''(t) dt,   K(t) = sum_k w_k max(t_k - t, 0),

so with all other torques averaged by the same K the equation

    J theta'' = torque - load - B omega - T_c tanh(omega / width) + cogging(theta) + offset

holds for the averages exactly, whatever the motion inside the window.  Friction and cogging are
averaged along the path of `path.py`, currents over their readings.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from model.array_types import Array
from sandbox.gap.motion.path import PLACES, path_of
from sandbox.recordings.motion_log import MotionCampaign, MotionRecording
from sandbox.recordings.stamps import stamp_jitter

SAMPLES = 24  # of a window
OVERLAP = 3  # windows that share a row
# of the accelerations' rms, that their noise may be: what is known of it is taken out of the
# inertia, and longer windows wash out orders of cogging
NOISY = 0.5
LONGEST = 8 * SAMPLES
FEWEST = 4  # windows, one behind the other, that a recording keeps
# Between rows nobody knows a signal: the line between its readings makes parabolas, and on average
# jumps, too smooth by h^2/12 of their curvature, the sum of its readings weighted by K too rough
# by as much.  Of a tilt from row to row the one takes 1/12, the other 1/4; half of each is right.
TILTED = 0.5 * (1.0 / 12.0 + 1.0 / 4.0)


@dataclass(frozen=True)
class Averages:
    """One recording window by window, n of them: mean acceleration (rad/s^2), driving torque less
    load (N m), speed (rad/s), and what averages any function of the rows or of the path."""

    file: str
    acceleration: Array
    torque: Array
    slope: Array  # N m/s, of the torque as read
    speed: Array
    place: NDArray[np.int64]  # (n, samples): rows of each window
    kernel: Array  # (n, samples), sums to 1: of what is read at the rows
    level: Array  # (n, samples - 1), sums to 1: of means from row to row
    tilt: Array  # (n, samples - 1): of means times the place between two rows, from -1/2 to 1/2
    angle: Array  # (rows - 1, PLACES), rad mechanical: the path between rows
    path_speed: Array  # (rows - 1, PLACES), rad/s
    noise_acceleration: Array  # rad/s^2 rms (n,), of the encoder's counts and the stamps' scatter
    noise_torque: Array  # N m rms (n,), of the stated current noise
    jitter: float  # s rms, of the stamps
    step: float  # s, usual between samples

    def mean(self, values: Array) -> Array:
        """Return the averages (n, ...) of values at the rows (rows, ...)."""
        return np.einsum("nk,nk...->n...", self.kernel, values[self.place])

    def along(self, values: Array) -> Array:
        """Return the averages (n, ...) of values on the path (rows - 1, PLACES, ...)."""
        at, between = self.place[:, :-1], np.mean(values, axis=1)
        inclined = np.tensordot(values, PLACES - 0.5, (1, 0)) / len(PLACES)
        return np.einsum("nk,nk...->n...", self.level, between[at]) + np.einsum(
            "nk,nk...->n...", self.tilt, inclined[at]
        )


def averages(r: MotionRecording, campaign: MotionCampaign) -> Averages:
    """Return a recording's averages, over windows long enough that acceleration stands out of its
    noise."""
    samples = SAMPLES
    while True:
        out, twice = _averages(r, campaign, samples), 2 * samples
        own, noise = (np.sum(x**2) for x in (out.acceleration, out.noise_acceleration))
        if not noise > NOISY**2 * own or twice > LONGEST or FEWEST * twice > len(r.t):
            return out
        samples = twice


def _averages(r: MotionRecording, campaign: MotionCampaign, samples: int) -> Averages:
    """Return a recording's averages over windows of so many samples."""
    starts = np.arange(0, len(r.t) - samples + 1, samples // OVERLAP)
    place = starts[:, None] + np.arange(samples)
    t = r.t[place]
    half = 0.5 * (t[:, -1] - t[:, 0])
    s = (t - t[:, :1]) / half[:, None] - 1.0
    bump = (1.0 - np.minimum(np.abs(s), 1.0) ** 2 + 1e-3) ** 2
    basis = np.stack([np.ones_like(s), s, s * s], axis=2)
    weighted = basis * bump[:, :, None]
    solved = np.linalg.solve(
        np.einsum("nki,nkj->nij", basis, weighted), weighted.transpose(0, 2, 1)
    )
    w = 2.0 * solved[:, 2, :] / half[:, None] ** 2
    theta = r.angle[place] - r.angle[place[:, :1]]
    k = np.einsum("nk,nki->ni", w, np.maximum(t[:, :, None] - t[:, None, :], 0.0))
    gap = np.diff(t, axis=1)
    middle = 0.5 * (k[:, 1:] + k[:, :-1])  # K's mean from row to row: what a difference weighs
    whole = np.sum(gap * middle, axis=1, keepdims=True)
    level, tilt = gap * middle / whole, gap * np.diff(k, axis=1) / whole
    kernel = 0.5 * (np.pad(level, ((0, 0), (1, 0))) + np.pad(level, ((0, 0), (0, 1))))
    kernel += TILTED * (np.pad(tilt, ((0, 0), (1, 0))) - np.pad(tilt, ((0, 0), (0, 1))))
    torque = r.torque - r.load
    speed = np.einsum("nk,nk->n", middle, np.diff(theta, axis=1))
    jitter = stamp_jitter(r.t, r.angle, campaign.count)
    reading = np.hypot(max(campaign.count, 1e-9) / math.sqrt(12.0), speed * jitter)
    current = (campaign.torque_constant or 0.0) * (campaign.current_noise or 0.0)
    angle, path_speed = path_of(r, jitter, campaign.count)
    return Averages(
        r.file,
        np.einsum("nk,nk->n", w, theta),
        np.einsum("nk,nk->n", kernel, torque[place]),
        np.einsum("nk,nk->n", middle, np.diff(r.torque[place], axis=1)),
        speed,
        place,
        kernel,
        level,
        tilt,
        angle,
        path_speed,
        reading * np.sqrt(np.sum(w * w, axis=1)),
        current * np.sqrt(np.sum(kernel**2, axis=1)),
        jitter,
        float(np.median(np.diff(r.t))),
    )


def white(x: Array) -> float:
    """Return the white part (rms) of a signal, of fourth differences (70 times its variance); 0
    where it is short."""
    return float(np.median(np.abs(np.diff(x, 4))) / 0.6745 / math.sqrt(70.0)) if len(x) > 8 else 0.0
