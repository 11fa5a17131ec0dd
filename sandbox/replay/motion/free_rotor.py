"""A free rotor's motion behind an encoder's counts: Kalman filter, smoother, and what a reading
bounds.

Angle, speed and an unexplained acceleration,

    d theta = omega dt,   d omega = (a + b) dt + white noise of the torque,   d b = white noise of strength q,

a the acceleration by measured currents, load and friction.  Smoother of Bierman (Int. J. Control 18
(1973) 65), which inverts no covariance.

A reading does not scatter about the angle like noise: it says that the angle lies within half a
count, and nothing more.  Where a rotor turns by less than a few counts a sample, errors of rounding
repeat, and a filter that takes them for noise follows them.  So each reading is replaced by the
normal distribution that does to the angle, as all others tell it, what the bounds do: the same mean
and variance afterwards (expectation propagation: Minka,
UAI 2001, 362). Bounds are as soft as an encoder is noisy: by what readings scatter more than
rounding would, and a little at least.
"""  # noqa: E501

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from model.array_types import Array
from model.compiled import inlined, kernel

ANYWHERE = 100.0  # variance of the first angle in variances of a reading
SWEEPS = 12  # over all readings
DAMPED = 0.7  # share of a change that is made: whole ones swing
SETTLED = 0.01  # count, rms, that a sweep moves the angle
# mean of e^(2 pi i reading/count): 1 of rounded readings; below it they scatter by 0.07 counts and
# more
ROUNDED = 0.9
# count: deviation of the noise that an encoder has at least, which keeps bounds from contradicting
SOFT = 0.05
AROUND = 11  # samples: so few take a parabola
STRAY = 1.0  # count: a reading farther from it is a fault of its own and says nothing
FAULTY = 0.01  # share of such readings from which on rounding explains none of them
FLAT = 1e-6  # of a reading's precision: what others tell less precisely than that is nothing
LEAST = 1e-9  # of the predicted variance: what rounding leaves of a smaller one
TAIL = 25.0  # deviations beyond which a normal distribution falls exponentially, to 1 in 600
NARROW = 0.02  # deviations, or of what it falls by: between bounds so close it is a straight line
ROOT_2, ROOT_2_PI = math.sqrt(2.0), math.sqrt(2.0 * math.pi)

# a step of the filter: predicted state (angle, speed, constant acceleration), its covariance, the
# innovation and its variance
STATES, COVARIANCES, INNOVATION = (
    ("x_0", "x_1", "x_2"),
    ("p_00", "p_01", "p_02", "p_11", "p_12", "p_22"),
    ("y", "s"),
)
STEP = np.dtype([(name, np.float64) for name in (*STATES, *COVARIANCES, *INNOVATION)], align=True)


class KnownMotion(NamedTuple):
    """What is known beside the readings: acceleration (n,) rad/s^2 electrical, mean over the
    interval from each sample on, variance (n,) of its white part; period, s; first angle (rad), its
    scale of variance, variance of the first speed, which that of what is unexplained from the first
    sample on follows: as much in one period."""

    acceleration: Array
    white: Array
    period: float
    angle: float
    variance: float
    start: float


class Bounds(NamedTuple):
    """What readings (n,), rad, bound: `half` a count beside each but those that are `stray` (n,),
    and the deviation of an encoder's noise, rad."""

    read: Array
    stray: NDArray[np.bool_]
    half: float
    noise: float


@kernel
def filtered(read, variance, known, q, work):
    """Return the log likelihood of readings (n,) of variances (n,); work (n,) of STEP, or empty, is
    filled."""
    n, t = len(read), known.period
    x_0, x_1, x_2 = known.angle, 0.0, 0.0
    p_00, p_01, p_02, p_11, p_12, p_22 = (
        ANYWHERE * known.variance,
        0.0,
        0.0,
        known.start,
        0.0,
        known.start / t**2,
    )
    total = 0.0
    for k in range(n):
        if k:
            a = known.acceleration[k - 1] + x_2
            x_0 += t * (x_1 + 0.5 * t * a)
            x_1 += t * a
            h, w = 0.5 * t * t, known.white[k - 1] * t * t
            a_00 = p_00 + t * p_01 + h * p_02  # rows of F P
            a_01, a_02 = p_01 + t * p_11 + h * p_12, p_02 + t * p_12 + h * p_22
            a_11, a_12 = p_11 + t * p_12, p_12 + t * p_22
            p_00 = a_00 + t * a_01 + h * a_02 + 0.25 * t * t * w
            p_01 = a_01 + t * a_02 + 0.5 * t * w
            p_02 = a_02
            p_11 = a_11 + t * a_12 + w
            p_12 = a_12
            p_22 += q * t
        s, y = p_00 + variance[k], read[k] - x_0
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
        left = variance[k] / s
        p_01, p_02, p_00 = p_01 * left, p_02 * left, p_00 * left
    return total


