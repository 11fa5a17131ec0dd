"""Tables as TOML text that `tomllib` reads back, numbers to the last digit."""

from __future__ import annotations

import json
import math
from collections.abc import Iterator, Mapping, Sequence
from typing import Any


def toml_text(
    tables: Sequence[tuple[str, Mapping[str, Any]]], notes: Mapping[str, str] | None = None
) -> str:
    """Return tables (head such as "[motor]", entries) as text; empty tables and entries of None are
    left out.

    A table inside a table becomes dotted keys (`dead_time.time = 2e-06`).  notes: comments, by the
    dotted key.
    """
    parts = [(head, list(_lines(table, "", notes or {}))) for head, table in tables]
    return "\n".join(head + "\n" + "".join(lines) for head, lines in parts if lines)


def _lines(table: Mapping[str, Any], above: str, notes: Mapping[str, str]) -> Iterator[str]:
    for own, value in table.items():
        name = above + key(own)
        if isinstance(value, Mapping):
            yield from _lines(value, f"{name}.", notes)
        elif value is not None:
            note = f"  # {notes[name]}" if name in notes else ""
            yield f"{name} = {_value(value)}{note}\n"


def key(name: str) -> str:
    """Return a TOML key, in quotes where a bare one could not hold it."""
    bare = name.replace("_", "").replace("-", "")
    return name if bare.isascii() and bare.isalnum() else json.dumps(name, ensure_ascii=False)


def _value(value: Any) -> str:
    if isinstance(value, float) and not math.isfinite(value):
        return str(value)  # inf, -inf, nan: as TOML writes them
    return json.dumps(value, ensure_ascii=False)
