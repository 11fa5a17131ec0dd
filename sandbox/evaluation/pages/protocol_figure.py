"""The figure of a protocol: a table of texts for each motor, coloured by the verdicts."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from sandbox.output.plots import AnyAxes, drawn, page

if TYPE_CHECKING:
    from sandbox.output.plots import Axes, Figure


LETTERS = 28  # of a line that fits a cell
Cells = tuple[Sequence[str], Sequence[Sequence[str]]]  # heads and lines of a table of texts


def protocol_figure(
    by_motor: Mapping[str, Cells], note: str, path: str | Path | None = None, ax: AnyAxes = None
) -> Figure:
    """Draw a page: a panel per motor, a line per estimator and belief, a column per test, coloured
    by the verdict.

    ax: see `page`.
    """
    motors, tables = list(by_motor), list(by_motor.values())
    lines = sum(len(cells) + 2 for _, cells in tables)
    width = 2.2 + 1.45 * (max(len(heads) for heads, _ in tables) - 1)
    heights = [len(cells) + 1 for _, cells in tables]
    figure, panels = page((width, 0.8 + 0.34 * lines), len(motors), 1, ax, height_ratios=heights)
    for panel, motor, (heads, cells) in zip(panels[:, 0], motors, tables, strict=True):
        _draw_cells(panel, heads[1:], [row[0] for row in cells], [row[1:] for row in cells])
        panel.set_title(motor, loc="left", fontweight="bold", fontsize=10, parse_math=False)
    if ax is None:
        figure.supxlabel(note, fontsize=8, color="0.25", wrap=True)
    return drawn(figure, path)


def _draw_cells(
    axes: Axes, heads: Sequence[str], names: Sequence[str], cells: Sequence[Sequence[str]]
) -> None:
    """Draw a table of texts: green where there is a tick before the goal, red for a cross, grey for
    all else."""
    colours = {"✓": "#cfe8d5", "✗": "#f3cdc7", "○": "0.93"}
    for y, row in enumerate(cells):
        for x, text in enumerate(row):
            mark = next((m for m in colours if f" {m}" in text), "")
            face = colours.get(mark, "0.93" if text else "white")
            text = text.replace(f" {mark} ", f"\n{mark} ") if mark else text
            axes.fill_between([x + 0.02, x + 0.98], y + 0.04, y + 0.96, color=face, linewidth=0)
            size = 6.5 if max(map(len, text.splitlines()), default=0) <= LETTERS else 5.5
            axes.text(x + 0.5, y + 0.5, text, ha="center", va="center", fontsize=size)
    axes.set_xticks([x + 0.5 for x in range(len(heads))], heads, fontsize=8)
    axes.set_yticks([y + 0.5 for y in range(len(names))], names, fontsize=8)
    axes.set(xlim=(0, len(heads)), ylim=(len(names), 0))
    axes.tick_params(length=0, top=False, labeltop=True, bottom=False, labelbottom=False)
    axes.spines[:].set_visible(False)
