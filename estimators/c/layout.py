"""Where variables of a C function are declared, and how its lines are folded."""

from __future__ import annotations

import ast
import re
import textwrap
from typing import NamedTuple

from estimators.c.expressions import INT, REAL

HOLD = "\x00"


class Place(NamedTuple):
    """Where a variable lives: the innermost block around all its uses, and whether it is declared
    where it is set."""

    block: tuple[int, ...]
    at_once: bool


def together(lines: list[str]) -> list[str]:
    """Return lines with declarations of one type, one after another, in one."""
    found: list[str] = []
    for line in lines:
        before, kind = found[-1] if found else "", line.split(" ")[0]
        if (
            kind in (REAL, INT)
            and line.endswith(";")
            and "=" not in line + before
            and before.startswith(f"{kind} ")
        ):
            found[-1] = f"{before[:-1]}, {line[len(kind) + 1 :]}"
        else:
            found.append(line)
    return found


def places_of(tree: ast.FunctionDef) -> dict[str, Place]:
    """Return the place of every variable of a function."""
    seen: dict[str, list[tuple[tuple[int, ...], bool]]] = {}

    def visit(statements: list[ast.stmt], block: tuple[int, ...]) -> None:
        """Note every name of a block and of those inside."""
        for s in statements:
            inner = [
                (b, k)
                for k, b in enumerate((getattr(s, "body", []), getattr(s, "orelse", [])))
                if b
            ]
            skipped = {id(n) for b, _ in inner for part in b for n in ast.walk(part)}
            plain = isinstance(s, ast.Assign)
            for n in ast.walk(s):
                if isinstance(n, ast.Name) and id(n) not in skipped:
                    seen.setdefault(n.id, []).append(
                        (block, plain and isinstance(n.ctx, ast.Store))
                    )
            for b, k in inner:
                visit(b, (*block, s.lineno, k))

    visit(tree.body, ())
    loops = {
        n.target.id
        for n in ast.walk(tree)
        if isinstance(n, ast.For) and isinstance(n.target, ast.Name)
    }
    places = {}
    for name, uses in ((name, uses) for name, uses in seen.items() if name not in loops):
        common, stored = uses[0]
        for block, _ in uses:
            while block[: len(common)] != common:
                common = common[:-2]
        places[name] = Place(common, stored and uses[0][0] == common)
    return places


def folded(line: str, width: int = 116) -> list[str]:
    """Return a long line in several."""
    if len(line) <= width or "/*" in line:
        return [line]
    indent = " " * (len(line) - len(line.lstrip()))
    held = re.sub(r"(?<=\w) (?=\*?\w)", HOLD, line.lstrip())  # a type stays with its name
    parts = textwrap.wrap(
        indent + held,
        width,
        subsequent_indent=indent + "    ",
        break_long_words=False,
        break_on_hyphens=False,
    )
    return [part.replace(HOLD, " ") for part in parts]
