"""Flux maps as they are published: points without a value, ragged circles, axes the other way round, scattered points,
a frame whose d axis is not the magnet's.

The frame: `angle` (electrical rad) says how far the file's d axis stands ahead of the magnet; a vector of the file is
turned by exp(j angle).  magnet = "q" is the same as an angle of -pi/2.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from model.arrays import read_arrays
from model.errors import BadInput, brief
from model.fluxmap import MOST_POINTS, NAMES, SIZES, TURNS, FluxMap, check_axis
from model.parameters import finite

Array = NDArray[np.float64]
MORE_NAMES = {
    "i_d": ("i_d_vec", "id_vec", "Id_vec", "ID"), "i_q": ("i_q_vec", "iq_vec", "Iq_vec", "IQ"),
    "psi_d": ("Psi_d", "psi_d_map", "flux_d", "PSID"), "psi_q": ("Psi_q", "psi_q_map", "flux_q", "PSIQ"),
}  # fmt: skip
FEWEST = 24  # points with a value


@dataclass(frozen=True)
class MapPoints:
    """Points of a flux map in the magnet's frame, each (n,): currents (A), fluxes (Wb), torque (N m, None: not in the
    file); notes: what was left out."""

    name: str
    i_d: Array
    i_q: Array
    psi_d: Array
    psi_q: Array
    notes: tuple[str, ...]
    torque: Array | None = None

    def points(self) -> tuple[Array, Array, Array, Array]:
        """Return psi_d, psi_q, i_d, i_q."""
        return self.psi_d, self.psi_q, self.i_d, self.i_q

    def turned(self, angle: float) -> MapPoints:
        """Return the same in a frame turned back by an angle (rad): vectors times exp(j angle)."""
        i = (self.i_d + 1j * self.i_q) * np.exp(1j * angle)
        psi = (self.psi_d + 1j * self.psi_q) * np.exp(1j * angle)
        return MapPoints(self.name, i.real, i.imag, psi.real, psi.imag, self.notes, self.torque)

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
    torque = _first(data, names["torque"], "fiu")
    kept = torque.ravel()[good].astype(float) if torque is not None and torque.size == good.size else None
    turn = TURNS[magnet] * np.exp(1j * angle)
    i, psi = turn * i[good], turn * psi[good]
    return MapPoints(path.stem, i.real.copy(), i.imag.copy(), psi.real.copy(), psi.imag.copy(), tuple(notes), kept)


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
