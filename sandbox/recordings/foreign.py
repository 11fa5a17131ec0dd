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
from sandbox.recordings.formats.matrices import matrices, numpy_arrays
from sandbox.recordings.formats.preamble import scope_lines, separator_of, table_lines
from sandbox.recordings.parquet import read_parquet

Array = NDArray[np.float64]
SUFFIXES = (".parquet", ".csv", ".txt", ".tsv", ".mat", ".npy", ".npz", ".mf4", ".tdms", ".mcap")
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
    if not path.is_file():
        raise BadInput(f"{path.name}: the file does not exist in '{path.parent}'; correct [[recording]]")
    if suffix == ".parquet":
        return Table(read_parquet(path), {}, {})
    if suffix == ".mat":
        return _mat(path, names)
    if suffix in (".npy", ".npz"):
        return matrices(path.name, numpy_arrays(path), names)
    many = {".mf4": mdf4.read_mdf4, ".tdms": tdms.read_tdms, ".mcap": mcap_log.read_mcap}
    return many[suffix](path, tuple(wanted)) if suffix in many else _csv(path)


def _csv(path: Path) -> Table:
    try:
        raw = path.read_bytes()
        try:
            text = raw.decode("utf-8-sig")
        except UnicodeDecodeError:
            text = raw.decode("latin-1")  # a degree sign of an older program
        lines = scope_lines(text, _is_number) or table_lines(text, _is_number)
        if not lines:
            raise BadInput(f"{path.name}: no line of data; a table needs a header and rows")
        rows = list(csv.reader(lines, delimiter=separator_of(lines[0])))
    except (OSError, csv.Error) as error:
        raise BadInput(f"{path.name}: cannot be read as CSV ({error}); export it again") from None
    names, units = _header(path.name, rows[0])
    first = 1
    if len(rows) > 1 and not any(_is_number(cell) for cell in rows[1]) and any(c.strip() for c in rows[1]):
        stated = [cell.strip().strip("[]()").strip() for cell in rows[1]]
        units |= {n: u for n, u in zip(names, stated, strict=False) if u}
        first = 2
    for k, row in enumerate(rows[first:]):
        if len(row) != len(names) and not (len(row) == len(names) + 1 and not row[-1].strip()):
            raise BadInput(
                f"{path.name}: row {k} has {len(row)} cells, the header has {len(names)}; with decimal commas the "
                "separator "
                "must be ';' or a tab"
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
