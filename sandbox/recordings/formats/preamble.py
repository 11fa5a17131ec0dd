"""Which lines of a text file are its table: comments and what a program writes above its header are left out."""

from __future__ import annotations

import re
from collections.abc import Callable

COMMENTS = ("#", "%", "//")
SEPARATORS = (";", "\t", ",")
MOST = 60  # lines above a header


def table_lines(text: str, is_number: Callable[[str], bool]) -> list[str]:
    """Return the header, a row of units where there is one, and the rows of data.

    Lines that begin with a comment sign are left out, but for one that names the columns (NumPy writes '# t,i_a');
    lines above the header are left out where they have other cells than the data.
    """
    lines: list[str] = []
    commented = ""
    for line in text.splitlines():
        bare = line.strip().lstrip('"')
        if bare.startswith(COMMENTS):
            commented = line if not lines else commented
        elif line.strip():
            lines.append(line)
    if not lines:
        return lines
    separator = separator_of(lines[min(len(lines) - 1, MOST)])
    data = next((k for k, line in enumerate(lines[:MOST]) if _of_data(line, separator, is_number)), None)
    if data is None:
        return lines
    if data == 0:
        named = re.sub(r"^\W*?(?:#|%|//)+\s*", "", commented)
        width = lines[0].count(separator)
        return [named, *lines] if commented and named.count(separator) == width else lines
    width = lines[data].rstrip(separator).count(separator)
    begin = data
    while begin > 0 and data - begin < 2 and lines[begin - 1].rstrip(separator).count(separator) == width:
        begin -= 1
    return lines[begin:] if begin < data else lines


def scope_lines(text: str, is_number: Callable[[str], bool]) -> list[str] | None:
    """Return a TwinCAT Scope export as a table, None for any other text.

    It begins with a block on the record (Name, File, StartRecord, EndRecord), then has one on the channels, one line an
    attribute (Name, SymbolName, ...), label and value by turns; then stamp (ms) and value of each channel by turns.
    """
    lines = [line for line in text.splitlines() if line.strip() and line.strip() != "EOF"]
    heads = [line.partition("\t")[0].strip() for line in lines[: 2 * MOST]]
    if "SymbolName" not in heads or not lines[0].startswith("Name"):
        return None
    last = max(k for k, head in enumerate(heads[: heads.index("SymbolName")]) if head == "Name")
    names = [c.strip() for c in lines[last].split("\t")][1::2]
    data = [line for line in lines[last:] if is_number(line.partition("\t")[0].strip())]
    stamps = ["Time", *(f"Time {k}" for k in range(2, len(names) + 1))]
    header = "\t".join(f"{t}\t{n}" for t, n in zip(stamps, names, strict=True))
    return [header, *data]


def separator_of(line: str) -> str:
    """Return what stands between a line's cells."""
    return next((s for s in SEPARATORS if s in line), ",")


def _of_data(line: str, separator: str, is_number: Callable[[str], bool]) -> bool:
    """Tell whether most cells that are not empty are numbers."""
    cells = [c.strip().strip('"') for c in line.split(separator)]
    filled = [c for c in cells if c]
    return bool(filled) and 2 * sum(map(is_number, filled)) > len(filled)
