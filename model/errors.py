"""The two ways a user's request can fail, each one sentence: value, bound, remedy."""

from __future__ import annotations

import difflib
from collections.abc import Iterable
from pathlib import PurePath

LONGEST_SENTENCE = 400  # characters; more is a user's text inside it
LONGEST_NAME = 60  # characters of a user's own name repeated to him
LONGEST_LIST = 200  # characters of known names
COMPARED = 2000  # known names among which the nearest is looked for


def shown(text: str) -> str:
    """Return a text as a terminal may be given it: control characters and the like as escapes (\\x1b), one line."""
    return "".join(c if c.isprintable() or c == "\xa0" else c.encode("unicode_escape").decode() for c in text)


def sentence(text: str) -> str:
    """Return a text as one line of at most LONGEST_SENTENCE characters, nothing in it that a terminal obeys."""
    line = shown(" ".join(text.split()))
    tail = LONGEST_SENTENCE // 3
    return line if len(line) <= LONGEST_SENTENCE else f"{line[: LONGEST_SENTENCE - tail - 3]} … {line[-tail:]}"


def brief(value: object, longest: int = 40) -> str:
    """Return what a file or a caller gave, as Python writes it, cut; whatever it is."""
    try:
        return repr(value)[:longest]
    except (ValueError, RecursionError):  # an integer of more digits than Python writes, lists without an end
        return f"a {type(value).__name__} too long to write"


class BadInput(ValueError):
    """A value, name or file that cannot be used as given (exit code 2); its text is one line, see `sentence`."""

    exit_code = 2

    def __init__(self, text: str) -> None:
        super().__init__(sentence(text))


class OwnCodeError(BadInput):
    """The user's own code raised something; its text says what, in which file and line."""


class PhysicsError(RuntimeError):
    """The physics failed while solving: no valid or no stable operating point (exit code 3)."""

    exit_code = 3

    def __init__(self, text: str) -> None:
        super().__init__(sentence(text))


def unknown(kind: str, name: object, known: Iterable[str]) -> BadInput:
    """Return the error for an unknown name, with the nearest known one."""
    names = [n[:LONGEST_NAME] for n in sorted(known)]
    name = str(name)[:LONGEST_NAME] if isinstance(name, (str, PurePath)) else brief(name, LONGEST_NAME)
    near = difflib.get_close_matches(name, names[:COMPARED], n=1, cutoff=0.5)
    listed = ", ".join(names)
    if len(listed) > LONGEST_LIST:
        listed = f"{listed[:LONGEST_LIST].rpartition(', ')[0]}, ... ({len(names)} in all)"
    hint = f"did you mean '{near[0]}'?" if near else f"known: {listed}"
    return BadInput(f"unknown {kind} '{name}'; {hint}")
