"""Lines of a text that holds a table: how it is encoded, what is no row of it, where the table
begins, how it is cut.

Comments, prompts of a terminal and what a program writes above its header are passed over.
"""

from __future__ import annotations

import codecs
import csv
import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from typing import TextIO

from model.errors import BadInput
from model.units import KNOWN, kinds_of

HEAD = 1 << 18  # characters in which a table has to begin
CHUNK = 1 << 20  # characters cleaned at a time
MOST_ABOVE = 200  # lines above a header
MOST_COLUMNS = 10_000
BOMS = (
    (codecs.BOM_UTF8, "utf-8-sig"),
    (codecs.BOM_UTF16_LE, "utf-16"),
    (codecs.BOM_UTF16_BE, "utf-16"),
)
SEPARATORS = (";", "\t", ",", "|", " ")
TRIED = 24  # rows that tell a separator
COMMENT = re.compile(r'[ \t]*"?(?:#|%|//)')
# colours of a terminal, unused blocks of a file, a logger's stamp ('12:03:45.123 -> '), a shell's
# prompt ('ch> ')
NOISE = re.compile(
    r"\x1b\[[\d;]*[A-Za-z]|\x00+|\ufeff"
    r"|^[ \t]*(?:\[?\d+:\d\d:\d\d(?:\.\d+)?\]?[ \t]*->|\[\d[\d:.,\- "
    r"]*\]|(?:[\w@~/.:-]{0,40}>{1,3})|\$)[ \t]+",
    re.MULTILINE,
)
COMMENTED = re.compile(r'^[ \t]*"?(?:#|%|//).*\n?', re.MULTILINE)
ENDS = re.compile(r"^[ \t]+|[ \t]+$", re.MULTILINE)
BLANKS = re.compile(r"[ \t]+")
# of a header with blanks between: 't [s]' is one
WORDS = re.compile(r"[^\s\[(]\S*(?:\s*[\[(][^\])]*[\])])?|\S+")
HEADER = re.compile(r"^\s*(?P<name>.*?)\s*[\[(](?P<unit>[^\[\]()]*)[\])]\s*$")
# a quantity over its unit: 'i_d/A', 'n/(1/min)'
OVER = re.compile(r"^\s*(?P<name>[^\[\](]*?)\s*/\s*(?P<unit>.+?)\s*$")
GROUPED = re.compile(  # 1.234,5 or 1,234.5 or 1 234,5 or 1'234.5
    r"[+-]?\d{1,3}(?:(?:\.\d{3})+,\d*|(?:,\d{3})+\.\d*|(?:[ '’\xa0\u2009\u202f]\d{3})+(?:[.,]\d*)?)"
)
MARK = re.compile(r"[.,](?=\d*$)")  # before the last digits
MINUS = str.maketrans("−–", "--")
NAMED = re.compile(r"\s*[^\W\d]")  # begins with a letter
WRAPPED = re.compile(r"""^=?(["'])(.*)\1$""", re.DOTALL)  # 'x', "x", and ="x" of spreadsheets


@dataclass(frozen=True)
class Header:
    """Names of columns, the units in their brackets or in a row of their own, and other spellings
    of the names."""

    names: list[str]
    units: dict[str, str]
    also: dict[str, str] = field(default_factory=dict)
    # names made for columns whose own stands before
    again: dict[str, str] = field(default_factory=dict)


@dataclass(frozen=True)
class Layout:
    """How a text's table is laid out: header, separator, lines above the first row, and that row's
    width."""

    header: Header
    separator: str
    above: int
    width: int


def encoding_of(begin: bytes) -> str:
    """Return how a text is encoded, by its first bytes: UTF-8, UTF-16 with or without its mark,
    else Latin-1."""
    for mark, name in BOMS:
        if begin.startswith(mark):
            return name
    even, odd = begin[0::2].count(0), begin[1::2].count(0)
    if max(even, odd) > 0.3 * len(begin) and min(even, odd) < 0.05 * len(begin):
        return "utf-16-be" if even > odd else "utf-16-le"
    try:
        codecs.getincrementaldecoder("utf-8")().decode(begin)
    except UnicodeDecodeError:
        return "latin-1"  # a degree sign of an older program
    return "utf-8"


def unwrapped(cell: str) -> str:
    """Return a cell without blanks and quotes around it."""
    cell = cell.strip()
    found = WRAPPED.match(cell)
    return found[2].strip() if found else cell.strip('"').strip()


def number(cell: str, thousands: str = "") -> float | None:
    """Return what a cell holds, decimal commas and grouped thousands included; None where that is
    no number.

    thousands: the mark, ',' or '.', that is no decimal one in the cell's column.
    """
    cell = unwrapped(cell).translate(MINUS)
    if GROUPED.fullmatch(cell):
        found = MARK.search(cell)
        whole, part = (cell[: found.start()], cell[found.end() :]) if found else (cell, "")
        cell = re.sub(r"[^\d+-]", "", whole) + "." + part
    elif thousands and thousands in cell:
        grouped = re.fullmatch(rf"[+-]?\d{{1,3}}(\{thousands}\d{{3}})+", cell)
        cell = cell.replace(thousands, "") if grouped else ""
    try:
        return None if "_" in cell else float(cell.replace(",", "."))
    except ValueError:
        return None


