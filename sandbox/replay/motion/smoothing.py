"""The rotor's motion behind an encoder's counts, as a replay needs it at every sample.

A locked rotor stands.  A driven one moves at constant speed or along straight ramps (`ramps`).  A
free one follows its torque (`free_rotor`); what a torque model leaves unexplained is not known
beforehand: its strength q is the one under which the readings are most likely.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from model.array_types import Array
from model.compiled import kernel
from sandbox.replay.motion.free_rotor import STEP, KnownMotion, filtered, within_readings
from sandbox.replay.motion.ramps import are_ramps, ramps_of, straightened
from sandbox.replay.motion.rounded import within_counts

# driven recordings whose motion is kept: those of a large campaign, and their excerpts
KEPT_MOTIONS = 64
LONGEST_KEPT = 100_000  # readings: all that is kept takes 150 MB at most

GAINS = np.dtype([(name, np.float64) for name in ("angle", "speed", "scale")], align=True)


@dataclass(frozen=True)
class Motion:
    """Encoder-side angle (rad, electrical, counts removed) and speed (rad/s, electrical), one value
    a sample (n,).

    `eccentric`: an eccentric encoder's error is still in the angle.
    """

    angle: Array
    speed: Array
    eccentric: bool = True

    def at(self, period: float, share: Array) -> Array:
        """Return the angle (n, shares) at t_k + share x period: cubic from angles and speeds of
        both samples."""
        a, v = self.angle, self.speed
        b, w = np.append(a[1:], a[-1] + period * v[-1]), np.append(v[1:], v[-1])
        x = np.asarray(share)[None, :]
        y = x * x * (3.0 - 2.0 * x)
        out = a[:, None] + (b - a)[:, None] * y
        return np.asarray(out + period * x * (1.0 - x) * (v[:, None] * (1.0 - x) - w[:, None] * x))

    def finer(self, parts: int, period: float) -> Motion:
        """Return it at so many instants a sampling period (s): (n parts,), as `at`."""
        if parts == 1:
            return self
        a, v, n = self.angle, self.speed, len(self.angle)
        b, w = np.append(a[1:], a[-1] + period * v[-1]), np.append(v[1:], v[-1])
        x = (np.arange(parts) / parts)[None, :]
        rate = ((b - a) / period)[:, None] * 6.0 * x * (1.0 - x)
        speed = rate + v[:, None] * (1.0 - x) * (1.0 - 3.0 * x) - w[:, None] * x * (2.0 - 3.0 * x)
        return Motion(
            self.at(period, x[0]).reshape(n * parts), speed.reshape(n * parts), self.eccentric
        )


def locked_motion(theta: Array) -> Motion:
    """Return the motion of a rotor that stands: the mean reading; theta: (n,) rad."""
    return Motion(np.full(len(theta), float(np.mean(theta))), np.zeros(len(theta)))


def driven_motion(theta: Array, pole_pairs: float, period: float, count: float) -> Motion:
    """Return the motion of a rotor at imposed speed: straight ramps, as few corners as the
    reading's counts allow, a sine of once a mechanical turn beside them where they need it and the
    rotor turns more than once.  No reading is farther than half a count off, where such ramps are
    (`rounded`).  Where few corners will not do, a smooth motion about the ramps that come nearest.

    Whether the sine is the rotor's or an eccentric encoder's the angle cannot tell, and currents
    do: it stays in the motion, and an encoder's error is taken off it.

    theta: (n,) rad, electrical; period: s; count: rad, electrical.  The same readings are looked at
    once: ramps take a second, and no parameter of a fit moves them.
    """
    read = np.ascontiguousarray(theta, dtype=float)
    if len(read) > LONGEST_KEPT:
        return _found(read, pole_pairs, period, count)
    return _driven(read.tobytes(), pole_pairs, period, count)


@lru_cache(maxsize=KEPT_MOTIONS)
def _driven(readings: bytes, pole_pairs: float, period: float, count: float) -> Motion:
    """Return the motion of a rotor at imposed speed, from the bytes of its readings."""
    motion = _found(np.frombuffer(readings), pole_pairs, period, count)
    motion.angle.flags.writeable = motion.speed.flags.writeable = False
    return motion


def _found(theta: Array, pole_pairs: float, period: float, count: float) -> Motion:
    """Return it from the readings (n,)."""
    if np.ptp(theta) == 0.0:
        return locked_motion(theta)
    found = within_counts(theta, ramps_of(theta, pole_pairs, count), pole_pairs, count)
    if are_ramps(found, theta, count):
        if not found.sine.any():  # less than a turn: corners may stand for a sine
            return Motion(found.angle, found.speed / period)
        plain = straightened(found, theta, count)
        plain = within_counts(theta, plain, pole_pairs, count)
        if are_ramps(plain, theta, count):
            return Motion(plain.angle, plain.speed / period, False)
        speed = found.speed + np.gradient(found.sine)
        return Motion(found.angle + found.sine, speed / period)
    speed = (found.speed + (np.gradient(found.sine) if found.sine.any() else 0.0)) / period
    acceleration = np.append(np.diff(speed) / period, 0.0)
    return free_motion(theta, acceleration, period, count, np.zeros_like(theta))


def free_motion(
    theta: Array, acceleration: Array, period: float, count: float, noise: Array
) -> Motion:
    """Return the motion of a free rotor from counts and the torque's acceleration.

    theta: (n,) rad; acceleration: (n,) rad/s^2 electrical, mean over the interval from each sample
    on, by torque less load and friction; period: s; count: rad, electrical; noise: (n,) standard
    deviation of that acceleration.
    """
    base = np.asarray(theta - theta[0])
    variance = max(count, 1e-9) ** 2 / 12.0
    known = KnownMotion(
        np.asarray(acceleration),
        np.asarray(noise) ** 2,
        period,
        0.0,
        variance,
        (count / period) ** 2,
    )
    alike = np.full(len(base), variance)
    q = likeliest(lambda q: filtered(base, alike, known, q, np.empty(0, STEP)), len(base), known)
    work = within_readings(base, count, known, q)
    return Motion(theta[0] + work["x_0"], work["x_1"].copy())


def likeliest(likelihood: Callable[[float], float], n: int, known: KnownMotion) -> float:
    """Return the strength q, (rad/s^2)^2/s, of what is unexplained under which n readings are most
    likely, to a decade: the smoother's bandwidth goes as its sixth root.

    From one that moves the angle by a reading's deviation within a sample down to one that does so
    in all of them: the angle's variance grows with the fifth power of time.
    """
    most = known.variance / known.period**5
    decades = range(0, math.ceil(5.0 * math.log10(n)) + 1)
    found = {k: likelihood(most * 10.0**-k) for k in decades[::2]}
    best = max(found, key=found.__getitem__)
    found |= {k: likelihood(most * 10.0**-k) for k in (best - 1, best + 1) if k in decades}
    return most * 10.0 ** -max(found, key=found.__getitem__)


@kernel
def motion_gains(
    load, acceleration, period, count_variance, torque_variance, load_share, speed_variance
):
    """Return gains for angle and speed and the scale 1/standard deviation of the innovation, (n,)
    of GAINS.

    The Kalman filter of a free rotor's reading: white torque error (N m)^2 a sample plus
    `load_share` of the load (n,), counts of the given variance (rad^2); acceleration: p/J; the
    first reading starts the angle.
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
