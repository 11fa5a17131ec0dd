"""Searches before a fit: which frequency of the link, which order of the shaft, is worth starting
from."""

from __future__ import annotations

import itertools
import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import scipy.ndimage

from model.array_types import Array
from sandbox.gap.evidence.normal import ParameterPoint, normal, part_of, simulated
from sandbox.gap.evidence.priors import Coordinate
from sandbox.replay.replay import Residual, replay, residuals
from sandbox.replay.sensitivity import mechanical_only
from sandbox.replay.voltage import voltage_residual

PEAKS = 3
NEIGHBOURS = 101  # bins over which a spectrum's own level is taken
# frequencies at most that are tried near a line: four a bin of some three hours at 1 Hz either way
FINEST = 100_000


def shown(point: ParameterPoint) -> list[Residual]:
    """Return the residuals of every recording at a point, one set."""
    simulated(1.0)
    return residuals(point.prepared, replay(point.turned(), [point.values]))


def whole_turns(angle: Array, per_turn: float, turns: float) -> list[tuple[int, int]]:
    """Return (first, last) of stretches of whole turns with enough samples a turn."""
    turned = np.floor(np.maximum.accumulate(np.abs(angle - angle[0])) / (turns * math.tau))
    edges = [0, *(np.flatnonzero(np.diff(turned) > 0.0) + 1).tolist()]
    return [(a, b) for a, b in itertools.pairwise(edges) if b - a >= per_turn * turns]


def link_lines(point: ParameterPoint, low: float, high: float) -> list[float]:
    """Return the PEAKS frequencies (Hz) at which the voltage residual along the command stands out
    most.

    Residual times command, of every recording.
    """
    prepared = point.prepared
    period = prepared.campaign.drive.converter.sampling_period
    parts = []
    for k, res in enumerate(shown(point)):
        u = (
            prepared.recordings[k].mean_duty()[:-1]
            * prepared.campaign.drive.converter.dc_bus_voltage
        )
        v = voltage_residual(prepared, point.values, k, res.current)
        parts.append((prepared.recordings[k].first, np.asarray(np.sum(v * u, axis=1))))
    return lines(parts, period, low, high)


def lines(
    parts: Sequence[tuple[int, Array]], period: float, low: float, high: float
) -> list[float]:
    """Return the PEAKS frequencies (Hz) that stand out most in parts of recordings: first sample
    there, and values.

    One periodogram of the sum where all parts begin their recordings, which share the phase there.
    Else the sum of every part's own finds the lines, and each is looked for more finely near there,
    all parts in phase.
    """
    length = max(len(x) for _, x in parts) + 1
    together = all(first == 0 for first, _ in parts)
    total = np.zeros((1 if together else len(parts), 2 * length))
    for k, (_, x) in enumerate(parts):
        total[0 if together else k, : len(x)] += x
    power = np.sum(np.abs(np.fft.rfft(total)) ** 2, axis=0)
    frequency = np.fft.rfftfreq(2 * length, period)
    level = scipy.ndimage.median_filter(power, NEIGHBOURS, mode="mirror")
    clear = np.where((frequency >= low) & (frequency <= high), power / level, 0.0)
    out: list[float] = []
    for _ in range(PEAKS):
        k = int(np.argmax(clear))
        out.append(
            float(frequency[k])
            if together
            else in_phase(parts, period, frequency[k], 1.0 / (length * period))
        )
        clear[max(0, k - 4) : k + 5] = 0.0
    return out


def in_phase(
    parts: Sequence[tuple[int, Array]], period: float, about: float, within: float
) -> float:
    """Return the frequency (Hz), at most so far from one, at which parts in phase with each other
    sum up to most."""
    from scipy.signal import zoom_fft

    span = period * max(first + len(x) for first, x in parts)
    count = min(FINEST, 4 * math.ceil(2.0 * within * span))
    tried = np.linspace(about - within, about + within, count)
    total = np.zeros(count, complex)
    for first, x in parts:
        rate = 1.0 / period
        own = zoom_fft(x, [tried[0], tried[-1]], count, fs=rate, endpoint=True)
        total += own * np.exp(-2j * np.pi * tried * first * period)
    return float(tried[int(np.argmax(np.abs(total)))])


def best_values(
    point: ParameterPoint, pair: tuple[str, str], parameter: str, values: Sequence[float]
) -> list[float]:
    """Return the PEAKS values of a parameter at which an amplitude with a phase would explain most,
    by simulation."""
    prepared = point.prepared
    chosen = prepared.recordings
    if mechanical_only(parameter):
        chosen = tuple(r for r in chosen if r.rotor == "free")
    if not chosen:
        return []
    # what a map may be off by has no say here
    part = ParameterPoint(replace(prepared, recordings=chosen, map_error=None), point.values)
    coordinates = [
        Coordinate(f"{value} {form}", 0.0, 1.0, form, pair, ((parameter, float(value)),))
        for value in values
        for form in ("cosine", "sine")
    ]
    with part_of(part.prepared.samples / prepared.samples):
        a, g, _ = normal(part, coordinates).summed()
    gain: list[tuple[float, float]] = []
    for k, value in enumerate(values):
        own = slice(2 * k, 2 * k + 2)
        block = a[own, own] + 1e-12 * np.trace(a) / len(a) * np.eye(2)
        gain.append((float(g[own] @ np.linalg.solve(block, g[own])), float(value)))
    return [value for _, value in sorted(gain, reverse=True)[:PEAKS]]
