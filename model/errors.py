"""The two ways a user's request can fail, each one sentence: value, bound, remedy."""

from __future__ import annotations

import difflib
import re
from collections.abc import Iterable, Mapping
from pathlib import PurePath

LONGEST_SENTENCE = 700  # characters; more is a user's text inside it
LONGEST_NAME = 60  # characters of a user's own name repeated to him
LONGEST_LIST = 200  # characters of known names
LONGEST_RAISED = 200  # characters of what a user's own code raised
# numba's own
AROUND = ("Failed in nopython", "During: ", "- Resolution failure", "No implementation of function")
PLACE = re.compile(r'File "([^"]*\.py)", line (\d+)')
COMPARED = 2000  # known names among which the nearest is looked for


def shown(text: str) -> str:
    """Return a text as a terminal may be given it: control characters and the like as escapes
    (\\x1b), one line."""
    return "".join(
        c if c.isprintable() or c == "\xa0" else c.encode("unicode_escape").decode() for c in text
    )


def sentence(text: str) -> str:
    """Return a text as one line of at most LONGEST_SENTENCE characters, nothing in it that a
    terminal obeys."""
    line = shown(" ".join(text.split()))
    tail = LONGEST_SENTENCE // 3
    return (
        line
        if len(line) <= LONGEST_SENTENCE
        else f"{line[: LONGEST_SENTENCE - tail - 3]} … {line[-tail:]}"
    )


def brief(value: object, longest: int = 40) -> str:
    """Return what a file or a caller gave, as Python writes it, cut; whatever it is."""
    try:
        return repr(value)[:longest]
    except (ValueError, RecursionError):
        # an integer of more digits than Python writes, lists without an end
        return f"a {type(value).__name__} too long to write"


def as_toml(value: object) -> str:
    """Return what a file's key was given, as the file writes it: true where Python says True;
    otherwise as `brief`."""
    return str(value).lower() if isinstance(value, bool) else brief(value)


def raised(error: BaseException) -> str:
    """Return what somebody's own code raised: its kind and what it says, without numba's
    explanations.

    Of what numba cannot compile: the first thing it names, and the line of the user's file.
    """
    kind = type(error).__name__
    try:
        lines = [line.strip() for line in str(error).splitlines()]
    except Exception:  # its text is made by the user's code, too
        return kind
    if not type(error).__module__.startswith("numba"):
        return f"{kind}: {' '.join(lines)[:LONGEST_RAISED]}" if any(lines) else kind
    message = next((line for line in lines if line and not line.startswith(AROUND)), "")
    place = next((match for line in lines if (match := PLACE.match(line))), None)
    where = f" ({PurePath(place[1]).name}, line {place[2]})" if place else ""
    return f"{kind}: {message[:LONGEST_RAISED]}{where}"


class BadInput(ValueError):
    """A value, name or file that cannot be used as given (exit code 2); its text is one line, see
    `sentence`."""

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


class Diverged(PhysicsError):
    """A run broke off: its fluxes left the model's domain, or it is no longer finite.  So a rotor
    that is lost ends."""


def unknown(
    kind: str, name: object, known: Iterable[str], also: Mapping[str, str] | None = None
) -> BadInput:
    """Return the error for an unknown name, with the nearest known one; also: known ones by other
    names in use."""
    names = [n[:LONGEST_NAME] for n in sorted(known)]
    name = (
        str(name)[:LONGEST_NAME] if isinstance(name, (str, PurePath)) else brief(name, LONGEST_NAME)
    )
    alike = {n.casefold(): n for n in reversed(names[:COMPARED])}
    alike |= also or {}
    near = [alike[n] for n in difflib.get_close_matches(name.casefold(), alike, n=1, cutoff=0.5)]
    listed = ", ".join(names)
    if len(listed) > LONGEST_LIST:
        listed = f"{listed[:LONGEST_LIST].rpartition(', ')[0]}, ... ({len(names)} in all)"
    hint = f"did you mean '{near[0]}'?" if near else f"known: {listed}"
    return BadInput(f"unknown {kind} '{name}'; {hint}")
