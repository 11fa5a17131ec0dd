"""Long CSV files: pyarrow reads their rows, in pieces, so that ten minutes at 10 kHz take seconds and no more memory
than their numbers."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from sandbox.recordings.formats.log_table import MOST_VALUES, too_many

DUMMY = "\0"  # the cell that a separator at the end of each line makes


def read_rows(
    path: Path, names: Sequence[str], separator: str, above: int, row: Sequence[str]
) -> dict[str, NDArray[np.float64]] | None:
    """Return the columns of a text file, empty cells as NaN; None where a row holds something else than numbers.

    above: lines over the first row of data; row: the cells of that one.  BadInput for more than MOST_VALUES values.
    """
    from pyarrow import ArrowException, csv, float64

    cells = [*names, DUMMY] if len(row) == len(names) + 1 else list(names)
    comma = separator != "," and any("," in cell for cell in row)
    options = csv.ConvertOptions(
        column_types=dict.fromkeys(names, float64()), include_columns=list(names), null_values=[""],
        decimal_point="," if comma else ".",
    )  # fmt: skip
    parse = csv.ParseOptions(delimiter=separator)
    pieces: list[list[NDArray[np.float64]]] = [[] for _ in names]
    rows = 0
    try:
        reading = csv.ReadOptions(column_names=cells, skip_rows=above, use_threads=False)
        for batch in csv.open_csv(path, reading, parse, options):
            rows += batch.num_rows
            if rows * len(names) > MOST_VALUES:
                raise too_many(path.name)
            for piece, column in zip(pieces, batch.columns, strict=True):
                piece.append(np.asarray(column.to_numpy(zero_copy_only=False), dtype=np.float64))
    except ArrowException:
        return None
    return {name: np.concatenate(piece) for name, piece in zip(names, pieces, strict=True)} if rows else None
