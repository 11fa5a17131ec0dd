"""Tables of numbers in texts as programs write them: CSV with any separator, terminal logs,
spreadsheets' exports.

pyarrow reads the rows in pieces, so that ten minutes at 10 kHz take seconds and no more memory than
their numbers. Cells that are empty or no number become NaN; rows are counted from 0, after header
and unit row.
"""

from __future__ import annotations

import contextlib
import io
import re
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple, TextIO

import numpy as np
from numpy.typing import NDArray

from model.array_types import Array
from model.errors import BadInput
from model.number_table import Table
from model.text_lines import (
    HEAD,
    Layout,
    cells,
    cleaned,
    encoding_of,
    is_data,
    layout,
    number,
    pieces,
    thousands_of,
)

if TYPE_CHECKING:
    import pyarrow

MOST_LEFT = 1000  # lines left out that are remembered
WIDER = re.compile(r"Expected (\d+) columns, got (\d+)")
NO_TEXT = {  # what files of other kinds begin with
    b"PK\x03\x04": "it is a workbook or an archive; give it its ending .xlsx, or unpack it",
    b"\x1f\x8b": "it is compressed; unpack it",
    b"7z\xbc\xaf": "it is compressed; unpack it",
    b"\xd0\xcf\x11\xe0": "it is an old workbook (.xls); save it as .xlsx or as CSV",
    b"<": "it is a web page or XML, no table; download the file itself, or export CSV",
    b"{": "it is JSON, no table; export CSV",
    b"[{": "it is JSON, no table; export CSV",
}
BLOCK = 1 << 20  # bytes pyarrow parses at a time


class Skipped(NamedTuple):
    """A line that is no row of the table: how many lines came before it, its cells and what it
    says."""

    row: int
    cells: int
    text: str


def read_text(path: Path, most: int) -> Table:
    """Return the table in a text file of any usual encoding, `most` values at most; BadInput says
    what is wrong."""
    with path.open("rb") as file:
        begin = file.read(HEAD)
        for sign, text in NO_TEXT.items():
            if begin.lstrip().startswith(sign):
                raise BadInput(f"{path.name}: {text}")
        encoding = encoding_of(begin)
        file.seek(0)
        return read_lines(path.name, io.TextIOWrapper(file, encoding, errors="replace"), most)


def read_lines(file: str, text: TextIO, most: int) -> Table:
    """Return the table in an open text; `file` is the name that errors tell."""
    head = text.read(HEAD)
    head += text.readline()
    found = layout(file, head)
    text.seek(0)
    for _ in range(found.above):
        text.readline()
    reading = _Reading(file, found, most)
    columns = reading.columns(_Bytes(pieces(text, found.separator)))
    return reading.table(columns)


def lines_of_rows(path: Path) -> list[int]:
    """Return the lines of a text, counted from 1, in which the rows of its table stand."""
    with path.open("rb") as file:
        encoding = encoding_of(file.read(HEAD))
    with path.open(encoding=encoding, errors="replace", newline="\n") as text:
        head = text.read(HEAD)
        found = layout(path.name, head + text.readline())
        text.seek(0)
        lines = list(enumerate(text, 1))[found.above :]
    rows = [(k, cells(cleaned(x, found.separator), found.separator)) for k, x in lines]
    return [k for k, row in rows if is_data(row)]


class _Bytes(io.RawIOBase):
    """Pieces of text as a file of UTF-8 that pyarrow reads."""

    def __init__(self, texts: Iterator[str]) -> None:
        self.texts = texts
        self.left = b""

    def readable(self) -> bool:
        """Say so to io's buffers."""
        return True

    def readinto(self, buffer: Any) -> int:
        """Fill a buffer; returns how many bytes it holds, 0 at the end."""
        while not self.left:
            text = next(self.texts, None)
            if text is None:
                return 0
            self.left = text.encode("utf-8", "replace")
        n = min(len(buffer), len(self.left))
        buffer[:n], self.left = self.left[:n], self.left[n:]
        return n


