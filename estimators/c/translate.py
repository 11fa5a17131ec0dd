"""Kernels in C: each function translated for the kinds of values it is handed, callees first.

As a compiler for numba does, one function is written for each list of kinds.  What kernels do not
use is not translated: an AssertionError names it.  Order and rounding of the arithmetic stay as
they are in Python, and so do the comments at the end of its lines.
"""

from __future__ import annotations

import ast
import inspect
import io
import re
import textwrap
import tokenize
from collections.abc import Callable, Iterable
from dataclasses import dataclass, field
from functools import cache
from importlib import import_module
from types import ModuleType
from typing import Any

from estimators.c.expressions import Expressions, Text, bound, literal
from estimators.c.kinds import (
    INT,
    NOTHING,
    REAL,
    Absent,
    Kind,
    Lane,
    Record,
    Rows,
    Several,
    declared,
    joined,
    passed,
    structure,
)
from estimators.c.layout import folded, with_declarations

CALL = re.compile(r"\b[a-z]\w*\(")  # of a function: macros are in capitals
SILENT = re.compile(r"# (fmt|type|noqa)\b")  # comments for tools
HELPERS = """\
static inline real smaller(real a, real b) { return b < a ? b : a; }
static inline real larger(real a, real b) { return b > a ? b : a; }
static inline int32_t smaller_whole(int32_t a, int32_t b) { return b < a ? b : a; }
static inline int32_t larger_whole(int32_t a, int32_t b) { return b > a ? b : a; }
static inline real square(real x) { return x * x; }
static inline real cube(real x) { return x * x * x; }
static inline real fourth(real x) { return x * x * (x * x); }"""
OF_TWO = ("atan2", "copysign", "fmod", "hypot")
WORDS = re.findall(  # of C, and of ours
    r"\w+",
    "long short double register signed static auto const switch union volatile "
    "real smaller larger square cube fourth modulo",
)


@dataclass
class Written:
    """A function in C: its name, what it returns, its text."""

    name: str
    kind: Kind
    text: str


@dataclass
class Program:
    """All that has been translated so far."""

    records: dict[type, Record]  # named tuples by their class
    bare: bool = False  # names as they are in Python, or the module's name before them
    chosen: Callable[[Any], Any] = lambda function: function  # what stands for a kernel
    functions: dict[Any, Written] = field(default_factory=dict)
    constants: dict[str, Any] = field(default_factory=dict)  # values by their names in C
    tuples: dict[str, str] = field(default_factory=dict)  # type definitions by name
    names: dict[str, Any] = field(default_factory=dict)

    def translate(self, function: Any, kinds: tuple[Kind, ...]) -> Written:
        """Return a kernel in C for these kinds of arguments; it and all it calls are added."""
        plain = self.plain(function)
        key = plain, kinds
        if key not in self.functions:
            name = self._named(plain, key)
            written = Function(self, plain, kinds, name).written()
            self.functions[key] = written
        return self.functions[key]

    def plain(self, function: Any) -> Callable[..., Any]:
        """Return the Python function that a kernel is compiled from."""
        chosen = self.chosen(function)
        return getattr(chosen, "py_func", chosen)

    def _named(self, plain: Callable[..., Any], key: Any) -> str:
        """Return a name of its own: numbered where it is written for other kinds, too."""
        bare = plain.__name__ if self.bare else f"{tail(plain.__module__)}_{plain.__name__}"
        name, count = bare, 1
        while self.names.setdefault(name, key) != key:
            count += 1
            name = f"{bare}_{count}"
        return name

    def constant(self, module: str, name: str, value: Any) -> Text:
        """Return a module's constant by the name it has in C."""
        whole = f"{tail(module)}_{name}".upper()
        called = name if self.bare and self.constants.get(name, value) == value else whole
        assert isinstance(value, (tuple, int, float)), f"{module}.{name} is {value!r}"
        self.constants[called] = value
        if isinstance(value, tuple):
            return Text(called, Rows((len(value),)))
        return Text(called, INT if isinstance(value, int) else REAL)

    def several(self, parts: tuple[Kind, ...]) -> Several:
        """Return the kind of a tuple; its type is defined."""
        kind = Several(parts)
        for part in parts:
            if isinstance(part, Several):
                self.several(part.parts)
        self.tuples.setdefault(kind.name, structure(kind))
        return kind

    def text(self) -> str:
        """Return everything as C: types, constants and functions."""
        whole = [(v, k) for k, v in self.constants.items() if isinstance(v, int)]
        numbers = {k: int(v) for v, k in sorted(whole)}
        lines = ["enum {", *(f"    {k} = {v}," for k, v in numbers.items()), "};"] * bool(numbers)
        rest = {k: v for k, v in self.constants.items() if k not in numbers}
        parts = ["\n".join(self.tuples.values()), "\n".join(lines)]
        parts += ["\n".join(_defined(k, v) for k, v in rest.items())]
        return "\n\n".join(filter(None, [*parts, *(f.text for f in self.functions.values())]))


