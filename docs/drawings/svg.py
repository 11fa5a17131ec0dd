"""Shapes of a drawing as SVG text: lines, arrows, arcs and words."""

from __future__ import annotations

import math

from experiments.screens import STYLE

# seen on light and on dark
INK, GREY, BLUE, RED, GREEN = "currentColor", "#8a8f98", "#3b82c4", "#d9503f", "#2f9a5f"
Point = tuple[float, float]


def words(
    x: float, y: float, said: str, colour: str = INK, anchor: str = "start", size: int = 14
) -> str:
    """Return a line of text."""
    return (
        f'<text x="{x:g}" y="{y:g}" fill="{colour}" text-anchor="{anchor}" '
        f'font-size="{size}">{said}</text>'
    )


def line(points: list[Point], colour: str = INK, width: float = 1.5, dashed: bool = False) -> str:
    """Return straight lines through points."""
    way = " ".join(f"{x:g},{y:g}" for x, y in points)
    dash = ' stroke-dasharray="5 4"' if dashed else ""
    return (
        f'<polyline points="{way}" fill="none" stroke="{colour}" stroke-width="{width:g}"{dash}/>'
    )


def arrow(
    start: Point, end: Point, colour: str = INK, width: float = 2.0, dashed: bool = False
) -> str:
    """Return a line with a head at its end."""
    (x, y), angle = end, math.atan2(end[1] - start[1], end[0] - start[0])
    head = [(x - 11 * math.cos(angle + s), y - 11 * math.sin(angle + s)) for s in (0.38, -0.38)]
    way = " ".join(f"{a:.1f},{b:.1f}" for a, b in (head[0], end, head[1]))
    short = (x - 8 * math.cos(angle), y - 8 * math.sin(angle))
    return (
        line([start, short], colour, width, dashed) + f'<polygon points="{way}" fill="{colour}"/>'
    )


def arc(centre: Point, radius: float, begin: float, end: float, colour: str = INK) -> str:
    """Return an arc with a head; angles in degrees, anticlockwise from the right."""
    steps = [math.radians(begin + (end - begin) * k / 40) for k in range(41)]
    points = [(centre[0] + radius * math.cos(a), centre[1] - radius * math.sin(a)) for a in steps]
    return line([(round(x, 1), round(y, 1)) for x, y in points[:-2]], colour) + arrow(
        points[-6], points[-1], colour, 0.01
    )


def whole(width: float, height: float, parts: list[str]) -> str:
    """Return a drawing whose ink is the page's, or follows the reader's system where it stands
    alone."""
    size = f'viewBox="0 0 {width:g} {height:g}" width="{width:g}"'
    head = f'<svg xmlns="http://www.w3.org/2000/svg" {size} font-family="system-ui, sans-serif">'
    return "\n".join([head, STYLE, *parts, "</svg>"]) + "\n"