class _Reading:
    """One pass over the rows of a text, and what is found on the way."""

    def __init__(self, file: str, found: Layout, most: int) -> None:
        self.file, self.found, self.most = file, found, most
        self.names = found.header.names
        self.skipped: list[Skipped] = []
        self.odd: dict[str, tuple[int, str]] = {}
        self.empty: list[int] = []  # rows in which no cell is a number
        self.again: list[int] = []  # those that are the header once more
        self.rows = 0

    def columns(self, raw: io.RawIOBase) -> list[Array]:
        """Return the columns; BadInput for a row that is too long or too short, or too many
        values."""
        from pyarrow import ArrowException, csv, string

        more = self.found.width - len(self.names)  # a separator at the end of each line
        names = [
            *map(str, range(len(self.names))),
            *(f"more {k}" for k in range(max(more, 0) and 1)),
        ]
        separator = "\t" if self.found.separator == " " else self.found.separator
        parse = csv.ParseOptions(delimiter=separator, invalid_row_handler=self._skip)
        convert = csv.ConvertOptions(
            column_types=dict.fromkeys(names, string()), strings_can_be_null=False
        )
        reading = csv.ReadOptions(column_names=names, use_threads=False, block_size=BLOCK)
        parts: list[list[Array]] = [[] for _ in self.names]
        try:
            for batch in csv.open_csv(io.BufferedReader(raw, BLOCK), reading, parse, convert):
                self._add(batch, parts)
        except ArrowException as error:
            if "Empty CSV file" not in str(error):
                said, remedy = str(error).splitlines()[0][:80], "export it again"
                if (
                    separator == ","
                    and (counts := WIDER.search(said))
                    and int(counts[2]) > 1.5 * int(counts[1])
                ):
                    remedy = (
                        "are there decimal commas, too? export it with points, or with ; "
                        "between the cells"
                    )
                raise BadInput(f"{self.file}: cannot be read as CSV ({said}); {remedy}") from None
        self._judge_skipped()
        return [np.concatenate(x) if x else np.zeros(0) for x in parts]

    def _skip(self, row: Any) -> str:
        if len(self.skipped) < MOST_LEFT:
            self.skipped.append(Skipped(row.number or 0, row.actual_columns, row.text))
            return "skip"
        return "error"

    def _add(self, batch: pyarrow.RecordBatch, parts: list[list[Array]]) -> None:
        first, self.rows = self.rows, self.rows + batch.num_rows
        if self.rows * len(self.names) > self.most:
            raise BadInput(
                f"{self.file}: more than {self.most / 1e6:g} million values; keep the "
                "columns needed, or cut the log"
            )
        for k in range(len(self.names), batch.num_columns):
            extra = batch.column(k).to_pylist()
            row = next((j for j, cell in enumerate(extra) if cell.strip()), None)
            if row is not None:
                raise self._width(first + row, batch.num_columns)
        blank = np.ones(batch.num_rows, dtype=bool)
        for name, part, column in zip(
            self.names, parts, batch.columns[: len(self.names)], strict=True
        ):
            values, odd = _numbers(column)
            part.append(values)
            blank &= np.isnan(values)
            if odd is not None and name not in self.odd:
                self.odd[name] = (first + odd, column[odd].as_py().strip().strip('"'))
        self.empty += (first + np.flatnonzero(blank)).tolist()
        for row in np.flatnonzero(blank).tolist():
            cells = [c[row].as_py() for c in batch.columns[: len(self.names)]]
            if self._is_header(cells, first + row):
                self.again.append(first + row)

    def _is_header(self, row: Sequence[str], at: int) -> bool:
        """Tell whether cells are the header's once more; BadInput where they are in another
        order."""
        header = self.found.header
        own = [" ".join(c.strip().strip('"').split()) for c in row]
        names = [header.again.get(n, n) for n in self.names]
        columns = [c if c in names else header.also.get(c, c) for c in own]
        if columns != names and sorted(columns) == sorted(names) and len(names) > 1:
            raise BadInput(
                f"{self.file}: row {at} is a header of the same columns in another "
                "order; make two files of it"
            )
        return columns == names

    def _width(self, row: int, width: int) -> BadInput:
        names = len(self.names)
        remedy = "the row is damaged: mend it, or cut the log there"
        if row == 0 and width > 1.5 * names:
            remedy = "with decimal commas the separator must be ';' or a tab"
        elif row == 0 and width == names + 1:
            remedy = "if the first cell counts the rows, give that column a name"
        return BadInput(
            f"{self.file}: row {row} has {width} cells, the header has {names}; {remedy}"
        )

    def _judge_skipped(self) -> None:
        """Raise BadInput for a line left out that holds numbers of a row, unless it is the last:
        cut there."""
        for k, line in enumerate(self.skipped):
            row = max(line.row - 1 - k, 0)
            own = cells(line.text, "\t" if self.found.separator == " " else self.found.separator)
            numbers = sum(number(c) is not None for c in own)
            last = row >= self.rows and k >= len(self.skipped) - 2  # a line of text may follow
            cut = (last or row in self.again) and line.cells < self.found.width
            if numbers and not cut and 2 * numbers > sum(map(bool, own)):
                above = self.skipped[k - 1] if k else None
                if above is not None and above.cells == line.cells and above.row == line.row - 1:
                    raise BadInput(
                        f"{self.file}: a header of other columns stands above row {row} "
                        f"('{above.text.strip()[:40]}'); make two files of it"
                    )
                raise self._width(row, line.cells)

    def table(self, columns: list[Array]) -> Table:
        """Return the columns by name, without lines at the end that hold no whole row."""
        header, notes = self.found.header, list[tuple[str, str]]()
        keep = np.ones(self.rows, dtype=bool)
        keep[self.empty] = False
        if self._is_cut(columns, keep):
            keep[int(np.flatnonzero(keep)[-1])] = False
            notes.append(("", f"{self.file}: the last row is cut; left out"))
        if self.again:
            many = f", {len(self.again)} times" if len(self.again) > 1 else ""
            notes.append(
                ("", f"{self.file}: the header stands again in row {self.again[0]}{many}; left out")
            )
        texts = [s.text.strip() for s in self.skipped]
        if texts:
            notes.append(
                (
                    "",
                    (
                        f"{self.file}: {_lines(len(texts))} no row of the table and left "
                        f"out: '{texts[0][:40]}'"
                    ),
                )
            )
        if not keep.all():
            columns = [x[keep] for x in columns]
        moved = np.cumsum(keep) - 1
        odd = {(n, int(moved[row])): cell for n, (row, cell) in self.odd.items() if keep[row]}
        own = dict(zip(self.names, columns, strict=True))
        twice = {
            name
            for again, name in header.again.items()
            if not np.array_equal(own[again], own[name])
        }
        breaks = tuple(
            int(moved[row]) + 1 for row in self.again if 0 <= int(moved[row]) + 1 < int(keep.sum())
        )
        return Table(own, header.units, odd, tuple(notes), header.also, frozenset(twice), breaks)

    def _is_cut(self, columns: list[Array], keep: NDArray[np.bool_]) -> bool:
        """Tell whether the last row ends in cells that hold numbers in the row before, and not
        here."""
        rows = np.flatnonzero(keep)
        if len(rows) < 3:
            return False
        here, before = rows[-1], rows[-2]
        filled = [not np.isnan(x[before]) for x in columns]
        return bool(filled[-1] and np.isnan(columns[-1][here]))


def _lines(count: int) -> str:
    return "a line is" if count == 1 else f"{count} lines are"


def _numbers(column: pyarrow.Array) -> tuple[Array, int | None]:
    """Return a column's numbers, NaN for the rest, and the first row of the rest."""
    from pyarrow import ArrowException, compute, float64

    marks = [compute.any(compute.match_substring(column, m)).as_py() for m in ",."]
    thousands = thousands_of(column.to_pylist()) if all(marks) else ""
    if not thousands:
        plain = compute.replace_substring(column, ",", ".")
        with contextlib.suppress(ArrowException):
            found = compute.cast(plain, float64()).to_numpy(zero_copy_only=False)
            return np.array(found, dtype=np.float64), None
    own = [number(cell, thousands) for cell in column.to_pylist()]
    values = np.array([np.nan if x is None else x for x in own])
    return values, next((k for k, x in enumerate(own) if x is None), None)
