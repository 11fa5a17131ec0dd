"""Kernels in C: the statements of each function, translated as they stand in Python, comments
included.

Numbers, tuples, loops and calls are all that kernels use; what else turns up ends in an
AssertionError that names it.
"""

from __future__ import annotations

import ast
from collections.abc import Iterable, Iterator

from estimators.c.collect import Function, Program
from estimators.c.expressions import INT, REAL, REALS, STRUCTURES, Expressions, Text, as_real
from estimators.c.layout import folded, places_of, together

STEP_TYPES = (REALS, "Sample", "Belief", "Tuning")
Kinds = str | tuple[str, ...]


def translated(program: Program, step: str) -> list[str]:
    """Return every function of a program in C, callees first."""
    given: dict[str, list[str]] = {step: list(STEP_TYPES)}
    returns: dict[str, Kinds] = {name: _shape(program, name) for name in program.functions}
    texts, before = dict.fromkeys(program.functions, ""), {"": ""}
    while texts != before:
        # until types have come down from the step, and kinds of results up to it
        before = dict(texts)
        for name, function in reversed(program.functions.items()):
            texts[name] = _Writer(program, function, given, returns).text()
    return [texts[name] for name in program.functions]


def _shape(program: Program, name: str) -> Kinds:
    """Return what a function returns, as far as its tree says."""
    for node in ast.walk(program.functions[name].tree):
        if isinstance(node, ast.Return) and node.value is not None:
            if isinstance(node.value, ast.Tuple):
                return tuple(REAL for _ in node.value.elts)
            if isinstance(node.value, ast.Call):
                called = ast.unparse(node.value.func)
                return _shape(program, called) if called in program.functions else _single(called)
            return REAL
    return "void"


def _single(called: str) -> str:
    return called if called in STRUCTURES else REAL


def declared(kind: str, name: str) -> str:
    """Return a declaration of a parameter or variable."""
    if kind == "Estimate":
        return f"{STRUCTURES[kind][0]} {name}"
    if kind in STRUCTURES:
        return f"const {STRUCTURES[kind][0]} *{name}"
    return f"{kind}{name}" if kind.endswith("*") else f"{kind} {name}"


