"""Tables of recordings read from Parquet, and commands as volts, whatever they were written as."""

from __future__ import annotations

import dataclasses
from pathlib import Path
from typing import Any, TypeVar

import numpy as np
from numpy.typing import NDArray

from model.errors import BadInput
from model.parameters import Converter
from sandbox.recordings.formats.log_table import MOST_VALUES, too_many

Array = NDArray[np.float64]
Recording = TypeVar("Recording", bound=Any)


def with_volts(r: Recording, converter: Converter) -> Recording:
    """Return a `CampaignRecording` whose commands are in volts that the drive divides by u_dc (`Converter.command`)."""
    if converter.command == "volts":
        return r
    factor = r.u_dc if converter.command == "duties" else r.u_dc / (r.dc_bus_voltage or converter.dc_bus_voltage)
    volts = {name: factor * r[name] for name in ("u_alpha", "u_beta")}
    return dataclasses.replace(r, columns={**r.columns, **volts})


def check_table(path: Path) -> None:
    """Raise BadInput unless a recording's table is a file."""
    if not path.is_file():
        what = "is a folder or a pipe, no file" if path.exists() else f"does not exist in '{path.parent}'"
        raise BadInput(f"{path.name}: the file {what}; correct [[recording]]".replace("the file is", "it is"))


def _column(values: Any) -> Array:
    """Return a column's numbers; NaN where there is none, instants and spans of time in the unit they are kept in."""
    from pyarrow import types

    if types.is_null(values.type):
        return np.full(len(values), np.nan)
    return np.asarray(values.to_numpy(), dtype=np.float64)


def read_parquet(path: Path) -> dict[str, Array]:
    """Return a Parquet table's columns, float64; BadInput where it is no table of numbers."""
    check_table(path)
    try:
        import pyarrow
        from pyarrow import parquet, types
    except ImportError:
        raise BadInput(f"{path.name}: reading Parquet needs pyarrow; install it with 'pip install pyarrow'") from None
    try:
        with parquet.ParquetFile(path, page_checksum_verification=True) as file:
            schema = file.schema_arrow
            if file.metadata.num_rows * len(schema.names) > MOST_VALUES:
                raise too_many(path.name)
            numbers = (types.is_integer, types.is_floating, types.is_boolean, types.is_decimal, types.is_temporal)
            for name, kind in zip(schema.names, schema.types, strict=True):
                if schema.names.count(name) > 1:
                    raise BadInput(f"{path.name}: column '{name}' stands twice; give each column its own name")
                if not types.is_null(kind) and not any(fits(kind) for fits in numbers):
                    raise BadInput(f"{path.name}: column '{name}' holds {str(kind)[:40]}, no numbers; leave it away")
            return {n: _column(file.read([n])[n]) for n in schema.names}
    except BadInput:
        raise
    except (pyarrow.ArrowException, OSError, TypeError, ValueError) as error:
        raise BadInput(f"{path.name}: not a Parquet table of numbers ({str(error).splitlines()[0]})") from None
