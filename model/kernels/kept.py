"""What was computed once and is kept on disk: checked before it is believed, made anew with a note
where it is damaged.

An entry is a file that begins with the SHA-256 of its own name and the rest.  Nothing here is ever
an error the user must act on.
"""

from __future__ import annotations

import hashlib
import os
import sys
import threading
from functools import cache
from pathlib import Path


@cache
def note(text: str) -> None:
    """Say something about the cache on stderr, once a process."""
    print(f"sensorless: {text}", file=sys.stderr)


def digest(body: bytes) -> str:
    """Return the SHA-256 of some bytes, in hexadecimal."""
    return hashlib.sha256(body).hexdigest()


def read(path: Path) -> bytes | None:
    """Return what was kept; None where there is nothing, or (with a note) where it is not what was
    written."""
    try:
        if not path.is_file():  # nor a pipe, which would have to be waited for
            return None
        head, _, body = path.read_bytes().partition(b"\n")
    except OSError:
        return None
    if head != _seal(path, body):
        note_damage(path)
        return None
    return body


def write(path: Path, body: bytes) -> None:
    """Keep some bytes, whole or not at all; where they cannot be kept, they are computed again next
    time."""
    write_plain(path, _seal(path, body) + b"\n" + body)


def _seal(path: Path, body: bytes) -> bytes:
    """Return what an entry begins with: its name belongs to it, so that one put in another's place
    is noticed."""
    return digest(os.fsencode(path.name) + b"\n" + body).encode()


def write_plain(path: Path, content: bytes) -> None:
    """Write a file aside, then rename it; a note where that cannot be."""
    aside = path.with_name(f"{path.name}.{os.getpid()}-{threading.get_ident()}.part")
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        try:
            aside.write_bytes(content)
            aside.replace(path)
        finally:
            aside.unlink(missing_ok=True)
    except OSError as error:
        note(
            f"nothing can be kept in '{path.parent}' ({error.strerror}), so it is "
            "computed again next time"
        )


def note_damage(path: Path) -> None:
    """Say that an entry is damaged."""
    note(f"the cache entry '{path.name}' was damaged and is made anew")
