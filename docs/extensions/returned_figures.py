"""Figures of the tutorials: those of pyplot, and the one that a block ends with (`result.plot()`),
for every screen."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from matplotlib import pyplot
from matplotlib.figure import Figure

from experiments import screens


def scraper(block: Any, variables: dict[str, Any], conf: dict[str, Any]) -> str:
    """Save the figures of a block of a tutorial; return how they stand on the page."""
    figures = [pyplot.figure(number) for number in pyplot.get_fignums()]
    last = variables["example_globals"].get("___")
    if isinstance(last, Figure) and last not in figures:
        figures.append(last)
    variables["example_globals"]["___"] = None  # the next block may end with none
    said = []
    for figure in figures:
        path = Path(next(variables["image_path_iterator"])).with_suffix("")
        screens.write(figure, path)
        relative = path.relative_to(conf["src_dir"]).as_posix()
        words = figure.get_suptitle() or "; ".join(
            t for a in figure.axes if (t := a.get_title() or a.get_ylabel())
        )
        said.append(f".. image:: /{relative}.svg\n   :alt: {' '.join(words.split())}\n\n")
    pyplot.close("all")
    return "".join(said)