def _defined(name: str, value: Any) -> str:
    """Return the definition of a constant."""
    if isinstance(value, tuple):
        numbers = ", ".join(literal(float(v)) for v in value)
        return "\n".join(folded(f"static const {REAL} {name}[{len(value)}] = {{{numbers}}};"))
    return f"#define {name} {literal(value)}"


def macros(names: Iterable[str]) -> str:
    """Return literals and functions of the mathematical library in either width, by one name."""
    wide = ["#define R(x) x", "#define EITHER(wide, narrow) wide"]
    narrow = ["#define R(x) x##f", "#define EITHER(wide, narrow) R(narrow)"]
    for name in names:
        given = "(x, y)" if name in OF_TWO else "(x)"
        wide.append(f"#define {name.upper()}{given} {name}{given}")
        narrow.append(f"#define {name.upper()}{given} {name}f{given}")
    return "\n".join(["#ifdef SENSORLESS_FLOAT64", *wide, "#else", *narrow, "#endif"])


def tail(module: str) -> str:
    """Return the last part of a module's name."""
    return module.rpartition(".")[2]


def of_quartic(function: Any) -> Any:
    """Return a kernel, the quartic's where the energy may be one of two kinds."""
    plain = getattr(function, "py_func", function)
    if plain.__module__ != "model.energy":
        return function
    return getattr(import_module("model.quartic"), plain.__name__, function)


