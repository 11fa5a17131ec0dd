"""Which files of the project a file depends on: its imports, theirs, and so on; and one short hash
of them all.

Only imports are followed, at the top of a file or inside a function; those for a type checker alone
are left out.
"""

from __future__ import annotations

import hashlib
import re
from collections.abc import Iterable, Iterator
from functools import cache
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
ROOMS = ("model", "estimators", "sandbox")
# modules without a file, and what they are composed of
COMPOSED = {"sandbox.plant.ports": ("sandbox/plant/compose.py", "model/effects/*.py")}
_FROM = re.compile(r"^[ \t]*from ([\w.]+) import (\([^)]*\)|[^\n#]+)", re.MULTILINE)
_PLAIN = re.compile(r"^[ \t]*import ([\w.]+)", re.MULTILINE)
_TYPES_ONLY = re.compile(r"^if TYPE_CHECKING:\n(?:[ \t]+[^\n]*\n|\n)*", re.MULTILINE)


@cache
def depends_on(path: Path) -> frozenset[Path]:
    """Return a file and every file of the rooms that it imports, directly or through others."""
    found: set[Path] = set()
    left = [path]
    while left:
        file = left.pop()
        if file not in found:
            found.add(file)
            left.extend(imports_of(file))
    return frozenset(found)


@cache
def source_key(*paths: Path) -> str:
    """Return a short hash of the sources of files and of everything of the rooms that they depend
    on."""
    return _digest(frozenset().union(*map(depends_on, paths)))


@cache
def code_files(*patterns: str) -> frozenset[Path]:
    """Return the files below ROOT that match patterns such as "model/**/*.toml", and all that
    Python files of them depend on."""
    found = frozenset(path for pattern in patterns for path in ROOT.glob(pattern))
    return found.union(*(depends_on(path) for path in found if path.suffix == ".py"))


@cache
def code_key(*patterns: str) -> str:
    """Return a short hash of these files: results of one state of the code are told by it from
    those of another."""
    return _digest(code_files(*patterns))


def forget() -> None:
    """Read files again when they are asked for next."""
    for memory in (depends_on, source_key, code_files, code_key, _body, imports_of):
        memory.cache_clear()


def _digest(files: Iterable[Path]) -> str:
    digest = hashlib.sha256()
    for file in sorted(files):
        digest.update(file.name.encode() + b"\0" + _body(file) + b"\0")
    return digest.hexdigest()[:16]


@cache
def _body(path: Path) -> bytes:
    return path.read_bytes()


@cache
def imports_of(path: Path) -> tuple[Path, ...]:
    """Return the files of the rooms that a file imports, anywhere in it but for a type checker
    alone."""
    text = _TYPES_ONLY.sub("", _body(path).decode("utf-8", "replace"))
    return tuple(file for name in _names(text) for file in _files_of(name))


def _names(text: str) -> Iterator[str]:
    """Return the dotted names that a source imports; of `from a import b` both a.b and a."""
    for package, names in _FROM.findall(text):
        yield package
        for name in re.findall(r"(\w+)(?:\s+as\s+\w+)?", names):
            yield f"{package}.{name}"
    yield from _PLAIN.findall(text)


def _files_of(name: str) -> list[Path]:
    """Return the file of a module of the rooms, those of what a module is composed of; none for
    packages (theirs hold no code that kernels see) and others."""
    if name.partition(".")[0] not in ROOMS:
        return []
    if name in COMPOSED:
        return [path for pattern in COMPOSED[name] for path in sorted(ROOT.glob(pattern))]
    path = ROOT.joinpath(*name.split(".")).with_suffix(".py")
    return [path] if path.is_file() else []
