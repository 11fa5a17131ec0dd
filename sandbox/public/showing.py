"""Looking at what was written: the page of a result folder in the browser, its trace in the rerun
viewer."""

from __future__ import annotations

import os
import subprocess
import sys
import webbrowser
from pathlib import Path

from model.errors import BadInput

MOST_NAMED = 12  # results in a sentence
PAGES, TRACES, FIGURES = (".html",), (".rrd",), (".png", ".svg")


def display_at_hand() -> bool:
    """Tell whether a window can be opened here."""
    if os.name == "nt" or sys.platform == "darwin":
        return True
    return bool(os.environ.get("DISPLAY") or os.environ.get("WAYLAND_DISPLAY"))


def view(path: str | Path, web: bool = False) -> None:
    """Open a trace in the rerun viewer of this environment and wait until it is closed.

    Parameters
    ----------
    path : str or Path
        A trace (`.rrd`), as `compare`, `simulate`, `diagnose` or `.to_rerun` write it.
    web : bool
        Serve the viewer to a browser, on this machine or another.

    Raises
    ------
    BadInput
        Where the trace, the viewer or, without `web`, a display is missing.

    Examples
    --------
    >>> from sandbox import view
    >>> view("sensorless-out/compare/compare.rrd", web=True)  # doctest: +SKIP
    """
    path = Path(path)
    if not path.is_file():
        raise BadInput(f"no trace at '{path}'; `sensorless compare` writes one")
    if path.suffix.lower() != ".rrd":
        raise BadInput(f"'{path}' is no trace; give an .rrd that a command has written")
    viewer = Path(sys.executable).with_name("rerun.exe" if os.name == "nt" else "rerun")
    if not viewer.is_file():
        raise BadInput(f"no rerun viewer at '{viewer}'; install rerun-sdk in this environment")
    if not web and not display_at_hand():
        raise BadInput(
            f"no display to open '{path}' on; `sensorless view {path} --web` shows it in a browser"
        )
    how = [] if not web else ["--web-viewer"] if display_at_hand() else ["--serve-web"]
    done = subprocess.run([str(viewer), *how, str(path)], check=False)
    if done.returncode:
        raise BadInput(
            f"the rerun viewer could not show '{path}' (exit code {done.returncode}); is "
            "it a trace?"
        )


def show(result: str | Path) -> str:
    """Open what a result folder holds: its page in the browser (else its figures), its trace in the
    viewer.

    Parameters
    ----------
    result : str or Path
        A folder that a command or `.save` has written, or one file in it.

    Returns
    -------
    str
        One sentence that names what was opened or, without a display, the files to open elsewhere.

    Raises
    ------
    BadInput
        Where there is nothing to show.

    Examples
    --------
    >>> from sandbox import show
    >>> show("sensorless-out/compare")  # doctest: +SKIP
    'opened sensorless-out/compare/compare.html and sensorless-out/compare/compare.rrd'
    """
    files = shown(Path(result))
    named = " and ".join(str(path) for path in files)
    if not display_at_hand():
        trace = next((path for path in files if path.suffix in TRACES), None)
        there = f"; `sensorless view {trace} --web` serves the trace to a browser" if trace else ""
        return f"no display here: open {named}{there}"
    for path in files:
        if path.suffix in TRACES:
            view(path)
        else:
            webbrowser.open(path.resolve().as_uri())
    return f"opened {named}"


def shown(result: Path) -> list[Path]:
    """Return what of a result is worth opening: pages, or figures where there is none, then
    traces."""
    if result.is_file() and result.suffix in (*PAGES, *TRACES, *FIGURES):
        return [result]
    folder = result.parent if result.is_file() else result
    if not folder.is_dir():
        raise BadInput(
            f"no result at '{result}'; give a folder that a command has written, such as "
            "sensorless-out/compare"
        )
    files = sorted(
        path for path in folder.iterdir() if path.is_file() and not path.name.startswith(".")
    )
    kinds = [[path for path in files if path.suffix in kind] for kind in (PAGES, FIGURES, TRACES)]
    found = [*(kinds[0] or kinds[1]), *kinds[2]]
    below = sorted(
        path.name for path in folder.iterdir() if path.is_dir() and any(path.glob("*.json"))
    )
    if not found and below:
        named = ", ".join(below[:MOST_NAMED]) + (", ..." if len(below) > MOST_NAMED else "")
        raise BadInput(
            f"nothing to show in '{folder}' itself; give one of the results below it: {named}"
        )
    if not found:
        raise BadInput(
            f"nothing to show in '{folder}'; a result has a page (.html), figures (.png) "
            "or a trace (.rrd)"
        )
    return found
