"""Figures over the plane of currents: where the model may be used, inductances and what injection
sees."""

from __future__ import annotations

import math
from pathlib import Path
from typing import TYPE_CHECKING

from sandbox.output.plots import AnyAxes, circle, colour_of, drawn, entitle, page

if TYPE_CHECKING:
    from model.parameters import Drive
    from model.saliency import Audit
    from sandbox.evaluation.maps import Maps
    from sandbox.output.plots import Axes, Figure


def audit_figure(
    drive: Drive, audit: Audit, path: str | Path | None = None, ax: AnyAxes = None
) -> Figure:
    """Draw the current plane (convexity, saliency) and the cross-saturation angle against load.

    ax: see `page`. Raises as `comparison_figure`.
    """
    figure, ((plane, angles),) = page((10.5, 4.8), 1, 2, ax)
    _draw_plane(plane, audit)
    load = 100.0 * audit.load
    for values, name, style in (
        (audit.angle_local, "encoder controls (local)", "-"),
        (audit.angle_closed, "estimate controls (self-consistent)", (0, (4, 2))),
    ):
        angles.plot(
            load,
            [math.degrees(v) for v in values],
            linestyle=style,
            color=colour_of("linear"),
            label=name,
        )
    angles.axhline(0.0, color="0.6", linewidth=0.8)
    angles.set(
        xlabel="load (% of rated, i_d = 0)", ylabel="error of a linear belief (° electrical)"
    )
    angles.set_title("cross-saturation angle")
    angles.legend(frameon=False, fontsize=9)
    entitle(figure, f"{drive.name}: where the model may be used", ax)
    return drawn(figure, path)


def _draw_plane(axes: Axes, audit: Audit) -> None:
    """Draw min eigenvalue over the current plane, the audited disc, and where convexity ends."""
    i, values = audit.grid, audit.grid_eigenvalue
    filled = axes.contourf(i, i, values, levels=12, cmap="Blues")
    filled.set_clip_path(circle(axes, audit.radius))
    axes.figure.colorbar(filled, ax=axes, label="smallest eigenvalue of the Hessian (1/H)")
    axes.add_patch(circle(axes, audit.rated_current, fill=False, color="0.2", linewidth=1.2))
    axes.annotate(
        "rated",
        (0.0, audit.rated_current),
        (0, 3),
        textcoords="offset points",
        ha="center",
        fontsize=9,
    )
    if audit.violations:
        x, y = [v["i_d"] for v in audit.violations], [v["i_q"] for v in audit.violations]
        axes.plot(x, y, "x", color=colour_of("linear"), label="the model ends here")
        axes.legend(frameon=False, fontsize=9, loc="upper right")
    axes.set(xlabel="i_d (A)", ylabel="i_q (A)", aspect="equal", facecolor="0.85")
    axes.set_title("valid" if audit.passed else "grey: not valid")


def maps_figure(maps: Maps, path: str | Path | None = None, ax: AnyAxes = None) -> Figure:
    """Draw inductances, cross-saturation angle and gain over the current plane, and the first
    order's error of L_dd.

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
    if not (maps.first_order["l_dd"] == maps.first_order["l_dd"]).any():
        # NaN: a flux map has no alphas
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
