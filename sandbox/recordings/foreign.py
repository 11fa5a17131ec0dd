"""Tables of other programs as columns of floats: CSV, Parquet, MAT (versions 5 to 7), MDF4.

Cells that are empty or no number become NaN here; a column that is asked for and holds one is refused where it is
mapped (`sandbox.recordings.column_map`), with its row.  Rows are counted from 0, after header and unit row.
"""

from __future__ import annotations

import csv
import re
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from model.errors import BadInput, unknown
from model.matfile import read_mat
from sandbox.recordings.campaign import read_parquet

Array = NDArray[np.float64]
SUFFIXES = (".parquet", ".csv", ".txt", ".tsv", ".mat", ".mf4")
LARGEST_MAT = 1_000_000_000  # bytes unpacked of one file
HEADER = re.compile(r"^\s*(?P<name>.*?)\s*(?:[\[(](?P<unit>[^\[\]()]*)[\])])?\s*$")


@dataclass(frozen=True)
class Table:
    """Columns by name, the units that the file itself states, and what stood in cells that are no number."""

    columns: Mapping[str, Array]
    units: Mapping[str, str]
    odd: Mapping[tuple[str, int], str]


def read_table(path: Path, wanted: Iterable[str] = ()) -> Table:
    """Return a table by its file's suffix; `wanted` are the columns that MDF files are asked for (they hold thousands).

    Raises BadInput for a file that is absent, of another format, or needs a package that is not installed.
    """
    suffix = path.suffix.lower()
    if suffix not in SUFFIXES:
        raise BadInput(f"{path.name}: format '{suffix}' is not read; export as one of {', '.join(SUFFIXES)}")
    if not path.is_file():
        raise BadInput(f"{path.name}: the file does not exist in '{path.parent}'; correct [[recording]]")
    if suffix == ".parquet":
        return Table(read_parquet(path), {}, {})
    if suffix == ".mat":
        return Table(_mat(path), {}, {})
    if suffix == ".mf4":
        return _mdf(path, wanted)
    return _csv(path)


def _csv(path: Path) -> Table:
    try:
        raw = path.read_bytes()
        try:
            text = raw.decode("utf-8-sig")
        except UnicodeDecodeError:
            text = raw.decode("latin-1")  # a degree sign of an older program
        lines = [line for line in text.splitlines() if line.strip() and not line.lstrip().startswith("#")]
        if not lines:
            raise BadInput(f"{path.name}: no line of data; a table needs a header and rows")
        separator = next((s for s in (";", "\t", ",") if s in lines[0]), ",")
        rows = list(csv.reader(lines, delimiter=separator))
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


def _mat(path: Path) -> dict[str, Array]:
    """Return the vectors of a MAT file; those in a structure are named 'structure.field'."""
    try:
        found = read_mat(path, LARGEST_MAT)
    except (OSError, ValueError) as error:
        raise BadInput(f"{path.name}: not a MAT file that can be read ({error!s:.100}); save it again") from None
    vectors = {name: np.squeeze(a) for name, a in found.items()}
    return {name: v.astype(np.float64) for name, v in vectors.items() if v.ndim == 1 and v.dtype.kind == "f"}


def _mdf(path: Path, wanted: Iterable[str]) -> Table:
    """Return channels of an MDF4 file that share one raster, with their time stamps as 't' (s)."""
    try:
        from asammdf import MDF
    except ImportError:
        raise BadInput(
            f"{path.name}: reading MDF4 needs asammdf; install it with pip install 'sensorless-sandbox[mdf]'"
        ) from None
    try:
        with MDF(path) as file:
            names = [n for n in dict.fromkeys(wanted) if n in file.channels_db]
            signals = [(n, file.get(n)) for n in names]
    except Exception as error:  # asammdf raises whatever a damaged file or an ambiguous channel leads it to
        raise BadInput(f"{path.name}: cannot be read as MDF4 ({error!s:.80}); export it again") from None
    if not signals:
        raise BadInput(f"{path.name}: {unknown('channels', ', '.join(wanted), file.channels_db)}")
    columns, units = {}, {}
    stamps = np.asarray(signals[0][1].timestamps, dtype=np.float64)
    for name, signal in signals:
        if len(signal.timestamps) != len(stamps) or not np.allclose(signal.timestamps, stamps, rtol=0.0, atol=1e-9):
            raise BadInput(
                f"{path.name}: channel '{name}' has another raster ({len(signal.timestamps)} samples) than "
                f"'{signals[0][0]}' ({len(stamps)}); record them in one group, once each sampling period"
            )
        columns[name] = np.asarray(signal.samples, dtype=np.float64)
        if signal.unit:
            units[name] = str(signal.unit)
    return Table({"t": stamps, **columns}, units, {})