@kernel
def smoothed(work, variance, period, spread):
    """Replace the predicted states in `work` (n,) of STEP by smoothed ones, x = x_predicted + P r;
    write the variance of their angles, P - P N P, to `spread` (n,).  r and N: adjoint state and its
    covariance.

    variance: (n,) of the readings.
    """
    t, h = period, 0.5 * period * period
    r_0 = r_1 = r_2 = 0.0
    n_00 = n_01 = n_02 = n_11 = n_12 = n_22 = 0.0
    for k in range(len(work) - 1, -1, -1):
        step = work[k]
        p_00, p_01, p_02 = step.p_00, step.p_01, step.p_02
        p_11, p_12, p_22 = step.p_11, step.p_12, step.p_22
        y, s = step.y, step.s
        left, g_1, g_2 = variance[k] / s, p_01 / s, p_02 / s
        r_0 = y / s + left * r_0 - g_1 * r_1 - g_2 * r_2  # (I - K H)' r + H' y / s
        # N (I - K H): its first column, the others are N's own
        b_0 = n_00 * left - n_01 * g_1 - n_02 * g_2
        b_1, b_2 = n_01 * left - n_11 * g_1 - n_12 * g_2, n_02 * left - n_12 * g_1 - n_22 * g_2
        n_00, n_01, n_02 = 1.0 / s + left * b_0 - g_1 * b_1 - g_2 * b_2, b_1, b_2
        step.x_0 += p_00 * r_0 + p_01 * r_1 + p_02 * r_2
        step.x_1 += p_01 * r_0 + p_11 * r_1 + p_12 * r_2
        step.x_2 += p_02 * r_0 + p_12 * r_1 + p_22 * r_2
        c_0 = n_00 * p_00 + n_01 * p_01 + n_02 * p_02
        c_1 = n_01 * p_00 + n_11 * p_01 + n_12 * p_02
        c_2 = n_02 * p_00 + n_12 * p_01 + n_22 * p_02
        spread[k] = max(p_00 - p_00 * c_0 - p_01 * c_1 - p_02 * c_2, LEAST * p_00)
        r_0, r_1, r_2 = r_0, r_1 + t * r_0, r_2 + t * r_1 + h * r_0
        m_02, m_12 = n_02 + t * n_01 + h * n_00, n_12 + t * n_11 + h * n_01  # N F, its last column
        m_01 = n_01 + t * n_00
        m_11 = n_11 + t * n_01
        n_22 = n_22 + t * n_12 + h * n_02 + t * m_12 + h * m_02
        n_12 = m_12 + t * m_02
        n_11 = m_11 + t * m_01
        n_02, n_01 = m_02, m_01


@inlined
def cut_normal(low, high):
    """Return mean and variance of a standard normal distribution between two bounds, low < high."""
    width, middle, rate = high - low, 0.5 * (low + high), max(low, -high)
    if width * max(1.0, rate) < NARROW:
        return middle - middle * width * width / 12.0, width * width / 12.0
    if rate > TAIL:  # it falls exponentially from the nearer bound
        gone = math.expm1(min(rate * width, 700.0))
        away = 1.0 / rate - width / gone
        variance = 1.0 / (rate * rate) - width / gone * (width / gone + width)
        return (low + away if low > 0.0 else high - away), variance
    first, last = math.exp(-0.5 * low * low) / ROOT_2_PI, math.exp(-0.5 * high * high) / ROOT_2_PI
    side = -1.0 if low > 0.0 else 1.0  # tails are subtracted on the side where they are small
    share = 0.5 * side * (math.erfc(-side * high / ROOT_2) - math.erfc(-side * low / ROOT_2))
    mean = (first - last) / share
    return mean, 1.0 + (low * first - high * last) / share - mean * mean


