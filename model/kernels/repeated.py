"""What numba works out again for every function, answered once: a fifth of the time of compiling.

Each of these is numba's own function, found at the same place, with the same result.  Importing
this puts them there.
"""

from __future__ import annotations

from collections.abc import Mapping
from functools import cache
from types import BuiltinFunctionType
from typing import Any

from numba.core import ir
from numba.core.compiler import Flags
from numba.core.targetconfig import TargetConfig
from numba.core.types import npytypes
from numba.core.types.functions import BaseFunction

# a record's type is written out, field by field, before each pass over a function that takes one
# and for each field that is read: 5900 times 0.3 ms for a replay
npytypes.Record.__repr__ = cache(npytypes.Record.__repr__)  # type: ignore[method-assign]

_resolve = BaseFunction.get_call_type
# the type and the implementation of a built-in function of arguments of these types
_known: dict[Any, Any] = {}


def get_call_type(self: Any, context: Any, args: Any, kws: Mapping[str, Any]) -> Any:
    """Return a call's type; for `+` of two floats, asked thousands of times, not through all forms
    of `+` each time."""
    if not isinstance(self.typing_key, BuiltinFunctionType):
        return _resolve(self, context, args, kws)
    key = self, context, args, tuple(kws.items())
    if key not in _known:
        found = _resolve(self, context, args, kws)
        if found is None:  # there is no such form: numba says so
            return None
        _known[key] = found, self._impl_keys[found.args]
    found, implementation = _known[key]
    self._impl_keys[found.args] = implementation
    return found


# types whose values hold no variables: most parts are texts, numbers and places in a file
_bare: set[type] = set()


def variables(self: ir.Inst, value: Any) -> list[ir.Var]:
    """Return the variables in a part of an instruction."""
    found: list[ir.Var] = []
    _collect(value, found)
    return found


def _collect(value: Any, found: list[ir.Var]) -> None:
    """Append the variables in a part of an instruction, in their order."""
    if isinstance(value, ir.Var):
        found.append(value)
        return
    if isinstance(value, ir.Inst):
        found.extend(value.list_vars())
        return
    if isinstance(value, dict):
        value = value.values()
    elif not isinstance(value, (list, tuple)):
        _bare.add(type(value))
        return
    for part in value:
        if type(part) not in _bare:
            _collect(part, found)


BaseFunction.get_call_type = get_call_type  # type: ignore[method-assign]
ir.Inst._rec_list_vars = variables  # type: ignore[method-assign]


class Options(Flags):
    """numba's flags of one compilation, which it compares ten thousand times: by what is set, not
    by all fifty."""

    __slots__ = ()
    _HASH = hash(Flags())  # numba's, too, is the same for all

    def __eq__(self, other: object) -> bool:
        if not isinstance(other, TargetConfig):
            return NotImplemented
        mine, others = self._values, other._values
        return mine == others or all(
            getattr(self, k) == getattr(other, k) for k in mine.keys() | others.keys()
        )

    def __hash__(self) -> int:
        return self._HASH
