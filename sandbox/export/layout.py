"""How lines of C are folded."""

from __future__ import annotations

import textwrap


def folded(line: str, width: int = 100) -> list[str]:
    """Return a long line in several."""
    if len(line) <= width or "/*" in line:
        return [line]
    indent = " " * (len(line) - len(line.lstrip()))
    return textwrap.wrap(
        line,
        width,
        subsequent_indent=indent + "    ",
        break_long_words=False,
        break_on_hyphens=False,
    )
