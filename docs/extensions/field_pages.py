"""The page of the objects that one builds or is handed: their own text, or a table of the comments
at their fields."""

from __future__ import annotations

import ast
import inspect
import re
from dataclasses import MISSING
from importlib import import_module
from pathlib import Path

from api_pages import block
from markdown import cell, code, table

import sandbox

OBJECTS = {
    "Scenario and segments": [
        ("sandbox.drive.scenario", "Scenario"),
        ("sandbox.drive.scenario", "Segment"),
    ],
    "What an estimator is given, and gives": [
        ("estimators.contract", name)
        for name in ("Sample", "Oversampled", "Belief", "Tuning", "Estimate", "Estimator")
    ],
    "What a motor is": [
        ("model.parameters", name)
        for name in ("Motor", "Converter", "Injection", "Limits", "Drive")
    ],
}
HEAD = """# Objects and their fields

All numbers are in SI units; see [conventions](../../explanation/conventions.md). A parameter without a default has to
be given; in a table such a field has an empty *usual*.

"""


def comments(module: str, name: str) -> dict[str, tuple[str, str]]:
    """Return each field's usual value and the comment beside it, or above it, in the order of a
    class's source."""
    path = Path(inspect.getfile(import_module(module)))
    lines = path.read_text(encoding="utf-8").splitlines()
    (own,) = (
        n
        for n in ast.parse("\n".join(lines)).body
        if isinstance(n, ast.ClassDef) and n.name == name
    )
    found = {}
    for node in own.body:
        if isinstance(node, ast.AnnAssign) and isinstance(node.target, ast.Name):
            behind = re.search(r"#\s*(.*)$", lines[node.end_lineno - 1][node.end_col_offset :])
            usual = ast.unparse(node.value) if node.value is not None else ""
            found[node.target.id] = (
                usual,
                behind[1] if behind else above(lines[: node.lineno - 1]),
            )
    return found


def above(lines: list[str]) -> str:
    """Return the comment that the last of the lines end with."""
    said: list[str] = []
    for line in reversed(lines):
        comment = re.fullmatch(r"\s*#\s*(.*)", line)
        if comment is None:
            break
        said.insert(0, comment[1])
    return " ".join(said)


def rows(module: str, name: str) -> list[tuple[str, str, str]]:
    """Return a class's fields: name, usual value, and unit, range and meaning as far as its source
    states them."""
    declared = getattr(getattr(import_module(module), name), "__dataclass_fields__", {})
    found, noted = [], comments(module, name)
    for field, (usual, comment) in noted.items():
        stated = declared[field].metadata if field in declared else {}
        if "low" in stated:
            usual = "" if declared[field].default is MISSING else str(declared[field].default)
            comment = f"{stated['unit'] or 'no unit'}; {stated['low']:g} to {stated['high']:g}" + (
                f"; {comment}" if comment else ""
            )
        found.append((code(field), code(usual), cell(comment)))
    return found


def page() -> str:
    """Return the whole page."""
    text = HEAD
    for title, classes in OBJECTS.items():
        text += f"## {title}\n\n"
        for module, name in classes:
            text += f"### `{name}`\n\n{part(module, name)}\n"
    return text


def part(module: str, name: str) -> str:
    """Return what the page says of a class: its text, with a table of its fields where the text
    does not list them."""
    said = inspect.getdoc(getattr(import_module(module), name)) or ""
    if has_parameters(module, name):
        home = "sandbox" if name in sandbox.__all__ else module  # where a reader imports it from
        return block([f".. autoclass:: {home}.{name}"])
    return f"{said}\n\n" + table(("field", "usual", "unit, range, meaning"), rows(module, name))


def has_parameters(module: str, name: str) -> bool:
    """Return whether the text of a class lists its fields, in numpydoc form."""
    return "\nParameters\n---" in (inspect.getdoc(getattr(import_module(module), name)) or "")
