"""What the page's tests share: a short scenario, an estimator of one's own, which test is of which
name."""

from __future__ import annotations

import ast
import os
import subprocess
import sys
from pathlib import Path

import sandbox

ROOT = Path(__file__).resolve().parents[3]
SHORT = sandbox.Scenario(
    "short", (sandbox.Segment(0.2), sandbox.Segment(0.2, 1.0, ramp=0.05, settle=0.1))
)
OWN = """
import dataclasses
import sandbox
ESTIMATOR = dataclasses.replace(sandbox.load_estimator("qnull"), name="{name}", summary="mine")
"""


def of(*names):
    """Mark a test as one of these names of the page; `names_tested` finds the marks."""
    return lambda test: test


def names_tested():
    """Return the names of the page that tests of the page and of the commands are marked with."""
    found = set()
    rooms = (ROOT / "tests" / "sandbox" / room for room in ("public", "cli"))
    for path in (path for room in rooms for path in room.rglob("test_*.py")):
        for node in ast.walk(ast.parse(path.read_text())):
            if (
                isinstance(node, ast.Call)
                and isinstance(node.func, ast.Name)
                and node.func.id == "of"
            ):
                found |= {argument.value for argument in node.args}
    return found


def python(code, folder, script="script.py", **more):
    """Run a script of its own in a folder, with variables of the environment; return what it
    did."""
    environment = {**os.environ, "PYTHONPATH": str(ROOT), **more}
    file = folder / script
    file.write_text(code)
    return subprocess.run(
        [sys.executable, str(file)], cwd=folder, env=environment, capture_output=True, text=True
    )
