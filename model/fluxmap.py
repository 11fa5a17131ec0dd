"""Flux maps: what a bench or finite elements give over the current plane, read from .npz, .mat and
.csv files.

Everything in the rotor frame with the magnet on +d (the axis the energy is symmetric about),
amplitude-invariant. A map whose magnet lies elsewhere (SyR-e's PM-assisted reluctance motors:
on -q) is turned at the door.
"""

from __future__ import annotations

import csv
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from model.array_types import Array
from model.arrays import Arrays, read_arrays
from model.errors import BadInput, brief
from model.map_names import NAMES

TURNS = {"d": 1.0, "q": -1j, "-d": -1.0, "-q": 1j}  # what brings the magnet's axis onto +d
MOST_POINTS = 20_000  # of a map: what a fit needs a gigabyte for
# of an array: a map may hold an angle of the rotor as a further axis
MOST_VALUES = 40 * MOST_POINTS
# A and Wb: of the largest current and flux of any machine
SIZES = {"i": (1e-6, 1e6), "psi": (1e-9, 1e4)}
REAL = "fiu"


@dataclass(frozen=True)
class FluxMap:
    """Total flux linkages (Wb) over a rectangular grid of currents (A): i_d (n,), i_q (m,), the
    rest (n, m)."""

    name: str
    i_d: Array
    i_q: Array
    psi_d: Array
    psi_q: Array
    torque: Array | None = None  # N m, measured or computed

    def __post_init__(self) -> None:
        shape = (len(self.i_d), len(self.i_q))
        for name in ("psi_d", "psi_q", "torque"):
            values = getattr(self, name)
            if values is None:
                continue
            if values.shape != shape:
                raise BadInput(
                    f"map '{self.name}': {name} has shape {values.shape}, the grid of "
                    f"currents {shape}"
                )
            if not np.all(np.isfinite(values)):
                k = tuple(int(n) for n in np.argwhere(~np.isfinite(values))[0])
                raise BadInput(
                    f"map '{self.name}': {name} is {values[k]} at i_d = {self.i_d[k[0]]:.4g} A, "
                    f"i_q = {self.i_q[k[1]]:.4g} A; give finite values"
                )
        if any(a.ndim != 1 or not np.all(np.isfinite(a)) for a in (self.i_d, self.i_q)):
            raise BadInput(
                f"map '{self.name}': the axes of currents must be finite numbers, one row each"
            )
        if np.any(np.diff(self.i_d) <= 0) or np.any(np.diff(self.i_q) <= 0) or min(shape) < 3:
            raise BadInput(
                f"map '{self.name}': currents must rise strictly along both axes, at "
                f"least 3 each (got {shape})"
            )

    def points(self) -> tuple[Array, Array, Array, Array]:
        """Return psi_d, psi_q, i_d, i_q of all grid points, flat."""
        x, y = np.meshgrid(self.i_d, self.i_q, indexing="ij")
        return self.psi_d.ravel(), self.psi_q.ravel(), x.ravel(), y.ravel()

    def every(self, step: int) -> FluxMap:
        """Return the map on every step-th grid line."""
        t = None if self.torque is None else self.torque[::step, ::step]
        grid = (
            self.i_d[::step],
            self.i_q[::step],
            self.psi_d[::step, ::step],
            self.psi_q[::step, ::step],
        )
        return FluxMap(self.name, *grid, t)


def read_map(path: str | Path, magnet: str = "d") -> FluxMap:
    """Read a flux map; `magnet` is the axis of the file's frame the magnet lies on: 'd', 'q', '-d'
    or '-q'.

    Accepts .npz and .mat with complex (i_s_dq, psi_s_dq) or real arrays (NAMES), 1-D axes or full
    grids, and .csv with a header of those names.  Raises BadInput for a missing quantity, a ragged
    grid or numbers not finite.
    """
    path = Path(path)
    check_axis(magnet)
    data, names = read_arrays(path, {n for known in NAMES.values() for n in known}, MOST_VALUES)
    i, psi = _complex(data, "i", path, names), _complex(data, "psi", path, names)
    torque = _first(data, "torque", REAL)
    check_size(path.name, "currents", i, SIZES["i"], "A")
    if psi.shape != i.shape:
        raise BadInput(
            f"{path.name}: fluxes have shape {psi.shape}, currents {i.shape}; they must be equal"
        )
    check_size(path.name, "fluxes", psi, SIZES["psi"], "Wb")
    if torque is not None and torque.size != i.size:
        torque = None
    turn = TURNS[magnet]
    with np.errstate(invalid="ignore"):
        # single fluxes that are not finite are named where they stand on the grid
        i, psi = turn * i, turn * psi
    return _gridded(path.stem, i.ravel(), psi.ravel(), None if torque is None else torque.ravel())


def check_axis(magnet: object) -> None:
    """Raise BadInput for an axis that is none of 'd', 'q', '-d', '-q'."""
    if not isinstance(magnet, str) or magnet not in TURNS:
        raise BadInput(f"magnet axis {brief(magnet)} is not known; give one of {', '.join(TURNS)}")


