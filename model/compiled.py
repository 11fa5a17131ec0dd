"""One decorator for every compiled function: numba, cached on disk, never stale.

A cached kernel is stamped with its own file only, so a changed callee in another module would leave the caller's
machine code in place.  The cache folder is therefore keyed by a hash of every source file that a kernel can depend on;
what is in it is checked before it is believed (`model.kernel_cache`).
"""

from __future__ import annotations

import atexit
import hashlib
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

import numba
from numba.core.dispatcher import Dispatcher
from numba.core.typeinfer import register_dispatcher

from model.compiling import ROOMS, watch
from model.kernel_cache import KernelCache

NO_KERNELS = (
    "sandbox/gap",
    "sandbox/public",
    "sandbox/cli",
    "sandbox/sweep",
)  # nothing compiled is in a file of these or depends on one (tests/test_house.py)
KEPT_DAYS = 30


_MORE: list[str] = []  # what kernels depend on beside the rooms' files


def depend_on(key: str) -> None:
    """Keep kernels decorated from now on apart from those that do not depend on what `key` stands for."""
    global _CACHE_DIR
    _MORE.append(key)
    _CACHE_DIR = _cache_dir()


def cache_home() -> Path:
    """Return the folder for compiled kernels and memoised designs (`SENSORLESS_CACHE` or the user's cache)."""
    user = os.environ.get("XDG_CACHE_HOME") or os.path.expanduser("~/.cache")
    return Path(os.environ.get("SENSORLESS_CACHE") or os.path.join(user, "sensorless-sandbox"))


def source_key() -> str:
    """Return a short hash of every source file of the rooms: a constant or a field's place goes into kernels, too."""
    root = Path(__file__).resolve().parent.parent
    digest = hashlib.sha256(numba.__version__.encode())
    for room in ROOMS:
        for path in sorted((root / room).rglob("*.py")):
            if path.parent.relative_to(root).as_posix() in NO_KERNELS:
                continue
            digest.update(path.name.encode() + path.read_bytes())
    return digest.hexdigest()[:16]


def _cache_dir() -> Path | None:
    """Return the folder for kernels: in the cache, or of this process alone; None where nothing can be written."""
    path = cache_home() / "-".join(["kernels", source_key(), *_MORE])
    try:
        if not path.exists():
            path.mkdir(parents=True, exist_ok=True)
            for old in path.parent.glob("kernels-*"):
                if time.time() - old.stat().st_mtime > KEPT_DAYS * 86400:
                    shutil.rmtree(old, ignore_errors=True)
        with tempfile.TemporaryFile(dir=path):  # a read-only home still runs, from a cache of this process alone
            return path
    except OSError:
        try:
            own = tempfile.mkdtemp(prefix="sensorless-kernels-")
        except OSError:
            return None
        atexit.register(shutil.rmtree, own, ignore_errors=True)
        return Path(own)


_CACHE_DIR = _cache_dir()
_COMPILING = Lock()
watch(cache_home())


def kernel_folder() -> Path:
    """Return the folder in which kernels decorated now are kept, or one of this process alone."""
    return _CACHE_DIR or Path(tempfile.mkdtemp(prefix="sensorless-kernels-"))


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
        compiled: Any = numba.njit(**options)(function)
        if not isinstance(compiled, Dispatcher):  # NUMBA_DISABLE_JIT
            return compiled
        if _CACHE_DIR is not None and os.path.isfile(inspect.getfile(function)):
            compiled._cache = KernelCache(function, _CACHE_DIR)  # type: ignore[attr-defined]
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
