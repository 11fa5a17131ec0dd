"""Tables in Excel workbooks (.xlsx): openpyxl reads the cells (extra `xlsx`), the rest is as in a
text.

The first sheet that holds numbers is read.  Formulas count with the values that the workbook last
had.
"""

from __future__ import annotations

import io
import zipfile
from collections.abc import Iterator
from datetime import datetime
from itertools import islice
from pathlib import Path
from typing import Any

from model.errors import BadInput
from model.number_table import Table
from model.text_table import read_lines

MOST_UNPACKED = 1_000_000_000  # bytes of a workbook's parts; it is read by rows, and not held
MOST_CHARACTERS = 400_000_000  # of the cells as a text


def read_workbook(path: Path, most: int) -> Table:
    """Return the table in a workbook, `most` values at most; BadInput says what is wrong."""
    try:
        import openpyxl
    except ImportError:
        raise BadInput(
            f"{path.name}: reading a workbook needs openpyxl; install it with pip install "
            "'sensorless-sandbox[xlsx]', or save the sheet as CSV"
        ) from None
    try:
        with zipfile.ZipFile(path) as archive:
            if sum(info.file_size for info in archive.infolist()) > MOST_UNPACKED:
                raise BadInput(
                    f"{path.name}: more than {MOST_UNPACKED / 1e9:g} GB unpacked; save "
                    "the sheet as CSV"
                )
        book = openpyxl.load_workbook(path, read_only=True, data_only=True, keep_links=False)
        try:
            for sheet in book.worksheets:
                rows = _rows(sheet)
                begin = list(islice(rows, 200))
                if any(isinstance(x, (int, float)) for row in begin for x in row):
                    return read_lines(path.name, _text(path.name, begin, rows), most)
        finally:
            book.close()
    except BadInput:
        raise
    except Exception as error:  # openpyxl raises whatever a damaged file leads it to
        why = str(error)[:80] or type(error).__name__
        raise BadInput(
            f"{path.name}: cannot be read as a workbook ({why}); save the sheet as CSV"
        ) from None
    raise BadInput(f"{path.name}: no sheet holds a table of numbers; save the log's sheet as CSV")


def _rows(sheet: Any) -> Iterator[tuple[Any, ...]]:
    for row in sheet.iter_rows(values_only=True):
        if any(cell is not None for cell in row):
            yield row


def _text(file: str, begin: list[tuple[Any, ...]], rows: Iterator[tuple[Any, ...]]) -> io.StringIO:
    """Return a sheet as a text, each row as wide as the widest in its begin; BadInput for more than
    is held."""
    out = io.StringIO()
    width = max(len(row) for row in begin)
    for source in (begin, rows):
        for row in source:
            out.write("\t".join(map(_cell, row)) + "\t" * (width - len(row)) + "\n")
            if out.tell() > MOST_CHARACTERS:
                raise BadInput(
                    f"{file}: more than {MOST_CHARACTERS / 1e6:g} MB of cells; save the "
                    "sheet as CSV"
                )
    out.seek(0)
    return out


def _cell(value: Any) -> str:
    if isinstance(value, datetime):
        return repr(value.timestamp())
    return (
        ""
        if value is None
        else " ".join(str(value).split())
        if isinstance(value, str)
        else repr(value)
    )
