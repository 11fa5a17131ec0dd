"""Long CSV files: pyarrow reads their rows, in pieces, so that ten minutes at 10 kHz take seconds and no more memory
than their numbers."""

from __future__ import annotations

from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from sandbox.recordings.formats.log_table import MOST_VALUES, too_many

BLANK = ["", " ", "  "]
DUMMY = "\0"  # the cell that a separator at the end of each line makes


class Layout(NamedTuple):
    """How a text's table is laid out: units, names, separator, lines above the first row, cells of that row, and
    whether the decimal mark is a comma."""

    units: dict[str, str]
    names: list[str]
    separator: str
    above: int
    row: list[str]
    comma: bool


def read_rows(path: Path, layout: Layout) -> dict[str, NDArray[np.float64]] | None:
    """Return the columns of a text file, empty cells as NaN; None where a row holds something else than numbers.

    BadInput for more than MOST_VALUES values.
    """
    from pyarrow import ArrowException, csv, float64, string

    names = layout.names
    more = [DUMMY] if len(layout.row) == len(names) + 1 else []
    kinds = {**dict.fromkeys(names, float64()), **dict.fromkeys(more, string())}
    options = csv.ConvertOptions(
        column_types=kinds, null_values=BLANK, strings_can_be_null=True, decimal_point="," if layout.comma else "."
    )
    parse = csv.ParseOptions(delimiter=layout.separator)
    pieces: list[list[NDArray[np.float64]]] = [[] for _ in names]
    rows = 0
    try:
        reading = csv.ReadOptions(column_names=[*names, *more], skip_rows=layout.above, use_threads=False)
        for batch in csv.open_csv(path, reading, parse, options):
            rows += batch.num_rows
            if rows * len(names) > MOST_VALUES:
                raise too_many(path.name)
            if more and batch.columns[-1].null_count < batch.num_rows:
                return None
            for piece, column in zip(pieces, batch.columns[: len(names)], strict=True):
                piece.append(np.asarray(column.to_numpy(zero_copy_only=False), dtype=np.float64))
    except ArrowException:
        return None
    return {name: np.concatenate(piece) for name, piece in zip(names, pieces, strict=True)} if rows else None
