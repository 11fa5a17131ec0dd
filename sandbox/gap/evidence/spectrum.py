"""Searches before a fit: which frequency of the link, which order of the shaft, is worth starting from."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import scipy.ndimage
from numpy.typing import NDArray

from sandbox.gap.evidence.normal import Point, normal, part_of, simulated
from sandbox.gap.evidence.priors import Coordinate
from sandbox.replay.replay import Residual, replay, residuals
from sandbox.replay.sensitivity import mechanical_only
from sandbox.replay.voltage import voltage_residual

Array = NDArray[np.float64]
PEAKS = 3
NEIGHBOURS = 101  # bins over which a spectrum's own level is taken


def shown(point: Point) -> list[Residual]:
    """Return the residuals of every recording at a point, one set."""
    simulated(1.0)
    return residuals(point.prepared, replay(point.turned(), [point.values]))


def link_lines(point: Point, low: float, high: float) -> list[float]:
    """Return the PEAKS frequencies (Hz) at which the voltage residual along the command stands out most.

    One periodogram of residual times command over all recordings, which share the phase at their start; stretches of
    one recording stand in it where they were recorded.
    """
    prepared = point.prepared
    period = prepared.campaign.drive.converter.sampling_period
    places = [round(r.clock / period) for r in prepared.recordings]
    length = max(first + r.samples for first, r in zip(places, prepared.recordings, strict=True))
    total = np.zeros(2 * length)
    for k, res in enumerate(shown(point)):
        u = prepared.recordings[k].mean_duty()[:-1] * prepared.campaign.drive.converter.dc_bus_voltage
        v = voltage_residual(prepared, point.values, k, res.current)
        along = np.sum(v * u, axis=1)
        total[places[k] : places[k] + len(along)] += along
    power = np.abs(np.fft.rfft(total)) ** 2
    frequency = np.fft.rfftfreq(len(total), period)
    level = scipy.ndimage.median_filter(power, NEIGHBOURS, mode="mirror")
    clear = np.where((frequency >= low) & (frequency <= high), power / level, 0.0)
    out: list[float] = []
    for _ in range(PEAKS):
        k = int(np.argmax(clear))
        out.append(float(frequency[k]))
        clear[max(0, k - 4) : k + 5] = 0.0
    return out


def best_values(point: Point, pair: tuple[str, str], parameter: str, values: Sequence[float]) -> list[float]:
    """Return the PEAKS values of a parameter at which an amplitude with a phase would explain most, by simulation."""
    prepared = point.prepared
    chosen = prepared.recordings
    if mechanical_only(parameter):
        chosen = tuple(r for r in chosen if r.rotor == "free")
    if not chosen:
        return []
    part = Point(replace(prepared, recordings=chosen), point.values)
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
