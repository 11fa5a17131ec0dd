"""Content of files that users and other programs give: regular files of a stated size at most."""

from __future__ import annotations

import re
import stat
import tomllib
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from model.errors import BadInput

# bytes of a TOML file: a hundred times the longest of ours, an inverter's table in it
LONGEST = 20_000_000
EXISTING = "give the path of an existing TOML file"
SMALLER = "keep long tables of numbers in files of their own, which it names"
# of a dotted key in it: tomllib's time and memory grow with their square, 20 GB for 60 000
MOST_PARTS = 50
_PART = r"""(?:[\w-]++|"(?:[^"\\\n]|\\.)*+"|'[^'\n]*+')"""
DECIMAL_COMMA = re.compile(
    r"\s*(?P<key>[\w.-]+)\s*=\s*(?P<whole>[-+]?\d+),(?P<part>\d+(?:[eE][-+]?\d+)?)\s*(?:#.*)?"
)
UNIT_BEHIND = re.compile(
    r"\s*(?P<key>[\w.-]+)\s*=\s*(?!0[xob])[-+]?[\d.]++(?:[eE][-+]?\d+)?+\s*(?P<unit>[^\W\d_]\w*+|[°%Ω])[^#=\"']*(?:#.*)?"
)
# a key of too many parts, or what it cannot begin in: strings, comments, all else
TOKENS = re.compile(
    rf"(?P<key>(?:{_PART}[ \t]*+\.[ \t]*+){{{MOST_PARTS}}})"
    r'|"""(?:[^"\\]|\\.|"(?!""))*+"""' + r"|\'\'\'(?:[^']|'(?!''))*+\'\'\'"
    rf"|{_PART}|#[^\n]*+|[^\w\"'#-]++|.",
    re.DOTALL,
)
# bytes of a JSON document of results: twenty times the longest, a whole protocol's
MOST_JSON = 100_000_000


def check_given(path: Path, most: int, remedy: str, smaller: str = "") -> int:
    """Return a file's size (bytes); BadInput where it is absent, no regular file, or larger than
    `most` bytes.

    A pipe would make the program wait for ever, a device like /dev/zero take all memory.  remedy:
    what to give instead, the end of the sentence; smaller: the same where the file is too large, if
    another.
    """
    try:
        found = path.stat()
    except FileNotFoundError:
        raise BadInput(f"file '{path}' does not exist; {remedy}") from None
    except (OSError, ValueError) as error:  # a NUL in the name
        raise BadInput(
            f"file '{path}' cannot be read ({getattr(error, 'strerror', None) or error}); {remedy}"
        ) from None
    if stat.S_ISDIR(found.st_mode):
        raise BadInput(f"'{path}' is a folder; {remedy}")
    if not stat.S_ISREG(found.st_mode):
        raise BadInput(f"'{path}' is a pipe or a device, no file; {remedy}")
    if found.st_size > most:
        raise BadInput(f"file '{path}' has more than {most / 1e6:g} MB; {smaller or remedy}")
    return found.st_size


def given_bytes(path: Path, most: int, remedy: str, smaller: str = "") -> bytes:
    """Return a file's content; BadInput as in `check_given`, or where it cannot be read."""
    check_given(path, most, remedy, smaller)
    try:
        with path.open("rb") as file:
            content = file.read(most + 1)
    except OSError as error:
        raise BadInput(
            f"file '{path}' cannot be read ({error.strerror or error}); {remedy}"
        ) from None
    if len(content) > most:  # it grew, or stands in /proc, where every size is 0
        raise BadInput(f"file '{path}' has more than {most / 1e6:g} MB; {smaller or remedy}")
    return content


def check_toml(path: Path) -> None:
    """Raise BadInput where a TOML file is absent, no regular file, or too large."""
    check_given(path, LONGEST, EXISTING, SMALLER)


def read_toml(path: Path) -> dict[str, Any]:
    """Return a TOML file's content; BadInput where it cannot be read or parsed."""
    content = given_bytes(path, LONGEST, EXISTING, SMALLER)
    try:
        text = content.decode("utf-8-sig").replace("\r\n", "\n").replace("\r", "\n")
        if any(token.lastgroup == "key" for token in TOKENS.finditer(text)):
            raise BadInput(
                f"file '{path}' holds a key of more than {MOST_PARTS} parts joined by "
                "dots; shorten it"
            )
        return tomllib.loads(text)
    except tomllib.TOMLDecodeError as error:
        raise BadInput(
            f"file '{path}' is not valid TOML: {error}; {_mistyped(text) or 'mend that place'}"
        ) from None
    except BadInput:
        raise
    except (ValueError, RecursionError) as error:
        raise BadInput(
            f"file '{path}' cannot be read as TOML: {error}; give a text file in UTF-8"
        ) from None


def _mistyped(text: str) -> str:
    """Return what to do about the first decimal comma of a TOML text, or unit behind a number;
    nothing without one."""
    for number, line in enumerate(text.split("\n"), 1):
        if found := DECIMAL_COMMA.fullmatch(line):
            right = f"{found['key']} = {found['whole']}.{found['part']}"
            return f"line {number} holds a decimal comma: write {right}, with a point"
        if found := UNIT_BEHIND.fullmatch(line):
            return (
                f"line {number} holds a unit, {found['unit']}: write {found['key']} = the "
                "number alone, in SI units"
            )
    return ""


def is_file(path: Path) -> bool:
    """Tell whether a path is a file; no file either where none can have such a name."""
    try:
        return path.is_file()
    except (OSError, ValueError):
        return False


def is_folder(path: Path) -> bool:
    """Tell whether a path is a folder, in the same way."""
    try:
        return path.is_dir()
    except (OSError, ValueError):
        return False


def named_by(path: Path, folder: Path) -> list[Path]:
    """Return the files in a folder that a TOML file names anywhere in it, sorted; none of another
    file."""
    if path.suffix.lower() != ".toml" or not is_file(path):
        return []
    try:
        texts = set(_texts(read_toml(path)))
    except BadInput:
        return []
    return sorted(file for file in (folder / text for text in texts if text) if is_file(file))


def _texts(tree: Any) -> Iterator[str]:
    if isinstance(tree, str):
        yield tree
    elif isinstance(tree, (list, dict)):
        for part in tree.values() if isinstance(tree, dict) else tree:
            yield from _texts(part)
