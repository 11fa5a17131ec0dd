"""Figures for print and phone. Only this module imports matplotlib."""

from __future__ import annotations

import io
import math
import os
import textwrap
from collections.abc import Mapping, Sequence
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from model.errors import BadInput
from sandbox.output.files import check_parent
from sandbox.output.trace import COLOURS, GREY

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from model.parameters import Drive
    from model.saliency import Audit
    from sandbox.evaluation.compare import Comparison, Row, Run
    from sandbox.evaluation.maps import Maps

AnyAxes = Any  # None, one Axes of matplotlib, or a sequence or an array of them
Cells = tuple[Sequence[str], Sequence[Sequence[str]]]  # heads and lines of a table of texts
DPI = 150
LETTERS = 12  # of nine points in an inch
NO_THEORY = "as it does not stop where the ripple across its axis is zero"
MARKERS = {"saturated": "o", "linear": "s"}
READING = (
    "error = true − estimated angle;  marker: mean;  outer end of bar: 95th percentile of |error|;  "
    "dashed: theory;  × lost lock"
)


def comparison_figure(comparison: Comparison, path: str | Path | None = None, ax: AnyAxes = None) -> Figure:
    """Draw position error (deg electrical) against load or segment: columns estimators, rows closed and open.

    Markers are means, outer ends of the bars 95th percentiles of |error|, dashed lines theory, crosses lost
    locks. Returns the figure, and writes it where a path is given: its suffix (.png, .svg, .pdf) is the format, the
    file appears whole or not at all. ax: see `page`. Raises ValueError if there is no run, BadInput for an unknown
    suffix or a folder that does not exist, OSError if the file is not writable.
    """
    if not comparison.runs:
        raise ValueError("a figure needs at least one run, this comparison has none")
    estimators = list(dict.fromkeys(run.estimator for run in comparison.runs))
    loops = sorted({run.closed_loop for run in comparison.runs}, reverse=True)
    size = (1.2 + 3.3 * len(estimators), 1.3 + 2.8 * len(loops))
    figure, panels = page(size, len(loops), len(estimators), ax, sharex=True, sharey=True)
    loads = by_load(comparison.runs)
    for axes_row, closed in zip(panels, loops, strict=True):
        for axes, estimator in zip(axes_row, estimators, strict=True):
            runs = [run for run in comparison.runs if (run.estimator, run.closed_loop) == (estimator, closed)]
            draw_panel(axes, runs, loads)
        axes_row[0].set_ylabel(f"{'closed' if closed else 'open'} loop\nposition error (° electrical)")
    for axes, estimator in zip(panels[0], estimators, strict=True):
        axes.set_title(estimator, fontweight="bold")
    if ax is None:
        figure.suptitle(f"{comparison.drive.name}, {comparison.scenario.name}", parse_math=False)
        figure.supxlabel(textwrap.fill(reading(comparison.runs), int(LETTERS * size[0])), fontsize=9, color="0.25")
    for axes in panels[-1]:
        axes.set_xlabel("load (% of rated)" if loads else "segment: load (%), speed (rpm)")
    return drawn(figure, path)


def reading(runs: Sequence[Run]) -> str:
    """Return how to read the position error of runs; theory is named where there is one, and who has none."""
    known = {run.estimator: any(row.predicted_mean_deg is not None for row in run.rows) for run in runs}
    if not any(known.values()):
        return READING.replace("dashed: theory;  ", "")
    without = ", ".join(name for name, held in known.items() if not held)
    theory = f"dashed: theory (none for {without}, {NO_THEORY})" if without else "dashed: theory"
    return READING.replace("dashed: theory", theory)


def by_load(runs: Sequence[Run]) -> bool:
    """Return whether load alone tells the segments of a run apart."""
    return all(len({row.load for row in run.rows}) == len(run.rows) > 1 for run in runs)


