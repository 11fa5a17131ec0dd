"""A residual taken apart: by recording, channel, direction, operating region, order, injection
band, fixed frequency.

All shares are of the excess: the sum of squares of residuals over the noise, less what noise
alone would have. Directions and dependences are read off the voltage that would explain the current
residual, noise taken off by the same analysis of white noise.  Orders are of the rotor's frame: 0
turns with the rotor, -1 stands still in the stator (an offset), -2 turns backwards (an
asymmetry), +-6 are a three-phase machine's or inverter's harmonics.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from model.array_types import Array
from sandbox.gap.evidence.normal import ParameterPoint
from sandbox.gap.evidence.spectrum import whole_turns
from sandbox.gap.location.readings import Readings, readings
from sandbox.recordings.injection import samples_per_period
from sandbox.replay.inputs import LEGS, Inputs
from sandbox.replay.replay import Residual
from sandbox.replay.voltage import voltage_residual

Complex = NDArray[np.complex128]
CHANNELS = ("currents", "motion", "position")
# of the campaign's top speed: bounds of standstill, low, medium and high speed
SPEEDS = (0.02, 0.3, 0.65)
SPEED_NAMES = ("at standstill", "at low speed", "at medium speed", "at high speed")
CURRENTS = (0.15, 0.5, 0.85)  # of rated current
CURRENT_NAMES = (
    "near zero current",
    "at low current",
    "at medium current",
    "around rated current and above",
)
DIRECTIONS = (
    "along the current",
    "across the current",
    "along the voltage command",
    "across the voltage command",
    "on the d axis",
    "on the q axis",
)
LEAST_CURRENT = 0.02  # of rated: below that a direction is noise
LOW, SLOTS = 13, (18, 24, 30, 36)  # orders looked at one by one; further ones, of a machine's slots
ORDERS = (*(-n for n in reversed(SLOTS)), *range(-LOW, LOW + 1), *SLOTS)
MECHANICAL = tuple(range(1, 49))
PER_TURN = 2.0 * (LOW + 1)  # samples a turn needs, to tell its low orders apart
FEWEST = 30  # blocks in a cell of speed and current
LINE = 30.0  # times its neighbourhood: a line
BINS = 1024
VARIANCE = 2.0  # of 1.5 |z|^2, z the stationary residual of three unit-variance readings


@dataclass(frozen=True)
class Decomposition:
    """Shares of the excess of a residual; amplitude (4, 4): rms voltage (V) in the leading
    direction by speed and current, NaN where nothing was recorded.

    direction: the one that holds most of the voltage, and how much; line: (Hz, share) of a fixed
    frequency, or None;
    readings: the same residual as errors of the measured currents, in A.
    """

    excess: float
    recordings: dict[str, float]
    channels: dict[str, float]
    directions: dict[str, float]
    speeds: dict[str, float]
    currents: dict[str, float]
    amplitude: Array
    electrical: dict[int, float]
    mechanical: dict[int, float]
    injection: float
    line: tuple[float, float] | None
    readings: Readings

    @property
    def direction(self) -> tuple[str, float]:
        """The leading direction and its share of the voltage."""
        return max(self.directions.items(), key=lambda x: x[1], default=("in no direction", 0.0))


def decompose(point: ParameterPoint, shown: Sequence[Residual]) -> Decomposition:
    """Return a residual taken apart; point: where the model stood that left it."""
    own, drive = point.prepared.recordings, point.prepared.campaign.drive
    parts = {r.file: _squares(x) for r, x in zip(own, shown, strict=True)}
    excess = {f: {c: float(np.sum(v - 1.0)) for c, v in p.items()} for f, p in parts.items()}
    total = max(sum(max(0.0, sum(e.values())) for e in excess.values()), 1e-9)
    channels = {c: sum(max(0.0, e.get(c, 0.0)) for e in excess.values()) / total for c in CHANNELS}
    recordings = {f: max(0.0, sum(e.values())) / total for f, e in excess.items()}
    speed = bins_of(parts, [_speed(point, r) for r in own], SPEEDS, SPEED_NAMES, total)
    current = bins_of(parts, [_size(point, r) for r in own], CURRENTS, CURRENT_NAMES, total)
    directions, amplitude = _directions(point, shown, recordings)
    z = [_stationary(x) * np.exp(-1j * r.motion.angle) for r, x in zip(own, shown, strict=True)]
    return Decomposition(
        total,
        recordings,
        channels,
        directions,
        speed,
        current,
        amplitude,
        electrical_orders(own, z, total),
        mechanical_orders(own, shown, total),
        _injection(point, z, total),
        clearest_line(
            [v for r, v in zip(own, z, strict=True) if r.rotor == "locked"],
            drive.converter.sampling_period,
            drive.injection.frequency,
            total,
        ),
        readings(shown, point.prepared.noise_std, _of_readings(point, shown)),
    )


def _squares(x: Residual) -> dict[str, Array]:
    """Return squares of each channel, sample by sample."""
    out = {"currents": np.asarray((x.current[:, :, 0] ** 2).ravel())}
    if x.motion is not None:
        out["motion"] = x.motion[:, 0] ** 2
    if x.angle is not None:
        out["position"] = x.angle[:, 0] ** 2
    return out


def _stationary(x: Residual) -> Complex:
    z = (2.0 / 3.0) * x.current[:, :, 0] @ LEGS
    return np.asarray(z[:, 0] + 1j * z[:, 1])


def top_speed(point: ParameterPoint) -> float:
    """Return the largest speed of all recordings (rad/s, electrical)."""
    return max(float(np.max(np.abs(x.motion.speed))) for x in point.prepared.recordings)


def _speed(point: ParameterPoint, r: Inputs) -> Array:
    return np.asarray(np.abs(r.motion.speed) / max(top_speed(point), 1e-9) * np.ones(r.samples))


def _size(point: ParameterPoint, r: Inputs) -> Array:
    i = (2.0 / 3.0) * r.read @ LEGS
    return np.asarray(
        np.hypot(i[:, 0], i[:, 1]) / point.prepared.campaign.drive.motor.rated_current
    )


def bins_of(parts, where, bounds, names, total) -> dict[str, float]:
    """Return the share of each operating region, all channels together."""
    out = dict.fromkeys(names, 0.0)
    for squares, at in zip(parts.values(), where, strict=True):
        bins = np.digitize(at, bounds)
        for channel, v in squares.items():
            sums = np.bincount(
                np.repeat(bins, 3) if channel == "currents" else bins, v - 1.0, len(names)
            )
            for name, s in zip(names, sums, strict=True):
                out[name] += float(s) / total
    return {k: max(0.0, v) for k, v in out.items()}


def _directions(point: ParameterPoint, shown: Sequence[Residual], weight: dict[str, float]):
    """Return shares of the voltage by direction, and rms voltage in the leading one by speed and
    current (4, 4)."""
    rng = np.random.default_rng(0)
    blocks = [_projected(point, k, x, rng) for k, x in enumerate(shown)]
    shares = dict.fromkeys(DIRECTIONS, 0.0)
    whole = 0.0
    for (p, noise, _, _), r in zip(blocks, point.prepared.recordings, strict=True):
        power = np.maximum(0.0, np.sum(p**2, axis=0) - np.sum(noise**2, axis=0))
        most = np.max(power.reshape(-1, 2).sum(axis=1))  # of the pairs that make a vector each
        if most > 0.0:
            whole += weight[r.file]
            for name, value in zip(DIRECTIONS, power / most, strict=True):
                shares[name] += weight[r.file] * float(value)
    shares = {k: v / whole if whole else 0.0 for k, v in shares.items()}
    lead = max(range(len(DIRECTIONS)), key=lambda k: shares[DIRECTIONS[k]])
    p, noise = (np.concatenate([b[k][:, lead] for b in blocks]) for k in (0, 1))
    speed, size = (np.concatenate([b[k] for b in blocks]) for k in (2, 3))
    return shares, amplitudes(p, noise, np.digitize(speed, SPEEDS), np.digitize(size, CURRENTS))


def _of_readings(point: ParameterPoint, shown: Sequence[Residual]) -> Array:
    """Return rms residual of a phase (in units of the noise, which is taken off) by speed and
    current (4, 4)."""
    own = point.prepared.recordings
    rms = np.concatenate([np.sqrt(np.mean(x.current[:, :, 0] ** 2, axis=1)) for x in shown])
    speed, size = (np.concatenate([of(point, r) for r in own]) for of in (_speed, _size))
    return amplitudes(
        rms, np.ones_like(rms), np.digitize(speed, SPEEDS), np.digitize(size, CURRENTS)
    )


def _projected(
    point: ParameterPoint, k: int, x: Residual, rng: np.random.Generator
) -> tuple[Array, Array, Array, Array]:
    """Return block means (b, 6) of voltage in all DIRECTIONS, the same of white noise, speed and
    current (b,)."""
    r, drive = point.prepared.recordings[k], point.prepared.campaign.drive
    i = ((2.0 / 3.0) * r.read @ LEGS)[:-1]
    current = i[:, 0] + 1j * i[:, 1]
    size = np.abs(current)
    duty = r.mean_duty()[:-1]
    command = duty[:, 0] + 1j * duty[:, 1]
    units = (
        np.where(
            size > LEAST_CURRENT * drive.motor.rated_current, current / np.maximum(size, 1e-12), 0.0
        ),
        command / np.maximum(np.abs(command), 1e-12),
        np.exp(1j * r.motion.angle[:-1]),
    )
    width = 8
    out = []
    for residual in (x.current, rng.standard_normal(x.current.shape)):
        v = voltage_residual(point.prepared, point.values, k, residual)
        turned = [(v[:, 0] + 1j * v[:, 1]) * np.conj(u) for u in units]
        columns = [part for t in turned for part in (t.real, t.imag)]
        out.append(_means(np.stack(columns, axis=1), width))
    at = _means(np.stack([_speed(point, r)[:-1], _size(point, r)[:-1]], axis=1), width)
    return out[0], out[1], at[:, 0], at[:, 1]


def _means(x: Array, width: int) -> Array:
    n = len(x) // width
    return np.asarray(x[: n * width].reshape(n, width, x.shape[1]).mean(axis=1))


def amplitudes(p: Array, noise: Array, speed, current) -> Array:
    """Return rms by speed and current (4, 4); NaN where fewer than FEWEST blocks, or noise alone,
    were seen."""
    out = np.full((len(SPEED_NAMES), len(CURRENT_NAMES)), np.nan)
    for s in range(len(SPEED_NAMES)):
        for c in range(1, len(CURRENT_NAMES)):
            own = (speed == s) & (current == c)
            power = (
                np.mean(p[own] ** 2) - np.mean(noise[own] ** 2) if own.sum() >= FEWEST else np.nan
            )
            out[s, c] = math.sqrt(power) if power > 0.0 else np.nan
    return out


def electrical_orders(
    own: Sequence[Inputs], z: Sequence[Complex], total: float
) -> dict[int, float]:
    """Return the share of each electrical order of currents, in the rotor's frame, over turning
    recordings.

    An order counts where a turn has samples enough for it.
    """
    power, size = np.zeros(len(ORDERS)), np.abs(ORDERS)
    for r, values in zip(own, z, strict=True):
        if r.rotor == "locked":
            continue
        for a, b in whole_turns(r.motion.angle, PER_TURN, 2.0):
            wave = np.exp(-1j * np.outer(ORDERS, r.motion.angle[a:b]))
            turn = (b - a) * math.tau / abs(r.motion.angle[b - 1] - r.motion.angle[a])
            resolved = 2.0 * (size + 1) <= max(turn, PER_TURN)
            power += np.where(
                resolved, 1.5 * np.abs(wave @ values[a:b]) ** 2 / (b - a) - VARIANCE, 0.0
            )
    return {n: max(0.0, float(p)) / total for n, p in zip(ORDERS, power, strict=True)}


def mechanical_orders(
    own: Sequence[Inputs], shown: Sequence[Residual], total: float
) -> dict[int, float]:
    """Return the share of each mechanical order of a free rotor's innovations."""
    power = np.zeros(len(MECHANICAL))
    for r, x in zip(own, shown, strict=True):
        if x.motion is None:
            continue
        angle = r.motion.angle / r.pole_pairs
        for a, b in whole_turns(angle, 2.0 * max(MECHANICAL), 1.0):
            wave = np.exp(-1j * np.outer(MECHANICAL, angle[a:b]))
            power += 2.0 * (np.abs(wave @ x.motion[a:b, 0]) ** 2 / (b - a) - 1.0)
    return {n: max(0.0, float(p)) / total for n, p in zip(MECHANICAL, power, strict=True)}


