"""A result as one page: HTML with its figures inside, light and dark, on a telephone's width and on
paper."""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator, Sequence
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING

from model.names import html_text
from sandbox.output.files import write_whole

if TYPE_CHECKING:
    from jinja2 import Environment

ENLARGE = (
    "Click to enlarge; then wheel, two fingers or + and − zoom, dragging moves, × or Escape closes."
)
LONG = 36  # letters: a cell with more is broken between words
COLUMNS = 7  # of verdicts that stand within the text's width; more use a desk's whole screen
MARKS = {"✓": "good", "✗": "bad", "○": "none"}  # ○: as it should be, but not good


def write_page(path: Path, title: str, parts: Iterable[str]) -> None:
    """Write parts (HTML) as one self-contained page; the title is plain text.  BadInput without the
    page's folder."""
    write_whole(
        path,
        _templates()
        .get_template("page.html")
        .render(title=html_text(title), parts=list(parts))
        .encode(),
    )


@cache
def _templates() -> Environment:
    """Return the templates of pages, files beside this one."""
    from jinja2 import Environment, PackageLoader

    return Environment(
        loader=PackageLoader("sandbox.output"),
        autoescape=lambda name: str(name).endswith(".html"),
        keep_trailing_newline=True,
    )


def prose(text: str) -> str:
    """Return text for a page: percentages kept together, `words` as code."""
    plain = html_text(text).replace(" %", "&nbsp;%")
    return re.sub("`([^`]+)`", r"<code>\1</code>", plain)


def answer(question: str, text: str) -> str:
    """Return a question with its answer, set off from the rest."""
    return f'<div class="answer"><b>{prose(question)}</b>{prose(text)}</div>'


def bullets(texts: Iterable[str]) -> str:
    """Return sentences as a list, nothing where there is none."""
    items = "".join(f"<li>{prose(text)}</li>" for text in texts)
    return f"<ul>{items}</ul>" if items else ""


def table(heads: Sequence[str], rows: Iterable[Sequence[str]], stacked: bool = False) -> str:
    """Return a table; the first column is text, the others numbers where there are more than two;
    long ones wrap.

    stacked: where the screen is narrow, a row's cells stand below each other, each behind its
    column's head; those that hold nothing ("–") are left out there. So are all tables of more than
    two columns that have heads.
    """
    stacked = stacked or (len(heads) > 2 and all(heads))
    kind = " class='n'" if len(heads) > 2 else ""
    wraps = " class='n long'" if len(heads) > 2 else " class='long'"
    head = "".join(f"<th{kind if k else ''}>{prose(h)}</th>" for k, h in enumerate(heads))

    def cell(k: int, x: str) -> str:
        """Return the k-th cell of a row."""
        attribute = f' data-head="{html_text(heads[k])}"' if stacked and x != "–" else ""
        return f"<td{'' if not k else wraps if len(x) > LONG else kind}{attribute}>{prose(x)}</td>"

    body = "".join(f"<tr>{''.join(cell(k, x) for k, x in enumerate(row))}</tr>" for row in rows)
    return (
        "<div "
        f"class='wide{' stacked' if stacked else ''}'><table><tr>{head}</tr>{body}</table></div>"
    )


def verdicts(heads: Sequence[str], rows: Iterable[Sequence[str]]) -> str:
    """Return a table of texts with a verdict in them, such as '0.1 (0.4) ✓ ≤ 1': coloured by MARKS,
    the goal below."""
    head = "".join(f"<th>{prose(h)}</th>" for h in heads)
    lines = (
        f"<tr><td>{prose(row[0])}</td>{''.join(map(_verdict, row[1:], heads[1:]))}</tr>"
        for row in rows
    )
    body = "".join(lines)
    many = " many" if len(heads) > COLUMNS else ""
    return f"<div class='wide marks stacked{many}'><table><tr>{head}</tr>{body}</table></div>"


def _verdict(text: str, head: str) -> str:
    mark = next((m for m in MARKS if f" {m}" in text), "")
    seen, _, goal = text.partition(f" {mark} ") if mark else (text, "", "")
    below = f"<small>{mark} {prose(goal)}</small>" if mark else ""
    attribute = f' data-head="{html_text(head)}"' if seen else ""
    return f"<td class='{MARKS.get(mark, 'none')}'{attribute}>{prose(seen) or '–'}{below}</td>"


def fold(head: str, content: str) -> str:
    """Return a part that opens on demand (and when printed)."""
    return f"<details><summary>{prose(head)}</summary>{content}</details>"


def figure(svg: str, caption: str) -> str:
    """Return a drawing (SVG) with a caption in plain text."""
    drawing = f"<div class='draw'>{svg}</div>"
    return (
        "<figure role='img' "
        f"title='{ENLARGE}'>{drawing}<figcaption>{prose(caption)}</figcaption></figure>"
    )


def pairs(figures: Iterable[str]) -> Iterator[str]:
    """Yield figures side by side where the screen is wide enough."""
    yield f"<div class='pair'>{''.join(figures)}</div>"