def draw_panel(axes: Axes, runs: Sequence[Run], loads: bool) -> None:
    """Draw all beliefs of one estimator and loop; loads: over load, not segment by segment."""
    rows = [list(run.rows) for run in runs]
    if loads:
        rows = [sorted(run_rows, key=lambda row: row.load) for run_rows in rows]
    segments = max(rows, key=len, default=[])
    places = [100.0 * row.load if loads else float(k) for k, row in enumerate(segments)]
    if not places:
        axes.set_axis_off()
        return
    reach = (max(places) - min(places)) or 1.0
    axes.axhline(0.0, color="0.6", linewidth=0.8)
    # Both beliefs stand side by side, so that neither hides the other.
    for k, (run, run_rows) in enumerate(zip(runs, rows, strict=True)):
        shift = 0.02 * reach * (k - (len(runs) - 1) / 2)
        _draw_belief(axes, run.belief, run_rows, places, shift)
        lost = [place + shift for place, row in zip(places, run_rows, strict=False) if row.lost_lock]
        _draw_lost(axes, run.belief, lost, max(places), 0.05 + 0.08 * k)
    _label_beliefs(axes, [run.belief for run in runs], rows, places)
    axes.set_xlim(min(places) - 0.07 * reach, max(places) + 0.36 * reach)
    if loads:
        step = 100 if reach > 250 else 50 if reach > 60 else 20
        first = step * math.ceil(min(places) / step)
        axes.set_xticks(range(first, int(max(places)) + 1, step))
    else:
        axes.set_xticks(places, [f"{100 * row.load:.0f}\n{row.speed_rpm:.0f}" for row in segments])
    axes.tick_params(labelsize=9)
    axes.grid(axis="y", color="0.5", alpha=0.25, linewidth=0.6)
    axes.spines[["top", "right"]].set_visible(False)


def colour_of(belief: str) -> tuple[float, float, float]:
    """Return the colour of a belief, the same as in the trace."""
    red, green, blue = COLOURS.get(belief, GREY)
    return red / 255, green / 255, blue / 255


def _draw_belief(axes: Axes, belief: str, rows: Sequence[Row], places: Sequence[float], shift: float) -> None:
    """Draw means, bars and theory of one run."""
    colour = colour_of(belief)
    theory = [(x, row.predicted_mean_deg) for x, row in zip(places, rows, strict=False)]
    theory = [(x, value) for x, value in theory if value is not None]
    if theory:
        width = 2.4 if belief == "linear" else 1.2  # both are seen where they agree
        axes.plot(*zip(*theory, strict=True), color=colour, linewidth=width, linestyle=(0, (4, 2)), zorder=2)
    for place, row in zip(places, rows, strict=False):
        x = place + shift
        mean, p95 = row.error_deg.mean, row.error_deg.p95
        if row.lost_lock or mean is None:
            continue
        bar = max(0.0, (p95 or 0.0) - abs(mean))
        axes.errorbar(x, mean, yerr=bar, fmt=MARKERS.get(belief, "D"), color=colour, markersize=4, capsize=5, zorder=3)


def _draw_lost(axes: Axes, belief: str, lost: Sequence[float], end: float, height: float) -> None:
    """Draw crosses on the lower edge, named right of the last segment at a height (share of the panel)."""
    if not lost:
        return
    edge, colour = axes.get_xaxis_transform(), colour_of(belief)
    crosses = axes.plot(lost, [0.0] * len(lost), "x", color=colour, transform=edge, clip_on=False, zorder=5)
    crosses[0].set(markersize=10, markeredgewidth=2.8)
    axes.annotate(
        "lost lock",
        (end, height),
        (9, 0),
        xycoords=edge,
        textcoords="offset points",
        color=colour,
        va="center",
    )


def _label_beliefs(axes: Axes, beliefs: Sequence[str], rows: Sequence[Sequence[Row]], places: Sequence[float]) -> None:
    """Write each belief to the right of its last mean in lock; an upper label is lifted off a lower one."""
    ends = []
    for belief, run_rows in zip(beliefs, rows, strict=True):
        held = [(x, r.error_deg.mean) for x, r in zip(places, run_rows, strict=False) if not r.lost_lock]
        if held and held[-1][1] is not None:
            ends.append((held[-1][1], held[-1][0], belief))
    for rank, (mean, _, belief) in enumerate(sorted(ends)):
        lift = 0 if len(ends) == 1 else 5 * (2 * rank - len(ends) + 1)
        axes.annotate(
            belief,
            (max(places), mean),
            (9, lift),
            textcoords="offset points",
            color=colour_of(belief),
            fontsize=10,
            va="center",
        )


