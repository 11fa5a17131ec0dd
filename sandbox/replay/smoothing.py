"""The rotor's motion behind an encoder's counts, as a replay needs it at every sample.

A locked rotor stands.  A driven one moves at constant speed or along straight ramps (`ramps`).  A free one follows its
torque: angle, speed and an unexplained acceleration are smoothed over the whole recording,

    d theta = omega dt,   d omega = (a + b) dt + white noise of the torque,   d b = white noise of strength q,

a the acceleration by measured currents, load and friction; the encoder reads theta within its counts.  What a torque
model leaves unexplained is not known beforehand: q is the one under which the readings are most likely.  Kalman
filter and the smoother of Bierman (Automatica 9 (1973) 503), which inverts no covariance.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from model.compiled import kernel
from sandbox.replay.ramps import ramps_of
from sandbox.replay.rounded import within_counts

Array = NDArray[np.float64]
UNEXPLAINED = tuple(10.0**k for k in range(9))  # (rad/s^2)^2/s electrical; 1e6: 1000 rad/s^2 gathered in a second
CONSTANT = 1e3  # rad/s^2 electrical: standard deviation of what is unexplained from the first sample on
ANYWHERE = 100.0  # variance of the first angle in variances of a reading
LARGEST_MISS = (
    1.25  # of a count over sqrt(12): a driven rotor's motion is known better than that, or it does not move along ramps
)


# a step of the filter: predicted state (angle, speed, constant acceleration), its covariance, the innovation and its
# variance
STATES, COVARIANCES, INNOVATION = ("x_0", "x_1", "x_2"), ("p_00", "p_01", "p_02", "p_11", "p_12", "p_22"), ("y", "s")
STEP = np.dtype([(name, np.float64) for name in (*STATES, *COVARIANCES, *INNOVATION)], align=True)
GAINS = np.dtype([(name, np.float64) for name in ("angle", "speed", "scale")], align=True)


@dataclass(frozen=True)
class Motion:
    """Encoder-side angle (rad, electrical, counts removed) and speed (rad/s, electrical), one value a sample (n,).

    `eccentric`: an eccentric encoder's error is still in the angle.
    """

    angle: Array
    speed: Array
    eccentric: bool = True

    def at(self, period: float, share: Array) -> Array:
        """Return the angle (n, shares) at t_k + share x period: cubic from angles and speeds of both samples."""
        a, v = self.angle, self.speed
        b, w = np.append(a[1:], a[-1] + period * v[-1]), np.append(v[1:], v[-1])
        x = np.asarray(share)[None, :]
        y = x * x * (3.0 - 2.0 * x)
        out = a[:, None] + (b - a)[:, None] * y
        return np.asarray(out + period * x * (1.0 - x) * (v[:, None] * (1.0 - x) - w[:, None] * x))


def locked_motion(theta: Array) -> Motion:
    """Return the motion of a rotor that stands: the mean reading."""
    return Motion(np.full(len(theta), float(np.mean(theta))), np.zeros(len(theta)))


def driven_motion(theta: Array, pole_pairs: float, period: float, count: float) -> Motion:
    """Return the motion of a rotor at imposed speed: straight ramps, as few corners as the reading's counts allow.

    An eccentric encoder's sine, once a mechanical turn, is fitted beside and left out of the motion (where the rotor
    turns more than once).  No reading is farther than half a count off, where such ramps are (`rounded`).  period: s;
    count: rad, electrical.  Where few corners will not do, a smooth motion without torque.
    """
    if np.ptp(theta) == 0.0:
        return locked_motion(theta)
    ramps = within_counts(theta, ramps_of(theta, pole_pairs, count), pole_pairs, count)
    if math.sqrt(ramps.squares / len(theta)) <= LARGEST_MISS * max(count, 1e-6) / math.sqrt(12.0):
        return Motion(ramps.angle, ramps.speed / period, not ramps.sine.any())
    still = np.zeros_like(theta)
    return free_motion(theta, still, period, count, still)


def free_motion(theta: Array, acceleration: Array, period: float, count: float, noise: Array) -> Motion:
    """Return the motion of a free rotor from counts and the torque's acceleration.

    theta: (n,) rad; acceleration: (n,) rad/s^2 electrical, mean over the interval from each sample on, by torque less
    load and friction; period: s; count: rad, electrical; noise: (n,) standard deviation of that acceleration.
    """
    variance = max(count, 1e-9) ** 2 / 12.0
    start = (count / period) ** 2
    base, white = np.asarray(theta - theta[0]), np.asarray(noise) ** 2
    told = [filtered(base, acceleration, white, period, variance, start, q, np.empty(0, STEP)) for q in UNEXPLAINED]
    work = np.empty(len(theta), STEP)
    filtered(base, acceleration, white, period, variance, start, UNEXPLAINED[int(np.argmax(told))], work)
    smoothed(work, period, variance)
    return Motion(theta[0] + work["x_0"], work["x_1"].copy())


@kernel
def filtered(read, acceleration, white, period, variance, start, q, work):
    """Return the log likelihood of the readings (n,); work (n,) of STEP, or empty, is filled.

    white: (n,) variance of the acceleration's white part; variance: of a reading; start: of the first speed.
    """
    n, t = len(read), period
    x_0, x_1, x_2 = read[0], 0.0, 0.0
    p_00, p_01, p_02, p_11, p_12, p_22 = ANYWHERE * variance, 0.0, 0.0, start, 0.0, CONSTANT**2
    total = 0.0
    for k in range(n):
        if k:
            a = acceleration[k - 1] + x_2
            x_0 += t * (x_1 + 0.5 * t * a)
            x_1 += t * a
            h, w = 0.5 * t * t, white[k - 1] * t * t
            a_00 = p_00 + t * p_01 + h * p_02  # rows of F P
            a_01, a_02 = p_01 + t * p_11 + h * p_12, p_02 + t * p_12 + h * p_22
            a_11, a_12 = p_11 + t * p_12, p_12 + t * p_22
            p_00 = a_00 + t * a_01 + h * a_02 + 0.25 * t * t * w
            p_01 = a_01 + t * a_02 + 0.5 * t * w
            p_02 = a_02
            p_11 = a_11 + t * a_12 + w
            p_12 = a_12
            p_22 += q * t
        s, y = p_00 + variance, read[k] - x_0
        total -= 0.5 * (y * y / s + math.log(s))
        if len(work):
            step = work[k]
            step.x_0, step.x_1, step.x_2 = x_0, x_1, x_2
            step.p_00, step.p_01, step.p_02 = p_00, p_01, p_02
            step.p_11, step.p_12, step.p_22 = p_11, p_12, p_22
            step.y, step.s = y, s
        g_0, g_1, g_2 = p_00 / s, p_01 / s, p_02 / s
        x_0, x_1, x_2 = x_0 + g_0 * y, x_1 + g_1 * y, x_2 + g_2 * y
        p_11, p_12, p_22 = p_11 - g_1 * p_01, p_12 - g_1 * p_02, p_22 - g_2 * p_02
        p_01, p_02 = p_01 * variance / s, p_02 * variance / s
        p_00 = p_00 * variance / s
    return total


@kernel
def smoothed(work, period, variance):
    """Replace the predicted states in `work` (n,) of STEP by smoothed ones: adjoint r, x = x_predicted + P r."""
    r_0 = r_1 = r_2 = 0.0
    for k in range(len(work) - 1, -1, -1):
        step = work[k]
        p_00, p_01, p_02 = step.p_00, step.p_01, step.p_02
        p_11, p_12, p_22 = step.p_11, step.p_12, step.p_22
        y, s = step.y, step.s
        r_0 = y / s + variance / s * r_0 - (p_01 * r_1 + p_02 * r_2) / s  # (I - K H)' r + H' y / s
        step.x_0 += p_00 * r_0 + p_01 * r_1 + p_02 * r_2
        step.x_1 += p_01 * r_0 + p_11 * r_1 + p_12 * r_2
        step.x_2 += p_02 * r_0 + p_12 * r_1 + p_22 * r_2
        r_0, r_1, r_2 = r_0, r_1 + period * r_0, r_2 + period * (r_1 + 0.5 * period * r_0)


@kernel
def motion_gains(load, acceleration, period, count_variance, torque_variance, load_share, speed_variance):
    """Return gains for angle and speed and the scale 1/standard deviation of the innovation, (n,) of GAINS.

    The Kalman filter of a free rotor's reading: white torque error (N m)^2 a sample plus `load_share` of the load
    (n,), counts of the given variance (rad^2); acceleration: p/J; the first reading starts the angle.
    """
    n = len(load)
    out = np.zeros(n, GAINS)
    p_11, p_12, p_22 = count_variance, 0.0, speed_variance
    for k in range(1, n):
        q = acceleration * acceleration * (torque_variance + (load_share * load[k - 1]) ** 2)
        p_11 += period * (2.0 * p_12 + period * p_22) + 0.25 * period**4 * q
        p_12 += period * p_22 + 0.5 * period**3 * q
        p_22 += period * period * q
        s = p_11 + count_variance
        g_1, g_2 = p_11 / s, p_12 / s
        row = out[k]
        row.angle, row.speed, row.scale = g_1, g_2, 1.0 / math.sqrt(s)
        p_22 -= g_2 * p_12
        p_12 -= g_2 * p_11
        p_11 -= g_1 * p_11
    return out
