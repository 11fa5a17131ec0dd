"""One rule for every name that becomes a file, a title or an entity: checked where it enters,
escaped where shown.

A name is at most LONGEST printable characters and can be one file in a folder: no separator, no dot
in front.  A name made from a folder or file of the user's is not refused but made to fit
(`fitting`).  `model.errors.shown` escapes what a terminal would obey, `html_text` what a browser
would.
"""

from __future__ import annotations

import html
from pathlib import PurePosixPath

from model.errors import BadInput, brief, shown

LONGEST = 64  # characters; with a suffix well below the 255 bytes of a file system
LONGEST_FILE = 128  # a recording's file keeps the name that its program gave it
SEPARATORS = "/\\"
RULE = "printable characters without / and \\, no dot or space in front"


def check_name(name: object, what: str) -> str:
    """Return a name that can be a file's, a title and an entity; BadInput says what (e.g. '[motor]
    name') is wrong."""
    if not isinstance(name, str):
        raise BadInput(f"{what} = {brief(name)} is not a text; put it in quotes")
    if not _is_name(name):
        raise BadInput(
            f"{what} = '{name[:LONGEST]}' cannot name a file or a title; give 1 to {LONGEST} {RULE}"
        )
    return name


def check_file(file: object, what: str) -> str:
    """Return the path of a file below the one that names it, e.g. 'data/run.csv'; BadInput where it
    leads elsewhere."""
    if not isinstance(file, str):
        raise BadInput(f"{what} = {brief(file)} is not a text; put it in quotes")
    if not file or not all(_is_name(part, LONGEST_FILE) for part in file.split("/")):
        raise BadInput(
            f"{what} = '{file[:LONGEST]}' is no file in the folder of the one that names it, or "
            f"below; give a relative path without '..', each part 1 to {LONGEST_FILE} {RULE}"
        )
    return file


def check_path(file: object, what: str) -> str:
    """Return the path of a file that may lie anywhere, e.g. '../maps/motor.mat'; BadInput where it
    can be none."""
    if not isinstance(file, str):
        raise BadInput(f"{what} = {brief(file)} is not a text; put it in quotes")
    parts = PurePosixPath(file).parts
    own = [part for k, part in enumerate(parts) if part != ".." and not (k == 0 and part == "/")]
    if not own or parts[-1] == ".." or not all(_is_name(part, LONGEST_FILE) for part in own):
        raise BadInput(
            f"{what} = '{file[:LONGEST]}' is no path of a file; give it relative to the file that "
            f"names it, or whole, with / between folders, each part 1 to {LONGEST_FILE} {RULE}"
        )
    return file


def _is_name(name: str, longest: int = LONGEST) -> bool:
    if not (1 <= len(name) <= longest and name.isprintable() and name[0] not in ". "):
        return False
    # of the 255 bytes of a file system
    return not set(name) & set(SEPARATORS) and len(name.encode("utf-8")) <= 200


def fitting(text: str, usual: str) -> str:
    """Return the nearest name to a folder's or file's own, `usual` where nothing is left of it."""
    kept = "".join(c if c.isprintable() and c not in SEPARATORS else "_" for c in text)
    name = kept.lstrip(". ")[:LONGEST]
    return name if _is_name(name) else usual


def html_text(text: str) -> str:
    """Return a text as a page may hold it: nothing that a browser takes for markup, nothing that
    cannot be seen."""
    return html.escape(shown(text))
