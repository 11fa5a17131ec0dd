"""Tables of recordings read from Parquet."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

import numpy as np

from model.array_types import Array
from model.errors import BadInput
from sandbox.recordings.formats.log_table import MOST_VALUES, too_many

ROWS = 1 << 18  # read at a time: what is decoded besides the columns themselves
BUFFER = 1 << 20  # bytes of the file held at a time
INDEX = re.compile(r"__index_level_\d+__")  # an unnamed index as pandas saves it


def check_table(path: Path) -> None:
    """Raise BadInput unless a recording's table is a file."""
    if not path.is_file():
        what = (
            "is a folder or a pipe, no file"
            if path.exists()
            else f"does not exist in '{path.parent}'"
        )
        raise BadInput(
            f"{path.name}: the file {what}; correct [[recording]]".replace("the file is", "it is")
        )


def _column(file: Any, name: str, kind: Any, rows: int) -> Array:
    """Return a column's numbers; NaN where there is none, instants and spans of time in the unit
    they are kept in."""
    from pyarrow import types

    out, n = np.full(rows, np.nan), 0
    if types.is_null(kind):
        return out
    for batch in file.iter_batches(ROWS, columns=[name], use_threads=False):
        column = batch.column(0)
        if column.null_count == 0 and (types.is_integer(kind) or types.is_floating(kind)):
            out[n : n + len(column)] = np.from_dlpack(column)  # `to_numpy` loads pandas
            n += len(column)
            continue
        if types.is_time(kind):  # of a day: NumPy has no kind for it
            column = column.cast(f"int{kind.bit_width}")
        part = column.to_numpy(zero_copy_only=False)
        numbers = np.asarray(part, dtype=np.float64)
        if part.dtype.kind in "mM":  # no instant is a whole number there
            numbers[np.isnat(part)] = np.nan
        out[n : n + len(part)] = numbers
        n += len(part)
    if n != rows:
        raise ValueError(f"column '{name}' has {n} rows, the file's end says {rows}")
    return out


def _kinds(file: str, schema: Any) -> dict[str, Any]:
    """Return the kinds of a table's columns by name; BadInput where one holds no numbers, or a name
    stands twice."""
    from pyarrow import types

    numbers = (
        types.is_integer,
        types.is_floating,
        types.is_boolean,
        types.is_decimal,
        types.is_temporal,
    )
    for name, kind in zip(schema.names, schema.types, strict=True):
        if schema.names.count(name) > 1:
            raise BadInput(f"{file}: column '{name}' stands twice; give each column its own name")
        if (
            not types.is_null(kind)
            and not any(fits(kind) for fits in numbers)
            and not INDEX.fullmatch(name)
        ):
            raise BadInput(
                f"{file}: column '{name}' holds {str(kind)[:40]}, no numbers; leave it away"
            )
    kinds = zip(schema.names, schema.types, strict=True)
    return {n: k for n, k in kinds if not INDEX.fullmatch(n) or any(fits(k) for fits in numbers)}


def read_parquet(path: Path) -> dict[str, Array]:
    """Return a Parquet table's columns, float64; BadInput where it is no table of numbers."""
    check_table(path)
    try:
        import pyarrow
        from pyarrow import parquet
    except ImportError:
        raise BadInput(
            f"{path.name}: reading Parquet needs pyarrow; install it with 'pip install pyarrow'"
        ) from None
    try:
        with parquet.ParquetFile(path, buffer_size=BUFFER, page_checksum_verification=True) as file:
            rows = file.metadata.num_rows
            if rows * len(file.schema_arrow.names) > MOST_VALUES:
                raise too_many(path.name)
            return {
                n: _column(file, n, kind, rows)
                for n, kind in _kinds(path.name, file.schema_arrow).items()
            }
    except BadInput:
        raise
    except (pyarrow.ArrowException, OSError, TypeError, ValueError) as error:
        said = str(error).splitlines()[0].rstrip(".")[:200]
        raise BadInput(
            f"{path.name}: not a Parquet table of numbers ({said}); export it again, or as CSV"
        ) from None
