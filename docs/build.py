"""Build the documentation into docs/_build/html, every warning an error: `python docs/build.py`.

It says what it does as it goes, and where the first page is when it is done. `--quick` leaves the
tutorials as they are (their programs are not run; pages that name their figures then miss them),
which takes some seconds.
"""

from __future__ import annotations

import os
import sys
import time
from pathlib import Path

from sphinx.cmd.build import main

HERE = Path(__file__).resolve().parent
OUT = HERE / "_build" / "html"


def build(arguments: list[str]) -> int:
    """Build all pages that are not up to date; return Sphinx' exit code."""
    began, own = time.monotonic(), [a for a in arguments if a != "--quick"]
    quick = ["-D", "plot_gallery=0"] if len(own) < len(arguments) else []
    # what was stopped is not gone on with
    fresh = [] if (OUT / "searchindex.js").is_file() else ["-E"]
    jobs = ["-j", str(min(4, os.cpu_count() or 1))]
    print(
        "building the documentation: about three minutes the first time, then what has changed",
        flush=True,
    )
    code = main(
        ["-W", "--keep-going", *jobs, *fresh, *quick, "-b", "html", str(HERE), str(OUT), *own]
    )
    print(f"{'done' if code == 0 else 'not done'} in {time.monotonic() - began:.0f} s", flush=True)
    if code == 0:
        print(OUT / "index.html")
    return int(code)


if __name__ == "__main__":
    sys.exit(build(sys.argv[1:]))
