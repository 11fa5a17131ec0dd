"""Arrays that a compiled function only looks at: handed on without being counted.

Numba counts who holds an array, and every call that hands one on counts twice, by an atomic
addition of some 20 clock cycles: a third of the time of a replay on a flux map, whose cells go
through some 15 calls a
period.  A borrowed array has no count; who borrows it must neither keep nor return it: it lives as
long as the call that borrowed it.
"""

from __future__ import annotations

from typing import Any

from numba import types
from numba.core import cgutils
from numba.core.errors import TypingError
from numba.extending import intrinsic, overload


def borrowed(value):
    """Return a named tuple whose arrays are not counted, for the calls made from here; anything
    else as it is."""
    return value


@overload(borrowed)
def _typed(value):
    """Return how a value of this type is borrowed."""
    if isinstance(value, types.BaseNamedTuple):
        return lambda value: _uncounted(value)  # type: ignore[call-arg]
    return lambda value: value


@intrinsic
def _uncounted(typing: Any, value: Any) -> Any:
    """Return a tuple with the counts of its arrays left out; TypingError where it holds more."""
    if not all(
        isinstance(kind, types.Array | types.Number | types.Boolean) for kind in value.types
    ):
        raise TypingError(f"{value} holds more than arrays and numbers; borrow a tuple of these")

    def write(context: Any, builder: Any, signature: Any, args: Any) -> Any:
        """Write the same tuple, its arrays held by nobody."""
        (out,) = args
        for k, kind in enumerate(value.types):
            if isinstance(kind, types.Array):
                array = cgutils.create_struct_proxy(kind)(
                    context, builder, builder.extract_value(out, k)
                )
                array.meminfo = cgutils.get_null_value(array.meminfo.type)
                out = builder.insert_value(out, array._getvalue(), k)
        return out

    return value(value), write