def audit_figure(drive: Drive, audit: Audit, path: str | Path | None = None, ax: AnyAxes = None) -> Figure:
    """Draw the current plane (convexity, saliency) and the cross-saturation angle against load.

    ax: see `page`. Raises as `comparison_figure`.
    """
    figure, ((plane, angles),) = page((10.5, 4.8), 1, 2, ax)
    _draw_plane(plane, drive, audit)
    load = 100.0 * audit.load
    for values, name, style in (
        (audit.angle_local, "encoder controls (local)", "-"),
        (audit.angle_closed, "estimate controls (self-consistent)", (0, (4, 2))),
    ):
        angles.plot(load, [math.degrees(v) for v in values], linestyle=style, color=colour_of("linear"), label=name)
    angles.axhline(0.0, color="0.6", linewidth=0.8)
    angles.set(xlabel="load (% of rated, i_d = 0)", ylabel="error of a linear belief (° electrical)")
    angles.set_title("cross-saturation angle")
    angles.legend(frameon=False, fontsize=9)
    entitle(figure, f"{drive.name}: where the model may be used", ax)
    return drawn(figure, path)


def _draw_plane(axes: Axes, drive: Drive, audit: Audit) -> None:
    """Draw min eigenvalue over the current plane, the audited disc, and where convexity ends."""
    from matplotlib.patches import Circle

    i, values = audit.grid, audit.grid_eigenvalue
    filled = axes.contourf(i, i, values, levels=12, cmap="Blues")
    filled.set_clip_path(Circle((0, 0), audit.radius, transform=axes.transData))
    axes.figure.colorbar(filled, ax=axes, label="smallest eigenvalue of the Hessian (1/H)")
    axes.add_patch(Circle((0, 0), audit.rated_current, fill=False, color="0.2", linewidth=1.2))
    axes.annotate("rated", (0.0, audit.rated_current), (0, 3), textcoords="offset points", ha="center", fontsize=9)
    if audit.violations:
        x, y = [v["i_d"] for v in audit.violations], [v["i_q"] for v in audit.violations]
        axes.plot(x, y, "x", color=colour_of("linear"), label="the model ends here")
        axes.legend(frameon=False, fontsize=9, loc="upper right")
    axes.set(xlabel="i_d (A)", ylabel="i_q (A)", aspect="equal", facecolor="0.85")
    axes.set_title("valid" if audit.passed else "grey: not valid")


def maps_figure(maps: Maps, path: str | Path | None = None, ax: AnyAxes = None) -> Figure:
    """Draw inductances, cross-saturation angle and gain over the current plane, and the first order's error of L_dd.

    ax: see `page`.
    """
    figure, axes = page((12.5, 7.2), 2, 3, ax, sharex=True, sharey=True)
    panels = [
        ("L_dd (mH)", 1e3 * maps.l_dd),
        ("L_dq (mH)", 1e3 * maps.l_dq),
        ("L_qq (mH)", 1e3 * maps.l_qq),
        ("cross-saturation angle (°)", maps.angle * 180.0 / math.pi),
        ("gain of the null (of zero current)", maps.gain),
        ("L_dd, first order − exact (mH)", 1e3 * (maps.first_order["l_dd"] - maps.l_dd)),
    ]
    if not (maps.first_order["l_dd"] == maps.first_order["l_dd"]).any():  # NaN: a flux map has no alphas
        axes[-1, -1].set_axis_off()
        panels = panels[:-1]
    for panel, (title, values) in zip(axes.flat, panels, strict=False):
        filled = panel.contourf(maps.i_d, maps.i_q, values.T, levels=14, cmap="viridis")
        panel.figure.colorbar(filled, ax=panel)
        panel.set(title=title, aspect="equal", facecolor="0.85")
    for panel in axes[-1]:
        panel.set_xlabel("i_d (A)")
    for panel in axes[:, 0]:
        panel.set_ylabel("i_q (A)")
    entitle(figure, f"{maps.motor}: incremental inductances and what injection sees", ax)
    return drawn(figure, path)


