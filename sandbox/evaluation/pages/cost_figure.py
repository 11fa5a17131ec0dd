"""What injection costs beside what it brings: a table, and error, loss and sound side by side."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from sandbox.evaluation.choice import ANY, Limits, Standing
from sandbox.output.plots import (
    AnyAxes,
    colour_of,
    drawn,
    entitle,
    framed,
    page,
    plain_ticks,
    svg_text,
)
from sandbox.output.vector import PHONE, named

if TYPE_CHECKING:
    from sandbox.output.plots import Axes, Figure

HEADS = (
    "estimator, belief",
    "worst 95 %",
    "added loss",
    "of rated loss",
    "torque ripple",
    "sound proxy",
    "loudest tone",
    "link ripple",
    "volts lost",
)
READING = (
    "What the injection adds beside the same currents and voltages averaged over it, the largest "
    "of all segments: copper loss, and core loss where the plant has the effect iron_loss, in W "
    "and over the copper loss at rated current; torque ripple (rms) over rated torque; a proxy "
    "for the sound, A-weighted radial and tangential force against a thousandth of the rated "
    "ones, to compare methods on one motor (no sound pressure, no resonances), and its loudest "
    "tone alone, far below it where it hisses and does not whistle; ripple of the link's current "
    "(rms) below the PWM frequency; largest voltage that the control cannot have."
)
AXES = (
    ("worst_p95", "95 % of errors\nbelow (°)"),
    ("loss_w", "added loss (W)"),
    ("sound_db", "sound proxy (dB)"),
)
# as many times from the smallest to the largest: an axis of powers; below, its names would overlap
WIDE = 3.0
MARKS = {"saturated": "o", "linear": "s"}
# what is less is drawn there: it neither heats nor is heard
LEAST = {"loss_w": 1e-3, "sound_db": 0.0}


def cost_table(found: Sequence[Standing]) -> tuple[list[str], list[list[str]]]:
    """Return heads and cells: a line for each estimator and belief with its estimate in control."""
    return list(HEADS), [_line(s) for s in found if s.closed_loop]


def _line(s: Standing) -> list[str]:
    values = (
        (s.worst_p95, "{:.2f}°", 1.0),
        (s.loss_w, "{:.3g} W", 1.0),
        (s.loss_share, "{:.2g} %", 100.0),
        (s.torque_ripple, "{:.2g} %", 100.0),
        (s.sound_db, "{:.1f} dB", 1.0),
        (s.tone_db, "{:.1f} dB", 1.0),
        (s.link_a, "{:.2g} A", 1.0),
        (s.injected_v, "{:.3g} V", 1.0),
    )
    return [
        f"{s.estimator}, {s.belief}",
        *("–" if v is None else text.format(k * v) for v, text, k in values),
    ]


def cost_figure(
    found: Sequence[Standing],
    title: str = "",
    path: str | Path | None = None,
    *,
    limits: Limits = ANY,
    ax: AnyAxes = None,
    phone: bool = False,
) -> Figure:
    """Draw error, added loss and sound of each estimator and belief side by side, the smallest
    error first.

    limits: drawn dashed; ax: three axes of your own to draw in, see `page`; phone: panels below
    each other.
    """
    known = sorted(
        (s for s in found if s.closed_loop and s.worst_p95 is not None),
        key=lambda s: s.worst_p95 or 0.0,
    )
    names = list(dict.fromkeys(s.estimator for s in known))
    rows, width = (len(AXES), PHONE) if phone else (1, 8.0)
    figure, places = page(
        (width, rows * (1.2 + 0.26 * len(names))), rows, len(AXES) // rows, ax, sharey=True
    )
    panels = list(places.flat)
    bounds = {"loss_w": limits.loss_below, "sound_db": limits.quiet_below}
    for axes, (name, label) in zip(panels, AXES, strict=True):
        _draw(axes, known, names, name)
        if (bound := bounds.get(name)) is not None:
            axes.axvline(bound, color="0.5", linewidth=0.9, linestyle=(0, (4, 2)), zorder=1)
        axes.set_xlabel(label)
    if names:
        panels[0].set_yticks(range(len(names)), names, parse_math=False)
        panels[0].set_ylim(len(names) - 0.5, -0.5)
        named(panels[0 if phone else 1])
    if title:
        entitle(figure, title, ax)
    return drawn(figure, path)


def _draw(axes: Axes, known: Sequence[Standing], names: Sequence[str], quantity: str) -> None:
    """Draw one quantity over the estimators, a mark a belief."""
    for belief in dict.fromkeys(s.belief for s in known):
        own = [s for s in known if s.belief == belief and getattr(s, quantity) is not None]
        x = [max(getattr(s, quantity), LEAST.get(quantity, 0.0)) for s in own]
        y, mark = [names.index(s.estimator) for s in own], MARKS.get(belief, "D")
        # both are seen where they are alike
        face = colour_of(belief) if belief == "saturated" else "none"
        axes.plot(
            x, y, mark, color=colour_of(belief), markerfacecolor=face, markersize=5, label=belief
        )
    low, high = axes.dataLim.intervalx
    if quantity != "sound_db" and known and high > WIDE * low:
        axes.set_xscale("log")
        plain_ticks(axes)
    else:
        axes.locator_params(axis="x", nbins=4)
    framed(axes)


def cost_svg(found: Sequence[Standing], limits: Limits) -> str:
    """Return the same for a page."""
    drawing = cost_figure(found, limits=limits, phone=True)
    return svg_text(drawing, "cost" + "".join(s.estimator + s.belief for s in found))
