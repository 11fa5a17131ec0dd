"""Flux maps as they are published: points without a value, ragged circles, axes the other way round, scattered points,
a frame whose d axis is not the magnet's; and how far a map can be believed.

The frame: `angle` (electrical rad) says how far the file's d axis stands ahead of the magnet; a vector of the file is
turned by exp(j angle).  magnet = "q" is the same as an angle of -pi/2.

A machine that looks the same in both directions has psi_d even and psi_q odd in i_q.  Polynomials with and without that
symmetry tell how far a map breaks it, and at which angle it would break it least.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from model.arrays import read_arrays
from model.errors import BadInput, PhysicsError, brief
from model.fluxmap import MOST_POINTS, NAMES, SIZES, TURNS, FluxMap, check_axis
from model.parameters import finite
from model.spline import SplineEnergy

Array = NDArray[np.float64]
MORE_NAMES = {
    "i_d": ("i_d_vec", "id_vec", "Id_vec", "ID"), "i_q": ("i_q_vec", "iq_vec", "Iq_vec", "IQ"),
    "psi_d": ("Psi_d", "psi_d_map", "flux_d", "PSID"), "psi_q": ("Psi_q", "psi_q_map", "flux_q", "PSIQ"),
}  # fmt: skip
FEWEST = 24  # points with a value
DEGREE = 6  # of the polynomials that tell the asymmetry
FARTHEST = math.radians(15.0)  # angle that is looked for
ONE_SIDED = 0.25  # of the range of i_q: less on one side tells no asymmetry
TELLING = 1.4  # times the asymmetry must fall for an angle to be proposed
CHOICES = (((10, 8), 1e-3), ((10, 8), 3e-3), ((14, 12), 1e-3))  # cells and smoothness tried where a grid has holes
FOLDS = 4
NO_STARTING = 0.02  # of the range of i_d: less than that beyond 0 leaves no room for the polarity test


@dataclass(frozen=True)
class MapPoints:
    """Points of a flux map in the magnet's frame, each (n,): currents (A), fluxes (Wb); notes: what was left out."""

    name: str
    i_d: Array
    i_q: Array
    psi_d: Array
    psi_q: Array
    notes: tuple[str, ...]

    def points(self) -> tuple[Array, Array, Array, Array]:
        """Return psi_d, psi_q, i_d, i_q."""
        return self.psi_d, self.psi_q, self.i_d, self.i_q

    def turned(self, angle: float) -> MapPoints:
        """Return the same in a frame turned back by an angle (rad): vectors times exp(j angle)."""
        i = (self.i_d + 1j * self.i_q) * np.exp(1j * angle)
        psi = (self.psi_d + 1j * self.psi_q) * np.exp(1j * angle)
        return MapPoints(self.name, i.real, i.imag, psi.real, psi.imag, self.notes)

    def grid(self) -> FluxMap | None:
        """Return the map on its rectangular grid, None where the points do not fill one."""
        scale = float(max(np.max(np.abs(self.i_d)), np.max(np.abs(self.i_q))))
        d, q = np.round(self.i_d / scale, 7), np.round(self.i_q / scale, 7)
        n, m = len(np.unique(d)), len(np.unique(q))
        if n * m != len(d) or min(n, m) < 3:
            return None
        order = np.lexsort((q, d))
        square = [x[order].reshape(n, m) for x in (self.i_d, self.i_q, self.psi_d, self.psi_q)]
        return FluxMap(self.name, square[0].mean(axis=1), square[1].mean(axis=0), square[2], square[3])


@dataclass(frozen=True)
class Quality:
    """How far a map can be believed.

    points: with a value; held_out: Wb rms of a fit on points it has not seen (None: it does not reach them); asymmetry:
    Wb rms between +i_q and -i_q (None: the map has one sign only); angle: rad that would explain most of it (None: none
    does); asymmetry_turned: what that would leave.
    """

    points: int
    held_out: float | None
    asymmetry: float | None
    angle: float | None
    asymmetry_turned: float | None
    notes: tuple[str, ...]

    def sentences(self) -> list[str]:
        """Return what a person should know."""
        out = list(self.notes)
        if self.held_out is not None:
            out.append(f"fit of the map: {1e3 * self.held_out:.3g} mWb rms on points held out, of {self.points} points")
        if self.asymmetry is not None:
            out.append(f"+i_q and -i_q differ by {1e3 * self.asymmetry:.3g} mWb rms")
        if self.angle is not None and self.asymmetry_turned is not None:
            out.append(
                f"an angle offset of {math.degrees(self.angle):.2f} degrees explains that but for "
                f"{1e3 * self.asymmetry_turned:.3g} mWb: try angle = {self.angle:.4f} more in [flux_map]"
            )
        return out


