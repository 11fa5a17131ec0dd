"""numba's machine code on disk, checked before it is believed.

numba's own files are unpickled as they are: a flipped bit ends in a traceback, or in wrong machine
code.  Here the index of a function carries a checksum, and a data file is named by the hash of its
content, so that two processes that fill a cache at once cannot exchange their entries either.  In
doubt the function is compiled and kept again.
"""

from __future__ import annotations

import inspect
import os
import pickle
import re
import sys
from functools import cache
from pathlib import Path
from typing import Any, NamedTuple

from numba.core import event
from numba.core.caching import Cache
from numba.core.serialize import dumps

from model.kernels.callees import rebuilt
from model.kernels.folders import folder_of
from model.kernels.kept import digest, note_damage, write, write_plain
from model.kernels.kept import read as read_kept
from model.kernels.sources import ROOT

DIGITS = 32  # of the SHA-256 in a file's name
SHORT = 12  # of that of a signature
LINKED = "linked"  # a function as its callers see it
ASKED = "sensorless:kernel"  # an event: a kernel is wanted, compiled or read


class Name(NamedTuple):
    """A compiled function of one signature, the same in every process and for every state of its
    source."""

    module: str
    function: str
    kind: str  # "", or LINKED
    signature: str  # hash of the arguments' types

    @property
    def held(self) -> bool:
        """Whether its machine code is kept, of the source as it is now; nothing is imported to look
        for it."""
        loaded = getattr(sys.modules.get(self.module), "__file__", None)
        file = Path(loaded or ROOT.joinpath(*self.module.split(".")).with_suffix(".py"))
        folder = folder_of(file)
        if folder is None:
            return False
        base = _base(file, self.function, "*", self.kind)
        return any(_inside(folder, file.resolve()).glob(f"{base}.{self.signature}.*.nbc"))


def _inside(folder: Path, source: Path) -> Path:
    """Return the folder of a source's entries."""
    return folder / f"{source.parent.name}_{digest(os.fsencode(source.parent))[:DIGITS]}"


def _base(source: Path, function: str, line: object, kind: str) -> str:
    """Return how the names of a function's entries begin."""
    name = f"{source.stem}.{function}".replace("<", "").replace(">", "")
    return f"{name[:120]}-{line}{kind and '-'}{kind}.py{sys.version_info[0]}{sys.version_info[1]}"


@cache
def _types(arguments: tuple[Any, ...]) -> str:
    """Return a short hash of arguments' types; where functions lie in memory is no part of it."""
    text = ",".join(re.sub("0x[0-9a-f]+", "", str(a)) for a in arguments)
    return digest(text.encode())[:SHORT]


class KernelCache(Cache):
    """One function's entries in a folder: an index `<function>.nbi`, a data file for each
    signature."""

    def __init__(self, function: Any, folder: Path, kind: str = "") -> None:
        source = Path(inspect.getfile(function)).resolve()
        self._py_func = function
        self._kind = kind
        self._name = repr(function)
        self._folder = _inside(folder, source)
        line = function.__code__.co_firstlineno
        self._base = _base(source, function.__qualname__, line, kind)
        self._stamp = digest(source.read_bytes())
        self.enable()

    @property
    def cache_path(self) -> str:
        """The folder of the entries."""
        return str(self._folder)

    def named(self, sig: Any) -> Name:
        """Return what the function is called with a signature, or arguments' types."""
        arguments = tuple(getattr(sig, "args", sig))
        function = self._py_func
        return Name(function.__module__, function.__qualname__, self._kind, _types(arguments))

    def flush(self) -> None:
        """Forget the entries."""
        self._write_index({})

    def load_overload(self, sig: Any, target_context: Any) -> Any:
        """Return the compiled function for a signature; None where it is not kept or not what was
        kept."""
        target_context.refresh()
        event.broadcast(event.Event(ASKED, event.EventStatus.START, self.named(sig)))
        if not self._enabled:
            return None
        name = self._index().get(self._index_key(sig, target_context.codegen()))
        if name is None:
            return None
        path = self._folder / name
        try:
            body = path.read_bytes()
        except OSError:
            return None
        if f".{digest(body)[:DIGITS]}." not in name:
            note_damage(path)
            return None
        try:
            return rebuilt(target_context, pickle.loads(body))
        except Exception:  # whole, but not of this numba or this machine
            note_damage(path)
            return None

    def save_overload(self, sig: Any, data: Any) -> None:
        """Keep the compiled function for a signature, unless it holds what is of this process
        alone."""
        if (
            not self._enabled
            or any(not x.can_cache for x in data.lifted)
            or data.library.has_dynamic_globals
        ):
            return
        key, body = self._index_key(sig, data.codegen), dumps(data._reduce())
        name = f"{self._base}.{self.named(sig).signature}.{digest(body)[:DIGITS]}.nbc"
        write_plain(self._folder / name, body)
        self._write_index({**self._index(), key: name})

    def _index(self) -> dict[Any, str]:
        path = self._folder / f"{self._base}.nbi"
        body = read_kept(path)
        if body is None:
            return {}
        try:
            stamp, names = pickle.loads(body)
        except Exception:  # whole, but of classes that are no longer there
            note_damage(path)
            return {}
        return dict(names) if stamp == self._stamp else {}

    def _write_index(self, names: dict[Any, str]) -> None:
        write(self._folder / f"{self._base}.nbi", dumps((self._stamp, names)))
