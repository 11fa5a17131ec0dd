"""What an estimator of one's own is written with, beside the types of the page: compiled functions,
the C header."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from estimators.c.build import HEADERS


def compiled(function: Callable[..., Any]) -> Callable[..., Any]:
    """Compile a function that a compiled step calls, on its first use; a decorator.

    Parameters
    ----------
    function : callable
        Of floats, arrays and named tuples, as numba takes them; it stands in a file.

    Returns
    -------
    callable
        The compiled function; its machine code is kept on disk, and made anew when its file
        changes.

    Raises
    ------
    numba.core.errors.NumbaError
        At its first call, for what numba cannot compile.

    Examples
    --------
    >>> from sandbox import compiled
    >>> compiled(lambda x: 2.0 * x)(1.5)
    3.0
    """
    from model.compiled import kernel

    made: Callable[..., Any] = kernel(function)
    return made


def compiled_step(function: Callable[..., Any]) -> Callable[..., Any]:
    """Compile an estimator's step for the closed loop, which then calls it at full speed; a
    decorator.

    Parameters
    ----------
    function : callable
        ``step(state, sample, belief, tuning)``: the state is an array of floats, which it changes;
        it returns an `Estimate`. Functions that it calls are `compiled`.

    Returns
    -------
    callable
        The compiled step, for `Estimator`.

    Raises
    ------
    numba.core.errors.NumbaError
        For what numba cannot compile, or a step that returns anything but an `Estimate` of eight
        floats.

    Examples
    --------
    >>> from sandbox import Estimate, compiled_step
    >>> @compiled_step
    ... def still(state, sample, belief, tuning):
    ...     return Estimate(0.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0)
    """
    from estimators.contract import STEP
    from model.compiled import kernel_as

    made: Callable[..., Any] = kernel_as(STEP)(function)
    return made


def get_include() -> str:
    """Return the folder of `sensorless_estimator.h` and `startup.h`, for a C compiler's `-I`.

    Returns
    -------
    str
        What `sensorless include` prints.

    Examples
    --------
    >>> from pathlib import Path
    >>> from sandbox import get_include
    >>> (Path(get_include()) / "sensorless_estimator.h").is_file()
    True
    """
    return str(HEADERS)
