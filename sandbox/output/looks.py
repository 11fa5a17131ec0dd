"""What engineers look at beside time: paths in the planes of current and flux, spectra, the error against the angle."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import NDArray

from model.energy import flux_newton, hessian, is_convex_to
from model.saliency import LEAST_SALIENCY, null_angle

if TYPE_CHECKING:
    from model.parameters import Drive
    from sandbox.drive.recording import Recording

Array = NDArray[np.float64]
POINTS = 1500  # of a path: more than a page shows
GRID = 41  # points a side of the plane of currents
LONGEST = 4096  # samples of a spectrum's stretches
SLOWEST_TURN = 2.0  # s: a turn that takes longer is none to draw
LEAST_TURN = math.radians(350.0)  # electrical: less is no turn to draw an error over
SECTORS = 72
BARS = 128  # of a spectrum: more are too thin to see
MOST = 4000  # points drawn of a line: more than a page has pixels


class Plane(NamedTuple):
    """What injection sees over the plane of currents: NaN where the model is not valid."""

    current: Array  # (n,) A, of both axes
    angle: Array  # (n, n) degrees over i_d (first axis) and i_q: error of a linear belief where the encoder controls
    gain: Array  # (n, n) slope of the null relative to zero current


def plane(drive: Drive, reach: float) -> Plane | None:
    """Return the saliency over currents up to `reach` (A) on both axes; None for a motor without saliency."""
    m, i = drive.motor.energy, np.linspace(-reach, reach, GRID)
    zero = abs(m.gamma_d - m.gamma_q)
    if zero < LEAST_SALIENCY * max(m.gamma_d, m.gamma_q):
        return None
    angle, gain = np.full((2, GRID, GRID), np.nan)
    sign = math.copysign(1.0, m.gamma_d - m.gamma_q)
    for k in np.ndindex(angle.shape):
        d, q, outside = flux_newton(m, float(i[k[0]]), float(i[k[1]]), 0.0, 0.0)
        if not outside and is_convex_to(m, d, q):
            dd, dq, qq = hessian(m, d, q)
            angle[k] = math.degrees(null_angle(dd, dq, qq, sign))
            gain[k] = math.hypot(dd - qq, 2.0 * dq) / zero
    return Plane(i, angle, gain)


def currents(drive: Drive, recording: Recording) -> tuple[Array, Array]:
    """Return a run's way through the plane of currents (i_d, i_q in A), means over whole injection periods."""
    width = _injected(drive) * max(2, math.ceil(len(recording) / (_injected(drive) * POINTS)))
    return means(recording.i_d, width), means(recording.i_q, width)


def hodograph(drive: Drive, recording: Recording, ends: Sequence[float]) -> tuple[Array, Array]:
    """Return the flux linkage (Wb) in the stator's frame, by the nominal model at the currents of a run.

    Of a rotor that turns: the last electrical turn before each of the `ends` (s), NaN between them, as all turns would
    hide each other; else the whole way. NaN outside the model's domain, too.
    """
    turn = 2.0 * math.pi
    if len(recording) == 0 or np.ptp(recording.theta) < turn:
        return _flux(
            drive, recording, _injected(drive) * max(1, math.ceil(len(recording) / (_injected(drive) * POINTS)))
        )
    parts = []
    for end in ends:
        before = recording.between(-math.inf, end)
        away = np.flatnonzero(np.abs(before.theta - before.theta[-1]) > turn) if len(before) else np.array([])
        if away.size and before.t[-1] - before.t[away[-1]] < SLOWEST_TURN:
            parts.append(_flux(drive, recording.between(float(before.t[away[-1]]), end), _injected(drive)))
    gap = np.array([np.nan])
    pair = [np.concatenate([x for part in parts for x in (part[k], gap)]) if parts else gap for k in (0, 1)]
    return pair[0], pair[1]


