"""MATLAB's .mat files of version 7.3, which are HDF5; h5py reads them (extra `hdf5`)."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from model.errors import BadInput
from sandbox.recordings.formats.log_table import missing

DEEPEST = 4  # structures in structures
MOST_ENTRIES = 10_000


def is_hdf5(path: Path) -> bool:
    """Tell whether a .mat file is of version 7.3."""
    with path.open("rb") as file:
        begin = file.read(16)
    return begin.startswith((b"MATLAB 7.3", b"\x89HDF"))


def read_hdf5(path: Path, most: int) -> dict[str, NDArray[Any]]:
    """Return the arrays of numbers by name, those of structures as 'structure.field', `most` bytes
    at most.

    MATLAB stores columns first: arrays come out as MATLAB shows them.  BadInput for a damaged file
    or without h5py.
    """
    try:
        import h5py
    except ImportError:
        raise missing(path.name, "h5py", "hdf5", "MAT version 7.3") from None
    found: dict[str, NDArray[Any]] = {}
    try:
        with h5py.File(path, "r") as file:
            _collect(file, "", found, [most, MOST_ENTRIES], DEEPEST, h5py)
    except BadInput:
        raise
    except Exception as error:  # h5py raises whatever a damaged file leads it to
        why = (str(error).splitlines() or [type(error).__name__])[0]
        raise BadInput(
            f"{path.name}: cannot be read as MAT 7.3 ({why[:80]}); save it again, or with -v7"
        ) from None
    return found


def _collect(
    group: Any,
    prefix: str,
    found: dict[str, NDArray[Any]],
    left: list[int],
    deepest: int,
    h5py: Any,
) -> None:
    """Add a group's arrays of numbers; left: bytes and entries that may still be read."""
    for name in group:
        left[1] -= 1
        if name.startswith("#") or left[1] < 0:  # MATLAB's own room for cells
            continue
        item = group[name]
        if isinstance(item, h5py.Group) and deepest:
            _collect(item, f"{prefix}{name}.", found, left, deepest - 1, h5py)
        elif (
            isinstance(item, h5py.Dataset)
            and item.dtype.kind in "fiu"
            and 1 <= len(item.shape) <= 2
        ):
            size = int(np.prod(item.shape)) * 8
            left[0] -= size
            if left[0] < 0:
                name = group.file.filename.rpartition("/")[2]
                raise BadInput(f"{name}: too large to be read; keep the columns needed")
            found[prefix + name] = np.asarray(item[()]).T
