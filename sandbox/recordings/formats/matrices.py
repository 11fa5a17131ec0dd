"""Arrays of numbers in one file: vectors by name, matrices column by column, their columns named by the campaign."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from model.errors import BadInput, unknown
from sandbox.recordings.formats.log_table import MOST_VALUES, Table, split_matrix


def matrices(file: str, arrays: Mapping[str, NDArray[Any]], names: Mapping[str, Sequence[str]]) -> Table:
    """Return vectors under their names, columns of matrices as 'log(:,2)' or under the names given for `log`.

    BadInput where the names are more or fewer than the matrix has columns, or name no matrix.
    """
    columns: dict[str, NDArray[np.float64]] = {}
    for name, values in arrays.items():
        parts = split_matrix(name, values)
        given = names.get(name)
        if given is not None:
            if len(given) != len(parts):
                raise BadInput(
                    f"{file}: matrix '{name}' has {len(parts)} columns, {len(given)} names are given; name each"
                )
            parts = dict(zip(given, parts.values(), strict=True))
        columns.update(parts)
    for name in names:
        if name not in arrays:
            raise BadInput(f"{file}: {unknown('matrix', name, arrays)}")
    return Table(columns, {}, {})


def numpy_arrays(path: Path) -> dict[str, NDArray[Any]]:
    """Return the arrays of numbers of a .npy file (named 'data') or an .npz file; BadInput for pickled objects."""
    try:
        with path.open("rb") as file:
            found = np.load(file, allow_pickle=False)
            single = isinstance(found, np.ndarray)
            arrays = {"data": found} if single else {str(n): found[n] for n in found.files}
    except Exception as error:  # NumPy raises whatever a damaged file leads it to
        raise BadInput(f"{path.name}: {_why(error)}") from None
    kept = {n: a for n, a in arrays.items() if a.dtype.kind in "fiu" and 0 < a.size <= MOST_VALUES}
    if not kept:
        raise BadInput(f"{path.name}: no array of numbers in it; save the columns as one matrix")
    return kept


def _why(error: Exception) -> str:
    if "pickle" in str(error):
        return "it holds pickled objects, which could run code; save arrays of numbers, one matrix a run"
    return f"cannot be read as NumPy's format ({str(error)[:80]}); save it again"
