"""A-weighting (IEC 61672-1): how loud a frequency is to the ear, and the weighted power of a
signal.

The standard's constants follow in closed form from its four corner frequencies (annex E): f_1 and
f_4 from the -3 dB points f_L, f_H of the C-weighting with f_r = 1 kHz, f_2 and f_3 from the
A-weighting's own f_A.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import ArrayLike

from model.array_types import Array

F_R, F_L, F_H, F_A = 1000.0, 10.0**1.5, 10.0**3.9, 10.0**2.45  # Hz
HEARD = 20e3  # Hz: beyond it nothing is counted


def _corners() -> tuple[float, float, float, float]:
    """Return f_1 to f_4 (Hz)."""
    d = math.sqrt(0.5)
    c = (F_L * F_H) ** 2
    b = (F_R**2 + c / F_R**2 - d * (F_L**2 + F_H**2)) / (1.0 - d)
    root = math.sqrt(b * b - 4.0 * c)
    side = 0.5 * math.sqrt(5.0)
    return (
        math.sqrt(0.5 * (-b - root)),
        (1.5 - side) * F_A,
        (1.5 + side) * F_A,
        math.sqrt(0.5 * (-b + root)),
    )


CORNERS = _corners()


def _response(f: Array) -> Array:
    f_1, f_2, f_3, f_4 = CORNERS
    square = f * f
    low = (square + f_1**2) * np.sqrt((square + f_2**2) * (square + f_3**2))
    return np.asarray(f_4**2 * square**2 / (low * (square + f_4**2)))


def a_weight(frequency: ArrayLike) -> Array:
    """Return the A-weighting's gain (1 at 1 kHz) at frequencies in Hz."""
    return np.asarray(_response(np.asarray(frequency, dtype=float)) / _response(np.asarray(F_R)))


def weighted_power(signal: Array, rate: float) -> Array:
    """Return the A-weighted power of each line of a signal (n,) sampled at `rate` (Hz), its mean
    left out.

    Their sum is the weighted mean square.  By one periodogram with a Hann window, whose own power
    is taken out; frequencies beyond HEARD do not count.
    """
    n = signal.size
    window = 0.5 - 0.5 * np.cos(2.0 * math.pi * (np.arange(n) + 0.5) / n)
    lines = np.fft.rfft((signal - signal.mean()) * window)
    f = np.fft.rfftfreq(n, 1.0 / rate)
    # negative frequencies, which rfft leaves out
    twice = np.where((f > 0.0) & (f < 0.5 * rate), 2.0, 1.0)
    weights = twice * np.where(f <= HEARD, a_weight(f), 0.0) ** 2
    return np.asarray(weights * np.abs(lines) ** 2 / (n * np.sum(window**2)))


def loudest(power: Array) -> float:
    """Return the power of the loudest tone: a tone lies in three lines of a Hann window; power:
    (lines,) of the spectrum."""
    return float(np.max(np.convolve(power, np.ones(3), "same")))
