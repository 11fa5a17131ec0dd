"""Figures of the page's results that no other package draws: a run over time, an identification, a
replay."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from model.array_types import Array
from model.levels import AT_ZERO, D, Q
from sandbox.output.looks import thinned
from sandbox.output.plots import AnyAxes, colour_of, drawn, entitle, framed, page

if TYPE_CHECKING:
    from model.levels import Levels
    from sandbox.evaluation.compare import Run
    from sandbox.output.plots import Figure
    from sandbox.recordings.identify import Identification

STYLES: dict[str, dict[str, Any]] = {
    "exact": {"color": colour_of("saturated")},
    "first_order": {"color": colour_of("linear"), "linestyle": (0, (4, 2))},
}
STAIRCASES = (  # injected axis, biased axis, component of the slope: title, unit of 1/inductance
    (D, D, 0, "Γ_dd, bias on d"),
    (D, Q, 0, "Γ_dd, bias on q"),
    (D, Q, 1, "Γ_dq, bias on q"),
    (Q, Q, 1, "Γ_qq, bias on q"),
)


def run_figure(run: Run, title: str, path: str | Path | None = None, ax: AnyAxes = None) -> Figure:
    """Draw a run over time (s): position error (° electrical), currents (A), speed (rad/s
    electrical), load (%).

    Evaluated segments are shaded. Returns the figure, and writes it where a path is given; ax: see
    `page`.
    """
    r = run.recording
    t, error = r.t, np.degrees(r.error)
    panels: list[tuple[str, dict[str, Array]]] = [
        ("position error (°)", {"": error}),
        ("current (A)", {"i_d": r.i_d, "i_q": r.i_q}),
        ("speed (rad/s el.)", {"estimated": r.omega_hat, "true": r.omega}),
        ("load (% of rated)", {"": 100.0 * r.load}),
    ]
    figure, panels_ = page((9.0, 7.6), 4, 1, ax, sharex=True, height_ratios=(1.6, 1.2, 1.2, 0.7))
    axes = panels_[:, 0]
    for panel, (label, lines) in zip(axes, panels, strict=True):
        for k, (name, values) in enumerate(lines.items()):
            panel.plot(
                *thinned(t, values), color=("#2e86de", "#de6210")[k], linewidth=0.9, label=name
            )
        panel.set_ylabel(label, fontsize=9)
        framed(panel, "y")
        if len(lines) > 1:
            panel.legend(
                frameon=False,
                fontsize=8,
                ncols=2,
                loc="lower right",
                bbox_to_anchor=(1.0, 1.0),
                borderaxespad=0.0,
            )
        for row in run.rows:
            panel.axvspan(row.t_start, row.t_end, color="0.5", alpha=0.1, linewidth=0, zorder=0)
    largest = [row.transient_max_deg for row in run.rows if row.transient_max_deg is not None]
    if largest:  # starting up may err by half a turn, and would flatten all that counts
        reach = 1.1 * max(1.0, *largest)
        axes[0].set_ylim(-reach, reach)
    axes[0].axhline(0.0, color="0.6", linewidth=0.8)
    axes[-1].set_xlabel("time (s); grey: evaluated")
    entitle(figure, title, ax)
    return drawn(figure, path)


def identification_figure(
    result: Identification, path: str | Path | None = None, ax: AnyAxes = None
) -> Figure:
    """Draw the measured inverse inductances over current with the fits through them, and what the
    fits leave.

    Above: slope of the ripple (1/H, bars: two standard deviations) at each level of a staircase;
    lines: what a fit says at these levels. Below: measured minus fitted peak of the ripple (mA).
    Returns the figure, and writes it where a path is given; ax: see `page`.
    """
    levels = result.levels
    figure, axes = page((12.5, 6.4), 2, len(STAIRCASES), ax, sharex="col", height_ratios=(2.0, 1.0))
    peak = np.max(np.abs(levels.flux), axis=1)
    for k, (injected, biased, component, title) in enumerate(STAIRCASES):
        rows = staircase(levels, injected, biased)
        i, measured = levels.current[rows, biased], levels.slope[rows, component]
        above, below = axes[0, k], axes[1, k]
        bars = 2.0 * levels.slope_sd[rows, component]
        above.errorbar(
            i, measured, yerr=bars, fmt=".", color="0.25", markersize=5, zorder=3, label="measured"
        )
        for name, fit in result.fits.items():
            left = fit.residuals[rows, component]
            style = STYLES.get(name, {})
            above.plot(i, measured - left / peak[rows], label=name, **style)
            below.plot(i, 1e3 * left, ".", color=style.get("color"), markersize=4)
        above.set_title(title, fontsize=10)
        below.axhline(0.0, color="0.6", linewidth=0.8)
        below.set_xlabel(f"i_{'dq'[biased]} (A)")
    axes[0, 0].set_ylabel("slope of the ripple (1/H)")
    axes[1, 0].set_ylabel("left by the fit (mA)")
    axes[0, 0].legend(frameon=False, fontsize=8)
    left_over = "; ".join(
        f"{name} leaves {1e3 * fit.residual_rms:.3g} mA rms" for name, fit in result.fits.items()
    )
    entitle(figure, f"{result.campaign.name}: measured and fitted ({left_over})", ax)
    return drawn(figure, path)


def staircase(levels: Levels, injected: int, biased: int) -> NDArray[np.int64]:
    """Return the levels of one staircase by rising current, without the small steps of the other
    axis' staircase."""
    rows = levels.pick(injected, biased)
    along, off = np.abs(levels.current[rows, biased]), np.abs(levels.current[rows, 1 - biased])
    rows = rows[(off <= along) | (off <= AT_ZERO * np.max(np.hypot(*levels.current.T)))]
    return rows[np.argsort(levels.current[rows, biased])]


def replay_figure(
    title: str, rms: Mapping[str, float], path: str | Path | None = None, ax: AnyAxes = None
) -> Figure:
    """Draw the rms of each recording's current residual over its noise floor. Returns the figure;
    ax: see `page`."""
    figure, panels = page((8.0, 1.2 + 0.35 * len(rms)), 1, 1, ax)
    panel = panels[0, 0]
    panel.barh(list(rms), list(rms.values()), color=colour_of("saturated"))
    panel.axvline(1.0, color="0.3", linewidth=0.9)
    panel.invert_yaxis()
    panel.set_xlabel("rms of measured minus simulated current, in noise floors (1: noise alone)")
    if max(rms.values(), default=1.0) > 30.0 * max(min(rms.values(), default=1.0), 1e-9):
        panel.set_xscale("log")
    entitle(figure, title, ax)
    return drawn(figure, path)
