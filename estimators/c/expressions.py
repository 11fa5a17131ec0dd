"""Expressions of the kernels' Python as C: text, type and how tightly it binds."""

from __future__ import annotations

import ast
from collections.abc import Callable
from typing import NamedTuple, get_type_hints

from estimators.c.collect import Function, Program
from estimators.contract import Belief, Estimate, Sample, Tuning
from model.quartic import Energy

REAL, INT, REALS = "real", "int32_t", "real *"
STRUCTURES = {
    "Sample": ("sensorless_sample", Sample),
    "Belief": ("sensorless_belief", Belief),
    "Tuning": ("sensorless_tuning", Tuning),
    "Energy": ("sensorless_energy", Energy),
    "Estimate": ("sensorless_estimate", Estimate),
}
OPERATORS = {
    ast.Add: ("+", 6),
    ast.Sub: ("-", 6),
    ast.Mult: ("*", 7),
    ast.Div: ("/", 7),
    ast.FloorDiv: ("/", 7),
    ast.Mod: ("%", 7),
}
COMPARED = {ast.Lt: "<", ast.LtE: "<=", ast.Gt: ">", ast.GtE: ">=", ast.Eq: "==", ast.NotEq: "!="}
MATHS = {
    "cos": "COS",
    "sin": "SIN",
    "sqrt": "SQRT",
    "atan2": "ATAN2",
    "hypot": "length",
    "floor": "down",
}
CHOSEN = {"min": "smaller", "max": "larger", "abs": "magnitude"}
POWERS = {2: "square", 3: "cube", 4: "fourth"}
LEAST = 1e-30  # smaller literals stand for "nearly nothing", which depends on the width
ATOM = 9


class Text(NamedTuple):
    """C text, its type (REAL, INT, REALS, a structure's name or a tuple of these), its
    precedence."""

    text: str
    type: str | tuple[str, ...]
    binds: int = ATOM


def real(value: float) -> str:
    """Return a literal of either width."""
    return "NEARLY_NOTHING" if 0.0 < abs(value) < LEAST else f"R({float(value)!r})"


def bound(found: Text, binds: int) -> str:
    """Return a text, in parentheses where it binds less than is needed."""
    return found.text if found.binds >= binds else f"({found.text})"


def as_real(found: Text) -> str:
    """Return a whole number's text where a real one is needed; nothing where it is real already."""
    return f"(real){bound(found, 8)}" if found.type == INT else ""


