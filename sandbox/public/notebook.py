"""What a notebook shows of a result: its summary, its figure, the first rows of its table."""

from __future__ import annotations

import base64
from html import escape
from typing import TYPE_CHECKING, Any

from model.errors import BadInput
from sandbox.output.columns import unit_of

if TYPE_CHECKING:
    import pyarrow

ROWS = 10  # of a table
COLUMNS = 12


def shown_in_notebook(result: Any) -> str:
    """Return a `Result` as HTML; what it does not have is left out."""
    parts = [f"<p><b>{type(result).__name__}</b>: {escape(result.summary())}</p>"]
    for part in (_figure, _table):
        try:
            parts.append(part(result))
        except BadInput:
            continue
    return "\n".join(parts)


def _figure(result: Any) -> str:
    from sandbox.output.plots import png

    text = base64.b64encode(png(result.plot())).decode()
    return f'<img alt="{escape(result.summary(), quote=True)}" src="data:image/png;base64,{text}">'


def _table(result: Any) -> str:
    table: pyarrow.Table = result.to_table()
    first = table.slice(0, ROWS).select(table.column_names[:COLUMNS])
    heads = [f"{f.name} ({unit})" if (unit := unit_of(f)) else f.name for f in first.schema]
    lines = [
        _row("th", heads),
        *(_row("td", [_text(v) for v in row.values()]) for row in first.to_pylist()),
    ]
    left = f"<p>{table.num_rows} rows × {table.num_columns} columns</p>"
    return "<table>\n" + "\n".join(lines) + "\n</table>\n" + left


def _row(cell: str, texts: list[str]) -> str:
    return "<tr>" + "".join(f"<{cell}>{escape(t)}</{cell}>" for t in texts) + "</tr>"


def _text(value: Any) -> str:
    if value is None:
        return "–"
    return f"{value:.6g}" if isinstance(value, float) else str(value)
