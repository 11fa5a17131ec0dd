"""Figures for print and phone. Only this module imports matplotlib."""

from __future__ import annotations

import io
import os
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

import numpy as np

from model.errors import BadInput
from sandbox.output.files import check_parent
from sandbox.output.sheets import COLOURS, GREY

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure
    from matplotlib.patches import Circle

AnyAxes = Any  # None, one Axes of matplotlib, or a sequence or an array of them
DPI = 150


def colour_of(belief: str) -> tuple[float, float, float]:
    """Return the colour of a belief, the same as in the trace."""
    red, green, blue = COLOURS.get(belief, GREY)
    return red / 255, green / 255, blue / 255


def page(
    size: tuple[float, float], rows: int, columns: int, ax: AnyAxes = None, **layout: Any
) -> tuple[Figure, Any]:
    """Return an empty figure (inches) and its panels, (rows, columns), or the figure of the axes
    that are given.

    ax: axes of the caller's own to draw in, one for each panel, row by row; BadInput where these
    are more or fewer.
    """
    from matplotlib.figure import Figure

    if ax is None:
        figure = Figure(figsize=size, layout="constrained")
        # notebooks show it, though pyplot does not know it
        vars(figure)["_repr_png_"] = partial(png, figure)
        return figure, figure.subplots(rows, columns, squeeze=False, **layout)
    own = np.array(ax, dtype=object).reshape(-1)
    if own.size != rows * columns or not all(hasattr(axes, "axhline") for axes in own):
        raise BadInput(
            f"ax: this figure has {rows * columns} panel{'s' if rows * columns > 1 else ''}, and "
            f"needs as many axes of matplotlib; make them by plt.subplots({rows}, {columns})"
        )
    return own[0].figure.figure, own.reshape(rows, columns)  # of a part of a figure, the whole


def circle(axes: Axes, radius: float, **style: Any) -> Circle:
    """Return a circle about the origin in a panel's own coordinates, to draw or to clip by."""
    from matplotlib.patches import Circle

    return Circle((0, 0), radius, transform=axes.transData, **style)


def entitle(figure: Figure, title: str, ax: AnyAxes) -> None:
    """Write a title above a figure, or above the one panel of the caller's own; several of these
    keep theirs."""
    if ax is None:
        figure.suptitle(title, parse_math=False)
    elif np.size(ax) == 1:
        np.array(ax, dtype=object).item().set_title(title, parse_math=False, fontsize=11)


def png(figure: Figure) -> bytes:
    """Return a figure as PNG, at its own resolution."""
    out = io.BytesIO()
    figure.savefig(out, format="png")
    return out.getvalue()


def framed(axes: Axes, grid: Literal["both", "x", "y"] = "both") -> None:
    """Leave out a panel's upper and right frame, and draw a grid that is soft on light and on dark
    ground."""
    axes.grid(axis=grid, color="0.5", alpha=0.25, linewidth=0.6)
    axes.spines[["top", "right"]].set_visible(False)


def plain_ticks(axes: Axes, which: str = "x") -> None:
    """Write a logarithmic axis (x or y) as 1, 10, 100, without the powers whose letters other fonts
    hold."""
    from matplotlib.ticker import LogLocator, NullFormatter, StrMethodFormatter

    axis = axes.xaxis if which == "x" else axes.yaxis
    low, high = axis.get_view_interval()
    few, some, many = (1.0,), (1.0, 2.0, 5.0), (1.0, 2.0, 3.0, 4.0, 5.0, 7.0)
    axis.set_major_locator(
        LogLocator(subs=few if high > 100.0 * low else some if high > 8.0 * low else many)
    )
    axis.set_major_formatter(StrMethodFormatter("{x:g}"))
    axis.set_minor_formatter(NullFormatter())


def svg_text(figure: Figure, salt: str) -> str:
    """Return a figure as SVG that can stand in a page: black takes the page's ink, white its paper.

    Letters are paths, as fonts differ; names of its parts are its own by the salt.
    """
    from matplotlib import rc_context
    from matplotlib.backends.backend_svg import FigureCanvasSVG

    for patch in (figure.patch, *(axes.patch for axes in figure.axes)):
        patch.set_visible(False)
    out = io.StringIO()
    with rc_context({"svg.hashsalt": salt}):
        FigureCanvasSVG(figure).print_svg(out, metadata={"Date": None})
    text = out.getvalue()
    return text[text.index("<svg") :].replace("#000000", "currentColor")


def drawn(figure: Figure, path: str | Path | None) -> Figure:
    """Return a figure, saved where a path is given."""
    if path is not None:
        save(figure, Path(path))
    return figure


def save(figure: Figure, path: Path) -> None:
    """Save a figure under a temporary name beside its place, then move it there; BadInput where
    that cannot be."""
    kind = path.suffix.lstrip(".").lower()
    if kind not in figure.canvas.get_supported_filetypes():
        raise BadInput(f"cannot draw to '{path.name}': use a name that ends in .png, .svg or .pdf")
    check_parent(path)
    partial = path.with_name(f".{path.name}.{os.getpid()}.part")
    try:
        figure.savefig(partial, format=kind, dpi=DPI)
        os.replace(partial, path)
    finally:
        partial.unlink(missing_ok=True)