class Expressions:
    """Writes expressions inside one function; `before` collects statements that must come first."""

    def __init__(
        self,
        program: Program,
        user: Function,
        types: dict[str, str],
        returns: dict[str, str | tuple[str, ...]],
    ) -> None:
        self.program, self.aliases, self.types, self.returns = program, user.aliases, types, returns
        # hears of every call
        self.arguments: Callable[[str, list[Text]], None] = lambda name, given: None
        self.before: list[str] = []
        self.fresh = 0

    def write(self, node: ast.expr) -> Text:
        """Return an expression in C; an AssertionError names what kernels do not use so far."""
        method = getattr(self, f"_{type(node).__name__.lower()}", None)
        assert method is not None, f"{ast.unparse(node)}: {type(node).__name__} has no translation"
        found: Text = method(node)
        return found

    def inside(self, node: ast.expr, binds: int) -> str:
        """Return an expression, in parentheses where it binds less than is needed."""
        return bound(self.write(node), binds)

    def _constant(self, node: ast.Constant) -> Text:
        if isinstance(node.value, bool):
            return Text(str(int(node.value)), INT)
        if isinstance(node.value, int):
            return Text(str(node.value), INT)
        assert isinstance(node.value, float), ast.unparse(node)
        return Text(real(node.value), REAL)

    def _name(self, node: ast.Name) -> Text:
        if node.id in self.types:
            return Text(node.id, self.types[node.id])
        name = self.aliases.get(node.id, node.id)
        assert name in self.program.constants, f"{name} is unknown"
        return Text(name, INT if isinstance(self.program.constants[name], int) else REAL)

    def _attribute(self, node: ast.Attribute) -> Text:
        if ast.unparse(node) == "math.pi":
            return Text("PI", REAL)
        owner = self.write(node.value)
        kind = get_type_hints(STRUCTURES[str(owner.type)][1])[node.attr]
        found = {int: INT, float: REAL}.get(kind, "Energy")
        arrow = "->" if isinstance(node.value, ast.Name) else "."
        return Text(f"{owner.text}{arrow}{node.attr}", found)

    def _subscript(self, node: ast.Subscript) -> Text:
        owner, index = self.write(node.value), self.write(node.slice)
        if isinstance(owner.type, tuple):  # one of several results
            names = [self.temporary(kind) for kind in owner.type]
            self.before.append(owner.text.format(", ".join(f"&{name}" for name in names)))
            at = int(ast.literal_eval(node.slice))
            return Text(names[at], owner.type[at])
        return Text(f"{owner.text}[{index.text}]", REAL)

    def temporary(self, kind: str) -> str:
        """Return the name of a new variable, declared before the statement."""
        self.fresh += 1
        self.before.append(f"{kind} got_{self.fresh};")
        return f"got_{self.fresh}"

    def _unaryop(self, node: ast.UnaryOp) -> Text:
        sign = "!" if isinstance(node.op, ast.Not) else "-"
        found = self.write(node.operand)
        return Text(f"{sign}{bound(found, 8)}", INT if sign == "!" else found.type, 8)

    def _binop(self, node: ast.BinOp) -> Text:
        if isinstance(node.op, ast.Pow):
            return self._power(node)
        sign, binds = OPERATORS[type(node.op)]
        left, right = self.write(node.left), self.write(node.right)
        a, b = bound(left, binds), bound(right, binds + 1)
        kind = REAL if REAL in (left.type, right.type) or isinstance(node.op, ast.Div) else INT
        if kind == REAL:
            a, b = as_real(left) or a, as_real(right) or b
        return Text(f"{a} {sign} {b}", kind, binds)

    def _power(self, node: ast.BinOp) -> Text:
        return Text(
            f"{POWERS[int(ast.literal_eval(node.right))]}({self.write(node.left).text})", REAL
        )

    def _compare(self, node: ast.Compare) -> Text:
        values = [node.left, *node.comparators]
        parts = [
            f"{self.inside(a, 6)} {COMPARED[type(op)]} {self.inside(b, 6)}"
            for a, op, b in zip(values, node.ops, values[1:], strict=False)
        ]
        return Text(" && ".join(parts), INT, 4 if len(parts) == 1 else 2)

    def _boolop(self, node: ast.BoolOp) -> Text:
        sign = "&&" if isinstance(node.op, ast.And) else "||"
        return Text(f" {sign} ".join(self.inside(v, 3) for v in node.values), INT, 2)

    def _ifexp(self, node: ast.IfExp) -> Text:
        a, b = self.write(node.body), self.write(node.orelse)
        kind = REAL if REAL in (a.type, b.type) else a.type
        return Text(f"{self.inside(node.test, 3)} ? {bound(a, 2)} : {bound(b, 1)}", kind, 1)

    def _call(self, node: ast.Call) -> Text:
        name, given = ast.unparse(node.func), [self.write(a) for a in node.args]
        if name.startswith("math."):
            return Text(f"{MATHS[name[5:]]}({', '.join(a.text for a in given)})", REAL)
        if name in ("min", "max", "abs"):
            return Text(f"{CHOSEN[name]}({', '.join(a.text for a in given)})", REAL)
        if name == "int":
            return Text(f"(int32_t){bound(given[0], 8)}", INT, 8)
        if name == "Estimate":
            values = [
                *(a.text for a in given),
                *(["R(1.0)"] if len(given) < len(Estimate._fields) else []),
            ]
            return Text(f"(sensorless_estimate){{{', '.join(values)}}}", "Estimate")
        return self._own_call(name, given)

    def _own_call(self, name: str, given: list[Text]) -> Text:
        """Return a call of one of our functions; where it has several results, `{}` waits for where
        they go."""
        function = self.program.functions[name]
        missing = [a.arg for a in function.tree.args.args][len(given) :]
        given = [*given, *(Text(real(function.defaults[m]), REAL) for m in missing)]
        self.arguments(name, given)
        passed = ", ".join(
            f"&{a.text}" if a.type == "Energy" and ("->" in a.text) else a.text for a in given
        )
        kind = self.returns.get(name, REAL)
        return Text(
            f"{name}({passed}, {{}});" if isinstance(kind, tuple) else f"{name}({passed})", kind
        )
