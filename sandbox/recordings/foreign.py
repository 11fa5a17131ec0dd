"""Tables of other programs as columns of floats: CSV, Parquet, MAT, NumPy, MDF4, TDMS, MCAP.

Cells that are empty or no number become NaN here; a column that is asked for and holds one is refused where it is
mapped (`sandbox.recordings.column_map`), with its row.  Rows are counted from 0, after header and unit row.
"""

from __future__ import annotations

import csv
import re
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from model.errors import BadInput
from model.matfile import read_mat
from sandbox.recordings.formats import hdf5, mcap_log, mdf4, tdms
from sandbox.recordings.formats.log_table import Table
from sandbox.recordings.formats.long_text import Layout, read_rows
from sandbox.recordings.formats.matrices import matrices, numpy_arrays
from sandbox.recordings.formats.parquet import check_table, read_parquet
from sandbox.recordings.formats.preamble import scope_lines, separator_of, table_lines

Array = NDArray[np.float64]
SUFFIXES = (".parquet", ".csv", ".txt", ".tsv", ".mat", ".npy", ".npz", ".mf4", ".tdms", ".mcap")
LONG = 4_000_000  # bytes of a text from which on its rows are read by pyarrow
LARGEST_TEXT = 60_000_000  # bytes of a text that is read cell by cell, at some 20 bytes of memory for each
MOST_COLUMNS = 10_000
LARGEST_MAT = 1_000_000_000  # bytes unpacked of one file
HEADER = re.compile(r"^\s*(?P<name>.*?)\s*(?:[\[(](?P<unit>[^\[\]()]*)[\])])?\s*$")


def read_table(path: Path, wanted: Iterable[str] = (), matrix: Mapping[str, Sequence[str]] | None = None) -> Table:
    """Return a table by its file's suffix.

    wanted: the columns that files of many channels are asked for; matrix: names of the columns of matrices in it.
    Raises BadInput for a file that is absent, of another format, or needs a package that is not installed.
    """
    suffix, names = path.suffix.lower(), matrix or {}
    if suffix not in SUFFIXES:
        raise BadInput(f"{path.name}: format '{suffix}' is not read; export as one of {', '.join(SUFFIXES)}")
    check_table(path)
    if suffix == ".parquet":
        return Table(read_parquet(path), {}, {})
    if suffix == ".mat":
        return _mat(path, names)
    if suffix in (".npy", ".npz"):
        return matrices(path.name, numpy_arrays(path), names)
    many = {".mf4": mdf4.read_mdf4, ".tdms": tdms.read_tdms, ".mcap": mcap_log.read_mcap}
    return many[suffix](path, tuple(wanted)) if suffix in many else _csv(path)


def _csv(path: Path) -> Table:
    """Return a text's table: a long one by `long_text` where all its rows are numbers, else cell by cell."""
    size = path.stat().st_size
    if size > LONG:
        found = _by_rows(path)
        if found is not None:
            return found
    if size > LARGEST_TEXT:
        raise BadInput(
            f"{path.name}: {size / 1e6:.0f} MB of text in rows that are not all numbers with commas, semicolons or "
            "tabs between them; export it so, under one header"
        )
    return _by_cells(path.name, _text(path.read_bytes()))


def _text(raw: bytes) -> str:
    try:
        return raw.decode("utf-8-sig")
    except UnicodeDecodeError:
        return raw.decode("latin-1")  # a degree sign of an older program


def _by_rows(path: Path) -> Table | None:
    """Return a long table of numbers, None where it is not simply lines of numbers."""
    with path.open("rb") as file:
        layout = _layout(path.name, _text(file.read(LONG).rpartition(b"\n")[0]))
    if layout is None:
        return None
    columns = read_rows(path, layout)
    if columns is None:
        return None
    first = [_cells(n, [cell], {})[0] for n, cell in zip(layout.names, layout.row, strict=False)]
    if not np.array_equal([columns[n][0] for n in layout.names], first, equal_nan=True):
        return None  # what counts as a line above the table is seen in two ways
    return Table(columns, layout.units, {})


