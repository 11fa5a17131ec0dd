"""Columns of a result as tables: pyarrow, pandas, Parquet and CSV, every column with its unit."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from model.errors import BadInput
from sandbox.output.files import plain

if TYPE_CHECKING:
    import pandas
    import pyarrow


class Column(NamedTuple):
    """One column of a table: its values (numbers, texts, truth values; None where undefined) and
    their unit."""

    values: Any
    unit: str = ""


def table_of(columns: Mapping[str, Column]) -> pyarrow.Table:
    """Return columns as a pyarrow table; a field's metadata holds its unit where it has one."""
    import pyarrow as pa

    arrays, schema = [], []
    for name, (values, unit) in columns.items():
        array = pa.array(values if isinstance(values, np.ndarray) else plain(list(values)))
        if pa.types.is_null(array.type):  # a column that is undefined throughout
            array = array.cast(pa.float64())
        arrays.append(array)
        schema.append(pa.field(name, array.type, metadata={"unit": unit} if unit else None))
    return pa.Table.from_arrays(arrays, schema=pa.schema(schema))


def unit_of(field: pyarrow.Field) -> str:
    """Return the unit of a column, empty where it has none."""
    return str((field.metadata or {}).get(b"unit", b"").decode())


def columns_of(rows: Sequence[Mapping[str, Any]], units: Mapping[str, str]) -> dict[str, Column]:
    """Return rows (all of the same keys) as columns with units."""
    names = list(rows[0]) if rows else list(units)
    return {name: Column([row[name] for row in rows], units.get(name, "")) for name in names}


def frame_of(table: pyarrow.Table) -> pandas.DataFrame:
    """Return a table as a pandas data frame, units in `.attrs["units"]`; BadInput where pandas is
    missing."""
    try:
        import pandas  # noqa: F401 - pyarrow's own message is longer
    except ImportError:
        raise BadInput(
            "a data frame needs pandas; install it with `pip install pandas`, or take .to_table()"
        ) from None
    frame = table.to_pandas()
    frame.attrs["units"] = {f.name: unit_of(f) for f in table.schema if unit_of(f)}
    return frame


def together(frames: Mapping[str, pandas.DataFrame]) -> pandas.DataFrame:
    """Return data frames below each other, a first column `file` telling them apart."""
    import pandas

    whole = pandas.concat(
        [frame.assign(file=name) for name, frame in frames.items()], ignore_index=True
    )
    whole.insert(0, "file", whole.pop("file"))
    whole.attrs["units"] = {
        k: v for frame in frames.values() for k, v in frame.attrs["units"].items()
    }
    return whole


def write_table(path: Path, table: pyarrow.Table) -> None:
    """Write a table as Parquet or, by the suffix, as CSV (its heads with units: `i_d (A)`)."""
    if path.suffix == ".csv":
        from pyarrow import csv

        heads = [f"{f.name} ({unit_of(f)})" if unit_of(f) else f.name for f in table.schema]
        csv.write_csv(table.rename_columns(heads), path)
    else:
        from pyarrow import parquet

        parquet.write_table(table, path, write_page_checksum=True)