class Function:
    """Writes one function."""

    def __init__(
        self, program: Program, plain: Callable[..., Any], kinds: tuple[Kind, ...], name: str
    ) -> None:
        self.program, self.plain, self.name = program, plain, name
        source = textwrap.dedent(inspect.getsource(plain))
        self.comments, tree = comments(source), ast.parse(source).body[0]
        assert isinstance(tree, ast.FunctionDef)
        _Renamed().visit(tree)
        self.tree, self.parameters = tree, [a.arg for a in tree.args.args]
        self.kinds = dict(zip(self.parameters, kinds, strict=True))
        self.locals: dict[str, Kind] = {}
        self.now: dict[
            str, str
        ] = {}  # what a name is called at present, where it was of another kind before
        self.read: set[str] = set()
        self.used: set[str] | None = None  # what an earlier pass has read
        self.fresh = 0
        self.result: Kind = NOTHING

    def written(self) -> Written:
        """Return the function: a first pass finds the kinds of its variables and which are read."""
        body = self.tree.body[1:] if ast.get_docstring(self.tree) else self.tree.body
        lines, self.used = self._block(body), None
        while self.read != self.used:  # what only dropped assignments read is not used, either
            self.used, self.read, self.fresh, self.now = self.read, set[str](), 0, {}
            lines = self._block(body)
        while lines and lines[-1] == "return;":
            lines.pop()
        given = [
            declared(k, n) for n, k in self.kinds.items() if n in self.parameters and passed(k)
        ]
        kind = self.result
        head = f"static {declared(kind, '').strip()} {self.name}({', '.join(given) or 'void'}) {{"
        named = [n for n in self.parameters if passed(self.kinds[n])]
        idle = [f"(void){n};" for n in named if n not in self.used]
        own = {n: k for n, k in self.locals.items() if n in self.used and passed(k)}
        every = [*idle, *with_declarations(lines, own)]
        inside = [part for line in every for part in folded(f"    {line}")]
        return Written(self.name, kind, "\n".join([self._said(), *folded(head), *inside, "}"]))

    def _said(self) -> str:
        text = ast.get_docstring(self.tree) or self.name
        return "/* " + "\n".join(f" * {x}".rstrip() for x in text.splitlines())[3:] + " */"

    def named(self, name: str) -> Text:
        """Return a variable or a constant."""
        if name in self.kinds or name in self.locals:
            called = self.now.get(name, name)
            self.read.add(called)
            return Text(called, self.kinds.get(called) or self.locals[called])
        value = self.plain.__globals__[name]
        module = home_of(self.plain, name)
        return self.program.constant(module, name, value)

    def found(self, node: ast.expr) -> Any:
        """Return the object that a name or a module's attribute is; None where it is a variable."""
        if isinstance(node, ast.Name):
            return (
                None
                if node.id in self.kinds or node.id in self.locals
                else self.plain.__globals__.get(node.id)
            )
        if isinstance(node, ast.Attribute):
            owner = self.found(node.value)
            return getattr(owner, node.attr) if isinstance(owner, ModuleType) else None
        return None

    def set_kind(self, name: str, kind: Kind) -> str:
        """Note the kind of a variable; return its name, a new one where its kind was another."""
        if name in self.parameters and name not in self.locals:
            assert self.kinds[name] == kind or {self.kinds[name], kind} == {REAL, INT}, (
                f"{self.name}: {name}"
            )
            return name
        called = self.now.get(name, name)
        known = self.locals.get(called, kind)
        if known != kind and {known, kind} != {REAL, INT}:
            called = self.now[name] = f"{called}_{len(self.now) + 2}"
        self.locals[called] = joined(self.locals.get(called, kind), kind)
        return called

    def _block(self, statements: list[ast.stmt]) -> list[str]:
        lines: list[str] = []
        for statement in statements:
            e = Expressions(self)
            method = getattr(self, f"_{type(statement).__name__.lower()}", None)
            assert method is not None, (
                f"{ast.unparse(statement)}: {type(statement).__name__} has no translation"
            )
            written = method(statement, e)
            if written is None:  # nothing after it is reached
                return lines
            said = self.comments.get(statement.lineno)
            lines += [f"/* {said} */"] if said and written else []
            lines += [*e.before, *written]
            if isinstance(statement, ast.Return):
                break
        return lines

    def _inner(self, statements: list[ast.stmt]) -> list[str]:
        return [f"    {line}" for line in self._block(statements)]

    def _expr(self, node: ast.Expr, e: Expressions) -> list[str]:
        return [] if isinstance(node.value, ast.Constant) else [f"{e.write(node.value).text};"]

    def _pass(self, node: ast.Pass, e: Expressions) -> list[str]:
        return []

    def _break(self, node: ast.Break, e: Expressions) -> list[str]:
        return ["break;"]

    def _return(self, node: ast.Return, e: Expressions) -> list[str]:
        if node.value is None:
            return ["return;"]
        value = e.write(node.value)
        self.result = value.kind if self.result == NOTHING else joined(self.result, value.kind)
        if isinstance(self.result, Several):
            self.program.several(self.result.parts)
        return [f"return {e.as_kind(value, self.result)};"]

    def _if(self, node: ast.If, e: Expressions) -> list[str]:
        test = e.write(node.test)
        if test.always is not None:
            return self._block(node.body if test.always else node.orelse)
        lines = [f"if ({test.text}) {{", *self._inner(node.body)]
        rest = self._block(node.orelse)
        if rest and rest[0].startswith("if (") and "}" not in rest[1:-1]:  # else if
            return [*lines, f"}} else {rest[0]}", *rest[1:]]
        if rest:
            lines += ["} else {", *(f"    {line}" for line in rest)]
        return [*lines, "}"]

    def _while(self, node: ast.While, e: Expressions) -> list[str]:
        test = e.write(node.test)
        assert not e.before
        head = "for (;;) {" if test.text == "1" else f"while ({test.text}) {{"
        return [head, *self._inner(node.body), "}"]

    def _for(self, node: ast.For, e: Expressions) -> list[str]:
        assert isinstance(node.target, ast.Name)
        name = "round" if node.target.id == "_" else node.target.id
        if isinstance(node.iter, ast.Tuple):
            values = [e.write(v) for v in node.iter.elts]
            numbers = ", ".join(v.text for v in values)
            self.set_kind(name, REAL)
            self.read.add(name)
            count = f"at_{name}"
            return [
                f"for (int32_t {count} = 0; {count} < {len(values)}; {count}++) {{",
                f"    static const {REAL} {name}_of[{len(values)}] = {{{numbers}}};",
                f"    {name} = {name}_of[{count}];",
                *self._inner(node.body),
                "}",
            ]
        assert isinstance(node.iter, ast.Call)
        assert ast.unparse(node.iter.func) == "range"
        if ast.unparse(node.iter.args[-1]) in ("w.psi_alpha.size", "n") and self._lanes(
            node.iter.args[-1]
        ):
            self.kinds[name] = Lane()  # the only lane
            return self._block(node.body)
        bounds = [bound(e.write(a), 6) for a in node.iter.args]
        begin, end = ("0", bounds[0]) if len(bounds) == 1 else bounds
        hidden = self.locals.pop(name, None)
        self.kinds[name] = INT
        body = self._inner(node.body)
        del self.kinds[name]
        if hidden is not None:  # a variable of the same name outside
            self.locals[name] = hidden
        return [f"for (int32_t {name} = {begin}; {name} < {end}; {name}++) {{", *body, "}"]

    def _lanes(self, node: ast.expr) -> bool:
        """Return whether this is the number of lanes."""
        if isinstance(node, ast.Name):
            return any(
                isinstance(s, ast.Assign) and _sets_lanes(s, node.id)
                for s in ast.walk(self.tree)
                if s is not node
            )
        return True

    def _augassign(self, node: ast.AugAssign, e: Expressions) -> list[str]:
        sign = {ast.Add: "+", ast.Sub: "-", ast.Mult: "*", ast.Div: "/"}[type(node.op)]
        value, target = e.write(node.value), e.write(node.target)
        return [f"{target.text} {sign}= {e.as_kind(value, target.kind)};"]

    def _assign(self, node: ast.Assign, e: Expressions) -> list[str]:
        if len(node.targets) > 1:
            value = e.write(node.value)
            return [line for target in node.targets for line in self._set(target, value, e)]
        target = node.targets[0]
        if isinstance(target, ast.Tuple) and isinstance(node.value, ast.Tuple):
            return self._parallel(target.elts, node.value.elts, e)
        return self._set(target, e.write(node.value), e)

    def _parallel(
        self, targets: list[ast.expr], values: list[ast.expr], e: Expressions
    ) -> list[str]:
        """Assign several at once: by new variables where a later value reads an earlier target."""
        texts = [e.write(v) for v in values]
        touched = [
            {ast.unparse(n) for n in ast.walk(t) if isinstance(n, (ast.Name, ast.Subscript))}
            for t in targets
        ]
        reads = [{ast.unparse(n) for n in ast.walk(v)} for v in values]
        clash = (
            any(_own(targets[n]) & reads[k] for k in range(len(values)) for n in range(k))
            and touched
        )
        if clash:
            texts = [e.kept(text) for text in texts]
        return [
            line
            for target, text in zip(targets, texts, strict=True)
            for line in self._set(target, text, e)
        ]

    def _set(self, target: ast.expr, value: Text, e: Expressions) -> list[str]:
        """Return the assignment of a value to a target; to a tuple's parts one by one."""
        if isinstance(target, ast.Tuple):
            assert isinstance(value.kind, Several)
            held = value if value.text.isidentifier() else e.kept(value)
            parts = [Text(f"{held.text}._{k}", kind) for k, kind in enumerate(value.kind.parts)]
            return [
                line
                for t, part in zip(target.elts, parts, strict=True)
                for line in self._set(t, part, e)
            ]
        if not isinstance(target, ast.Name):
            place = e.write(target)
            return [f"{place.text} = {e.as_kind(value, place.kind)};"]
        if target.id == "_":
            return []
        if isinstance(value.kind, (Absent, Lane)):
            self.kinds[target.id] = value.kind
            return []
        name = self.set_kind(target.id, value.kind)
        if self.used is not None and name not in self.used and name not in self.parameters:
            return [f"(void)({value.text});"] if CALL.search(value.text) else []
        return [f"{name} = {e.as_kind(value, self.kinds.get(name) or self.locals[name])};"]


