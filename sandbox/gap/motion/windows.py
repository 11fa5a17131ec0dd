"""The shaft's equation averaged over windows of samples, without differentiating anything and on
uneven stamps.

In each window the quadratic fitted to the angle gives the mean acceleration sum(w theta).  Since
sum(w) = sum(w t) = 0,

    sum_k w_k theta(t_k) = integral of K(t) theta''(t) dt,   K(t) = sum_k w_k max(t_k - t, 0),

so with all other torques averaged by the same K the equation

    J theta'' = torque - load - B omega - T_c tanh(omega / width) + cogging(theta) + offset

holds for the averages exactly, whatever the motion inside the window.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from sandbox.recordings.motion_log import MotionCampaign, MotionRecording
from sandbox.recordings.stamps import stamp_jitter

Array = NDArray[np.float64]
SAMPLES = 24  # of a window
STEP = 8  # samples from window to window


@dataclass(frozen=True)
class Averages:
    """One recording window by window, n of them: mean acceleration (rad/s^2), driving torque less
    load (N m), speed (rad/s), and what averages any function of the samples."""

    file: str
    acceleration: Array
    torque: Array
    slope: Array  # N m/s, of the torque as read
    speed: Array
    middle: Array  # s, of the window
    place: NDArray[np.int64]  # (n, SAMPLES): samples of each window
    kernel: Array  # (n, SAMPLES), rows sum to 1
    angle: Array  # rad mechanical, at the samples
    sample_speed: Array  # rad/s, at the samples: the log's own where it holds one
    noise_acceleration: Array  # rad/s^2 rms (n,), of the encoder's counts and the stamps' scatter
    noise_torque: Array  # N m rms (n,), of the stated current noise
    jitter: float  # s rms, of the stamps
    step: float  # s, usual between samples

    def mean(self, values: Array) -> Array:
        """Return the averages (n, ...) of values at the samples (samples, ...)."""
        return np.einsum("nk,nk...->n...", self.kernel, values[self.place])


def averages(r: MotionRecording, campaign: MotionCampaign) -> Averages:
    """Return a recording's averages."""
    place = np.arange(0, len(r.t) - SAMPLES + 1, STEP)[:, None] + np.arange(SAMPLES)
    t = r.t[place]
    middle = 0.5 * (t[:, 0] + t[:, -1])
    half = 0.5 * (t[:, -1] - t[:, 0])
    s = (t - middle[:, None]) / half[:, None]
    bump = (1.0 - np.minimum(np.abs(s), 1.0) ** 2 + 1e-3) ** 2
    basis = np.stack([np.ones_like(s), s, s * s], axis=2)
    weighted = basis * bump[:, :, None]
    solved = np.linalg.solve(
        np.einsum("nki,nkj->nij", basis, weighted), weighted.transpose(0, 2, 1)
    )
    w = 2.0 * solved[:, 2, :] / half[:, None] ** 2
    theta = r.angle[place] - r.angle[place[:, :1]]
    speed = np.einsum("nk,nk->n", solved[:, 1, :], theta) / half
    kernel = np.einsum("nk,nki->ni", w, np.maximum(t[:, :, None] - t[:, None, :], 0.0))
    gap = np.diff(t, axis=1)
    kernel = kernel * 0.5 * (np.pad(gap, ((0, 0), (1, 0))) + np.pad(gap, ((0, 0), (0, 1))))
    kernel /= kernel.sum(axis=1, keepdims=True)
    torque = r.torque - r.load
    jitter = stamp_jitter(r.t, r.angle, campaign.count)
    count = max(campaign.count, 1e-9)
    reading = np.hypot(count / math.sqrt(12.0), speed * jitter)
    driving = np.einsum("nk,nk->n", kernel, torque[place])
    current = (campaign.torque_constant or 0.0) * (campaign.current_noise or 0.0)
    slope = np.gradient(r.torque, r.t)
    at_samples = r.beside.get("speed", np.interp(r.t, middle, speed))
    return Averages(
        r.file,
        np.einsum("nk,nk->n", w, theta),
        driving,
        np.einsum("nk,nk->n", kernel, slope[place]),
        speed,
        middle,
        place,
        kernel,
        r.angle,
        at_samples,
        reading * np.sqrt(np.sum(w * w, axis=1)),
        current * np.sqrt(np.sum(kernel**2, axis=1)),
        jitter,
        float(np.median(np.diff(r.t))),
    )


def white(x: Array) -> float:
    """Return the white part (rms) of a signal, of fourth differences (70 times its variance); 0
    where it is short."""
    return float(np.median(np.abs(np.diff(x, 4))) / 0.6745 / math.sqrt(70.0)) if len(x) > 8 else 0.0
