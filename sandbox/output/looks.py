"""What engineers look at beside time: means, spectra, the error against the angle, lines that are
thinned."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from model.array_types import Array

LONGEST = 4096  # samples of a spectrum's stretches
LEAST_TURN = math.radians(350.0)  # electrical: less is no turn to draw an error over
SECTORS = 72
BARS = 128  # of a spectrum: more are too thin to see
MAX_POINTS = 4000  # points drawn of a line: more than a page has pixels


def means(values: NDArray, width: int) -> NDArray:
    """Return the means of whole blocks of `width` values, an incomplete last one left out; fewer
    are one block."""
    width = max(1, min(width, values.size))
    return np.asarray(values[: values.size // width * width].reshape(-1, width).mean(axis=1))


def spectrum(values: Array, period: float) -> tuple[Array, Array]:
    """Return frequencies (Hz) and amplitudes of samples (n,) or (n, channels), `period` s apart.

    Amplitude: of a line (peak), by Hann windows over stretches of at most LONGEST samples that
    overlap by half, their powers averaged, over channels, too; without the mean.
    """
    data = np.asarray(values, dtype=float).reshape(len(values), -1)
    data = data - data.mean(axis=0)
    n = min(LONGEST, len(data))
    window = 0.5 - 0.5 * np.cos(2.0 * math.pi * np.arange(n) / n)
    starts = range(0, len(data) - n + 1, max(1, n // 2))
    power = np.mean(
        [np.abs(np.fft.rfft(data[s : s + n] * window[:, None], axis=0)) ** 2 for s in starts],
        axis=0,
    )
    amplitude = 2.0 * np.sqrt(power.mean(axis=1)) / window.sum()
    return np.asarray(np.fft.rfftfreq(n, period)[1:], dtype=np.float64), np.asarray(amplitude[1:])


def bars(f: Array, size: Array, low: float) -> tuple[Array, Array]:
    """Return a spectrum as at most BARS bars (Hz, dB over `low`): the largest line of each stretch
    of frequencies."""
    width = -(-f.size // BARS)
    whole = f.size // width * width
    peaks = size[:whole].reshape(-1, width).max(axis=1)
    return f[:whole].reshape(-1, width).mean(axis=1), 20.0 * np.log10(np.maximum(peaks / low, 1.0))


def over_angle(error: Array, theta: Array) -> tuple[Array, Array, Array, Array] | None:
    """Return sectors of the electrical angle (degrees) with mean, 5th and 95th percentile of an
    error in them.

    error: (n,) any unit; theta: (n,) rad. None where the rotor did not turn once.
    """
    if theta.size < 10 * SECTORS or np.ptp(theta) < LEAST_TURN:
        return None
    sector = (
        np.floor(np.mod(theta, 2.0 * math.pi) / (2.0 * math.pi) * SECTORS).astype(int) % SECTORS
    )
    order = np.argsort(sector, kind="stable")
    groups = np.split(error[order], np.searchsorted(sector[order], np.arange(1, SECTORS)))
    if min(g.size for g in groups) == 0:
        return None
    statistics = [(float(g.mean()), *np.percentile(g, (5.0, 95.0))) for g in groups]
    mean, low, high = np.array(statistics).T
    return (np.arange(SECTORS) + 0.5) * 360.0 / SECTORS, mean, low, high


def thinned(t: Array, values: Array, most: int = MAX_POINTS) -> tuple[Array, Array]:
    """Return a line with at most 2 `most` points that keeps the extremes of every stretch."""
    if t.size <= 2 * most:
        return t, values
    width = -(-t.size // most)
    whole = t.size // width * width
    blocks = values[:whole].reshape(-1, width)
    pairs = np.sort(np.stack([blocks.argmin(axis=1), blocks.argmax(axis=1)], axis=1), axis=1)
    index = (pairs + width * np.arange(len(blocks))[:, None]).ravel()
    return t[index], values[index]