def read_points(path: Path, magnet: str = "d", angle: float = 0.0) -> MapPoints:
    """Return the points of a .npz, .mat or .csv map that have a value, in the magnet's frame.

    Axes are vectors or grids; where vectors of i_d and i_q fit the map only the other way round it is transposed.
    BadInput for a missing quantity, other shapes, or fewer than FEWEST points with a value.
    """
    check_axis(magnet)
    names = {q: (*NAMES[q], *MORE_NAMES.get(q, ())) for q in NAMES}
    data, known = read_arrays(path, {n for spelled in names.values() for n in spelled}, MOST_POINTS)
    notes: list[str] = []
    i, psi = _vectors(data, names, path.name, known, notes)
    good = np.isfinite(i) & np.isfinite(psi)
    if np.count_nonzero(good) < FEWEST:
        raise BadInput(
            f"{path.name}: {np.count_nonzero(good)} of {good.size} points have a value; a map needs at least {FEWEST}"
        )
    if not np.all(good):
        notes.append(f"{path.name}: {np.count_nonzero(~good)} of {good.size} points have no value and are left out")
    for values, (low, high), what, unit in (
        (i[good], SIZES["i"], "currents", "A"),
        (psi[good], SIZES["psi"], "fluxes", "Wb"),
    ):
        largest = float(np.max(np.abs(values)))
        if not low <= largest <= high:
            raise BadInput(
                f"{path.name}: the largest of the {what} is {largest:.3g} {unit}, not in [{low:g}, {high:g}]"
            )
    turn = TURNS[magnet] * np.exp(1j * angle)
    i, psi = turn * i[good], turn * psi[good]
    return MapPoints(path.stem, i.real.copy(), i.imag.copy(), psi.real.copy(), psi.imag.copy(), tuple(notes))


def check_angle(angle: object) -> float:
    """Return the `angle` of [flux_map] in rad; BadInput where it is none."""
    value = finite(angle)
    if value is None or abs(value) > math.pi:
        raise BadInput(f"[flux_map] angle = {brief(angle)} is no angle; give electrical rad in [-3.1416, 3.1416]")
    return value


def _vectors(
    data: Any, names: dict[str, tuple[str, ...]], file: str, known: list[str], notes: list[str]
) -> tuple[NDArray[np.complex128], NDArray[np.complex128]]:
    """Return currents and fluxes as complex numbers, flat."""
    whole = {q: _first(data, names[q], "c") for q in ("i", "psi")}
    if whole["i"] is not None and whole["psi"] is not None and whole["i"].shape == whole["psi"].shape:
        return whole["i"].ravel().astype(complex), whole["psi"].ravel().astype(complex)
    parts = {q: _first(data, names[q], "fiu") for q in ("i_d", "i_q", "psi_d", "psi_q")}
    for name, values in parts.items():
        if values is None:
            raise BadInput(
                f"{file}: no '{name}' of numbers (or {', '.join(names[name])}); it holds {', '.join(known)[:80]}"
            )
    d, q, psi_d, psi_q = (np.asarray(parts[n], dtype=float) for n in ("i_d", "i_q", "psi_d", "psi_q"))
    if psi_d.shape != psi_q.shape:
        raise BadInput(f"{file}: psi_d has shape {psi_d.shape}, psi_q {psi_q.shape}; they must be equal")
    if d.ndim == q.ndim == 1 and psi_d.ndim == 2:
        d, q = _grid(d, q, psi_d, file, notes)
    if not d.shape == q.shape == psi_d.shape:
        raise BadInput(
            f"{file}: currents have shapes {d.shape} and {q.shape}, fluxes {psi_d.shape}; they must be equal"
        )
    return _complex(d, q), _complex(psi_d, psi_q)


def _complex(a: Array, b: Array) -> NDArray[np.complex128]:
    """Return a + jb, flat, an infinite part leaving the other as it is."""
    both = np.empty(a.size, dtype=complex)
    both.real, both.imag = a.ravel(), b.ravel()
    return both


def _grid(d: Array, q: Array, psi_d: Array, file: str, notes: list[str]) -> tuple[Array, Array]:
    """Return grids of currents for vectors of them, the map's first axis i_d, or i_q where only that fits.

    A square map says by itself: psi_d rises along i_d.
    """
    n, m = len(d), len(q)
    straight, across = psi_d.shape == (n, m), psi_d.shape == (m, n)
    if not straight and not across:
        raise BadInput(
            f"{file}: fluxes have shape {psi_d.shape}, axes of {n} (i_d) and {m} (i_q) currents fit neither way"
        )
    if straight and across:
        along = [float(np.nansum(np.diff(psi_d, axis=k) * np.sign(np.diff(d)[0]))) for k in (0, 1)]
        straight = along[0] >= along[1]
    if straight:
        x, y = np.meshgrid(d, q, indexing="ij")
    else:
        notes.append(f"{file}: rows are i_q, columns i_d; taken the other way round")
        y, x = np.meshgrid(q, d, indexing="ij")
    return x, y


