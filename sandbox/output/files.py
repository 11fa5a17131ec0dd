"""Result folders: files that appear whole, together or not at all; JSON of any result."""

from __future__ import annotations

import json
import math
import os
import platform
import shutil
import zlib
from collections.abc import Iterable, Iterator, Mapping
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any

import numpy as np

from model.errors import BadInput, brief
from sandbox.output.provenance import version

SCHEMA = 1


def plain(value: Any) -> Any:
    """Return a value as JSON knows it: arrays as lists, undefined numbers as None."""
    if isinstance(value, dict):
        return {str(k): plain(v) for k, v in value.items()}
    if isinstance(value, (list, tuple)):
        return [plain(v) for v in value]
    if isinstance(value, np.ndarray):
        return plain(value.tolist())
    if isinstance(value, (bool, np.bool_)):
        return bool(value)
    if isinstance(value, (float, np.floating)):
        return float(value) if math.isfinite(value) else None
    if isinstance(value, np.integer):
        return int(value)
    return value


KINDS = (".json", ".png", ".svg", ".rrd", ".npz", ".html", ".parquet", ".csv")
FURTHER_FILES = {  # files that commands write under names of their own
    "diagnosis": ("report.html", "motor.toml", "effects.toml", "next_recording.csv"),
    "identify": ("motor.toml", "effects.toml"),
    "check": ("columns.toml",),
}
# Drafts that a user goes on with: they stay where no new one is written, and beside one that
# differs.
CORRECTED = {"columns.toml": "columns.earlier.toml"}


def rounded(value: Any, digits: int) -> Any:
    """Return a value of JSON with all its numbers rounded to so many significant digits; whole
    numbers stay."""
    if isinstance(value, Mapping):
        return {k: rounded(v, digits) for k, v in value.items()}
    if isinstance(value, (list, tuple)):
        return [rounded(v, digits) for v in value]
    if isinstance(value, float) and math.isfinite(value):
        return float(f"{value:.{digits}g}")
    return value


# processes of another machine may write to the same disk
NODE = f"{zlib.crc32(platform.node().encode()):x}"


def _aside(place: Path, full: Path) -> Path:
    return place / f".part-{NODE}-{os.getpid()}-{zlib.crc32(os.fsencode(full)):x}"


def aside_of(full: Path, place: Path | None = None) -> Path:
    """Return where this process prepares a file or folder (a full path): below `place`, by default
    beside it.

    What a process that was killed left of the same one is removed.
    """
    path = _aside(full.parent if place is None else place, full)
    for old in path.parent.glob(f".part-{NODE}-*-{path.name.rpartition('-')[2]}"):
        pid = old.name.split("-")[2]
        if old != path and pid.isdecimal() and not _is_running(int(pid)):
            shutil.rmtree(old, ignore_errors=True)
            with suppress(OSError):
                old.unlink(missing_ok=True)
    return path


def _is_running(pid: int) -> bool:
    if os.name == "nt":  # nothing there asks without harm
        return True
    try:
        os.kill(pid, 0)
    except ProcessLookupError:
        return False
    except (OSError, OverflowError):  # another user's
        return True
    return True


def check_parent(path: Path) -> None:
    """Raise BadInput where the folder that a file is to stand in does not exist."""
    if not path.parent.is_dir():
        raise BadInput(
            f"cannot write '{path}': there is no folder '{path.parent}'; make it, or "
            "give another place"
        )


def write_whole(path: Path, content: bytes) -> Path:
    """Write a file, whole or not at all; return its path.  BadInput where its folder does not
    exist."""
    check_parent(path)
    full = Path(os.path.realpath(path.parent)) / path.name
    aside = aside_of(full)
    try:
        aside.write_bytes(content)
        aside.replace(full)
    finally:
        aside.unlink(missing_ok=True)
    return path


def _waiting(out: Path) -> Path:
    """Return a new folder for files on their way to `out`, below the nearest place that exists."""
    full = Path(os.path.realpath(out))
    place = next(p for p in (full, *full.parents) if os.path.lexists(p))
    path = aside_of(full, place) / full.relative_to(place)
    try:
        path.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise BadInput(f"cannot write to '{out}': {error.strerror}; give another --out") from None
    return path


