"""Figures of the package on pages of tutorials: `result.plot()` returns one that pyplot does not know."""

from __future__ import annotations

from typing import Any

from matplotlib.figure import Figure
from sphinx_gallery.scrapers import figure_rst


def scraper(block: Any, variables: dict[str, Any], conf: dict[str, Any]) -> str:
    """Save the figure that a block of a tutorial ends with; return how it stands on the page."""
    last = variables["example_globals"].get("___")
    if not isinstance(last, Figure):
        return ""
    path = next(variables["image_path_iterator"])
    last.savefig(path, dpi=100)
    variables["example_globals"]["___"] = None  # the next block may end with none
    return str(figure_rst([path], conf["src_dir"]))
