"""What made a result: version, commit, code, libraries and machine; the call with the hashes of its
inputs."""

from __future__ import annotations

import hashlib
import platform
import subprocess
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from functools import cache
from importlib.metadata import PackageNotFoundError
from importlib.metadata import version as installed
from pathlib import Path
from typing import Any

from model.kernels.sources import ROOMS, ROOT, code_key

PACKAGE = "sensorless-sandbox"
LIBRARIES = (
    "numpy",
    "scipy",
    "numba",
    "llvmlite",
    "control",
    "filterpy",
    "matplotlib",
    "pyarrow",
    "rerun-sdk",
)
PATIENCE = 10.0  # s for git
CHUNK = 1 << 20  # bytes read at once


@dataclass(frozen=True)
class Call:
    """How a function of the page `sandbox` was called.

    arguments: names, paths and numbers as given, defaults included; inputs: SHA-256 by path of
    every file that was read; objects: arguments that were Python objects, of which nobody else can
    be told.
    """

    function: str
    arguments: Mapping[str, Any]
    inputs: Mapping[str, str] = field(default_factory=dict)
    objects: tuple[str, ...] = ()


def version() -> str:
    """Return the package's version, or `source` where it runs from a plain checkout."""
    try:
        return installed(PACKAGE)
    except PackageNotFoundError:
        return "source"


def made_by(call: Call | None = None, files: Iterable[Path] = ()) -> dict[str, Any]:
    """Return what a result says of its making; files: those written beside it, told with their
    hashes."""
    return {
        "commit": commit(),
        "code": code(),
        "python": platform.python_version(),
        "machine": f"{platform.system()} {platform.machine()}",
        "libraries": libraries(),
        "call": None
        if call is None
        else {
            "function": call.function,
            "arguments": dict(call.arguments),
            "objects": list(call.objects),
            "inputs": dict(call.inputs),
        },
        "files": {path.name: digest_of(path) for path in sorted(files)},
    }


@cache
def commit() -> str | None:
    """Return the commit of the checkout that runs, with `+` where its files were changed; None
    outside a checkout."""
    if not (ROOT / ".git").exists():
        return None
    try:
        head, changed = (
            subprocess.run(
                ["git", "-C", str(ROOT), *words],
                capture_output=True,
                check=True,
                text=True,
                timeout=PATIENCE,
            ).stdout.strip()
            for words in (("rev-parse", "HEAD"), ("status", "--porcelain", "--", *ROOMS))
        )
    except (OSError, subprocess.SubprocessError):  # no git, or not the owner's checkout
        return None
    return f"{head}+" if changed else head


def code() -> str:
    """Return a hash of all sources of the project, motors and scenarios included."""
    return code_key(*(f"{room}/**/*.{kind}" for room in ROOMS for kind in ("py", "toml")))


@cache
def libraries() -> dict[str, str]:
    """Return the versions of the libraries that results hang on, as far as they are installed."""
    found = {}
    for name in LIBRARIES:
        try:
            found[name] = installed(name)
        except PackageNotFoundError:
            continue
    return found


def digest_of(path: Path) -> str:
    """Return the SHA-256 of a file."""
    found = hashlib.sha256()
    with path.open("rb") as file:
        while part := file.read(CHUNK):
            found.update(part)
    return found.hexdigest()