def thousands_of(cells: Sequence[str]) -> str:
    """Return the mark that groups thousands in a column whose cells hold points and commas; empty
    where they hold one of them, or both marks could."""
    fits = {}
    for mark, other in (",.", ".,"):
        own = re.compile(rf"[+-]?\d{{1,3}}(\{mark}\d{{3}})+(\{other}\d*)?")
        marked = [c for c in map(unwrapped, cells) if mark in c]
        if not marked:
            return ""
        fits[mark] = all(own.fullmatch(c) for c in marked)
    return "" if fits[","] == fits["."] else "," if fits[","] else "."


def cleaned(text: str, separator: str = "") -> str:
    """Return lines without comments, prompts and colours; with a blank as separator each run of
    blanks as one tab."""
    text = COMMENTED.sub("", NOISE.sub("", text))
    return BLANKS.sub("\t", ENDS.sub("", text)) if separator == " " else text


def pieces(text: TextIO, separator: str) -> Iterator[str]:
    """Yield what is left of a text, cleaned, in whole lines."""
    while part := text.read(CHUNK):
        yield cleaned(part + text.readline(), separator)


def cells(line: str, separator: str) -> list[str]:
    """Return a row's cells, or a header's."""
    if separator == " ":
        return WORDS.findall(line)
    return [unwrapped(c) for c in next(csv.reader([line], delimiter=separator), [])]


def layout(file: str, head: str) -> Layout:
    """Return how a table begins in the first lines of a text; BadInput where none does."""
    # as the rest is read: a form feed ends no line
    raw = head.split("\n")
    lines = [(k, NOISE.sub("", line)) for k, line in enumerate(raw)]
    rows = [(k, line) for k, line in lines if line.strip() and not COMMENT.match(line)]
    if not rows:
        raise BadInput(f"{file}: no line of data; a table needs a header and rows")
    found = _scope(rows)
    if found is not None:
        return found
    separator = _separator([line for _, line in rows])
    split = [(k, cells(line, separator)) for k, line in rows[: MOST_ABOVE + TRIED]]
    _refuse_lying(file, [x for _, x in split])
    widths = [len(x) for _, x in split if is_data(x)]
    if not widths:  # a header alone
        return Layout(header_of(file, split[0][1]), separator, split[0][0] + 1, 0)
    usual = max(widths, key=widths.count)  # of equally many, those that come first
    first = next(j for j, (_, x) in enumerate(split) if is_data(x) and len(x) == usual)
    at, data = split[first]
    _check_width(file, usual)
    named, below = _above(split[:first], data)
    if not named:
        said = next((x for k, x in reversed(lines[:at]) if COMMENT.match(x)), "")
        names = cells(re.sub(r"^\W*?(?:#|%|//)+\s*", "", said), separator)
        named = names if said and len(names) == len(data) else data
    return Layout(header_of(file, named, below), separator, at, usual)


def _above(rows: Sequence[tuple[int, list[str]]], data: list[str]) -> tuple[list[str], list[str]]:
    """Return the header above a table's first row, and the row of units below it; both empty where
    there is none."""
    texts = [x for _, x in rows if not is_data(x)][-2:]
    fitting = [x for x in texts if len(_filled(data)) <= len(_filled(x)) <= len(data)]
    if (
        len(texts) == 2
        and texts[0] in fitting
        and _are_units(texts[1])
        and len(texts[1]) >= len(_filled(texts[0]))
    ):
        return texts[0], texts[1]
    if texts and (texts[-1] in fitting or len(_filled(texts[-1])) > 1):
        # else rows are refused for their width
        return texts[-1], []
    return [], []


def _refuse_lying(file: str, rows: Sequence[Sequence[str]]) -> None:
    """Raise BadInput for a table whose lines are the signals: a name, then more numbers than there
    are lines."""
    names = [x[0] for x in rows]
    header = len(set(names)) == len(names) > 1 and all(NAMED.match(n) for n in names)
    if header and all(len(x) > len(rows) + 1 and is_data(x[1:]) for x in rows):
        raise BadInput(
            f"{file}: the table lies on its side: each line is a signal ('{names[0]}', "
            f"'{names[1]}'), each column a sample; transpose it (a spreadsheet pastes so) and "
            "export it again"
        )


def _filled(row: list[str]) -> list[str]:
    """Return a row without the empty cells at its end."""
    while row and not row[-1]:
        row = row[:-1]
    return row


