"""Drawings for pages: SVG that takes the page's colours, so that it is read on a light and on a
dark ground."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

from sandbox.output.plots import framed, page, plain_ticks, svg_text

if TYPE_CHECKING:
    from sandbox.output.plots import Axes, Figure

PHONE = 3.75  # inches: 360 pixels, so that letters of nine points keep their size on a phone
SERIES = ("#de6210", "#2e86de", "#7f7f7f")  # before, after, recorded; as in the trace
THIN = 0.7  # points: a line's width
# points: that of the topmost of lines that may lie on each other, what each below has more
TOP, WIDER = 1.1, 1.5
Line = tuple[Sequence[float], Sequence[float]]  # x, y


def bars_svg(
    labels: Sequence[str],
    series: Mapping[str, Sequence[float]],
    xlabel: str,
    *,
    ylabel: str = "",
    colours: Sequence[Any] = SERIES,
) -> str:
    """Return horizontal bars as inline SVG, one group a label, one bar a series."""
    drawing, panels = page((PHONE, 0.9 + 0.34 * len(labels)), 1, 1)
    axes = panels[0, 0]
    height = 0.8 / max(1, len(series))
    for k, (name, values) in enumerate(series.items()):
        places = [n + (k - (len(series) - 1) / 2) * height for n in range(len(labels))]
        axes.barh(places, list(values), height, color=colours[k % len(colours)], label=name)
    return _by_label(drawing, axes, labels, xlabel, ylabel)


def dots_svg(
    labels: Sequence[str],
    series: Mapping[str, Sequence[float]],
    xlabel: str,
    *,
    mark: float = 1.0,
    colours: Sequence[Any] = SERIES,
) -> str:
    """Return dots over a logarithmic axis as inline SVG, one line a label; mark: a value that is
    marked (1: noise)."""
    drawing, panels = page((PHONE, 0.9 + 0.34 * len(labels)), 1, 1)
    axes = panels[0, 0]
    axes.axvline(mark, color="0.5", linewidth=0.9, linestyle=(0, (4, 2)), zorder=1)
    every = [v for values in series.values() for v in values if v > 0.0] or [mark]
    for k, (name, values) in enumerate(series.items()):
        # the first looks out behind the next
        colour, size = colours[k % len(colours)], 7.0 - 2.0 * k
        axes.plot(list(values), range(len(labels)), "o", color=colour, markersize=size, label=name)
    axes.set_xscale("log")
    axes.set_xlim(0.75 * min(mark, *every), 1.4 * max(2.0 * mark, *every))
    plain_ticks(axes)
    framed(axes, "y")
    return _by_label(drawing, axes, labels, xlabel)


def _by_label(
    drawing: Figure, axes: Axes, labels: Sequence[str], xlabel: str, ylabel: str = ""
) -> str:
    """Name the lines of a drawing and its axes; return it as SVG."""
    axes.set_yticks(range(len(labels)), list(labels), parse_math=False)
    axes.set_ylim(len(labels) - 0.5, -0.5)
    # long names of lines leave an axis that may be shorter than its name
    axes.set_xlabel(xlabel, x=1.0, ha="right")
    axes.set_ylabel(ylabel)
    named(axes)
    return svg_text(drawing, "".join(labels) + xlabel)


def lines_svg(
    panels: Sequence[tuple[str, Mapping[str, Line]]],
    xlabel: str,
    *,
    log: str = "",
    colours: Sequence[Any] = SERIES,
    alike: bool = False,
    bands: Sequence[float] = (),
) -> str:
    """Return panels of lines over a common axis as inline SVG; a panel: its y label, {name: (x,
    y)}.

    log: the logarithmic axes, such as "y" or "xy"; alike: lines may lie on each other, see
    `widths`; bands: of each panel the height of a grey band about zero (0: none).  A panel whose
    lines have other names than the first one's names them, too.
    """
    drawing, places = page((PHONE, 0.7 + 1.5 * len(panels)), len(panels), 1, sharex=True)
    heights = iter(bands)
    for axes, (ylabel, lines) in zip(places[:, 0], panels, strict=True):
        wide = widths(len(lines)) if alike else [THIN] * len(lines)
        if band := next(heights, 0.0):
            axes.axhspan(-band, band, color="0.5", alpha=0.35, linewidth=0.0, zorder=0)
        for k, (name, (x, y)) in enumerate(lines.items()):
            axes.plot(x, y, color=colours[k % len(colours)], linewidth=wide[k], label=name)
        axes.set_ylabel(ylabel)
        axes.spines[["top", "right"]].set_visible(False)
        if "y" in log:
            axes.set_yscale("log")
            plain_ticks(axes, "y")
        if axes is not places[0, 0] and list(lines) != list(panels[0][1]):
            named(axes)
    if "x" in log:
        places[-1, 0].set_xscale("log")
        plain_ticks(places[-1, 0])
    named(places[0, 0])
    places[-1, 0].set_xlabel(xlabel)
    return svg_text(
        drawing, "".join(p[0] for p in panels) + xlabel + "".join(n for p in panels for n in p[1])
    )


def widths(count: int) -> list[float]:
    """Return the widths of lines in the order of drawing: each looks out on both sides where the
    next lies on it."""
    return [TOP + WIDER * (count - 1 - k) for k in range(count)]


def named(axes: Axes, columns: int = 3) -> None:
    """Name a panel's lines above it, and leave out the frame's upper and right edge."""
    axes.legend(
        frameon=False, fontsize=9, loc="lower center", bbox_to_anchor=(0.5, 1.0), ncols=columns
    )
    axes.spines[["top", "right"]].set_visible(False)
