"""Where compiled kernels are kept: a folder named by a hash of a kernel's file and of all that this
one imports."""

from __future__ import annotations

import atexit
import os
import shutil
import tempfile
import time
from functools import cache
from pathlib import Path

import numba

from model.kernels.sources import depends_on, source_key

KEPT_DAYS = 30
# what kernels depend on beside the rooms' files: those that import a file
_MORE: list[tuple[str, Path]] = []


def depend_on(key: str, through: Path) -> None:
    """Keep kernels decorated from now on, where they depend on a file, apart from those without
    `key`."""
    _MORE.append((key, through))


def cache_home() -> Path:
    """Return the folder for compiled kernels and memoised designs (`SENSORLESS_CACHE` or the user's
    cache)."""
    user = os.environ.get("XDG_CACHE_HOME") or os.path.expanduser("~/.cache")
    return Path(os.environ.get("SENSORLESS_CACHE") or os.path.join(user, "sensorless-sandbox"))


@cache
def _folder(key: str) -> Path | None:
    """Return a folder for kernels: in the cache, or of this process alone; None where nothing can
    be written."""
    path = cache_home() / f"kernels-{key}"
    try:
        if not path.exists():
            path.mkdir(parents=True, exist_ok=True)
            for old in path.parent.glob("kernels-*"):
                if time.time() - old.stat().st_mtime > KEPT_DAYS * 86400:
                    shutil.rmtree(old, ignore_errors=True)
        with tempfile.TemporaryFile(dir=path):
            # a read-only home still runs, from a cache of this process alone
            return path
    except OSError:
        return _own_folder()


@cache
def _own_folder() -> Path | None:
    try:
        own = tempfile.mkdtemp(prefix="sensorless-kernels-")
    except OSError:
        return None
    atexit.register(shutil.rmtree, own, ignore_errors=True)
    return Path(own)


def folder_of(file: Path) -> Path | None:
    """Return the folder that keeps the machine code of a file's functions; None where there is no
    such file."""
    if not file.is_file():
        return None
    file = file.resolve()
    more = [key for key, through in _MORE if through in depends_on(file)]
    return _folder("-".join([numba.__version__, source_key(file), *more]))


def kernel_folder(name: str) -> Path:
    """Return the folder for sources that are written for kernels, or one of this process alone."""
    return _folder(name) or Path(tempfile.mkdtemp(prefix="sensorless-kernels-"))
