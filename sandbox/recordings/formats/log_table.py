"""What readers of logs share: how much is read, matrices as columns, signals on one raster."""

from __future__ import annotations

import contextlib
import logging
import warnings
from collections.abc import Iterable, Iterator, Mapping

import numpy as np
from numpy.typing import NDArray

from model.array_types import Array
from model.errors import BadInput

# of one file, all columns together: 10 minutes of 16 columns at 10 kHz, 0.8 GB
MOST_VALUES = 100_000_000


def missing(file: str, package: str, extra: str, what: str) -> BadInput:
    """Return the refusal of a file whose reader is an extra that is not installed."""
    return BadInput(
        f"{file}: reading {what} needs {package}; install it with pip install "
        f"'sensorless-sandbox[{extra}]'"
    )


def too_many(file: str) -> BadInput:
    """Return the refusal of a file with more than MOST_VALUES values."""
    return BadInput(
        f"{file}: more than {MOST_VALUES / 1e6:g} million values; keep the columns "
        "needed, or cut the log"
    )


def first_beyond(values: Array, largest: float) -> int | None:
    """Return the first row that is no number, or larger in size than any that is measured; None
    where all are good."""
    if not len(values) or (np.min(values) >= -largest and np.max(values) <= largest):
        # usual, and takes no memory
        return None
    return int(np.argmin(np.abs(values) <= largest))


@contextlib.contextmanager
def silent() -> Iterator[None]:
    """Keep a reader's own warnings about a damaged file from the terminal: what is wrong is said in
    our sentence."""
    before = logging.root.manager.disable
    logging.disable(logging.CRITICAL)
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            yield
    finally:
        logging.disable(before)


def column_names(matrix: str, count: int) -> list[str]:
    """Return the names of a matrix's columns where nobody names them: as MATLAB writes them,
    log(:,1), log(:,2), ..."""
    return [f"{matrix}(:,{k})" for k in range(1, count + 1)]


def split_matrix(name: str, values: NDArray[np.generic]) -> dict[str, Array]:
    """Return a matrix (n, k), or lying (k, n), as k columns; a vector under its own name; nothing
    for other shapes."""
    values = np.squeeze(values)
    if values.ndim == 1:
        return {name: values.astype(np.float64)}
    if values.ndim != 2 or not values.size:
        return {}
    upright = values if values.shape[0] >= values.shape[1] else values.T
    names = column_names(name, upright.shape[1])
    return {n: upright[:, k].astype(np.float64) for k, n in enumerate(names)}


def on_one_raster(
    file: str, signals: Mapping[str, tuple[Array, Array]], first: Iterable[str] = ()
) -> tuple[dict[str, Array], list[tuple[str, str]]]:
    """Return signals (stamps in s, values) on the densest raster among them, its stamps as 't', and
    notes.

    `first`: names among which the raster is chosen where they are there.  A signal of another
    raster is interpolated linearly (at jumps of an angle that wraps: the nearer sample is taken);
    rows outside the time that all share go.
    """
    usable = {n: s for n, s in signals.items() if len(s[0]) == len(s[1]) and len(s[0]) > 1}
    for name, (stamps, _) in usable.items():
        if not (np.all(np.isfinite(stamps)) and np.all(np.diff(stamps) >= 0.0)):
            raise BadInput(
                f"{file}: the stamps of '{name}' go back or are none; export the log "
                "again, in order"
            )
    if not usable:
        raise BadInput(f"{file}: no signal with at least 2 samples; record longer")
    among = [n for n in first if n in usable] or list(usable)
    leader = max(among, key=lambda n: len(usable[n][0]))
    grid = usable[leader][0]
    begin = max(float(s[0][0]) for s in usable.values())
    end = min(float(s[0][-1] + np.median(np.diff(s[0]))) for s in usable.values())
    inside = (grid >= begin - 1e-9) & (grid < end + 1e-9)
    if np.count_nonzero(inside) < 2:
        raise BadInput(
            f"{file}: the signals share no stretch of time; export them from one measurement"
        )
    columns, notes = {"t": grid[inside]}, []
    for name, (stamps, values) in usable.items():
        if len(stamps) == len(grid) and np.allclose(stamps, grid, rtol=0.0, atol=1e-9):
            columns[name] = values[inside]
            continue
        columns[name] = _interpolated(grid[inside], stamps, values)
        every = float(np.median(np.diff(stamps)))
        text = (
            f"{file}: '{name}' has a raster of its own ({len(stamps)} samples, {every:.3g} s "
            f"apart); interpolated onto that of '{leader}' ({len(grid)} samples)"
        )
        notes.append((name, text))
    return columns, notes


def _interpolated(grid: Array, stamps: Array, values: Array) -> Array:
    out = np.interp(grid, stamps, values)
    place = np.clip(np.searchsorted(stamps, grid, side="right") - 1, 0, len(stamps) - 2)
    if not np.all(np.isfinite(values)):
        return np.asarray(out)
    span = float(np.ptp(values))
    wraps = np.abs(np.diff(values)) > 0.7 * span
    if span > 0.0 and np.any(wraps) and len(values) > 10 and np.mean(wraps) < 0.2:
        nearer = place + (grid - stamps[place] > stamps[place + 1] - grid)
        out = np.where(wraps[place], values[nearer], out)
    return out
