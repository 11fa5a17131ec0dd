"""Figures of sweeps: the share of drives below an error, and what is left of the saturated belief's
gain."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from sandbox.evaluation.sweep.summary import curve
from sandbox.output.plots import AnyAxes, colour_of, drawn, entitle, framed, page, plain_ticks
from sandbox.output.vector import widths

if TYPE_CHECKING:
    from sandbox.output.plots import Figure

MOST_CURVES = 12
LEAST = 0.01  # degrees, where the axis begins
STYLES = ("-", (0, (5, 2)), (0, (1, 1.5)), (0, (6, 2, 1, 2)))
OTHERS = ("#1b6ca8", "#d1802c", "#5a9367", "#8e44ad", "#7f7f7f", "#c0392b")


def yield_figure(
    curves: Mapping[str, NDArray[np.float64]],
    title: str,
    path: str | Path | None = None,
    share: float = 0.95,
    ax: AnyAxes = None,
) -> Figure:
    """Draw the share of drives (%) whose largest mean position error stays below x (° electrical),
    a curve a group.

    curves: errors of each group, infinite where lock was lost.  Returns the figure; written where a
    path is given; ax: see `page`.
    """
    figure, panels = page((7.6, 4.8), 1, 1, ax)
    axes = panels[0, 0]
    seen: dict[str | None, int] = {}
    for k, (name, errors) in enumerate(list(curves.items())[:MOST_CURVES]):
        x, y = curve(errors)
        belief = next((b for b in ("linear", "saturated") if b in name), None)
        colour = colour_of(belief) if belief else OTHERS[k % len(OTHERS)]
        number = seen[belief] = seen.get(belief, -1) + 1
        axes.plot(
            np.maximum(x, LEAST),
            100.0 * y,
            color=colour,
            linestyle=STYLES[number % len(STYLES)],
            label=name,
        )
    axes.axhline(100.0 * share, color="0.6", linewidth=0.8)
    axes.set(
        xscale="log",
        xlabel="largest mean position error (° electrical)",
        ylabel="drives that err less (%)",
    )
    axes.set_ylim(0.0, 101.0)
    plain_ticks(axes)
    framed(axes)
    if curves:
        axes.legend(frameon=False, fontsize=9, loc="upper left")
    axes.set_title(title, parse_math=False, fontsize=11)
    return drawn(figure, path)


def tolerance_figure(
    rows: Sequence[Any], title: str, path: str | Path | None = None, ax: AnyAxes = None
) -> Figure:
    """Draw position error against how far the belief's parameters are off, a panel an estimator;
    see `tolerances`.

    Returns the figure; written where a path is given; ax: see `page`.
    """
    names = list(dict.fromkeys(row.estimator for row in rows))
    figure, panels = page((1.0 + 3.4 * len(names), 3.8), 1, len(names), ax, sharey=True)
    for axes, name in zip(panels[0], names, strict=True):
        for width, belief in zip(widths(2), ("linear", "saturated"), strict=True):
            own = [r for r in rows if (r.estimator, r.belief) == (name, belief)]
            x = [100.0 * r.tolerance for r in own]
            middle, most = (
                [np.nan if v is None else v for v in values]
                for values in ([r.median_deg for r in own], [r.p95_deg for r in own])
            )
            how = {"color": colour_of(belief), "linewidth": width}
            axes.plot(
                x, middle, "o-", markersize=4.0 + width, label=f"{belief}: median of draws", **how
            )
            axes.plot(x, most, "--", label="95 % of draws", **how)
        axes.set(title=name, xlabel="the belief's parameters off by up to ± (%)")
        framed(axes, "y")
    panels[0, 0].set_ylim(bottom=0.0)
    panels[0, 0].set_ylabel("position error, rms of means (° el.)")
    panels[0, -1].legend(frameon=False, fontsize=8)
    entitle(figure, title, ax)
    return drawn(figure, path)
