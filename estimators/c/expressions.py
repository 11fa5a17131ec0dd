"""Expressions of kernels in C: text, kind, and what is known before it runs."""

from __future__ import annotations

import ast
import inspect
import math
import operator
import re
from enum import EnumType
from types import ModuleType
from typing import Any, NamedTuple, Protocol

from estimators.c.kinds import (
    INT,
    LANE,
    REAL,
    Absent,
    Kind,
    Lane,
    Record,
    Rows,
    Several,
    declared,
    joined,
)

OPERATORS = {
    ast.Add: ("+", 6),
    ast.Sub: ("-", 6),
    ast.Mult: ("*", 7),
    ast.Div: ("/", 7),
    ast.FloorDiv: ("/", 7),
    ast.Mod: ("%", 7),
    ast.BitAnd: ("&", 3),
    ast.BitOr: ("|", 3),
    ast.LShift: ("<<", 5),
}
COMPARED = {
    ast.Lt: ("<", operator.lt),
    ast.LtE: ("<=", operator.le),
    ast.Gt: (">", operator.gt),
    ast.GtE: (">=", operator.ge),
    ast.Eq: ("==", operator.eq),
    ast.NotEq: ("!=", operator.ne),
}
MATHS = re.findall(
    r"\w+",
    "cos sin tan acos asin atan atan2 "
    "exp log log1p expm1 cosh sinh tanh sqrt floor ceil copysign hypot fmod",
)
CHOSEN = {"min": "smaller", "max": "larger"}
POWERS = {2: "square", 3: "cube", 4: "fourth"}
NARROWEST = 1e-37  # of a float: smaller literals stand for "nearly nothing"
ATOM, BITS = 9, 3


class Text(NamedTuple):
    """C text, its kind, how tightly it binds, and its truth where that is known beforehand."""

    text: str
    kind: Kind
    binds: int = ATOM
    always: bool | None = None


class User(Protocol):
    """The function that expressions stand in: its names, and the program it belongs to."""

    program: Any
    fresh: int  # temporary variables so far
    read: set[str]  # variables that have been read

    def named(self, name: str) -> Text:
        """Return a variable or a constant."""

    def found(self, node: ast.expr) -> Any:
        """Return the object that a name or a module's attribute is; None where it is a variable."""


def known(truth: bool) -> Text:
    """Return a truth known beforehand."""
    return Text(str(int(truth)), INT, ATOM, truth)


def bound(found: Text, binds: int) -> str:
    """Return a text, in parentheses where it binds less than is needed."""
    return found.text if found.binds >= binds else f"({found.text})"


