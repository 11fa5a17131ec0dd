"""One decorator for every compiled function: numba, cached on disk, never stale.

A cached kernel is stamped with its own file only, so a changed callee in another module would leave the caller's
machine code in place.  A function is therefore kept in a folder named by a hash of its file and of every file that this
one imports, directly or not (`model.sources`); what is in it is checked before it is believed (`model.kernel_cache`).
"""

from __future__ import annotations

import atexit
import inspect
import os
import shutil
import tempfile
import time
from collections.abc import Callable
from functools import cache
from pathlib import Path
from threading import Lock
from typing import Any

import llvmlite.binding
import numba
from numba.core.typeinfer import register_dispatcher

from model.callees import Kernel
from model.compiling import watch
from model.kernel_cache import KernelCache
from model.sources import depends_on, source_key

# Loops over a batch's lanes have a known count (8 to 32).  LLVM would write out short ones lane by lane, which then are
# no vector code any more: a device drop took five times as long.
llvmlite.binding.set_option("", "-unroll-full-max-count=4")

KEPT_DAYS = 30
_COMPILING = Lock()
_MORE: list[tuple[str, Path]] = []  # what kernels depend on beside the rooms' files: those that import a file


def depend_on(key: str, through: Path) -> None:
    """Keep kernels decorated from now on, where they depend on a file, apart from those without `key`."""
    _MORE.append((key, through))


def cache_home() -> Path:
    """Return the folder for compiled kernels and memoised designs (`SENSORLESS_CACHE` or the user's cache)."""
    user = os.environ.get("XDG_CACHE_HOME") or os.path.expanduser("~/.cache")
    return Path(os.environ.get("SENSORLESS_CACHE") or os.path.join(user, "sensorless-sandbox"))


watch(cache_home())


@cache
def _folder(key: str) -> Path | None:
    """Return a folder for kernels: in the cache, or of this process alone; None where nothing can be written."""
    path = cache_home() / f"kernels-{key}"
    try:
        if not path.exists():
            path.mkdir(parents=True, exist_ok=True)
            for old in path.parent.glob("kernels-*"):
                if time.time() - old.stat().st_mtime > KEPT_DAYS * 86400:
                    shutil.rmtree(old, ignore_errors=True)
        with tempfile.TemporaryFile(dir=path):  # a read-only home still runs, from a cache of this process alone
            return path
    except OSError:
        return _own_folder()


@cache
def _own_folder() -> Path | None:
    try:
        own = tempfile.mkdtemp(prefix="sensorless-kernels-")
    except OSError:
        return None
    atexit.register(shutil.rmtree, own, ignore_errors=True)
    return Path(own)


def _folder_of(function: Callable[..., Any]) -> Path | None:
    """Return the folder that keeps a function's machine code; None for one that no file holds."""
    file = Path(inspect.getfile(function))
    if not file.is_file():
        return None
    file = file.resolve()
    more = [key for key, through in _MORE if through in depends_on(file)]
    return _folder("-".join([numba.__version__, source_key(file), *more]))


def kernel_folder() -> Path:
    """Return the folder for sources written for kernels decorated now, or one of this process alone."""
    name = "-".join(["ports", *(key for key, _ in _MORE)])
    return _folder(name) or Path(tempfile.mkdtemp(prefix="sensorless-kernels-"))


def kernel(function: Callable[..., Any]) -> Any:
    """Compile a function on first use: strict IEEE arithmetic, no GIL, machine code cached under the source key."""
    return kernel_as(None)(function)


def inlined(function: Callable[..., Any]) -> Any:
    """Compile as `kernel` does, the machine code always placed inside the caller: for what runs at every stage."""
    return kernel_as(None, forceinline=True)(function)


def kernel_as(signature: Any, **more: Any) -> Callable[[Callable[..., Any]], Any]:
    """Compile a function at import for one explicit signature, so that it can be passed as a function pointer."""

    def compile_(function: Callable[..., Any]) -> Any:
        """Return the dispatcher of a function, its machine code kept in the rooms' own folder."""
        options: dict[str, Any] = {"nogil": True, "error_model": "numpy", **more}
        if numba.config.DISABLE_JIT:  # type: ignore[attr-defined]
            return function
        compiled: Any = Kernel(function, targetoptions=options)
        twin = compiled.with_twin() if signature is None else None
        if (folder := _folder_of(function)) is not None:
            compiled._cache = KernelCache(function, folder)
            if twin is not None:
                twin._cache = KernelCache(function, folder, "linked")
        if signature is not None:
            with register_dispatcher(compiled):
                compiled.compile(signature)
                compiled.disable_compile()
        return compiled

    return compile_


def compiled_as(signature: Any, function: Callable[..., Any]) -> Any:
    """Return a function compiled for a signature, once a process, whichever thread asks first."""
    with _COMPILING:
        return _compiled_as(signature, function)


@cache
def _compiled_as(signature: Any, function: Callable[..., Any]) -> Any:
    return kernel_as(signature)(function)
