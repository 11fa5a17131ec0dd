"""What a long run has finished: an interrupted one goes on where it stopped, as long as the code is
the same.

A journal is a file of lines, one an entry, each behind the SHA-256 of the rest: half a line, or one
that was changed since, counts as not written.  Of two entries of one name the last counts.
"""

from __future__ import annotations

import hashlib
import json
import os
from functools import cache
from importlib.metadata import version
from pathlib import Path
from typing import Any

from model.effects import own
from model.errors import BadInput
from model.given import MOST_JSON, given_bytes
from model.kernels.kept import digest
from model.kernels.sources import code_key

LIBRARIES = ("numpy", "scipy", "numba")


class Journal:
    """Entries by name, in memory and, where a path is given, in a file."""

    def __init__(self, path: Path | None) -> None:
        """Read what is there; nothing where there is no file, or one that is no text of lines."""
        self.path = path
        self.entries: dict[str, Any] = {}
        if path is not None and path.is_file():
            try:
                lines = given_bytes(path, MOST_JSON, "what a run has finished").splitlines()
            except (OSError, BadInput):
                lines = []
            for stated, _, body in (line.partition(b" ") for line in lines):
                if stated == digest(body).encode():
                    self._read(body)

    def _read(self, body: bytes) -> None:
        try:
            name, content = json.loads(body)
        except (ValueError, TypeError, RecursionError):  # of somebody else
            return
        self.entries[str(name)] = content

    def add(self, name: str, content: Any, lasting: bool = True) -> None:
        """Keep an entry (of JSON's types); lasting: in the file, too, whose folder is made."""
        self.entries[name] = content
        if self.path is not None and lasting:
            self.path.parent.mkdir(parents=True, exist_ok=True)
            body = json.dumps([name, content], allow_nan=False).encode()
            with self.path.open("ab") as file:  # begins a line: the one before may be half written
                file.write(b"\n%s %s\n" % (digest(body).encode(), body))


@cache
def state_of_code(*patterns: str) -> str:
    """Return a short hash of the files below the project's root that match patterns such as
    "estimators/*.py", of all that they import, of effects of the user's own, and of the libraries
    that compute."""
    found = hashlib.sha256(repr([(name, version(name)) for name in LIBRARIES]).encode())
    for file in filter(None, os.environ.get(own.VARIABLE, "").split(os.pathsep)):
        found.update(Path(file).read_bytes())
    found.update(code_key(*patterns).encode())
    return found.hexdigest()[:16]