class Expressions:
    """Writes the expressions of one statement; `before` collects what must come before it."""

    def __init__(self, user: User) -> None:
        self.user, self.program = user, user.program
        self.before: list[str] = []

    def write(self, node: ast.expr) -> Text:
        """Return an expression in C; an AssertionError names what kernels do not use so far."""
        method = getattr(self, f"_{type(node).__name__.lower()}", None)
        assert method is not None, f"{ast.unparse(node)}: {type(node).__name__} has no translation"
        found: Text = method(node)
        return found

    def as_kind(self, value: Text, kind: Kind) -> str:
        """Return a value where a kind is needed: whole numbers become real ones."""
        if kind == REAL and value.kind == INT:
            return f"({REAL}){bound(value, 8)}"
        if isinstance(kind, Several) and value.kind != kind:
            before, name = f"({value.kind.name})", f"({kind.name})"  # type: ignore[union-attr]
            assert value.text.startswith(before), f"{value.text} is no {kind}"
            return name + value.text[len(before) :]
        return value.text

    def kept(self, value: Text) -> Text:
        """Return a value kept in a variable of its own."""
        self.user.fresh += 1
        name = f"got_{self.user.fresh}"
        self.before.append(f"const {declared(value.kind, name)} = {value.text};")
        return Text(name, value.kind)

    def _constant(self, node: ast.Constant) -> Text:
        if node.value is None:
            return Text("", Absent())
        if isinstance(node.value, bool):
            return Text(str(int(node.value)), INT)
        if isinstance(node.value, int):
            return Text(str(node.value), INT)
        assert isinstance(node.value, float), ast.unparse(node)
        return Text(literal(node.value), REAL)

    def _name(self, node: ast.Name) -> Text:
        return self.user.named(node.id)

    def _attribute(self, node: ast.Attribute) -> Text:
        whole = ast.unparse(node)
        if whole in ("math.pi", "math.tau", "math.inf"):
            return Text(
                "INFINITY" if whole == "math.inf" else f"R({getattr(math, node.attr)!r})", REAL
            )
        owner = self.user.found(node.value)
        if isinstance(owner, ModuleType):
            return self.program.constant(owner.__name__, node.attr, getattr(owner, node.attr))
        if isinstance(owner, EnumType):
            return self.program.constant(owner.__name__, node.attr, int(owner[node.attr]))
        of = self.write(node.value)
        if isinstance(of.kind, Rows) and node.attr == "size":
            return Text("1", INT)  # lanes
        assert isinstance(of.kind, Record), whole
        text, kind = (
            f"{of.text.removeprefix('&')}{'->' if _by_pointer(of) else '.'}{node.attr}",
            of.kind.field(node.attr),
        )
        if isinstance(kind, Record) and kind.pointed:  # it lies inside: its address
            return Text(f"&{text}", kind, 8)
        return Text(text, kind)

    def _subscript(self, node: ast.Subscript) -> Text:
        if isinstance(node.value, ast.Attribute) and node.value.attr == "shape":
            rows = self.write(node.value.value).kind
            if isinstance(rows, Rows):
                return Text(str(rows.shape[ast.literal_eval(node.slice)]), INT)
        of = self.write(node.value)
        if isinstance(of.kind, Several):
            at = int(ast.literal_eval(node.slice))
            return Text(f"{of.text}._{at}", of.kind.parts[at])
        assert isinstance(of.kind, Rows), ast.unparse(node)
        return self._indexed(
            of, node.slice.elts if isinstance(node.slice, ast.Tuple) else [node.slice]
        )

    def _indexed(self, of: Text, indices: list[ast.expr]) -> Text:
        """Return numbers of rows at indices; an index of the lane is none."""
        assert isinstance(of.kind, Rows)
        parts, shape = [], of.kind.shape
        for index in indices:
            if shape[0] != LANE:
                found, stride = self.write(index), Rows(shape).stride
                parts.append(found.text if stride == 1 else f"{bound(found, 7)} * {stride}")
            shape = shape[1:]
        if not parts:
            return Text(of.text if _plain(of) else f"*{bound(of, 8)}", of.kind.of, 8)
        text = f"{of.text}[{' + '.join(parts)}]"
        return (
            Text(f"&{text}", Rows(shape, of.kind.whole, of.kind.fixed), 8)
            if shape
            else Text(text, of.kind.of)
        )

    def _unaryop(self, node: ast.UnaryOp) -> Text:
        found = self.write(node.operand)
        if isinstance(node.op, ast.Not):
            if found.always is not None:
                return known(not found.always)
            return Text(f"!{bound(found, 8)}", INT, 8)
        if isinstance(node.op, ast.Invert):
            return Text(f"~{bound(found, 8)}", INT, 8)
        return Text(f"-{bound(found, 8)}", found.kind, 8)

    def _binop(self, node: ast.BinOp) -> Text:
        if isinstance(node.op, ast.Pow):
            power = POWERS[int(ast.literal_eval(node.right))]
            return Text(f"{power}({self.write(node.left).text})", REAL)
        sign, binds = OPERATORS[type(node.op)]
        left, right = self.write(node.left), self.write(node.right)
        bits = binds == BITS  # C wants its parentheses there
        a, b = bound(left, ATOM if bits else binds), bound(right, ATOM if bits else binds + 1)
        kind = REAL if REAL in (left.kind, right.kind) or isinstance(node.op, ast.Div) else INT
        if kind == REAL:
            a = self.as_kind(left, REAL) if left.kind == INT else a
            b = self.as_kind(right, REAL) if right.kind == INT else b
            if sign == "%":
                return Text(
                    f"modulo({self.as_kind(left, REAL)}, {self.as_kind(right, REAL)})", REAL
                )
            assert not isinstance(node.op, ast.FloorDiv), ast.unparse(node)
        return Text(f"{a} {sign} {b}", kind, binds)

    def _compare(self, node: ast.Compare) -> Text:
        if isinstance(node.ops[0], (ast.Is, ast.IsNot)):
            absent = isinstance(self.write(node.left).kind, Absent)
            return known(absent == isinstance(node.ops[0], ast.Is))
        values = [self.write(v) for v in (node.left, *node.comparators)]
        parts = [
            f"{bound(a, 6)} {COMPARED[type(op)][0]} {bound(b, 6)}"
            for a, op, b in zip(values, node.ops, values[1:], strict=False)
        ]
        if len(parts) == 1 and all(v.text.isdigit() for v in values):
            return known(COMPARED[type(node.ops[0])][1](*(int(v.text) for v in values)))
        return Text(" && ".join(parts), INT, 4 if len(parts) == 1 else 2)

    def _boolop(self, node: ast.BoolOp) -> Text:
        both, read = isinstance(node.op, ast.And), set(self.user.read)
        left = []
        for value in node.values:
            found = self.write(value)
            if found.always is not None:
                if found.always != both:
                    self.user.read = read
                    return known(not both)
                continue
            left.append(found)
        if not left:
            return known(both)
        if len(left) == 1:
            return left[0]
        return Text(f" {'&&' if both else '||'} ".join(bound(v, 4) for v in left), INT, 2)

    def _ifexp(self, node: ast.IfExp) -> Text:
        test = self.write(node.test)
        if test.always is not None:
            return self.write(node.body if test.always else node.orelse)
        a, b = self.write(node.body), self.write(node.orelse)
        kind = joined(a.kind, b.kind)
        x, y = self.as_kind(a, kind), self.as_kind(b, kind)
        x, y = (bound(a, 2) if x == a.text else x), (bound(b, 1) if y == b.text else y)
        return Text(f"{bound(test, 4)} ? {x} : {y}", kind, 1)

    def _tuple(self, node: ast.Tuple) -> Text:
        values = [self.write(v) for v in node.elts]
        kind = self.program.several(tuple(v.kind for v in values))
        return Text(f"({kind.name}){{{', '.join(v.text for v in values)}}}", kind)

    def _call(self, node: ast.Call) -> Text:
        name = ast.unparse(node.func)
        if name == "len":
            rows = self.write(node.args[0]).kind
            assert isinstance(rows, Rows)
            return Text(str(rows.shape[0]), INT)
        given = self._arguments(node)
        if name == "math.isfinite":
            return Text(f"isfinite({given[0].text})", INT)
        module, _, function = name.partition(".")
        if module in ("math", "np"):
            assert function in MATHS, f"{name} has no translation"
            return Text(
                f"{function.upper()}({', '.join(self.as_kind(a, REAL) for a in given)})", REAL
            )
        if name in CHOSEN:
            return self._chosen(CHOSEN[name], given)
        if name == "abs":
            return Text(f"FABS({given[0].text})", REAL)
        if name == "int":
            return Text(f"(int32_t){bound(given[0], 8)}", INT, 8)
        if name == "float":
            return Text(self.as_kind(given[0], REAL), REAL, 8)
        return self._own(node, given)

    def _arguments(self, node: ast.Call) -> list[Text]:
        """Return the arguments of a call, a starred tuple's parts one by one."""
        out: list[Text] = []
        for argument in node.args:
            if not isinstance(argument, ast.Starred):
                out.append(self.write(argument))
                continue
            whole = self.write(argument.value)
            assert isinstance(whole.kind, Several)
            held = self.kept(whole)
            out += [Text(f"{held.text}._{k}", kind) for k, kind in enumerate(whole.kind.parts)]
        return out

    def _chosen(self, function: str, given: list[Text]) -> Text:
        whole = all(a.kind == INT for a in given)
        numbers = [a.text if whole else self.as_kind(a, REAL) for a in given]
        text = numbers[0]
        for number in numbers[1:]:
            text = f"{function}{'_whole' if whole else ''}({text}, {number})"
        return Text(text, INT if whole else REAL)

    def _own(self, node: ast.Call, given: list[Text]) -> Text:
        """Return a call of one of our kernels, or a named tuple made."""
        found = self.user.found(node.func)
        assert found is not None, ast.unparse(node)
        if isinstance(found, type):
            record = self.program.records[found]
            missing = len(record.fields) - len(given)
            given = [
                *given,
                *(Text(literal(x), REAL) for x in record.defaults[-missing:] if missing),
            ]
            values = [
                self.as_kind(v, kind) for v, (_, kind) in zip(given, record.fields, strict=True)
            ]
            return Text(f"({record.name}){{{', '.join(values)}}}", record)
        if getattr(found, "__name__", "") == "borrowed":
            return given[0]
        plain = self.program.plain(found)
        names = list(inspect.signature(plain).parameters.values())
        given = [*given, *(Text(literal(p.default), REAL) for p in names[len(given) :])]
        written = self.program.translate(found, tuple(a.kind for a in given))
        passed = [_address(a) for a in given if not isinstance(a.kind, (Absent, Lane))]
        return Text(f"{written.name}({', '.join(passed)})", written.kind)


def literal(value: float) -> str:
    """Return a number as C writes it, in double or float."""
    if math.isinf(value):
        return "INFINITY" if value > 0.0 else "(-INFINITY)"
    if 0.0 < abs(value) < NARROWEST:
        return f"EITHER({value!r}, {math.copysign(NARROWEST, value)!r})"
    return f"R({float(value)!r})"


def _by_pointer(of: Text) -> bool:
    """Return whether a record is reached by a pointer that has a name."""
    assert isinstance(of.kind, Record)
    return of.kind.pointed and not of.text.startswith("&")


def _address(value: Text) -> str:
    """Return an argument: of a row that is a plain field, its address."""
    return f"&{value.text}" if _plain(value) else value.text


def _plain(of: Text) -> bool:
    """Return whether a row of the only lane is a plain field."""
    return (
        isinstance(of.kind, Rows)
        and of.kind.shape == (LANE,)
        and "->" in of.text
        and "[" not in of.text
    )
