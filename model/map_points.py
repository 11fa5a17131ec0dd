"""Flux maps as they are published: points without a value, ragged circles, axes the other way
round, scattered points, a frame whose d axis is not the magnet's.

The frame: `angle` (electrical rad) says how far the file's d axis stands ahead of the magnet; a
vector of the file is turned by exp(j angle).  magnet = "q" is the same as an angle of -pi/2.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from model.array_types import Array
from model.arrays import TEXTS, read_arrays
from model.errors import BadInput, as_toml
from model.fluxmap import MOST_POINTS, MOST_VALUES, SIZES, TURNS, FluxMap, check_axis
from model.map_names import NAMES, OF_BOTH, Column, columns_of
from model.parameters import finite
from model.text_table import lines_of_rows

FEWEST = 24  # points with a value
IN_HEADER = "write their units into the file's header, e.g. i_d [mA], psi_d [mWb]"


@dataclass(frozen=True)
class Source:
    """Where the points of a map stand in its file.

    names: its columns by quantity; polar: whether its currents are amplitude and angle; shape: of
    its arrays; place (n,): of each point among their values, counted from 0.
    """

    path: Path
    names: Mapping[str, str]
    polar: bool
    shape: tuple[int, ...]
    place: NDArray[np.int64]


@dataclass(frozen=True)
class MapPoints:
    """Points of a flux map in the magnet's frame, each (n,): currents (A), fluxes (Wb), torque (N
    m, None: not in the file); notes: what was left out; source: None where no file was read."""

    name: str
    i_d: Array
    i_q: Array
    psi_d: Array
    psi_q: Array
    notes: tuple[str, ...]
    torque: Array | None = None
    source: Source | None = None

    def points(self) -> tuple[Array, Array, Array, Array]:
        """Return psi_d, psi_q, i_d, i_q."""
        return self.psi_d, self.psi_q, self.i_d, self.i_q

    def turned(self, angle: float) -> MapPoints:
        """Return the same in a frame turned back by an angle (rad): vectors times exp(j angle)."""
        i = (self.i_d + 1j * self.i_q) * np.exp(1j * angle)
        psi = (self.psi_d + 1j * self.psi_q) * np.exp(1j * angle)
        return replace(self, i_d=i.real, i_q=i.imag, psi_d=psi.real, psi_q=psi.imag)

    def some(self, chosen: NDArray[Any]) -> MapPoints:
        """Return chosen points alone (a mask, or places)."""
        numbers = {n: getattr(self, n)[chosen] for n in OF_BOTH}
        torque = None if self.torque is None else self.torque[chosen]
        s = self.source
        source = None if s is None else replace(s, place=s.place[chosen])
        return replace(self, torque=torque, source=source, **numbers)

    def where(self, k: int) -> str:
        """Return a point in words: its currents, and where it stands in its file."""
        least = 1e-9 * float(np.max(np.hypot(self.i_d, self.i_q)))  # below: left by a turn
        d, q = (0.0 if abs(x) < least else float(x) for x in (self.i_d[k], self.i_q[k]))
        point, s = f"i_d = {d:.4g} A, i_q = {q:.4g} A", self.source
        if s is None:
            return point
        at = [int(n) + 1 for n in np.unravel_index(int(s.place[k]), s.shape)]
        if len(at) == 1 and s.path.suffix.lower() in TEXTS:
            lines = lines_of_rows(s.path)
            if at[0] <= len(lines):
                return f"{point} (line {lines[at[0] - 1]})"
        return f"{point} (row {at[0]}{f', column {at[1]}' if len(at) > 1 else ''})"

    def on_grid(self) -> NDArray[np.int64] | None:
        """Return which point stands where on the map's rectangular grid of i_d and i_q, None where
        the points do not fill one."""
        scale = float(max(np.max(np.abs(self.i_d)), np.max(np.abs(self.i_q))))
        d, q = np.round(self.i_d / scale, 7), np.round(self.i_q / scale, 7)
        n, m = len(np.unique(d)), len(np.unique(q))
        if n * m != len(d) or min(n, m) < 3:
            return None
        return np.lexsort((q, d)).reshape(n, m)

    def grid(self) -> FluxMap | None:
        """Return the map on its rectangular grid, None where the points do not fill one."""
        order = self.on_grid()
        if order is None:
            return None
        square = [x[order] for x in (self.i_d, self.i_q, self.psi_d, self.psi_q)]
        return FluxMap(
            self.name, square[0].mean(axis=1), square[1].mean(axis=0), square[2], square[3]
        )


def read_points(
    path: Path, magnet: str = "d", angle: float = 0.0, stated: Mapping[str, str] | None = None
) -> MapPoints:
    """Return the points of a map (.npz, .mat, a text or a workbook) that have a value, in the
    magnet's frame.

    Axes are vectors or grids; where vectors of i_d and i_q fit the map only the other way round it
    is transposed. Currents may be an amplitude and how far it stands ahead of q, towards -d.  Over
    further values at one current (the rotor's angle: rows, or a third axis) the mean is taken.
    stated: names of arrays by quantity, as [flux_map] gives them.  BadInput for a missing quantity,
    other shapes, or fewer than FEWEST points with a value.
    """
    check_axis(magnet)
    data, known = read_arrays(path, (), MOST_VALUES)
    columns = columns_of(known, stated or {}, path.name)
    data, _ = read_arrays(path, {c.name for group in columns.values() for c in group}, MOST_VALUES)
    notes: list[str] = []
    i, psi, shape = _vectors(data, columns, path.name, known, notes)
    polar = all(_first(data, columns[q], "cfiu") is None for q in ("i", "i_d", "i_q"))
    torque = _first(data, columns["torque"], "fiu")
    torque = None if torque is None else _over_angles(torque)
    torques = torque.ravel().astype(float) if torque is not None and torque.size == i.size else None
    i, psi, torques, place = _once(i, psi, torques, path.name, notes)
    if i.size > MOST_POINTS:
        raise BadInput(
            f"{path.name}: {i.size} points; at most {MOST_POINTS} are read, keep every second line"
        )
    good = np.isfinite(i) & np.isfinite(psi)
    if np.count_nonzero(good) < FEWEST:
        raise BadInput(
            f"{path.name}: {np.count_nonzero(good)} of {good.size} points have a value; "
            f"a map needs at least {FEWEST}"
        )
    if not np.all(good):
        notes.append(
            f"{path.name}: {np.count_nonzero(~good)} of {good.size} points have no value "
            "and are left out"
        )
    for values, (low, high), what, unit in (
        (i[good], SIZES["i"], "currents", "A"),
        (psi[good], SIZES["psi"], "fluxes", "Wb"),
    ):
        largest = float(np.max(np.abs(values)))
        if not low <= largest <= high:
            raise BadInput(
                f"{path.name}: the largest of the {what} is {largest:.3g} {unit}, not in "
                f"[{low:g}, {high:g}]; {IN_HEADER}"
            )
    kept = None if torques is None else torques[good]
    turn = TURNS[magnet] * np.exp(1j * angle)
    i, psi = turn * i[good], turn * psi[good]
    there = [(q, c) for q in OF_BOTH for c in columns[q][::-1]]
    names = {q: c.name for q, c in there if _first(data, [c], "fiu") is not None}
    return MapPoints(
        path.stem,
        i.real.copy(),
        i.imag.copy(),
        psi.real.copy(),
        psi.imag.copy(),
        tuple(notes),
        kept,
        Source(path, names, polar, shape, place[good]),
    )


def check_angle(angle: object) -> float:
    """Return the `angle` of [flux_map] in rad; BadInput where it is none."""
    value = finite(angle)
    if value is None or abs(value) > math.pi:
        raise BadInput(
            f"[flux_map] angle = {as_toml(angle)} is no angle; give electrical rad in "
            "[-3.1416, 3.1416]"
        )
    return value


def _vectors(
    data: Any, columns: Mapping[str, list[Column]], file: str, known: list[str], notes: list[str]
) -> tuple[NDArray[np.complex128], NDArray[np.complex128], tuple[int, ...]]:
    """Return currents and fluxes as complex numbers, flat, and the shape that they had."""
    whole = {q: _first(data, columns[q], "c") for q in ("i", "psi")}
    if (
        whole["i"] is not None
        and whole["psi"] is not None
        and whole["i"].shape == whole["psi"].shape
    ):
        i, psi = whole["i"], whole["psi"]
        return i.ravel().astype(complex), psi.ravel().astype(complex), i.shape
    parts = {q: _first(data, columns[q], "fiu") for q in OF_BOTH}
    if parts["i_d"] is None and parts["i_q"] is None:
        parts |= _from_amplitude(data, columns, notes, file)
    for name, values in parts.items():
        if values is None:
            raise BadInput(_missing(name, data, columns[name], file, known))
    d, q, psi_d, psi_q = (np.asarray(parts[n], dtype=float) for n in OF_BOTH)
    if d.ndim < 3 and psi_d.ndim == psi_q.ndim == 3:
        notes.append(
            f"{file}: fluxes over {psi_d.shape[2]} angles of the rotor; their mean is taken"
        )
        psi_d, psi_q = _over_angles(psi_d), _over_angles(psi_q)
    if psi_d.shape != psi_q.shape:
        raise BadInput(
            f"{file}: psi_d has shape {psi_d.shape}, psi_q {psi_q.shape}; they must be equal"
        )
    if d.ndim == q.ndim == 1 and psi_d.ndim == 2:
        d, q = _grid(d, q, psi_d, file, notes)
    if not d.shape == q.shape == psi_d.shape:
        raise BadInput(
            f"{file}: currents have shapes {d.shape} and {q.shape}, fluxes "
            f"{psi_d.shape}; they must be equal"
        )
    return _complex(d, q), _complex(psi_d, psi_q), d.shape


def _missing(name: str, data: Any, columns: Sequence[Column], file: str, known: list[str]) -> str:
    """Return what is wrong where a map has no usable array of a quantity."""
    short = next((c.name for c in columns if c.name in data and data[c.name].size <= 1), None)
    if short is not None:
        return (
            f"{file}: '{short}' has {data[short].size} values; a map needs at least {FEWEST} points"
        )
    remedy = f'name it in [flux_map], {name} = "..."'
    if name in ("i_d", "i_q"):
        remedy += (
            ', or current = "..." and advance = "..." (an amplitude, and how far it stands '
            "ahead of q)"
        )
    return (
        f"{file}: no '{name}' of numbers (or {', '.join(NAMES[name])}); it holds "
        f"{', '.join(known)[:80]}: {remedy}"
    )


def _complex(a: Array, b: Array) -> NDArray[np.complex128]:
    """Return a + jb, flat, an infinite part leaving the other as it is."""
    both = np.empty(a.size, dtype=complex)
    both.real, both.imag = a.ravel(), b.ravel()
    return both


def _grid(d: Array, q: Array, psi_d: Array, file: str, notes: list[str]) -> tuple[Array, Array]:
    """Return grids of currents for vectors of them, the map's first axis i_d, or i_q where only
    that fits.

    A square map says by itself: psi_d rises along i_d.
    """
    n, m = len(d), len(q)
    straight, across = psi_d.shape == (n, m), psi_d.shape == (m, n)
    if not straight and not across:
        raise BadInput(
            f"{file}: fluxes have shape {psi_d.shape}, axes of {n} (i_d) and {m} (i_q) "
            "currents fit neither way"
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


def _from_amplitude(
    data: Any, columns: Mapping[str, list[Column]], notes: list[str], file: str
) -> dict[str, Array]:
    """Return i_d, i_q of currents given by amplitude and angle (from q towards -d), nothing where
    they are not."""
    size, ahead = _first(data, columns["current"], "fiu"), _first(data, columns["advance"], "fiu")
    if size is None or ahead is None:
        return {}
    largest, unit = float(np.nanmax(np.abs(ahead))), ""
    if largest > math.tau:  # no unit said so
        ahead, unit = np.radians(ahead), f", in degrees, as it reaches {largest:.4g}"
    if size.ndim == ahead.ndim == 1 and size.size != ahead.size:
        size, ahead = np.meshgrid(size, ahead, indexing="ij")
    elif size.shape != ahead.shape:
        return {}
    notes.append(
        f"{file}: currents from amplitude and phase advance (0: on q, 90 degrees: on -d{unit})"
    )
    return {"i_d": -size * np.sin(ahead), "i_q": size * np.cos(ahead)}


def _over_angles(values: Array) -> Array:
    """Return means over a third axis, the rotor's angle, where there is one."""
    return np.asarray(np.mean(values, axis=2) if values.ndim == 3 else values)


def _once(
    i: NDArray[np.complex128],
    psi: NDArray[np.complex128],
    torque: Array | None,
    file: str,
    notes: list[str],
) -> tuple[NDArray[np.complex128], NDArray[np.complex128], Array | None, NDArray[np.int64]]:
    """Return each current once, with the mean of what stands at it, and where it stood first."""
    scale = float(np.max(np.abs(i[np.isfinite(i)]), initial=0.0)) or 1.0
    places = np.round(np.where(np.isfinite(i), i, 0.0) / scale, 7)
    _, first, of, count = np.unique(
        places, return_index=True, return_inverse=True, return_counts=True
    )
    if len(first) == len(i) or not np.all(np.isfinite(i)):
        return i, psi, torque, np.arange(len(i))
    notes.append(
        f"{file}: up to {int(count.max())} values at one current (angles of the rotor?); "
        "their mean is taken"
    )

    def mean(x: Array) -> Array:
        """Return the mean of what stands at one current."""
        return np.asarray(np.bincount(of.ravel(), x, len(first)) / count)

    order = np.argsort(first)  # as in the file
    both = mean(psi.real) + 1j * mean(psi.imag)
    torques = None if torque is None else mean(torque)[order]
    return i[first][order], both[order], torques, first[order]


def _first(data: Any, columns: Sequence[Column], kinds: str) -> Any:
    """Return the first usable array among some, in SI units and peak values; None where there is
    none."""
    for name, factor in columns:
        found = data.get(name)
        if found is not None and found.size > 1 and found.ndim <= 3 and found.dtype.kind in kinds:
            return found if factor == 1.0 else found * factor
    return None
