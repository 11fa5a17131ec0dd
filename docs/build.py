"""Build the documentation into docs/_build/html, every warning an error: `python docs/build.py`."""

from __future__ import annotations

import sys
from pathlib import Path

from sphinx.cmd.build import main

HERE = Path(__file__).resolve().parent

if __name__ == "__main__":
    sys.exit(main(["-W", "--keep-going", "-q", "-b", "html", str(HERE), str(HERE / "_build" / "html"), *sys.argv[1:]]))
