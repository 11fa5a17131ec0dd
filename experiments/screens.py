"""Figures for every screen: one drawing as two SVG files, for a desk and for a telephone, on light
and dark ground.

`NAME.svg` is at most WIDE inches wide, `NAME.narrow.svg` NARROW: its panels stand below each other.
In both, letters have at least LEAST points at that width. Ink is `currentColor`, which follows the
page where a page holds the drawing, and the light or dark setting of the reader's system where the
file stands alone; grids and frames are translucent.
"""

from __future__ import annotations

import io
import os
import pickle
import re
import textwrap
from pathlib import Path
from typing import Any

# inches: 920 and 345 CSS pixels, what pages of 1280 and 390 pixels leave for a figure
WIDE, NARROW = 9.6, 3.6
LEAST = 9.0  # points
LETTERS = 14.0  # of nine points in an inch, on average
DIGITS = re.compile(r"(\.\d\d)\d+")  # of points beyond a hundredth
LINE = 0.19  # inches of a line of letters
TALLEST = 1.15  # of a panel's width
INK, PAPER_INK, NIGHT_INK = "#000000", "#1d2430", "#e3e7ed"
STYLE = (
    f"<style>svg{{color:{PAPER_INK};fill:currentColor}}"
    f"@media (prefers-color-scheme:dark){{svg{{color:{NIGHT_INK}}}}}</style>"
)


def write(figure: Any, path: Path) -> None:
    """Write a figure as `path`.svg and `path`.narrow.svg (path without a suffix), each whole or not
    at all."""
    for ending, width in (("", WIDE), (".narrow", NARROW)):
        file = path.with_name(f"{path.name}{ending}.svg")
        partial = file.with_name(f".{file.name}.part")
        partial.write_text(svg(fitted(figure, width), f"{path.name}{ending}"), encoding="utf-8")
        os.replace(partial, file)


def fitted(figure: Any, width: float) -> Any:
    """Return a copy of a figure that is at most `width` inches wide: its panels in as many columns
    as fit."""
    own = pickle.loads(pickle.dumps(figure))
    for text in own.findobj(lambda x: hasattr(x, "set_fontsize")):
        text.set_fontsize(max(LEAST, text.get_fontsize()))
    panels = [a for a in own.axes if a.get_subplotspec() is not None]
    if own.get_figwidth() > width and panels:
        _restack(own, panels, width)
    for a in own.axes:
        _on_any_ground(a)
    for _ in range(2):
        # labels are folded to the panels of the first pass, panels stand beside these in the second
        own.get_layout_engine().execute(own)
        _fold(own)
    own.get_layout_engine().execute(own)
    return own


def _restack(figure: Any, panels: list[Any], width: float) -> None:
    """Lay a grid's panels out anew; each keeps its height, and gets the labels it had from its
    neighbours."""
    specs = [a.get_subplotspec() for a in panels]
    grid = specs[0].get_gridspec()
    shares = grid.get_height_ratios()
    height, each = figure.get_figheight() / sum(shares), figure.get_figwidth() / grid.ncols
    columns = min(grid.ncols, max(1, round(width / max(3.0, 0.8 * each))))
    column = width / columns
    by_row = (
        any(a.get_title() for a, s in zip(panels, specs, strict=True) if s.rowspan.start > 0)
        or grid.nrows == 1
    )
    places = sorted(dict.fromkeys((s.rowspan.start, s.colspan.start) for s in specs))
    weight = panels[0].title.get_fontweight()
    heads: dict[str, dict[int, str]] = {"title": {}, "x": {}, "y": {}}
    for a, s in zip(panels, specs, strict=True):
        row, at = s.rowspan.start, s.colspan.start
        heads["title"].setdefault(at, a.get_title())
        heads["y"].setdefault(row, a.get_ylabel())
        heads["x"][at] = a.get_xlabel() or heads["x"].get(at, "")
    if columns < grid.ncols:
        places.sort(key=lambda p: p if by_row else (p[1], p[0]))
    fewer = columns < grid.ncols
    order = {place: divmod(k, columns) if fewer else place for k, place in enumerate(places)}
    rows = 1 + max(r for r, _ in order.values())
    tall = [0.0] * rows
    for a, s in zip(panels, specs, strict=True):
        row, (to, _) = s.rowspan.start, order[s.rowspan.start, s.colspan.start]
        most = max(TALLEST * column, LINE * len(a.get_yticks()))
        tall[to] = max(tall[to], min(height * shares[row], most))
    new = figure.add_gridspec(rows, columns, height_ratios=tall)
    figure.set_size_inches(width, sum(tall) + (0.5 if figure.get_supxlabel() else 0.0))
    for a, s in zip(panels, specs, strict=True):
        row, at = s.rowspan.start, s.colspan.start
        a.set_subplotspec(new[order[row, at]])
        if fewer and a.axison:
            if not a.get_title() and not by_row:
                a.set_title(heads["title"].get(at, ""), fontweight=weight)
            if a.get_shared_y_axes().get_siblings(a)[1:]:
                a.set_ylabel(a.get_ylabel() or heads["y"].get(row, ""))
            if a.get_shared_x_axes().get_siblings(a)[1:]:
                a.set_xlabel(a.get_xlabel() or heads["x"].get(at, ""))
            a.tick_params(labelleft=a.yaxis.get_label_position() == "left", labelbottom=True)


