"""Small wrong changes of a source file, one at a time: what a test has to notice.

Rules on the syntax tree: numbers half as large or half as large again, + for -, * for /, comparisons turned round, `or`
for `and`, a term or factor left out, a minus left out, least for most.  Texts, refusals and type hints are left alone:
they are not arithmetic.
"""

from __future__ import annotations

import ast
from collections.abc import Callable, Iterator
from typing import NamedTuple

SWAPPED = {ast.Add: "-", ast.Sub: "+", ast.Mult: "/", ast.Div: "*", ast.FloorDiv: "*", ast.Pow: "*"}
TURNED = {ast.Lt: ">=", ast.LtE: ">", ast.Gt: "<=", ast.GtE: "<", ast.Eq: "!=", ast.NotEq: "=="}
OTHER_WAY = {"min": "max", "max": "min", "minimum": "maximum", "maximum": "minimum", "sin": "cos", "cos": "sin",
             "all": "any", "any": "all", "argmin": "argmax", "argmax": "argmin"}  # fmt: skip
FACTORS = (0.5, 1.5)


class Mutation(NamedTuple):
    """One change of a file: line (from 1), rule, the text that stands there, the text in its place, and where.

    begin, end: bytes of the file; constant: the module's constant that is changed, '' where it is no constant.
    """

    file: str
    line: int
    rule: str
    old: str
    new: str
    begin: int
    end: int
    constant: str = ""

    @property
    def told(self) -> str:
        """The change in one line; with the file, what tells mutations apart while the file stays as it is."""
        return f"{self.line}: {_short(self.old)} -> {_short(self.new)}"

    def applied(self, source: bytes) -> bytes:
        """Return the file's content with the change."""
        assert source[self.begin : self.end] == self.old.encode()
        return source[: self.begin] + self.new.encode() + source[self.end :]


def _short(text: str) -> str:
    return " ".join(text.split())


def mutations(file: str, source: bytes) -> list[Mutation]:
    """Return every mutation of a source file, by place."""
    tree = ast.parse(source)
    starts = [0]
    for line in source.splitlines(keepends=True):
        starts.append(starts[-1] + len(line))
    left_out = {id(child) for node in ast.walk(tree) if _is_left_out(node) for child in ast.walk(node)}
    names = {id(c): name for name, value in constants(tree) for c in ast.walk(value)}

    def text(node: ast.expr) -> str:
        """Return what stands in the file for a node."""
        begin, end = place(node)
        return source[begin:end].decode()

    def place(node: ast.expr) -> tuple[int, int]:
        """Return the first byte of a node and the one after its last."""
        return starts[node.lineno - 1] + node.col_offset, starts[(node.end_lineno or 0) - 1] + (
            node.end_col_offset or 0
        )

    found = []
    for node in ast.walk(tree):
        if isinstance(node, ast.expr) and id(node) not in left_out:
            for rule, new in _changes(node, text):
                found.append(Mutation(file, node.lineno, rule, text(node), new, *place(node), names.get(id(node), "")))
    return sorted(found, key=lambda m: (m.begin, m.end, m.rule, m.new))


def constants(tree: ast.Module) -> Iterator[tuple[str, ast.expr]]:
    """Yield the module's constants that are assigned one by one: names in capitals, and their values."""
    for node in tree.body:
        if isinstance(node, ast.Assign) and isinstance(node.targets[0], ast.Name):
            name, value = node.targets[0].id, node.value
        elif isinstance(node, ast.AnnAssign) and isinstance(node.target, ast.Name) and node.value is not None:
            name, value = node.target.id, node.value
        else:
            continue
        if name.isupper():
            yield name, value


def _is_left_out(node: ast.AST) -> bool:
    """Tell whether a node is no arithmetic: a refusal, a text, a type, a decorator's option."""
    if isinstance(node, (ast.Raise, ast.JoinedStr, ast.Assert, ast.Import, ast.ImportFrom, ast.arg)):
        return True
    if isinstance(node, ast.expr) and isinstance(getattr(node, "ctx", None), ast.Store):
        return True
    return isinstance(node, ast.BinOp) and any(_is_text(n) for n in (node.left, node.right))


def _is_text(node: ast.expr) -> bool:
    return isinstance(node, ast.JoinedStr) or (isinstance(node, ast.Constant) and isinstance(node.value, str))


def _changes(node: ast.expr, say: Callable[[ast.expr], str]) -> Iterator[tuple[str, str]]:
    """Yield (rule, new text) of one node; say: what stands in the file for a node."""
    if isinstance(node, ast.Constant) and type(node.value) in (int, float):
        yield from _numbers(node.value)
    elif isinstance(node, ast.BinOp) and type(node.op) in SWAPPED:
        left, right = say(node.left), say(node.right)
        yield "operator", f"({left}) {SWAPPED[type(node.op)]} ({right})"
        if not isinstance(node.op, (ast.Pow, ast.FloorDiv)):
            yield "dropped", f"({left})"
    elif isinstance(node, ast.UnaryOp) and isinstance(node.op, (ast.USub, ast.Not)):
        yield "sign", f"({say(node.operand)})"
    elif isinstance(node, ast.Compare) and len(node.ops) == 1 and type(node.ops[0]) in TURNED:
        yield "comparison", f"({say(node.left)}) {TURNED[type(node.ops[0])]} ({say(node.comparators[0])})"
    elif isinstance(node, ast.BoolOp):
        other = " or " if isinstance(node.op, ast.And) else " and "
        yield "logic", other.join(f"({say(v)})" for v in node.values)
    elif isinstance(node, ast.Call):
        name = say(node.func)
        if (last := name.rpartition(".")[2]) in OTHER_WAY:
            call = say(node)
            yield "call", name.removesuffix(last) + OTHER_WAY[last] + call[len(name) :]


def _numbers(value: float) -> Iterator[tuple[str, str]]:
    """Yield other numbers: whole ones stay whole and change by at least 1."""
    if isinstance(value, float):
        for factor in FACTORS if value else ():
            yield "number", repr(value * factor)
        if not value:
            yield "number", "1.0"
    elif value in (0, 1, 2):  # mostly places and axes: the next one
        yield "number", str(value + 1)
    else:
        for factor in FACTORS:
            yield "number", str(round(value * factor))