def _layout(file: str, text: str) -> Layout | None:
    """Return how a table begins; None where its rows are not simply lines of it."""
    if scope_lines(text, _is_number):
        return None
    lines = table_lines(text, _is_number)
    if not lines:
        return None
    separator = separator_of(lines[0])
    _check_width(file, lines[0], separator)
    top = [next(csv.reader([line], delimiter=separator), []) for line in lines[:3]]
    names, units, first = _begin(file, top)
    every = re.split(r"\r\n|\n|\r", text)  # as pyarrow counts: a form feed ends no line
    if first >= len(lines) or lines[first] not in every:
        return None
    comma = separator != "," and any("," in line for line in lines[first:])
    return Layout(units, names, separator, every.index(lines[first]), top[first], comma)


def _begin(file: str, rows: list[list[str]]) -> tuple[list[str], dict[str, str], int]:
    """Return a table's names, units, and the number of its first row of data."""
    names, units = _header(file, rows[0])
    if len(rows) > 1 and not any(_is_number(cell) for cell in rows[1]) and any(c.strip() for c in rows[1]):
        stated = [cell.strip().strip("[]()").strip() for cell in rows[1]]
        return names, units | {n: u for n, u in zip(names, stated, strict=False) if u}, 2
    return names, units, 1


def _check_width(file: str, header: str, separator: str) -> None:
    columns = header.count(separator) + 1
    if columns > MOST_COLUMNS:
        raise BadInput(f"{file}: {columns} columns; at most {MOST_COLUMNS} are read, keep those needed")


def _by_cells(file: str, text: str) -> Table:
    lines = scope_lines(text, _is_number) or table_lines(text, _is_number)
    if not lines:
        raise BadInput(f"{file}: no line of data; a table needs a header and rows")
    separator = separator_of(lines[0])
    _check_width(file, lines[0], separator)
    try:
        rows = list(csv.reader(lines, delimiter=separator))
    except csv.Error as error:
        raise BadInput(f"{file}: cannot be read as CSV ({error}); export it again") from None
    names, units, first = _begin(file, rows)
    for k, row in enumerate(rows[first:]):
        if len(row) != len(names) and not (len(row) == len(names) + 1 and not row[-1].strip()):
            raise BadInput(
                f"{file}: row {k} has {len(row)} cells, the header has {len(names)}; with decimal commas the "
                "separator must be ';' or a tab"
            )
    odd: dict[tuple[str, int], str] = {}
    columns = {name: _cells(name, [row[j] for row in rows[first:]], odd) for j, name in enumerate(names)}
    return Table(columns, units, odd)


def _header(file: str, cells: list[str]) -> tuple[list[str], dict[str, str]]:
    """Return names and the units in their brackets, 'i_a [mA]'."""
    while cells and not cells[-1].strip():
        cells = cells[:-1]  # a separator at the end of each line
    if not cells or all(_is_number(cell) for cell in cells):
        raise BadInput(f"{file}: the first line is no header ('{','.join(cells)[:40]}'); name the columns in it")
    names, units = [], {}
    for cell in cells:
        match = HEADER.match(cell)
        name = (match["name"] if match and match["name"] else cell).strip()
        if name in names:
            raise BadInput(f"{file}: column '{name}' stands twice in the header; give each column its own name")
        names.append(name)
        if match and match["name"] and match["unit"]:
            units[name] = match["unit"].strip()
    return names, units


def _cells(name: str, cells: list[str], odd: dict[tuple[str, int], str]) -> Array:
    """Return a column's numbers, decimal commas included; notes what is none in `odd`."""
    try:
        return np.array(cells, dtype=np.float64)
    except ValueError:
        out = np.full(len(cells), np.nan)
        for k, cell in enumerate(cells):
            if _is_number(cell):
                out[k] = float(cell.replace(",", "."))
            else:
                odd[name, k] = cell.strip()
        return out


def _is_number(cell: str) -> bool:
    try:
        float(cell.replace(",", "."))
    except ValueError:
        return False
    return True


def _mat(path: Path, names: Mapping[str, Sequence[str]]) -> Table:
    """Return the vectors and matrices of a MAT file; those in a structure are named 'structure.field'."""
    if hdf5.is_hdf5(path):
        found = hdf5.read_hdf5(path, LARGEST_MAT)
    else:
        try:
            found = read_mat(path, LARGEST_MAT)
        except (OSError, ValueError) as error:
            raise BadInput(f"{path.name}: not a MAT file that can be read ({error!s:.100}); save it again") from None
    return matrices(path.name, {n: v for n, v in found.items() if v.dtype.kind in "fiu"}, names)
