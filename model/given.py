"""Content of files that users and other programs give: regular files of a stated size at most."""

from __future__ import annotations

import stat
from pathlib import Path

from model.errors import BadInput

MOST_JSON = 100_000_000  # bytes of a JSON document of results: twenty times the longest, a whole protocol's


def check_given(path: Path, most: int, remedy: str) -> int:
    """Return a file's size (bytes); BadInput where it is absent, no regular file, or larger than `most` bytes.

    A pipe would make the program wait for ever, a device like /dev/zero take all memory.  remedy: what to give instead,
    the end of the sentence.
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
        raise BadInput(f"file '{path}' has more than {most / 1e6:g} MB; {remedy}")
    return found.st_size


def given_bytes(path: Path, most: int, remedy: str) -> bytes:
    """Return a file's content; BadInput as in `check_given`, or where it cannot be read."""
    check_given(path, most, remedy)
    try:
        with path.open("rb") as file:
            content = file.read(most + 1)
    except OSError as error:
        raise BadInput(f"file '{path}' cannot be read ({error.strerror or error}); {remedy}") from None
    if len(content) > most:  # it grew, or stands in /proc, where every size is 0
        raise BadInput(f"file '{path}' has more than {most / 1e6:g} MB; {remedy}")
    return content
