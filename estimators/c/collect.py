"""What an estimator's step is made of: every function it calls, every constant and comment, from
the Python sources."""

from __future__ import annotations

import ast
import inspect
import io
import math
import textwrap
import tokenize
from collections.abc import Callable
from dataclasses import dataclass, field
from importlib import import_module
from typing import Any

ENERGY, QUARTIC = "model.energy", "model.quartic"  # either energy, and the one that C has
BUILT_IN = ("range", "min", "max", "abs", "int")


@dataclass(frozen=True)
class Function:
    """One function: its name, its tree, and the comments at the end of its lines (by line of the
    tree)."""

    name: str
    tree: ast.FunctionDef
    comments: dict[int, str]
    defaults: dict[str, float]
    # constants that another module has with another value, by their name in C
    aliases: dict[str, str]


@dataclass
class Program:
    """Functions, callees first, and the constants (whole or real numbers) that they name."""

    functions: dict[str, Function] = field(default_factory=dict)
    constants: dict[str, int | float] = field(default_factory=dict)
    homes: dict[str, str] = field(default_factory=dict)


def collect(step: Any) -> Program:
    """Return everything below a compiled step."""
    program = Program()
    _add(program, step)
    return program


def _plain(function: Any) -> Callable[..., Any]:
    """Return the Python function of a kernel; the quartic's where the energy may be one of two
    kinds."""
    plain: Callable[..., Any] = getattr(function, "py_func", function)
    if plain.__module__ == ENERGY and hasattr(import_module(QUARTIC), plain.__name__):
        return _plain(getattr(import_module(QUARTIC), plain.__name__))
    return plain


def _add(program: Program, kernel: Any) -> None:
    """Add a function below its callees; two of one name cannot be told apart in C."""
    function = _plain(kernel)
    home = f"{function.__module__}.{function.__name__}"
    if program.homes.setdefault(function.__name__, home) != home:
        raise AssertionError(f"{home} and {program.homes[function.__name__]} share a name")
    if function.__name__ in program.functions:
        return
    source = textwrap.dedent(inspect.getsource(function))
    tree = ast.parse(source).body[0]
    assert isinstance(tree, ast.FunctionDef)
    names = {a.arg for a in tree.args.args} | {
        n.id for n in ast.walk(tree) if isinstance(n, ast.Name) and isinstance(n.ctx, ast.Store)
    }
    aliases: dict[str, str] = {}
    for node in ast.walk(ast.Module(tree.body, [])):
        if isinstance(node, ast.Name) and node.id not in names:
            _name(program, node.id, function, aliases)
    program.functions[function.__name__] = Function(
        function.__name__,
        tree,
        _comments(source),
        dict(zip(*_defaults(tree), strict=True)),
        aliases,
    )


def _defaults(tree: ast.FunctionDef) -> tuple[list[str], list[float]]:
    given = [ast.literal_eval(node) for node in tree.args.defaults]
    return [a.arg for a in tree.args.args[len(tree.args.args) - len(given) :]], given


def _name(program: Program, name: str, user: Callable[..., Any], aliases: dict[str, str]) -> None:
    """Add what a global name of a function stands for."""
    found = user.__globals__.get(name)
    if name in BUILT_IN or found is math or isinstance(found, type):
        return
    if callable(found):
        _add(program, found)
    else:
        assert isinstance(found, (int, float)), f"{name} in {user.__name__} is {found!r}"
        if program.constants.get(name, found) != found:
            aliases[name] = f"{user.__module__.rpartition('.')[2].upper()}_{name}"
        program.constants[aliases.get(name, name)] = found


def _comments(source: str) -> dict[int, str]:
    """Return comments by their line."""
    tokens = tokenize.generate_tokens(io.StringIO(source).readline)
    return {
        t.start[0]: t.string.lstrip("# ")
        for t in tokens
        if t.type == tokenize.COMMENT and "fmt:" not in t.string
    }
