"""The two ways a user's request can fail, each one sentence: value, bound, remedy."""

from __future__ import annotations

import difflib
from collections.abc import Iterable


class BadInput(ValueError):
    """A value, name or file that cannot be used as given (exit code 2)."""

    exit_code = 2


class PhysicsError(RuntimeError):
    """The physics failed while solving: no valid or no stable operating point (exit code 3)."""

    exit_code = 3


def unknown(kind: str, name: object, known: Iterable[str]) -> BadInput:
    """Return the error for an unknown name, with the nearest known one."""
    names = sorted(known)
    name = str(name)[:60]
    near = difflib.get_close_matches(name, names, n=1, cutoff=0.5)
    hint = f"did you mean '{near[0]}'?" if near else ""
    return BadInput(f"unknown {kind} '{name}'; {hint or 'known: ' + ', '.join(names)}")
