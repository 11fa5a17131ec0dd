"""Drawings of a run beside time, for pages: paths of current and flux, spectra, error against angle
and load."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from model.array_types import Array
from sandbox.evaluation.pages.compare_figure import by_load, draw_panel
from sandbox.evaluation.pages.planes import Plane
from sandbox.output.looks import over_angle
from sandbox.output.plots import colour_of, page, svg_text
from sandbox.output.vector import PHONE, named, widths

if TYPE_CHECKING:
    from sandbox.evaluation.compare import Run

Way = tuple[Array, Array]  # x, y
FAINT = {"color": "0.5", "linewidth": 0.6, "alpha": 0.6}
LEVELS = 9
LEAST_ANGLE = 0.1  # degrees; without saturation there is nothing to draw


def loci_svg(plane: Plane, paths: Mapping[str, Way], rated: float) -> str:
    """Return the paths of the currents (A) over the saliency map, {belief: path}; rated: current,
    A."""
    drawing, panels = page((PHONE, 4.4), 1, 1)
    axes = panels[0, 0]
    i = plane.current
    filled = axes.contourf(i, i, plane.gain.T, levels=LEVELS, cmap="Greys", alpha=0.4, vmin=0.0)
    bar = drawing.colorbar(filled, ax=axes, shrink=0.75, label="saliency (1: at zero current)")
    bar.ax.patch.set_visible(False)
    if np.nanmax(np.abs(plane.angle)) > LEAST_ANGLE:
        lines = axes.contour(i, i, plane.angle.T, levels=LEVELS, colors="#2a9d5c", linewidths=0.8)
        axes.clabel(lines, fontsize=8, fmt="%g°")
    _around(axes, rated, paths)
    axes.set(
        xlabel="i_d (A)", ylabel="i_q (A)", aspect="equal", xlim=(i[0], i[-1]), ylim=(i[0], i[-1])
    )
    named(axes)
    return svg_text(drawing, "loci" + "".join(paths))


def _around(axes: Any, radius: float, paths: Mapping[str, Way]) -> None:
    """Draw a dotted circle, and each belief's path."""
    turn = np.linspace(0.0, 2.0 * np.pi, 121)
    circle = radius * np.cos(turn), radius * np.sin(turn)
    axes.plot(*circle, linestyle=(0, (1, 2)), color="#000000", linewidth=0.9)
    for width, (belief, own) in zip(widths(len(paths)), paths.items(), strict=True):
        axes.plot(*own, color=colour_of(belief), linewidth=width, label=belief)


def hodograph_svg(paths: Mapping[str, Way], magnet_flux: float) -> str:
    """Return the path of the flux linkage (Wb) in the stator's frame, {belief: path}."""
    drawing, panels = page((PHONE, 4.4), 1, 1)
    axes = panels[0, 0]
    _around(axes, magnet_flux, paths)
    axes.set(xlabel="ψ_α (Wb)", ylabel="ψ_β (Wb)", aspect="equal")
    axes.plot(0.0, 0.0, "+", color="#000000", markersize=8)
    named(axes)
    return svg_text(drawing, "hodograph" + "".join(paths))


def angle_svg(errors: Mapping[str, tuple[Array, Array]]) -> str:
    """Return the position error (degrees) over the electrical angle, {belief: (error, theta in
    rad)}.

    Empty where no rotor turned: lines are means, bands hold nine samples in ten.
    """
    found = {belief: over_angle(error, theta) for belief, (error, theta) in errors.items()}
    if not any(found.values()):
        return ""
    drawing, panels = page((PHONE, 2.9), 1, 1)
    axes = panels[0, 0]
    for width, (belief, seen) in zip(widths(len(found)), found.items(), strict=True):
        if seen is not None:
            at, mean, low, high = seen
            axes.fill_between(at, low, high, color=colour_of(belief), alpha=0.25, linewidth=0)
            axes.plot(at, mean, color=colour_of(belief), linewidth=width, label=belief)
    axes.axhline(0.0, **FAINT)
    axes.set(
        xlabel="electrical angle (°)",
        ylabel="position error (°)",
        xlim=(0, 360),
        xticks=range(0, 361, 60),
    )
    named(axes)
    return svg_text(drawing, "angle" + "".join(errors))


def estimator_svg(runs: Sequence[Run]) -> str:
    """Return the position error of one estimator, every belief, over load or segment, as
    `comparison_figure` does."""
    drawing, panels = page((PHONE, 3.1), 1, 1)
    axes = panels[0, 0]
    loads = by_load(runs)
    draw_panel(axes, runs, loads)
    axes.set_ylabel("position error (°)")
    axes.set_xlabel("load (% of rated)" if loads else "segment: load (%), speed (rpm)")
    return svg_text(drawing, "".join(run.name for run in runs))


def contours(plane: Plane) -> list[tuple[float, Array]]:
    """Return lines of equal angle over the plane of currents: (degrees, points (n, 2) of i_d and
    i_q in A)."""
    if not np.nanmax(np.abs(plane.angle)) > LEAST_ANGLE:
        return []
    _, panels = page((PHONE, PHONE), 1, 1)
    found = panels[0, 0].contour(plane.current, plane.current, plane.angle.T, levels=LEVELS)
    levels = zip(found.levels, found.allsegs, strict=True)
    return [(float(level), line) for level, lines in levels for line in lines if len(line) > 1]