def _fold(figure: Any) -> None:
    """Break titles and labels that are longer than the place they have."""
    whole = figure.get_figwidth()
    for text in (figure._suptitle, figure._supxlabel):
        if text is not None:
            _filled(text, whole)
    for a in figure.axes:
        if a.get_subplotspec() is not None:
            place = a.get_position()
            for text in (a.title, a._left_title, a.xaxis.label):
                _filled(text, whole * place.width + 0.2)
            _filled(a.yaxis.label, figure.get_figheight() * place.height + 0.1)


def _filled(text: Any, inches: float) -> None:
    """Break a text into lines of a length; lines that were broken before stay apart where they
    fit."""
    letters = max(12, int(LETTERS * inches * 9.0 / text.get_fontsize()))
    lines = text.get_text().split("\n")
    if any(len(line) > letters for line in lines):
        text.set_text(textwrap.fill(" ".join(" ".join(lines).split()), letters))


def _on_any_ground(axes: Any) -> None:
    """Make letters the page's ink, grids and frames translucent, grounds transparent."""
    from matplotlib.colors import to_rgba

    def grey(colour: Any) -> float | None:
        """Return how light a grey is; None for a colour."""
        if isinstance(colour, str) and colour.lower() == "none":
            return None
        red, green, blue, alpha = to_rgba(colour)
        return red if max(red, green, blue) - min(red, green, blue) < 0.02 and alpha > 0.0 else None

    for line in [*axes.lines, *axes.get_xgridlines(), *axes.get_ygridlines()]:
        light = grey(line.get_color())
        if light is not None and light > 0.35:
            line.set(color="0.5", alpha=0.9 if light < 0.75 else 0.35)
        elif light is not None:
            line.set_color(INK)
    for text in [*axes.texts, axes.title, axes._left_title, axes.xaxis.label, axes.yaxis.label]:
        if grey(text.get_color()) is not None:
            text.set_color(INK)
    face = grey(axes.get_facecolor())
    if face is not None and face < 0.95:
        axes.patch.set(facecolor="0.5", alpha=0.25)
    else:
        axes.patch.set_visible(False)
    for legend in [axes.get_legend()]:
        if legend is not None:
            legend.get_frame().set(facecolor="none", edgecolor="none")


def svg(figure: Any, salt: str) -> str:
    """Return a figure as SVG: letters as text, ids of its own by the salt."""
    from matplotlib import rc_context
    from matplotlib.backends.backend_svg import FigureCanvasSVG

    figure.patch.set_visible(False)
    for text in (figure._suptitle, figure._supxlabel):
        if text is not None:
            text.set_color(INK)
    out = io.StringIO()
    with rc_context({"svg.hashsalt": salt, "svg.fonttype": "none"}):
        FigureCanvasSVG(figure).print_svg(
            out, metadata={"Date": None, "Creator": None, "Format": None, "Type": None}
        )
    text = out.getvalue()
    text = text[text.index("<svg") :].replace(INK, "currentColor")
    text = re.sub(r"<metadata>.*?</metadata>\s*", "", text, flags=re.S)
    text = re.sub(r"<defs>", STYLE + "\n <defs>", text, count=1)
    text = re.sub(
        r"font: ([^;\"]*?)'DejaVu Sans'[^;\"]*",
        r"font: \1system-ui, 'DejaVu Sans', sans-serif",
        text,
    )
    text = re.sub(r'( (?:d|x|y)=")([^"]*)', lambda m: m[1] + DIGITS.sub(r"\1", m[2]), text)
    mark = re.sub(r"\W", "-", salt)
    return re.sub(r'(\bid="|href="#|url\(#)', rf"\g<1>{mark}-", text)
