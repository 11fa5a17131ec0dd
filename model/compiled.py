"""The decorators of compiled functions: numba, cached on disk, never stale; `model/kernels` says
how."""

from __future__ import annotations

import inspect
from collections.abc import Callable
from functools import cache
from pathlib import Path
from threading import Lock
from typing import Any

import llvmlite.binding
import numba
from numba.core.typeinfer import register_dispatcher

from model.kernels.cache import LINKED, KernelCache
from model.kernels.callees import Kernel
from model.kernels.folders import cache_home, folder_of
from model.kernels.notice import watch

# Loops over a batch's lanes have a known count (8 to 32).  LLVM would write out short ones lane by
# lane, which then are no vector code any more: a device drop took five times as long.
llvmlite.binding.set_option("", "-unroll-full-max-count=4")

_COMPILING = Lock()


WATCH = watch(cache_home())


def kernel(function: Callable[..., Any]) -> Any:
    """Compile a function on first use: strict IEEE arithmetic, no GIL, machine code cached under
    the source key."""
    return kernel_as(None)(function)


def inlined(function: Callable[..., Any]) -> Any:
    """Compile as `kernel` does, the machine code always placed inside the caller: for what runs at
    every stage."""
    return kernel_as(None, forceinline=True)(function)


def kernel_as(signature: Any, **more: Any) -> Callable[[Callable[..., Any]], Any]:
    """Compile a function at import for one explicit signature, so that it can be passed as a
    function pointer."""

    def compile_(function: Callable[..., Any]) -> Any:
        """Return the dispatcher of a function, its machine code kept in the rooms' own folder."""
        options: dict[str, Any] = {"nogil": True, "error_model": "numpy", **more}
        if numba.config.DISABLE_JIT:  # type: ignore[attr-defined]
            return function
        compiled: Any = Kernel(function, targetoptions=options)
        twin = compiled.with_twin() if signature is None else None
        if (folder := folder_of(Path(inspect.getfile(function)))) is not None:
            compiled._cache = KernelCache(function, folder)
            if twin is not None:
                twin._cache = KernelCache(function, folder, LINKED)
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