class _Renamed(ast.NodeTransformer):
    """Gives variables that C has words for another name."""

    def visit_Name(self, node: ast.Name) -> ast.Name:
        """Rename a variable."""
        node.id = f"{node.id}_" if node.id in WORDS else node.id
        return node

    def visit_arg(self, node: ast.arg) -> ast.arg:
        """Rename a parameter."""
        node.arg = f"{node.arg}_" if node.arg in WORDS else node.arg
        return node


def _own(target: ast.expr) -> set[str]:
    """Return what an assignment changes, as text."""
    return {ast.unparse(target)}


def _sets_lanes(statement: ast.Assign, name: str) -> bool:
    """Return whether an assignment gives a name the number of lanes."""
    target, value = statement.targets[0], statement.value
    if isinstance(target, ast.Tuple) and isinstance(value, ast.Tuple):
        pairs = list(zip(target.elts, value.elts, strict=True))
    else:
        pairs = [(target, value)]
    return any(ast.unparse(t) == name and ast.unparse(v) == "w.psi_alpha.size" for t, v in pairs)


def home_of(user: Callable[..., Any], name: str) -> str:
    """Return the module that defines a constant which a function names."""
    module = inspect.getmodule(user)
    return _imported(module).get(name, user.__module__) if module else user.__module__


def comments(source: str) -> dict[int, str]:
    """Return comments of a source by their line, those for tools left out."""
    tokens = tokenize.generate_tokens(io.StringIO(source).readline)
    found = {t.start[0]: t.string for t in tokens if t.type == tokenize.COMMENT}
    return {line: text.lstrip("# ") for line, text in found.items() if not SILENT.match(text)}


@cache
def _imported(module: ModuleType) -> dict[str, str]:
    """Return from which modules a module imports names."""
    tree = ast.parse(inspect.getsource(module))
    places = [n for n in tree.body if isinstance(n, ast.ImportFrom) and n.module]
    return {a.asname or a.name: str(n.module) for n in places for a in n.names}
