"""A Python that has motulator: given, this one, or one in an environment of its own, made once in
the cache."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
from importlib.util import find_spec
from pathlib import Path

from model.datasets import OFFLINE
from model.errors import BadInput
from model.kernels.folders import cache_home

PEER = "motulator==0.18.0"
LEAST = (3, 12)
SCRIPT = "peer_motulator.py"
NAMES = ("python3.12", "python3.13")  # that may make the environment
REMEDY = f"give --peer-python a Python >= 3.12 that has {PEER}"


def peer_python(given: str | None) -> str:
    """Return a Python that has motulator; BadInput where none is at hand and none can be made."""
    if given:
        return given
    if sys.version_info >= LEAST and find_spec("motulator") is not None:
        return sys.executable
    folder = cache_home() / "peers" / PEER.replace("==", "-")
    python = folder / ("Scripts/python.exe" if os.name == "nt" else "bin/python")
    whole = folder / "whole"  # written last
    if not whole.is_file():
        _make(folder, python)
        whole.write_text("", encoding="utf-8")
    return str(python)


def check_peer(anchors: Path, given: str | None) -> str:
    """Return a Python that has motulator; BadInput where its script is not at hand, or no Python
    that has it."""
    if not (anchors / SCRIPT).is_file():
        raise BadInput(f"'{anchors / SCRIPT}' does not exist; give the folder with --anchors")
    python = peer_python(given)
    if not _runs(python, "import motulator"):
        raise BadInput(f"'{python}' does not run, or lacks {PEER}; {REMEDY}")
    return python


def _make(folder: Path, python: Path) -> None:
    """Make the environment; a part of one goes away again."""
    if os.environ.get(OFFLINE, "0") not in ("", "0"):
        raise BadInput(
            f"{PEER} is not at hand and nothing is downloaded ({os.environ[OFFLINE]}); {REMEDY}"
        )
    own = [sys.executable] if sys.version_info >= LEAST else []
    base = next((name for name in (*own, *NAMES) if _runs(name)), None)
    if base is None:
        raise BadInput(f"{PEER} needs Python >= 3.12, which is not found here; {REMEDY}")
    shutil.rmtree(folder, ignore_errors=True)
    for call in (
        [base, "-m", "venv", str(folder)],
        [str(python), "-m", "pip", "install", "--quiet", PEER],
    ):
        done = subprocess.run(call, capture_output=True, text=True, check=False)
        if done.returncode:
            shutil.rmtree(folder, ignore_errors=True)
            last = next(
                (
                    line
                    for line in reversed((done.stdout + done.stderr).splitlines())
                    if line.strip()
                ),
                "",
            )
            raise BadInput(f"an environment with {PEER} cannot be made ({last.strip()}); {REMEDY}")


def _runs(name: str, what: str = "import venv") -> bool:
    """Tell whether a Python is there and can do something, by default make environments."""
    try:
        return not subprocess.run([name, "-c", what], capture_output=True, check=False).returncode
    except OSError:
        return False