def check_free(folder: Path, names: Iterable[str]) -> None:
    """Raise BadInput where a folder stands in the place of a file that is to be written."""
    for path in (folder / name for name in names):
        if path.is_dir():
            raise BadInput(
                f"'{path}' is a folder, where a file is to be written; move it, or give "
                "another --out"
            )


def check_output(out: Path, command: str = "") -> None:
    """Raise BadInput, before a run, where its results could not be written to a folder; nothing is
    left there.

    command: whose files they are (`audit.json`, ...).
    """
    if "\0" in str(out):
        raise BadInput(
            f"cannot write to {brief(str(out))}: a name holds no NUL; give another --out"
        )
    try:
        os.path.realpath(out).encode()
    except UnicodeEncodeError:
        raise BadInput(
            f"cannot write to {brief(str(out))}: its path is no UTF-8; give another --out"
        ) from None
    if command:
        check_free(out, [*(f"{command}{kind}" for kind in KINDS), *FURTHER_FILES.get(command, ())])
    try:
        _waiting(out)
    finally:
        discard(out)


@contextmanager
def results(out: Path, command: str) -> Iterator[Path]:
    """Give a folder for a command's files; they appear in `out` together, the JSON last, or not at
    all.

    A folder that does not exist appears whole.  What an earlier call left there under the same
    names goes, so that the files in a folder belong together.
    """
    try:
        waiting = _waiting(out)
        yield waiting
        _publish(waiting, Path(os.path.realpath(out)), command)
    finally:
        discard(out)


def _publish(waiting: Path, full: Path, command: str) -> None:
    missing = [p for p in (full, *full.parents) if not os.path.lexists(p)]
    if missing:
        top = missing[-1]
        with suppress(OSError):  # made by another process in the meantime: file by file
            os.rename(_aside(top.parent, full) / top.name, top)
            return
    full.mkdir(parents=True, exist_ok=True)
    check_free(full, [new.name for new in waiting.iterdir()])
    earlier = [old for old in full.glob(f"{command}.*") if old.suffix in KINDS]
    if (full / f"{command}.json").is_file():
        earlier += [
            full / name
            for name in FURTHER_FILES.get(command, ())
            if not _of_others(full, name, command)
        ]
    for old in earlier:
        if old.is_file() and not (waiting / old.name).exists():
            old.unlink()
    for name, kept in CORRECTED.items():
        old, new = full / name, waiting / name
        if old.is_file() and new.is_file() and old.read_bytes() != new.read_bytes():
            old.replace(full / kept)
    for new in sorted(waiting.iterdir(), key=lambda path: path.suffix == ".json"):
        new.replace(full / new.name)


def _of_others(folder: Path, name: str, command: str) -> bool:
    """Return whether a file may be a user's, or of another command that has results in the
    folder."""
    others = [c for c, names in FURTHER_FILES.items() if name in names and c != command]
    return name in CORRECTED or any((folder / f"{c}.json").is_file() for c in others)


def discard(out: Path) -> None:
    """Remove what this process had not finished writing into a folder, and on the way to it."""
    full = Path(os.path.realpath(out))
    for place in (full, *full.parents):
        shutil.rmtree(_aside(place, full), ignore_errors=True)


def write_json(
    out: Path,
    name: str,
    content: dict[str, Any],
    command: str = "",
    made: Mapping[str, Any] | None = None,
) -> Path:
    """Write `<name>.json` with the common header into a folder, whole or not at all; return its
    path.

    command: the header's, where the file is not named after it; made: what made it
    (`provenance.made_by`).
    """
    document = {
        "schema": SCHEMA,
        "command": command or name,
        "version": version(),
        **plain(content),
    }
    if made is not None:
        document["made_by"] = plain(made)
    return write_whole(out / f"{name}.json", json_bytes(document))


def json_bytes(document: Mapping[str, Any]) -> bytes:
    """Return a document as JSON, a line an entry."""
    return (json.dumps(document, indent=1, allow_nan=False) + "\n").encode()
