"""The page of a scored check: confusion, reliability, detection limit, figures with limits."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from sandbox.output.plots import colour_of, framed, page, save

OPEN = (-1.0, 2.0)  # beyond the panel: where too few cases give no limit


def withheld_figure(content: Mapping[str, Any], path: Path) -> None:
    """Draw a scored check (`withheld.json`): confusion matrix, reliability, detection limit,
    figures with limits.

    The file appears whole or not at all; its suffix gives the format.
    """
    figure, panels = page((15.0, 11.0), 2, 2, width_ratios=(1.5, 1.0), height_ratios=(1.5, 1.0))
    _confusion(panels[0][0], content["confusion"])
    reliability(panels[0][1], content["reliability"])
    _limit(panels[1][0], content["detection_floor"])
    limits(panels[1][1], content["methods"])
    save(figure, path)


def _confusion(axes: Any, matrix: Mapping[str, Any]) -> None:
    """Draw counts of first hypotheses by true cause, each row in shares of its own."""
    axes.set_title(
        "confusion (campaigns with one effect or none of the library)", fontweight="bold"
    )
    counts = matrix["counts"]
    if not counts:
        _nothing(axes)
        return
    axes.imshow(
        [[x / max(1, sum(row)) for x in row] for row in counts], cmap="Blues", vmin=0.0, vmax=1.3
    )
    for y, row in enumerate(counts):
        for x, count in enumerate(row):
            if count:
                axes.text(x, y, str(count), ha="center", va="center", fontsize=8)
    axes.set_xticks(range(len(matrix["verdict"])), matrix["verdict"], rotation=90, fontsize=8)
    axes.set_yticks(range(len(matrix["truth"])), matrix["truth"], fontsize=8)
    axes.set_xlabel("first hypothesis")
    axes.set_ylabel("truth")


def reliability(axes: Any, bins: Sequence[Mapping[str, Any]]) -> None:
    """Draw the share that was right against the probability stated, with 90 % limits."""
    axes.plot([0.0, 1.0], [0.0, 1.0], color="0.6", linewidth=0.8)
    for b in bins:
        spread = [[b["value"] - b["low"]], [b["high"] - b["value"]]]
        axes.errorbar(
            b["stated"], b["value"], yerr=spread, fmt="o", color=colour_of("saturated"), capsize=3
        )
        axes.annotate(f" {b['n']}", (b["stated"], b["value"]), fontsize=8)
    axes.set_xlim(0.0, 1.05)
    axes.set_ylim(-0.02, 1.05)
    axes.set_xlabel("probability stated for the first hypothesis")
    axes.set_ylabel("share that was right")
    axes.set_title("reliability (number: campaigns)", fontweight="bold")


def _nothing(axes: Any) -> None:
    """Say that no campaign belongs into a panel."""
    axes.text(
        0.5,
        0.5,
        "no such campaign in this check",
        ha="center",
        va="center",
        color="0.4",
        transform=axes.transAxes,
    )
    axes.set_axis_off()


def _limit(axes: Any, limit: Mapping[str, Mapping[str, Any]]) -> None:
    """Draw by effect the smallest size found (dot) and the largest missed (cross), in multiples of
    the medium size."""
    axes.set_title("● smallest size found   × largest missed", fontweight="bold", color="0.2")
    for k, entry in enumerate(limit.values()):
        for key, marker, belief in (("found", "o", "saturated"), ("missed", "x", "linear")):
            if entry[key] is not None:
                axes.plot(k, entry[key], marker, color=colour_of(belief), markersize=7)
    if not limit:
        _nothing(axes)
        return
    axes.set_yscale("log", base=2)
    axes.set_xticks(range(len(limit)), list(limit), rotation=90, fontsize=8)
    axes.set_ylabel("size / medium")
    framed(axes, "y")


def limits(
    axes: Any, methods: Mapping[str, Mapping[str, Any]], words: Mapping[str, str] | None = None
) -> None:
    """Draw the figures that are shares, method beside method, with one-sided 95 % limits; words:
    their names."""
    every = (
        "top1",
        "mean_probability",
        "set_f1",
        "exact_set",
        "unknown_auroc",
        "false_alarm",
        "coverage",
        "closed_median",
        "closed_p10",
        "ambiguity_hit",
        "subsystem",
        "resolved",
        "resolved_promised",
        "recommended",
        "resolved_of_all",
    )
    shares = [k for k in every if any(f[k]["value"] is not None for f in methods.values())]
    for m, (method, figures) in enumerate(methods.items()):
        known = [
            (k, figures[name])
            for k, name in enumerate(shares)
            if figures[name]["value"] is not None
        ]
        places = [k + 0.2 * (m - 0.5 * (len(methods) - 1)) for k, _ in known]
        values = [f["value"] for _, f in known]
        below = [f["value"] - (OPEN[0] if f["low"] is None else f["low"]) for _, f in known]
        above = [(OPEN[1] if f["high"] is None else f["high"]) - f["value"] for _, f in known]
        axes.errorbar(
            values, places, xerr=[below, above], fmt="o", markersize=4, capsize=2, label=method
        )
    axes.set_yticks(range(len(shares)), [(words or {}).get(k, k) for k in shares], fontsize=8)
    axes.set_xlim(-0.05, 1.05)
    axes.invert_yaxis()
    framed(axes, "x")
    axes.legend(
        fontsize=8,
        loc="upper center",
        bbox_to_anchor=(0.5, -0.07),
        ncols=min(2, len(methods)),
        frameon=False,
    )
    axes.set_title("figures, one-sided 95 % limits", fontweight="bold")