def _injection(point: ParameterPoint, z: Sequence[Complex], total: float) -> float:
    """Return the share of currents at the injection's frequency and its odd harmonics."""
    campaign = point.prepared.campaign
    if all(r.injection_axis == "none" for r in campaign.recordings):
        return 0.0
    n = samples_per_period(campaign.drive.injection, campaign.drive.converter)
    out = 0.0
    for r, values in zip(point.prepared.recordings, z, strict=True):
        if campaign[r.file].injection_axis == "none":
            continue
        m = 16 * n
        own = values[: len(values) // m * m].reshape(-1, m)
        spectrum = 1.5 * np.abs(np.fft.fft(own, axis=1)) ** 2 / m - VARIANCE
        out += float(
            np.sum(spectrum[:, [16 * h % m for h in range(-n // 2 + 1, n // 2 + 1, 1) if h % 2]])
        )
    return max(0.0, out) / total


def clearest_line(
    z: Sequence[Complex], period: float, injection: float, total: float
) -> tuple[float, float] | None:
    """Return frequency (Hz) and share of the clearest line in vectors at locked rotor, sampled
    every period (s); what is an injection's own (Hz) left out."""
    window = np.hanning(BINS)
    power, kept = np.zeros(BINS), 0.0
    for values in z:
        if len(values) >= BINS:
            own = values[: len(values) // BINS * BINS].reshape(-1, BINS)
            power += np.sum(np.abs(np.fft.fft(own * window, axis=1)) ** 2, axis=0) / np.sum(
                window**2
            )
            kept += len(own)
    if not kept:
        return None
    power = 1.5 * power[1 : BINS // 2] + 1.5 * power[:0:-1][: BINS // 2 - 1]
    f = np.fft.fftfreq(BINS, period)[1 : BINS // 2]
    near = np.abs(f / injection - np.rint(f / injection)) * injection
    clear = np.where((near > 4.0 * f[0]) & (f > 8.0 * f[0]), power, 0.0)
    level = np.median(
        np.lib.stride_tricks.sliding_window_view(np.pad(power, 20, mode="reflect"), 41), axis=1
    )
    k = int(np.argmax(clear / level))
    peak = slice(max(0, k - 2), k + 3)
    share = float(np.sum(power[peak] - level[peak])) / total
    return (float(f[k]), share) if clear[k] > LINE * level[k] else None
