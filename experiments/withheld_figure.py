"""The figure of the page of checks: reliability, smallest size found, shares with limits."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from sandbox.output.plots import colour_of, framed, page, plain_ticks
from sandbox.withheld.scoring.check_figure import limits, reliability


def page_figure(content: Mapping[str, Any], words: Mapping[str, str]) -> Any:
    """Return the figure of a page: reliability, smallest size found, shares with limits; words:
    names of figures."""
    limit = content["detection_floor"]
    figure, (panels,) = page((9.6, 5.4), 1, 3 if limit else 2)
    reliability(panels[0], content["reliability"])
    if limit:
        _by_line(panels[1], limit)
    limits(panels[-1], content["methods"], words)
    return figure


def _by_line(axes: Any, limit: Mapping[str, Mapping[str, Any]]) -> None:
    """Draw the smallest size at which each effect was found, a line for each."""
    axes.set_title("size found (●), missed (×)", fontweight="bold")
    for k, entry in enumerate(limit.values()):
        for key, marker, belief in (("found", "o", "saturated"), ("missed", "x", "linear")):
            if entry[key] is not None:
                axes.plot(entry[key], k, marker, color=colour_of(belief), markersize=7)
    axes.set_xscale("log")
    plain_ticks(axes)
    axes.set_yticks(range(len(limit)), [name.replace("_", " ") for name in limit], fontsize=9)
    axes.set_ylim(len(limit) - 0.5, -0.5)
    axes.set_xlabel("multiples of a medium size")
    framed(axes)
