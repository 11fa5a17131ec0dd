"""Tables that fit their page: long names break at dots and underscores; on a telephone a row
becomes a card.

A table is turned into cards where its narrowest form is wider than a telephone: each cell then
stands on a line of its own behind its column's head (`pages.css`). Widths are estimated from the
longest piece of each column that cannot be broken, so that they are known without a browser.
"""

from __future__ import annotations

import html
import re
from typing import Any, NamedTuple

LETTER, CODE = 7.3, 8.4  # CSS pixels of a letter at the size of tables, of body text and of code
AROUND = 18.0  # CSS pixels left and right of a cell's text
DESK, PHONE = 930.0, 345.0  # CSS pixels that a table has on screens of 1280 and 390 pixels
TABLE = re.compile(r"<table\b.*?</table>", re.S)
ROW = re.compile(r"<tr\b.*?</tr>", re.S)
CELL = re.compile(r"(<t([hd])\b[^>]*)(>)(.*?)(</t\2>)", re.S)
NAME = re.compile(r"(<(?:code|span class=\"pre\")[^>]*>)([^<]*)")
UNDERSCORE = re.compile(r"(?<=[a-z]_)(?=\w[^<>]*(?:<|$))")  # not within a tag
BREAK = re.compile(r"(?<=[._,=/])(?=\w)")


class Table(NamedTuple):
    """A table of a page: heads, rows of cells (HTML)."""

    heads: list[str]
    rows: list[list[str]]

    @property
    def least(self) -> float:
        """The width (CSS pixels) below which it cannot be made by breaking lines between words."""
        columns = zip(*([self.heads] * bool(self.heads) + self.rows), strict=False)
        return sum(max(map(widest, column)) + AROUND for column in columns)


def widest(cell: str) -> float:
    """Return the width of the longest piece of a cell that is not broken (CSS pixels)."""
    width = 0.0
    for tag, text in re.findall(r"(<[^>]*>)?([^<]+)", breakable(cell)):
        letter = CODE if tag.startswith(("<code", '<span class="pre"', "<wbr")) else LETTER
        for piece in re.split(r"[ \n\t\u200b]+|(?<=[-–/])", html.unescape(text)):
            # not at a hard space
            width = max(width, letter * len(piece))
    return width


def breakable(cell: str) -> str:
    """Return a cell whose names in code may be broken after dots, underscores and commas, others
    after underscores.

    Percent signs stay with their number.
    """
    kept = re.sub(r"(?<=\d) (?=%)", "\u00a0", cell)
    return UNDERSCORE.sub("<wbr>", NAME.sub(lambda m: m[1] + BREAK.sub("<wbr>", m[2]), kept))


def table_of(text: str) -> Table:
    """Return the table of a piece of HTML."""
    rows = [[(c[1], c[3]) for c in CELL.findall(row)] for row in ROW.findall(text)]
    heads = [[x for _, x in row] for row in rows if row and all(kind == "h" for kind, _ in row)]
    body = [[x for _, x in row] for row in rows if row and not all(kind == "h" for kind, _ in row)]
    return Table(heads[0] if heads else [], body)


def tables(page: str) -> list[Table]:
    """Return the tables of a page (HTML)."""
    return [table_of(text) for text in TABLE.findall(page)]


def fitted(page: str) -> str:
    """Return a page whose tables fit: names can be broken, rows of wide ones become cards where the
    screen is small."""
    return TABLE.sub(lambda m: _fitted(m[0]), page)


def _fitted(text: str) -> str:
    found = table_of(text)
    cards = bool(found.heads) and (found.least > PHONE or len(found.heads) > 4)
    heads = [" ".join(re.sub(r"<[^>]*>", "", h).split()) for h in found.heads]

    def row(match: re.Match[str]) -> str:
        """Return a row, each cell with its column's head."""
        places = iter(heads)

        def cell(found: re.Match[str]) -> str:
            """Return a cell."""
            head = next(places, "")
            said = re.sub(r"<[^>]*>", "", found[4]).strip()  # a card leaves out what is empty
            told = f' data-head="{head}"' if cards and found[2] == "d" and said else ""
            return f"{found[1]}{told}{found[3]}{breakable(found[4])}{found[5]}"

        return CELL.sub(cell, match[0])

    text = ROW.sub(row, text)
    return re.sub(r'<table class="', '<table class="cards ', text, count=1) if cards else text


def setup(app: Any) -> dict[str, Any]:
    """Fit the tables of every page once it is written."""
    app.connect("html-page-context", _page)
    return {"parallel_read_safe": True, "parallel_write_safe": True}


def _page(app: Any, name: str, template: str, context: dict[str, Any], tree: Any) -> None:
    if "body" in context:
        context["body"] = fitted(context["body"])
