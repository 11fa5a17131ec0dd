"""The figure of a comparison: position error against load or segment, a panel for each estimator
and loop."""

from __future__ import annotations

import math
import textwrap
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from sandbox.output.plots import AnyAxes, colour_of, drawn, framed, page

if TYPE_CHECKING:
    from sandbox.evaluation.compare import Comparison, Run
    from sandbox.evaluation.score import Row
    from sandbox.output.plots import Axes, Figure


NO_THEORY = "as it does not stop where the ripple across its axis is zero"
MARKERS = {"saturated": "o", "linear": "s"}
READING = (
    "error = true − estimated angle;  marker: mean;  outer end of bar: 95th percentile of "
    "|error|;  dashed: theory;  × lost lock"
)
LETTERS = 12  # of nine points in an inch


def comparison_figure(
    comparison: Comparison, path: str | Path | None = None, ax: AnyAxes = None
) -> Figure:
    """Draw position error (deg electrical) against load or segment: columns estimators, rows closed
    and open.

    Markers are means, outer ends of the bars 95th percentiles of |error|, dashed lines theory,
    crosses lost locks. Returns the figure, and writes it where a path is given: its suffix (.png,
    .svg, .pdf) is the format, the file appears whole or not at all. ax: see `page`. Raises
    ValueError if there is no run, BadInput for an unknown suffix or a folder that does not exist,
    OSError if the file is not writable.
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
            runs = [
                run
                for run in comparison.runs
                if (run.estimator, run.closed_loop) == (estimator, closed)
            ]
            draw_panel(axes, runs, loads)
        axes_row[0].set_ylabel(
            f"{'closed' if closed else 'open'} loop\nposition error (° electrical)"
        )
    for axes, estimator in zip(panels[0], estimators, strict=True):
        axes.set_title(estimator, fontweight="bold")
    if ax is None:
        figure.suptitle(f"{comparison.drive.name}, {comparison.scenario.name}", parse_math=False)
        figure.supxlabel(
            textwrap.fill(reading(comparison.runs), int(LETTERS * size[0])),
            fontsize=9,
            color="0.25",
        )
    for axes in panels[-1]:
        axes.set_xlabel("load (% of rated)" if loads else "segment: load (%), speed (rpm)")
    return drawn(figure, path)


def reading(runs: Sequence[Run]) -> str:
    """Return how to read the position error of runs; theory is named where there is one, and who
    has none."""
    known = {
        run.estimator: any(row.predicted_mean_deg is not None for row in run.rows) for run in runs
    }
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
        lost = [
            place + shift for place, row in zip(places, run_rows, strict=False) if row.lost_lock
        ]
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
    framed(axes, "y")


def _draw_belief(
    axes: Axes, belief: str, rows: Sequence[Row], places: Sequence[float], shift: float
) -> None:
    """Draw means, bars and theory of one run."""
    colour = colour_of(belief)
    theory = [(x, row.predicted_mean_deg) for x, row in zip(places, rows, strict=False)]
    theory = [(x, value) for x, value in theory if value is not None]
    if theory:
        width = 2.4 if belief == "linear" else 1.2  # both are seen where they agree
        axes.plot(
            *zip(*theory, strict=True),
            color=colour,
            linewidth=width,
            linestyle=(0, (4, 2)),
            zorder=2,
        )
    for place, row in zip(places, rows, strict=False):
        x = place + shift
        mean, p95 = row.error_deg.mean, row.error_deg.p95
        if row.lost_lock or mean is None:
            continue
        bar = max(0.0, (p95 or 0.0) - abs(mean))
        axes.errorbar(
            x,
            mean,
            yerr=bar,
            fmt=MARKERS.get(belief, "D"),
            color=colour,
            markersize=4,
            capsize=5,
            zorder=3,
        )


def _draw_lost(axes: Axes, belief: str, lost: Sequence[float], end: float, height: float) -> None:
    """Draw crosses on the lower edge, named right of the last segment at a height (share of the
    panel)."""
    if not lost:
        return
    edge, colour = axes.get_xaxis_transform(), colour_of(belief)
    crosses = axes.plot(
        lost, [0.0] * len(lost), "x", color=colour, transform=edge, clip_on=False, zorder=5
    )
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


def _label_beliefs(
    axes: Axes, beliefs: Sequence[str], rows: Sequence[Sequence[Row]], places: Sequence[float]
) -> None:
    """Write each belief to the right of its last mean in lock; an upper label is lifted off a lower
    one."""
    ends = []
    for belief, run_rows in zip(beliefs, rows, strict=True):
        held = [
            (x, r.error_deg.mean) for x, r in zip(places, run_rows, strict=False) if not r.lost_lock
        ]
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