def _flux(drive: Drive, recording: Recording, width: int) -> tuple[Array, Array]:
    """Return the flux in the stator's frame, block by block."""
    i_d, i_q = means(recording.i_d, width), means(recording.i_q, width)
    way = means(np.exp(1j * recording.theta), width)
    psi = np.full(i_d.size, np.nan + 0j)
    for k, (x, y) in enumerate(zip(i_d, i_q, strict=True)):
        d, q, outside = flux_newton(drive.motor.energy, float(x), float(y), 0.0, 0.0)
        if not outside and is_convex_to(drive.motor.energy, d, q):
            psi[k] = (drive.motor.magnet_flux + d + 1j * q) * way[k] / abs(way[k])
    return psi.real, psi.imag


def _injected(drive: Drive) -> int:
    """Return the samples of an injection period."""
    return max(1, round(1.0 / (drive.injection.frequency * drive.converter.sampling_period)))


def means(values: NDArray, width: int) -> NDArray:
    """Return the means of whole blocks of `width` values, an incomplete last one left out; fewer are one block."""
    width = max(1, min(width, values.size))
    return np.asarray(values[: values.size // width * width].reshape(-1, width).mean(axis=1))


def spectrum(values: Array, period: float) -> tuple[Array, Array]:
    """Return frequencies (Hz) and amplitudes of samples (n,) or (n, channels), `period` s apart.

    Amplitude: of a line (peak), by Hann windows over stretches of at most LONGEST samples that overlap by half, their
    powers averaged, over channels, too; without the mean.
    """
    data = np.asarray(values, dtype=float).reshape(len(values), -1)
    data = data - data.mean(axis=0)
    n = min(LONGEST, len(data))
    window = 0.5 - 0.5 * np.cos(2.0 * math.pi * np.arange(n) / n)
    starts = range(0, len(data) - n + 1, max(1, n // 2))
    power = np.mean(
        [np.abs(np.fft.rfft(data[s : s + n] * window[:, None], axis=0)) ** 2 for s in starts], axis=0
    )  # fmt: skip
    amplitude = 2.0 * np.sqrt(power.mean(axis=1)) / window.sum()
    return np.asarray(np.fft.rfftfreq(n, period)[1:], dtype=np.float64), np.asarray(amplitude[1:])


def bars(f: Array, size: Array, low: float) -> tuple[Array, Array]:
    """Return a spectrum as at most BARS bars (Hz, dB over `low`): the largest line of each stretch of frequencies."""
    width = -(-f.size // BARS)
    whole = f.size // width * width
    peaks = size[:whole].reshape(-1, width).max(axis=1)
    return f[:whole].reshape(-1, width).mean(axis=1), 20.0 * np.log10(np.maximum(peaks / low, 1.0))


def over_angle(error: Array, theta: Array) -> tuple[Array, Array, Array, Array] | None:
    """Return sectors of the electrical angle (degrees) with mean, 5th and 95th percentile of an error in them.

    error: (n,) any unit; theta: (n,) rad. None where the rotor did not turn once.
    """
    if theta.size < 10 * SECTORS or np.ptp(theta) < LEAST_TURN:
        return None
    sector = np.floor(np.mod(theta, 2.0 * math.pi) / (2.0 * math.pi) * SECTORS).astype(int) % SECTORS
    order = np.argsort(sector, kind="stable")
    groups = np.split(error[order], np.searchsorted(sector[order], np.arange(1, SECTORS)))
    if min(g.size for g in groups) == 0:
        return None
    statistics = [(float(g.mean()), *np.percentile(g, (5.0, 95.0))) for g in groups]
    mean, low, high = np.array(statistics).T
    return (np.arange(SECTORS) + 0.5) * 360.0 / SECTORS, mean, low, high


def thinned(t: Array, values: Array, most: int = MOST) -> tuple[Array, Array]:
    """Return a line with at most 2 `most` points that keeps the extremes of every stretch."""
    if t.size <= 2 * most:
        return t, values
    width = -(-t.size // most)
    whole = t.size // width * width
    blocks = values[:whole].reshape(-1, width)
    pairs = np.sort(np.stack([blocks.argmin(axis=1), blocks.argmax(axis=1)], axis=1), axis=1)
    index = (pairs + width * np.arange(len(blocks))[:, None]).ravel()
    return t[index], values[index]
