"""Where the variables of a C function are declared, and how its lines are folded."""

from __future__ import annotations

import re
import textwrap
from collections.abc import Mapping

from estimators.c.kinds import Kind, declared, zero

HOLD = "\x00"
WIDTH = 100
WORD = re.compile(r"\b[A-Za-z_]\w*\b")


def with_declarations(lines: list[str], kinds: Mapping[str, Kind]) -> list[str]:
    """Return statements with their variables declared: where one is first set, if all else that
    names it stands in the same block behind that; at the top, beginning at zero, otherwise."""
    blocks = _blocks(lines)
    named: dict[str, list[int]] = {}
    for k, line in enumerate(lines):
        if not line.lstrip().startswith("/*"):
            for name in set(WORD.findall(line)) & set(kinds):
                named.setdefault(name, []).append(k)
    out, top = list(lines), list[str]()
    for name, kind in kinds.items():
        at = named.get(name, [])
        begin = re.match(rf"( *){name} = (.*);$", lines[at[0]]) if at else None
        inside = at and all(blocks[k][: len(blocks[at[0]])] == blocks[at[0]] for k in at)
        if begin and inside and name not in WORD.findall(begin[2]):
            out[at[0]] = f"{begin[1]}{declared(kind, name)} = {begin[2]};"
        elif at:
            top.append(f"{declared(kind, name)} = {zero(kind)};")
    return [*top, *out]


def _blocks(lines: list[str]) -> list[tuple[int, ...]]:
    """Return of every line in which blocks it stands, by numbers; a block's head is outside."""
    found, stack = [], list[int]()
    for k, line in enumerate(lines):
        if line.lstrip().startswith("}"):
            stack.pop()
        found.append(tuple(stack))
        if line.endswith("{"):
            stack.append(k)
    return found


def folded(line: str) -> list[str]:
    """Return a long line in several."""
    if len(line) <= WIDTH or "/*" in line:
        return [line]
    indent = " " * (len(line) - len(line.lstrip()))
    held = re.sub(r"(?<=\w) (?=\*?\w)", HOLD, line.lstrip())  # a type stays with its name
    parts = textwrap.wrap(
        indent + held,
        WIDTH,
        subsequent_indent=indent + "    ",
        break_long_words=False,
        break_on_hyphens=False,
    )
    return [part.replace(HOLD, " ") for part in parts]
