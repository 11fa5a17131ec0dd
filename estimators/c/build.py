"""A C file as a shared library, by the C compiler of this machine."""

from __future__ import annotations

import os
import shutil
import subprocess
from pathlib import Path

from model.errors import BadInput

HEADERS = Path(__file__).parent
STRICT = ("-std=c99", "-Wall", "-Wextra", "-Wpedantic", "-Werror")


def compiler() -> str | None:
    """Return the C compiler (environment variable CC, or cc), None where there is none."""
    return shutil.which(os.environ.get("CC", "cc"))


def build(source: Path, folder: Path, *, double: bool = False) -> Path:
    """Compile a C file into a shared library in a folder; return its path; BadInput with the
    compiler's first error."""
    cc = compiler()
    if cc is None:
        raise BadInput(f"no C compiler is at hand to build '{source.name}'; install one or set CC")
    out = folder / f"{source.stem}{'_double' if double else ''}.so"
    call = [
        cc,
        *STRICT,
        "-I",
        str(HEADERS),
        "-O2",
        "-fPIC",
        "-shared",
        *(["-DSENSORLESS_FLOAT64"] if double else []),
        "-o",
        str(out),
    ]
    done = subprocess.run([*call, str(source), "-lm"], capture_output=True, text=True, check=False)
    if done.returncode:
        errors = [
            line for line in done.stderr.splitlines() if "error" in line
        ] or done.stderr.splitlines()
        raise BadInput(
            f"'{source.name}' does not compile: "
            f"{errors[0].strip() if errors else 'no reason given'}"
        )
    return out