def protocol_figure(
    by_motor: Mapping[str, Cells], note: str, path: str | Path | None = None, ax: AnyAxes = None
) -> Figure:
    """Draw a page: a panel per motor, a line per estimator and belief, a column per test, coloured by the verdict.

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


def _draw_cells(axes: Axes, heads: Sequence[str], names: Sequence[str], cells: Sequence[Sequence[str]]) -> None:
    """Draw a table of texts: green where there is a tick before the goal, red for a cross, grey for all else."""
    colours = {"✓": "#cfe8d5", "✗": "#f3cdc7", "○": "0.93"}
    for y, row in enumerate(cells):
        for x, text in enumerate(row):
            mark = next((m for m in colours if f" {m}" in text), "")
            face = colours.get(mark, "0.93" if text else "white")
            text = text.replace(f" {mark} ", f"\n{mark} ") if mark else text
            axes.fill_between([x + 0.02, x + 0.98], y + 0.04, y + 0.96, color=face, linewidth=0)
            axes.text(x + 0.5, y + 0.5, text, ha="center", va="center", fontsize=6.5)
    axes.set_xticks([x + 0.5 for x in range(len(heads))], heads, fontsize=8)
    axes.set_yticks([y + 0.5 for y in range(len(names))], names, fontsize=8)
    axes.set(xlim=(0, len(heads)), ylim=(len(names), 0))
    axes.tick_params(length=0, top=False, labeltop=True, bottom=False, labelbottom=False)
    axes.spines[:].set_visible(False)


def page(size: tuple[float, float], rows: int, columns: int, ax: AnyAxes = None, **layout: Any) -> tuple[Figure, Any]:
    """Return an empty figure (inches) and its panels, (rows, columns), or the figure of the axes that are given.

    ax: axes of the caller's own to draw in, one for each panel, row by row; BadInput where these are more or fewer.
    """
    from matplotlib.figure import Figure

    if ax is None:
        figure = Figure(figsize=size, layout="constrained")
        vars(figure)["_repr_png_"] = partial(png, figure)  # notebooks show it, though pyplot does not know it
        return figure, figure.subplots(rows, columns, squeeze=False, **layout)
    own = np.array(ax, dtype=object).reshape(-1)
    if own.size != rows * columns or not all(hasattr(axes, "axhline") for axes in own):
        raise BadInput(
            f"ax: this figure has {rows * columns} panel{'s' if rows * columns > 1 else ''}, and needs as many axes of "
            f"matplotlib; make them by plt.subplots({rows}, {columns})"
        )
    return own[0].figure.figure, own.reshape(rows, columns)  # of a part of a figure, the whole


def entitle(figure: Figure, title: str, ax: AnyAxes) -> None:
    """Write a title above a figure, or above the one panel of the caller's own; several of these keep theirs."""
    if ax is None:
        figure.suptitle(title, parse_math=False)
    elif np.size(ax) == 1:
        np.array(ax, dtype=object).item().set_title(title, parse_math=False, fontsize=11)


def png(figure: Figure) -> bytes:
    """Return a figure as PNG, at its own resolution."""
    out = io.BytesIO()
    figure.savefig(out, format="png")
    return out.getvalue()


def plain_ticks(axes: Axes, which: str = "x") -> None:
    """Write a logarithmic axis (x or y) as 1, 10, 100, without the powers whose letters other fonts hold."""
    from matplotlib.ticker import FuncFormatter, LogLocator, NullFormatter

    axis = axes.xaxis if which == "x" else axes.yaxis
    low, high = axis.get_view_interval()
    few, some, many = (1.0,), (1.0, 2.0, 5.0), (1.0, 2.0, 3.0, 4.0, 5.0, 7.0)
    axis.set_major_locator(LogLocator(subs=few if high > 100.0 * low else some if high > 8.0 * low else many))
    axis.set_major_formatter(FuncFormatter(lambda x, _: f"{x:g}"))
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
    """Save a figure under a temporary name beside its place, then move it there; BadInput where that cannot be."""
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