def _first(data: Any, names: tuple[str, ...], kinds: str) -> Any:
    for name in names:
        if name in data and data[name].size > 1 and data[name].ndim <= 2 and data[name].dtype.kind in kinds:
            return data[name]
    return None


def asymmetry(p: MapPoints, angle: float = 0.0) -> float:
    """Return the rms (Wb) by which a map, turned by an angle, differs between +i_q and -i_q."""
    t = p.turned(angle)
    scale = float(np.max(np.hypot(t.i_d, t.i_q)))
    x, y = t.i_d / scale, t.i_q / scale
    powers = [(a, b) for a in range(DEGREE + 1) for b in range(DEGREE + 1 - a)]
    columns = np.stack([x**a * y**b for a, b in powers], axis=1)
    odd = np.array([b % 2 == 1 for _, b in powers])
    found = np.linalg.lstsq(columns, np.stack([t.psi_d, t.psi_q], axis=1), rcond=1e-10)[0]
    wrong = (columns[:, odd] @ found[odd, 0], columns[:, ~odd] @ found[~odd, 1])
    return math.sqrt(sum(float(np.mean(x**2)) for x in wrong))


def best_angle(p: MapPoints) -> float:
    """Return the angle (rad) by which a map, turned, is least different between +i_q and -i_q."""
    angles = np.linspace(-FARTHEST, FARTHEST, 31)
    k = int(np.argmin([asymmetry(p, a) for a in angles]))
    low, high = angles[max(k - 1, 0)], angles[min(k + 1, len(angles) - 1)]
    for _ in range(24):  # thirds of an interval in which there is one minimum
        a, b = low + (high - low) / 3.0, high - (high - low) / 3.0
        low, high = (low, b) if asymmetry(p, a) < asymmetry(p, b) else (a, high)
    return float(0.5 * (low + high))


def fit_points(p: MapPoints) -> SplineEnergy:
    """Return the spline energy of scattered points, cells and smoothness chosen by points held out."""
    from model.spline_energy import fit

    errors = [held_out_error(p, cells, smooth) for cells, smooth in CHOICES]
    cells, smooth = CHOICES[int(np.argmin(errors))]
    return fit(p.psi_d, p.psi_q, p.i_d, p.i_q, cells, smooth)


def held_out_error(p: MapPoints, cells: tuple[int, int] = (10, 8), smooth: float = 1e-3) -> float:
    """Return the rms error (Wb) at points that a fit has not seen, inf where it does not reach them.

    Points inside, one in FOLDS of them: the outermost ones are always fitted, the energy's box must hold the rest.
    """
    from model.spline_energy import fit, flux_from_current

    centre = np.array([np.mean(p.psi_d), 0.0])
    far = np.hypot((p.psi_d - centre[0]) / np.ptp(p.psi_d), (p.psi_q - centre[1]) / np.ptp(p.psi_q))
    inner = np.flatnonzero(far < np.quantile(far, 0.7))
    out = np.zeros(len(far), dtype=bool)
    out[inner[::FOLDS]] = True
    try:
        s = fit(p.psi_d[~out], p.psi_q[~out], p.i_d[~out], p.i_q[~out], cells, smooth)
        d, q = flux_from_current(s, p.i_d[out], p.i_q[out])
    except PhysicsError:
        return math.inf
    return math.sqrt(float(np.mean((d - p.psi_d[out]) ** 2 + (q - p.psi_q[out]) ** 2)))


def quality(p: MapPoints) -> Quality:
    """Return how far a map can be believed."""
    notes = list(p.notes)
    span = float(np.ptp(p.i_d))
    if float(np.max(p.i_d)) < NO_STARTING * span:
        notes.append(
            f"{p.name}: the map ends at i_d = {float(np.max(p.i_d)):.3g} A, so the polarity test of starting up leaves "
            "it; give start_up = false in the scenario"
        )
    error = held_out_error(p)
    held = error if math.isfinite(error) else None
    if min(-float(np.min(p.i_q)), float(np.max(p.i_q))) < ONE_SIDED * float(np.ptp(p.i_q)):
        return Quality(len(p.i_d), held, None, None, None, tuple(notes))
    now, angle = asymmetry(p), best_angle(p)
    after = asymmetry(p, angle)
    told = now > TELLING * after and abs(angle) > math.radians(0.2) and abs(angle) < 0.99 * FARTHEST
    return Quality(len(p.i_d), held, now, angle if told else None, after, tuple(notes))