def _are_units(row: Sequence[str]) -> bool:
    """Tell whether half of the cells that are not empty are known units."""
    filled = [c.strip("[]()").strip() for c in row if c]
    return bool(filled) and 2 * sum(c in KNOWN for c in filled) >= len(filled)


def _check_width(file: str, width: int) -> None:
    if width > MOST_COLUMNS:
        raise BadInput(
            f"{file}: {width} columns; at most {MOST_COLUMNS} are read, keep those needed"
        )


def _separator(lines: Sequence[str]) -> str:
    """Return what stands between cells: what makes numbers of most rows, of the widest such
    rows."""
    some = [*lines[:TRIED], *lines[len(lines) // 2 : len(lines) // 2 + TRIED]]
    scored: list[tuple[int, str]] = []
    for s in SEPARATORS:
        split = [cells(x, s) for x in some if s in x.strip()]
        widths = [len(x) for x in split if is_data(x)]
        if widths:
            usual = max(set(widths), key=widths.count)
            scored.append((widths.count(usual) * (usual > 1), s))
    best = max((n for n, _ in scored), default=0)
    return next(
        (s for n, s in scored if n == best and n),
        next((s for s in SEPARATORS[:3] if s in lines[0]), ","),
    )


def is_data(row: Sequence[str]) -> bool:
    """Tell whether most cells that are not empty are numbers."""
    filled = [c for c in row if c]
    return bool(filled) and 2 * sum(number(c) is not None for c in filled) > len(filled)


def _scope(rows: Sequence[tuple[int, str]]) -> Layout | None:
    """Return the layout of a TwinCAT Scope export, None for any other text.

    It begins with a block on the record (Name, File, StartRecord, EndRecord), then has one on the
    channels, one line an attribute (Name, SymbolName, ...), label and value by turns; then stamp
    (ms) and value of each channel by turns.
    """
    heads = [line.partition("\t")[0].strip() for _, line in rows[:MOST_ABOVE]]
    if "SymbolName" not in heads or not rows[0][1].startswith("Name"):
        return None
    last = max(k for k, head in enumerate(heads[: heads.index("SymbolName")]) if head == "Name")
    names = [c.strip() for c in rows[last][1].split("\t")][1::2]
    stamps = ["Time", *(f"Time {k}" for k in range(2, len(names) + 1))]
    columns = [x for pair in zip(stamps, names, strict=True) for x in pair]
    at = next(
        (k for k, x in rows[last:] if number(x.partition("\t")[0]) is not None), rows[-1][0] + 1
    )
    return Layout(Header(columns, {}), "\t", at, len(columns))


def _parts(cell: str, given: Sequence[str]) -> tuple[str, str]:
    """Return a cell's name and what may be its unit ('' for none)."""
    over = OVER.match(cell)
    if over and over["name"] and (unit := over["unit"].strip("() ")) in KNOWN:
        alike = [c for c in given if (m := OVER.match(c)) and m["name"] == over["name"]]
        return (over["name"], unit) if len(alike) == 1 else (cell, "")
    found = HEADER.match(cell)
    return (found["name"], found["unit"].strip()) if found and found["name"] else (cell, "")


def header_of(file: str, given: Sequence[str], below: Sequence[str] = ()) -> Header:
    """Return names and units of a header's cells; below: a row of units.

    A bracket is a unit where it is a known one and the names without it stay apart: 'i_a [mA]',
    'I(A)' beside 'I(B)' not; so is what stands behind a stroke: 'i_a/A', 'phase/A' beside 'phase/B'
    not.  A name that stands twice gets a number.
    BadInput for a line of numbers, or of nothing.
    """
    while given and not given[-1]:
        given = given[:-1]  # a separator at the end of each line
    if not given or all(number(c) is not None for c in given):
        shown = ",".join(given)[:40]
        raise BadInput(f"{file}: the first line is no header ('{shown}'); name the columns in it")
    _check_width(file, len(given))
    parts = [_parts(c, given) for c in given]
    bases = [base for base, _ in parts]
    found = Header([], {})
    for k, (whole, (base, unit)) in enumerate(zip(given, parts, strict=True)):
        same = [u for b, u in parts if b == base]
        alone = len(same) == 1
        is_unit = unit in KNOWN and (alone or len({kinds_of(u) for u in same if u}) == 1)
        name = (base if alone and (is_unit or not unit) else whole) or f"column {k + 1}"
        if name in found.names:
            number_of = 1 + sum(n == name for n in (*found.names, *found.again.values()))
            found.again[f"{name} #{number_of}"] = name
            name = f"{name} #{number_of}"
        elif whole != name:
            found.also[whole] = name
        elif base != name and bases.count(base) == 1:
            found.also[base] = name
        found.names.append(name)
        if unit and (is_unit or alone):
            found.units[name] = unit
    stated = [c.strip("[]()").strip() for c in below]
    found.units.update({n: u for n, u in zip(found.names, stated, strict=False) if u})
    return found