class _Writer:
    """Writes one function."""

    def __init__(
        self,
        program: Program,
        function: Function,
        given: dict[str, list[str]],
        returns: dict[str, Kinds],
    ) -> None:
        self.program, self.function, self.given, self.returns = program, function, given, returns
        self.names = [a.arg for a in function.tree.args.args]
        kinds = given.get(function.name, [REAL] * len(self.names))
        self.types: dict[str, str] = dict(zip(self.names, kinds, strict=True))
        self.blocks = places_of(function.tree)
        self.at: tuple[int, ...] = ()
        self.done: set[str] = set(self.names)
        self.lengths: dict[str, int] = {}

    def text(self) -> str:
        """Return the function."""
        self._lines(self.function.tree.body, ())  # once for the types of its variables
        self.done, self.unused = set(self.names), set[str]()
        body = list(self._lines(self._body(), ()))
        body = body[:-1] if body[-1].strip() == "return;" else body
        kind = self.returns[self.function.name]
        parameters = [declared(self.types[n], n) for n in self.names]
        if isinstance(kind, tuple):
            parameters += [f"{k} *out_{n}" for n, k in enumerate(kind)]
        used = {n.id for n in ast.walk(self.function.tree) if isinstance(n, ast.Name)}
        idle = [f"    (void){n};" for n in self.names if n not in used]
        result = "void" if isinstance(kind, tuple) else STRUCTURES.get(kind, (kind,))[0]
        head = f"static {result} {self.function.name}({', '.join(parameters)}) {{"
        spare = [f"    {k} unused_{'i' if k == INT else 'r'};" for k in sorted(self.unused)]
        return "\n".join([self._said(), *folded(head), *spare, *idle, *body, "}"])

    def _body(self) -> list[ast.stmt]:
        body = self.function.tree.body
        return body[1:] if ast.get_docstring(self.function.tree) else body

    def _said(self) -> str:
        text = ast.get_docstring(self.function.tree) or ""
        return (
            "/* "
            + "\n * ".join(line.rstrip() for line in text.splitlines()).replace("\n * \n", "\n *\n")
            + " */"
        )

    def _lines(self, statements: Iterable[ast.stmt], block: tuple[int, ...]) -> list[str]:
        """Return the lines of a block."""
        lines: list[str] = []
        for name, where in self.blocks.items():
            here = where.block == block and not where.at_once
            if here and name not in self.done and name in self.types:
                lines.append(f"{declared(self.types[name], name)};")
                self.done.add(name)
        for statement in statements:
            self.at = block
            e = Expressions(self.program, self.function, self.types, self.returns)
            e.arguments = self._heard
            written = list(getattr(self, f"_{type(statement).__name__.lower()}")(statement, e))
            comment = self.function.comments.get(statement.lineno)
            if comment:
                lines.append(f"/* {comment} */")
            lines += [*e.before, *written]
        return [f"    {part}" for line in together(lines) for part in folded(line)]

    def _heard(self, name: str, arguments: list[Text]) -> None:
        """Take the types of a call's arguments for the parameters of the function called."""
        known = self.given.setdefault(name, [str(a.type) for a in arguments])
        for n, a in enumerate(arguments):
            if a.type != known[n]:
                known[n] = REAL if {a.type, known[n]} <= {REAL, INT} else str(a.type)

    def _inner(self, statement: ast.stmt, statements: list[ast.stmt], which: int) -> list[str]:
        at = self.at
        lines = self._lines(statements, (*at, statement.lineno, which))
        self.at = at
        return lines

    def _expr(self, node: ast.Expr, e: Expressions) -> Iterator[str]:
        if not isinstance(node.value, ast.Constant):
            yield f"{e.write(node.value).text};"

    def _pass(self, node: ast.Pass, e: Expressions) -> Iterator[str]:
        yield ";"

    def _break(self, node: ast.Break, e: Expressions) -> Iterator[str]:
        yield "break;"

    def _return(self, node: ast.Return, e: Expressions) -> Iterator[str]:
        assert node.value is not None
        kinds = self.returns[self.function.name]
        if not isinstance(kinds, tuple):
            found = e.write(node.value)
            self.returns[self.function.name] = found.type
            yield f"return {found.text};"
            return
        if isinstance(node.value, ast.Call):
            yield e.write(node.value).text.format(", ".join(f"out_{n}" for n in range(len(kinds))))
            self.returns[self.function.name] = self.returns[ast.unparse(node.value.func)]
        else:
            assert isinstance(node.value, ast.Tuple)
            found_kinds = []
            for n, value in enumerate(node.value.elts):
                found = e.write(value)
                found_kinds.append(str(found.type))
                yield f"*out_{n} = {found.text};"
            self.returns[self.function.name] = tuple(found_kinds)
        yield "return;"

    def _if(self, node: ast.If, e: Expressions) -> Iterator[str]:
        yield f"if ({e.write(node.test).text}) {{"
        yield from self._inner(node, node.body, 0)
        rest = node.orelse
        while len(rest) == 1 and isinstance(rest[0], ast.If):
            yield f"}} else if ({e.write(rest[0].test).text}) {{"
            if comment := self.function.comments.get(rest[0].lineno):
                yield f"    /* {comment} */"
            yield from self._inner(rest[0], rest[0].body, 0)
            rest = rest[0].orelse
        if rest:
            yield "} else {"
            yield from self._inner(node, rest, 1)
        yield "}"

    def _while(self, node: ast.While, e: Expressions) -> Iterator[str]:
        endless = isinstance(node.test, ast.Constant) and node.test.value
        yield "for (;;) {" if endless else f"while ({e.write(node.test).text}) {{"
        yield from self._inner(node, node.body, 0)
        yield "}"

    def _for(self, node: ast.For, e: Expressions) -> Iterator[str]:
        assert isinstance(node.target, ast.Name)
        name = "round" if node.target.id == "_" else node.target.id
        self.done.add(name)
        if isinstance(node.iter, ast.Tuple):
            values = ", ".join(e.write(v).text for v in node.iter.elts)
            self.types[name] = REAL
            yield f"static const {REAL} {name}_of[{len(node.iter.elts)}] = {{{values}}};"
            yield f"for (int32_t at = 0; at < {len(node.iter.elts)}; at++) {{"
            yield f"    const {REAL} {name} = {name}_of[at];"
        else:
            assert isinstance(node.iter, ast.Call)
            bounds = [e.inside(a, 6) for a in node.iter.args]
            self.types[name] = INT
            begin, end = ("0", bounds[0]) if len(bounds) == 1 else bounds
            yield f"for (int32_t {name} = {begin}; {name} < {end}; {name}++) {{"
        yield from self._inner(node, node.body, 0)
        yield "}"

    def _augassign(self, node: ast.AugAssign, e: Expressions) -> Iterator[str]:
        sign = {ast.Add: "+", ast.Sub: "-", ast.Mult: "*", ast.Div: "/"}[type(node.op)]
        yield f"{e.write(node.target).text} {sign}= {e.write(node.value).text};"

    def _assign(self, node: ast.Assign, e: Expressions) -> Iterator[str]:
        target, value = node.targets[0], node.value
        if isinstance(target, ast.Tuple) and isinstance(value, ast.Call):
            yield from self._results(target, value, e)
        elif isinstance(target, ast.Tuple):
            if isinstance(value, ast.IfExp):  # (a, b) if c else (d, e)
                yes, no = value.body, value.orelse
                assert isinstance(yes, ast.Tuple)
                assert isinstance(no, ast.Tuple)
                value = ast.Tuple(
                    [ast.IfExp(value.test, a, b) for a, b in zip(yes.elts, no.elts, strict=True)]
                )
            assert isinstance(value, ast.Tuple)
            yield from self._parallel(target.elts, value.elts, e)
        else:
            for each in node.targets:
                yield self._set(
                    each,
                    e.write(value) if not isinstance(value, ast.Tuple) else self._array(value, e),
                    e,
                )

    def _array(self, value: ast.Tuple, e: Expressions) -> Text:
        return Text(f"{{{', '.join(e.write(v).text for v in value.elts)}}}", f"[{len(value.elts)}]")

    def _parallel(
        self, targets: list[ast.expr], values: list[ast.expr], e: Expressions
    ) -> Iterator[str]:
        """Assign several at once; by way of new variables where a later value reads an earlier
        target."""
        texts = [self._array(v, e) if isinstance(v, ast.Tuple) else e.write(v) for v in values]
        clash = any(_touched(targets[n]) & _read(v) for k, v in enumerate(values) for n in range(k))
        if clash:
            kept = []
            for text in texts:
                e.fresh += 1
                yield f"const {text.type} got_{e.fresh} = {text.text};"
                kept.append(Text(f"got_{e.fresh}", text.type))
            texts = kept
            yield from (self._set(t, text, e) for t, text in zip(targets, texts, strict=True))
        else:
            for t, text in zip(targets, texts, strict=True):
                yield self._set(t, text, e)

    def _set(self, target: ast.expr, value: Text, e: Expressions) -> str:
        """Return one assignment, a declaration where the variable is new."""
        if not isinstance(target, ast.Name):
            return f"{e.write(target).text} = {as_real(value) or value.text};"
        name, kind = target.id, str(value.type)
        if kind.startswith("["):
            self.types[name] = REALS
            self.done.add(name)
            return f"const {REAL} {name}{kind} = {value.text};"
        if kind == "Energy":
            self.types[name] = kind
            self.done.add(name)
            return f"{declared(kind, name)} = &{value.text};"
        known = self.types.get(name, kind)
        self.types[name] = REAL if REAL in (known, kind) else known
        if name in self.done:
            return f"{name} = {value.text};"
        self.done.add(name)
        return f"{declared(self.types[name], name)} = {value.text};"

    def _results(self, target: ast.Tuple, call: ast.Call, e: Expressions) -> Iterator[str]:
        """Write a call with several results."""
        found = e.write(call)
        places, after = [], []
        for each, kind in zip(target.elts, found.type, strict=True):
            if isinstance(each, ast.Name) and each.id == "_":
                self.unused.add(kind) if hasattr(self, "unused") else None
                places.append(f"&unused_{'i' if kind == INT else 'r'}")
            elif isinstance(each, ast.Name):
                self.types.setdefault(each.id, kind)
                if each.id not in self.done:
                    self.done.add(each.id)
                    e.before.append(f"{declared(kind, each.id)};")
                places.append(f"&{each.id}")
            else:
                name = e.temporary(kind)
                places.append(f"&{name}")
                after.append(f"{e.write(each).text} = {name};")
        yield found.text.format(", ".join(places))
        yield from after


def _touched(target: ast.expr) -> set[str]:
    return {
        n.id
        for n in ast.walk(target)
        if isinstance(n, ast.Name) and not (isinstance(target, ast.Subscript) and n is target.slice)
    }


def _read(value: ast.expr) -> set[str]:
    return {n.id for n in ast.walk(value) if isinstance(n, ast.Name)}
