"""Draw what belongs to a row of a recording: sample, PWM period, command and link reading.

python -m experiments.campaign_drawing
"""

from __future__ import annotations

from pathlib import Path
from typing import NamedTuple

from experiments.screens import STYLE

INK, GREY, BLUE, RED = "currentColor", "#8a8f98", "#3b82c4", "#d9503f"  # seen on light and on dark
DUTY = (0.62, 0.35, 0.5, 0.7)  # of leg a, period by period
SVG = "http://www.w3.org/2000/svg"


class Layout(NamedTuple):
    """Where a drawing's panels stand: the whole width, where the first sample is, a period's length
    (px), how many."""

    wide: int
    left: int
    period: int
    count: int


DESK, TELEPHONE = Layout(940, 150, 180, 4), Layout(370, 14, 168, 2)


def text(
    x: float, y: float, said: str, colour: str = INK, anchor: str = "start", size: int = 13
) -> str:
    """Return a line of text."""
    return (
        f'<text x="{x:g}" y="{y:g}" fill="{colour}" text-anchor="{anchor}" '
        f'font-size="{size}">{said}</text>'
    )


def path(points: list[tuple[float, float]], colour: str, width: float = 1.5) -> str:
    """Return straight lines through points."""
    way = " ".join(f"{x:g},{y:g}" for x, y in points)
    return f'<polyline points="{way}" fill="none" stroke="{colour}" stroke-width="{width:g}"/>'


def carrier(lay: Layout, top: float, double: bool) -> str:
    """Return the carrier: a peak at the first sample; a period of PWM is one sample's, or two."""
    each = 1 if double else 2
    half = lay.period / each
    points = [
        (lay.left + k * half, top if k % 2 == 0 else top + 60) for k in range(each * lay.count + 1)
    ]
    return path(points, GREY)


def leg(lay: Layout, top: float, edges: list[float]) -> str:
    """Return a leg's level: low at first, changing at each edge (px)."""
    points, level = [(float(lay.left), top + 28)], 0
    for x in edges:
        points += [(x, top + 28 * (1 - level)), (x, top + 28 * level)]
        level = 1 - level
    return path([*points, (lay.left + lay.count * lay.period, points[-1][1])], BLUE, 2)


def panel(lay: Layout, top: float, double: bool) -> list[str]:
    """Return one panel: samples, carrier, compare values, leg a, and which columns belong to which
    instant."""
    narrow = lay is TELEPHONE
    rate = "1 / (2 sampling_period)" if double else "1 / sampling_period"
    title = (
        f"{'double' if double else 'single'} update: {'PWM' if narrow else 'pwm_frequency'} "
        f"= {rate}"
    )
    out = [
        text(14 if narrow else 20, top, title, size=14 if narrow else 15),
        carrier(lay, top + 20, double),
    ]
    if not narrow:
        out += [text(20, top + 55, "carrier, compare", GREY), text(20, top + 125, "leg a", BLUE)]
    edges = []
    for k, duty in enumerate(DUTY[: lay.count]):
        x, y = lay.left + k * lay.period, top + 20 + 60 * (1.0 - duty)
        out.append(path([(x, y), (x + lay.period, y)], RED, 2))
        if not double:
            edges += [x + 0.5 * (1 - duty) * lay.period, x + 0.5 * (1 + duty) * lay.period]
        else:
            edges.append(x + ((1 - duty) if k % 2 == 0 else duty) * lay.period)
    out.append(leg(lay, top + 105, edges))
    for k in range(lay.count + 1):
        x = lay.left + k * lay.period
        out += [
            path([(x, top + 12), (x, top + 175)], GREY, 1),
            text(x, top + 192, f"t_{k}", anchor="middle"),
        ]
    for k in range(lay.count):
        x = lay.left + (k + 0.5) * lay.period
        out.append(text(x, top + 155, f"u of row {k}", RED, "middle"))
        out.append(
            text(
                lay.left + k * lay.period + 4, top + 173, f"i, theta, u_dc of row {k}", INK, size=12
            )
        )
    return out


def drawing(lay: Layout = DESK) -> str:
    """Return the whole drawing as SVG."""
    lines = [
        (
            f'<svg xmlns="{SVG}" viewBox="0 0 {lay.wide} 440" width="{lay.wide}" '
            'font-family="system-ui, sans-serif">'
        )
    ]
    names = [text(14, 470, "grey: carrier; red: compare; blue: leg a")] if lay is TELEPHONE else []
    if names:
        lines[0] = lines[0].replace(" 440", " 480")
    return (
        "\n".join([*lines, STYLE, *panel(lay, 30, False), *panel(lay, 245, True), *names, "</svg>"])
        + "\n"
    )


if __name__ == "__main__":
    for ending, lay in (("", DESK), (".narrow", TELEPHONE)):
        out = Path(__file__).parents[1] / "sandbox" / "recordings" / f"sampling{ending}.svg"
        out.write_text(drawing(lay), encoding="utf-8")
        print(out)