@kernel
def replace_readings(bounds, work, spread, seen, variance):
    """Move the normal distributions that stand for readings (seen: (n,), rad above the reading;
    variance: (n,)) to what bounds do to smoothed angles (work, spread)."""
    half, noise = bounds.half, bounds.noise * bounds.noise
    flat = FLAT / (half * half)
    for k in range(len(seen)):
        if bounds.stray[k]:
            seen[k], variance[k] = 0.0, 1.0 / flat
            continue
        own, precision = 1.0 / variance[k], 1.0 / spread[k]
        others = precision - own  # as all other readings tell the angle
        known = others > flat
        mean = (
            ((work[k].x_0 - bounds.read[k]) * precision - seen[k] * own) / others if known else 0.0
        )
        # as they tell the angle that is rounded
        before = 1.0 / (1.0 / (others if known else flat) + noise)
        sd = 1.0 / math.sqrt(before)
        z, v = cut_normal((-half - mean) / sd, (half - mean) / sd)
        new, at = before * (1.0 / v - 1.0), (mean + sd * z) * before / v - mean * before
        if new > flat:
            new, at = new / (1.0 + new * noise), at / (1.0 + new * noise)
        else:
            new, at = flat, 0.0
        kept = (1.0 - DAMPED) * own
        variance[k] = 1.0 / (kept + DAMPED * new)
        seen[k] = variance[k] * (kept * seen[k] + DAMPED * at)


def on_counts(read: Array, count: float) -> Array | None:
    """Return readings (n,), rad, exactly a count, rad, apart or several (a log may have few
    digits); None where they are not rounded to it."""
    if not 0.0 < count < math.inf:
        return None
    mean = complex(np.mean(np.exp(2j * math.pi / count * read)))
    if not abs(mean) > ROUNDED:
        return None
    first = math.atan2(mean.imag, mean.real) / (2.0 * math.pi) * count
    return np.asarray(first + count * np.round((read - first) / count))


def within_readings(read: Array, count: float, known: KnownMotion, q: float) -> NDArray[np.void]:
    """Return the smoothed motion, (n,) of STEP, of a rotor whose readings (n,), rad, are rounded to
    a count, rad.

    Readings that are not (a log that interpolates them), and those whose bounds lead to nothing
    finite, count as noisy.
    """
    work, spread, variance = (
        np.empty(len(read), STEP),
        np.empty(len(read)),
        np.full(len(read), known.variance),
    )
    filtered(read, variance, known, q, work)
    smoothed(work, variance, known.period, spread)
    rounded, best = on_counts(read, count), work.copy()
    if rounded is None:
        return best
    bounds, seen, before = bounds_of(rounded, count), np.zeros(len(read)), best["x_0"].copy()
    for _ in range(SWEEPS if np.mean(bounds.stray) < FAULTY else 0):
        replace_readings(bounds, work, spread, seen, variance)
        filtered(rounded + seen, variance, known, q, work)
        smoothed(work, variance, known.period, spread)
        if not (np.isfinite(work["x_0"]).all() and np.isfinite(spread).all()):
            return best
        if np.sqrt(np.mean((work["x_0"] - before) ** 2)) < SETTLED * count:
            break
        before[:] = work["x_0"]
    return work


def parabolas(read: Array) -> tuple[Array, float]:
    """Return the values of parabolas through AROUND readings about each (n,), at the ends of the
    first and the last of them, and a reading's weight in its own (Savitzky and Golay 1964).

    SciPy's filter is the same; its package takes longer to load than a short check to run.
    """
    place = np.arange(AROUND) - AROUND // 2
    columns = np.vander(place, 3)
    onto = columns @ np.linalg.pinv(columns)  # (AROUND, AROUND): readings to their parabola
    half = AROUND // 2
    inside = np.convolve(read, onto[half][::-1], mode="valid")
    ends = onto[:half] @ read[:AROUND], onto[half + 1 :] @ read[-AROUND:]
    return np.concatenate([ends[0], inside, ends[1]]), float(onto[half, half])


def bounds_of(read: Array, count: float) -> Bounds:
    """Return what readings (n,) bound, by how they scatter about a parabola through their
    neighbours: a motion that no torque is needed for."""
    stray, more = np.zeros(len(read), dtype=bool), 0.0
    if len(read) > AROUND:
        curve, weight = parabolas(read)
        away = (read - curve) / count
        stray = np.abs(away) > STRAY
        # of a reading's variance that its parabola leaves
        own = 1.0 - weight
        more = float(np.mean(away[~stray] ** 2)) / own - 1.0 / 12.0 if not stray.all() else 0.0
    return Bounds(read, stray, 0.5 * count, count * math.sqrt(SOFT**2 + max(0.0, more)))
