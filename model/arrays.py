"""Arrays of numbers from .npz, .mat, texts and workbooks of others: nothing in them is run, nothing
too large is read.

Pickled objects, texts and structures are passed over.  Sizes are read from the headers before any
data are.
"""

from __future__ import annotations

import io
import math
import re
import warnings
import zipfile
from collections.abc import Collection
from pathlib import Path
from typing import IO, Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from model.errors import BadInput, unknown
from model.given import check_given
from model.matfile import read_mat
from model.number_table import Table
from model.text_table import read_text
from model.units import KNOWN, PEAK, UNITS
from model.workbook import read_workbook

TEXTS = (".csv", ".txt", ".tsv", ".dat")
MOST_BYTES = {  # of a file; of an .npz only part is read
    ".npz": 256_000_000,
    ".mat": 64_000_000,
    ".xlsx": 32_000_000,
    **dict.fromkeys(TEXTS, 32_000_000),
}
MAGIC = 8  # bytes with which NumPy's format begins, its version among them
NUMBERS = "fiuc"  # kinds of NumPy arrays that are read

# what brackets say beside units
NO_UNIT = re.compile(
    "(peak|pk|amplitude|rms|mean|av|avg|average|max|raw|vec|vector|map|grid|table|data|index)",
    re.IGNORECASE,
)

MOST_HEADER = 10_000  # bytes that describe an array of NumPy's
MOST_COLUMNS = 100
MOST_AXES = 3

Arrays = dict[str, NDArray[Any]]


class ArrayHeader(NamedTuple):
    """What NumPy's format says of an array before its values."""

    shape: tuple[int, ...]
    column_major: bool
    dtype: np.dtype[Any]

    @property
    def values(self) -> int:
        """Return how many values there are."""
        return math.prod(self.shape)

    @property
    def is_numeric(self) -> bool:
        """Tell whether the values are plain numbers."""
        return (
            not self.dtype.hasobject
            and self.dtype.kind in NUMBERS
            and min(self.shape, default=0) >= 0
        )


def read_arrays(path: Path, wanted: Collection[str], most: int) -> tuple[Arrays, list[str]]:
    """Return the wanted arrays of numbers, of at most MOST_AXES axes and `most` values, and the
    names of all.

    Raises BadInput for a file that is absent, too large, damaged or of another kind.
    """
    readers = {".npz": _npz, ".mat": _mat, **dict.fromkeys((*TEXTS, ".xlsx"), _text)}
    if path.suffix.lower() not in readers:
        raise BadInput(
            f"map '{path.name}': suffix '{path.suffix}' is not known; use .npz, .mat, .csv or .xlsx"
        )
    if not check_given(
        path, MOST_BYTES[path.suffix.lower()], "give a flux map (.npz, .mat, .csv, .xlsx) alone"
    ):
        raise BadInput(f"{path.name} is empty; give a flux map (.npz, .mat, .csv or .xlsx)")
    try:
        with warnings.catch_warnings():
            # of a table's odd lines: what is missing is named below
            warnings.simplefilter("ignore")
            return readers[path.suffix.lower()](path, wanted, most)
    except BadInput:
        raise
    except Exception as error:  # the libraries raise whatever a damaged file leads them to
        why = str(error)[:120] or type(error).__name__
        raise BadInput(
            f"{path.name}: cannot be read as a flux map ({why}); export it again"
        ) from None


def _check(path: Path, name: str, shape: tuple[int, ...], most: int) -> None:
    values = 1
    for n in shape:
        values *= int(n)
    if not 0 <= values <= most or min(shape, default=0) < 0:
        raise BadInput(
            f"{path.name}: '{name}' has shape {shape}; at most {most} values are read, "
            "keep every second line"
        )


def npy_header(file: IO[bytes]) -> ArrayHeader:
    """Read what stands before an array's values in NumPy's format; ValueError where that is damaged
    or too long."""
    begin = file.read(MAGIC)
    version = np.lib.format.read_magic(io.BytesIO(begin))
    size = file.read(2 if version == (1, 0) else 4)
    length = int.from_bytes(size, "little")
    if length > MOST_HEADER:  # NumPy itself reads it whole before it looks
        raise ValueError(f"a header of {length} bytes")
    header = io.BytesIO(size + file.read(length))
    old = version == (1, 0)
    read = np.lib.format.read_array_header_1_0 if old else np.lib.format.read_array_header_2_0
    return ArrayHeader(*read(header, max_header_size=MOST_HEADER))


def npy_values(file: IO[bytes], head: ArrayHeader) -> NDArray[Any]:
    """Return the values that follow a header; ValueError where the file ends before them."""
    data = file.read(head.values * head.dtype.itemsize)
    # of a bytearray, so that it may be written to: kernels are compiled once more for arrays that
    # are read-only
    array = np.frombuffer(bytearray(data), dtype=head.dtype, count=head.values)
    return array.reshape(head.shape, order="F" if head.column_major else "C")


def _npz(path: Path, wanted: Collection[str], most: int) -> tuple[Arrays, list[str]]:
    found: Arrays = {}
    with zipfile.ZipFile(path) as archive:
        members = {info.filename.removesuffix(".npy"): info for info in archive.infolist()}
        for name in set(members) & set(wanted):
            with archive.open(members[name]) as file:
                head = npy_header(file)
                if not head.is_numeric or len(head.shape) > MOST_AXES:
                    continue
                _check(path, name, head.shape, most)
                found[name] = npy_values(file, head)
    return found, sorted(members)


def _mat(path: Path, wanted: Collection[str], most: int) -> tuple[Arrays, list[str]]:
    found = read_mat(path, MOST_BYTES[".mat"])
    chosen = {name: np.squeeze(a) for name, a in found.items() if name in wanted}
    for name, a in chosen.items():
        _check(path, name, a.shape, most)
    return {name: a for name, a in chosen.items() if a.ndim <= MOST_AXES}, sorted(found)


def _text(path: Path, wanted: Collection[str], most: int) -> tuple[Arrays, list[str]]:
    """Return columns of a text or a workbook, those with a unit in ours."""
    reading = read_workbook if path.suffix.lower() == ".xlsx" else read_text
    table = reading(path, most * MOST_COLUMNS)
    if len(table.columns) > MOST_COLUMNS:
        raise BadInput(
            f"{path.name}: {len(table.columns)} columns; at most {MOST_COLUMNS} are "
            "read, keep those of the map"
        )
    own = {name: table.columns[key] for name in wanted if (key := table.key(name)) is not None}
    rows = max((len(x) for x in own.values()), default=0)
    if rows > most:
        raise BadInput(f"{path.name}: {rows} rows; at most {most} are read, keep every second line")
    return {name: _in_ours(path.name, name, x, table) for name, x in own.items()}, sorted(
        table.names
    )


def _in_ours(file: str, name: str, values: NDArray[Any], table: Table) -> NDArray[Any]:
    """Return a column in our unit; BadInput where the file states one that is not known."""
    unit = table.units.get(table.key(name) or name)
    if unit is None:
        return values
    found = next((units[unit] for units in UNITS.values() if unit in units), None)
    if found is None and NO_UNIT.fullmatch(unit):
        return values * (PEAK if unit.lower() == "rms" else 1.0)
    if found is None:
        raise BadInput(f"{file}: {unknown(f'unit of column {name}', unit, KNOWN)}")
    return values * found[0] + found[1]
