"""Arrays of numbers in one file: vectors by name, matrices column by column, their columns named by
the campaign."""

from __future__ import annotations

import zipfile
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import IO, Any

import numpy as np
from numpy.typing import NDArray

from model.arrays import npy_header, npy_values
from model.errors import BadInput, unknown
from model.number_table import Table
from sandbox.recordings.formats.log_table import MOST_VALUES, split_matrix, too_many


def matrices(
    file: str, arrays: Mapping[str, NDArray[Any]], names: Mapping[str, Sequence[str]]
) -> Table:
    """Return vectors under their names, columns of matrices as 'log(:,2)' or under the names given
    for `log`.

    BadInput where the names are more or fewer than the matrix has columns, or name no matrix.
    """
    columns: dict[str, NDArray[np.float64]] = {}
    for name, values in arrays.items():
        parts = split_matrix(name, values)
        given = names.get(name)
        if given is not None:
            if len(given) != len(parts):
                raise BadInput(
                    f"{file}: matrix '{name}' has {len(parts)} columns, {len(given)} "
                    "names are given; name each"
                )
            parts = dict(zip(given, parts.values(), strict=True))
        columns.update(parts)
    for name in names:
        if name not in arrays:
            raise BadInput(f"{file}: {unknown('matrix', name, arrays)}")
    return Table(columns, {}, {})


def numpy_arrays(path: Path) -> dict[str, NDArray[Any]]:
    """Return the arrays of numbers of a .npy file (named 'data') or an .npz file; BadInput for
    pickled objects."""
    found: dict[str, NDArray[Any]] = {}
    left, pickled = MOST_VALUES, False
    try:
        for name, file in _members(path):
            head = npy_header(file)
            pickled |= head.dtype.hasobject
            if head.is_numeric and head.dtype.kind in "fiu" and head.values:
                left -= head.values
                if left < 0:
                    raise too_many(path.name)
                found[name] = npy_values(file, head)
    except BadInput:
        raise
    except Exception as error:  # NumPy and zipfile raise whatever a damaged file leads them to
        why = f"cannot be read as NumPy's format ({str(error)[:80]}); save it again"
        raise BadInput(f"{path.name}: {why}") from None
    if not found and pickled:
        raise BadInput(
            f"{path.name}: it holds pickled objects, which could run code; save arrays "
            "of numbers, one matrix a run"
        )
    if not found:
        raise BadInput(f"{path.name}: no array of numbers in it; save the columns as one matrix")
    return found


def _members(path: Path) -> Iterator[tuple[str, IO[bytes]]]:
    """Yield the arrays of a file, opened: that of a .npy file, or those of an .npz file by name."""
    if not zipfile.is_zipfile(path):
        with path.open("rb") as single:
            yield "data", single
        return
    with zipfile.ZipFile(path) as archive:
        for info in archive.infolist():
            with archive.open(info) as member:
                yield info.filename.removesuffix(".npy"), member