def check_size(
    file: str, what: str, values: NDArray[np.complex128], sizes: tuple[float, float], unit: str
) -> None:
    """Raise BadInput where numbers are not finite, or the largest is no current or flux of any
    machine."""
    good = values[np.isfinite(values)]
    if good.size < values.size and (
        unit == "A" or not good.size
    ):  # single fluxes are named where they stand on the grid
        left = values.size - good.size
        raise BadInput(
            f"{file}: {left} of {values.size} {what} are not finite; give a number at every point"
        )
    largest = float(max(np.max(np.abs(good.real)), np.max(np.abs(good.imag))))
    if not sizes[0] <= largest <= sizes[1]:
        raise BadInput(
            f"{file}: the largest of the {what} is {largest:.3g} {unit}, not in "
            f"[{sizes[0]:g}, {sizes[1]:g}]"
        )


def write_map(path: str | Path, m: FluxMap) -> None:
    """Write a map as .npz (complex, motulator's names), .mat (SyR-e's names) or .csv; BadInput for
    another suffix."""
    path = Path(path)
    psi_d, psi_q, i_d, i_q = m.points()
    if path.suffix == ".npz":
        body: dict[str, Any] = {
            "i_s_dq": (i_d + 1j * i_q).reshape(m.psi_d.shape),
            "psi_s_dq": m.psi_d + 1j * m.psi_q,
        }
        if m.torque is not None:
            body["tau"] = m.torque
        np.savez(path, **body)
    elif path.suffix == ".mat":
        from scipy.io import savemat

        shape = m.psi_d.shape
        body = {"Id": i_d.reshape(shape), "Iq": i_q.reshape(shape), "Fd": m.psi_d, "Fq": m.psi_q}
        savemat(path, {**body, **({} if m.torque is None else {"T": m.torque})})
    elif path.suffix == ".csv":
        columns = [i_d, i_q, psi_d, psi_q] + ([] if m.torque is None else [m.torque.ravel()])
        head = ["i_d", "i_q", "psi_d", "psi_q", "torque"][: len(columns)]
        with path.open("w", newline="", encoding="utf-8") as file:
            csv.writer(file).writerows(
                [head, *(map(repr, map(float, row)) for row in zip(*columns, strict=True))]
            )
    else:
        raise BadInput(
            f"map '{path.name}': suffix '{path.suffix}' is not known; use .npz, .mat or .csv"
        )


def _first(data: Arrays, quantity: str, kinds: str) -> Any:
    for name in NAMES[quantity]:
        if (
            name in data
            and data[name].size > 1
            and data[name].ndim <= 2
            and data[name].dtype.kind in kinds
        ):
            return data[name]
    return None


def _complex(data: Arrays, quantity: str, path: Path, names: list[str]) -> NDArray[np.complex128]:
    whole = _first(data, quantity, "c")
    if whole is not None:
        return np.asarray(whole, dtype=complex)
    d, q = _first(data, f"{quantity}_d", REAL), _first(data, f"{quantity}_q", REAL)
    for name, values in ((f"{quantity}_d", d), (f"{quantity}_q", q)):
        if values is None:
            raise BadInput(
                f"{path.name}: no '{name}' of numbers (or {', '.join(NAMES[name])}); it "
                f"holds {', '.join(names)[:80]}"
            )
    if (
        quantity == "i"
        and d.ndim == q.ndim == 1
        and np.shape(_first(data, "psi_d", REAL)) == (len(d), len(q))
    ):
        d, q = np.meshgrid(d, q, indexing="ij")
    if d.shape != q.shape:
        raise BadInput(
            f"{path.name}: {quantity}_d has shape {d.shape}, {quantity}_q {q.shape}; "
            "they must be equal"
        )
    both = np.empty(d.shape, dtype=complex)  # not d + 1j q: an infinite q would spoil d, too
    both.real, both.imag = d, q
    return both


def _gridded(
    name: str, i: NDArray[np.complex128], psi: NDArray[np.complex128], torque: Any
) -> FluxMap:
    """Return the points ordered on their rectangular grid of currents."""
    scale = float(np.max(np.abs(i))) or 1.0
    axes = [np.unique(np.round(x / scale, 7)) for x in (i.real, i.imag)]
    n, m = len(axes[0]), len(axes[1])
    if n * m != len(i):
        raise BadInput(
            f"map '{name}': {len(i)} points do not fill a grid of {n} x {m} currents; "
            "give a rectangular grid"
        )
    order = np.lexsort((np.round(i.imag / scale, 7), np.round(i.real / scale, 7)))
    square = i[order].reshape(n, m)
    psi = psi[order].reshape(n, m)
    grid = (square.real.mean(axis=1), square.imag.mean(axis=0), psi.real.copy(), psi.imag.copy())
    return FluxMap(name, *grid, None if torque is None else torque[order].reshape(n, m))
