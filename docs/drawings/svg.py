"""Shapes of a drawing as SVG text: lines, arrows, arcs and words."""

from __future__ import annotations

import math

INK, GREY, BLUE, RED, GREEN = "#222222", "#999999", "#1f5fa8", "#c0392b", "#2e7d4f"
Point = tuple[float, float]


def words(x: float, y: float, said: str, colour: str = INK, anchor: str = "start", size: int = 14) -> str:
    """Return a line of text."""
    return f'<text x="{x:g}" y="{y:g}" fill="{colour}" text-anchor="{anchor}" font-size="{size}">{said}</text>'


def line(points: list[Point], colour: str = INK, width: float = 1.5, dashed: bool = False) -> str:
    """Return straight lines through points."""
    way = " ".join(f"{x:g},{y:g}" for x, y in points)
    dash = ' stroke-dasharray="5 4"' if dashed else ""
    return f'<polyline points="{way}" fill="none" stroke="{colour}" stroke-width="{width:g}"{dash}/>'


def arrow(start: Point, end: Point, colour: str = INK, width: float = 2.0, dashed: bool = False) -> str:
    """Return a line with a head at its end."""
    (x, y), angle = end, math.atan2(end[1] - start[1], end[0] - start[0])
    head = [(x - 11 * math.cos(angle + s), y - 11 * math.sin(angle + s)) for s in (0.38, -0.38)]
    way = " ".join(f"{a:.1f},{b:.1f}" for a, b in (head[0], end, head[1]))
    short = (x - 8 * math.cos(angle), y - 8 * math.sin(angle))
    return line([start, short], colour, width, dashed) + f'<polygon points="{way}" fill="{colour}"/>'


def arc(centre: Point, radius: float, begin: float, end: float, colour: str = INK) -> str:
    """Return an arc with a head; angles in degrees, anticlockwise from the right."""
    steps = [math.radians(begin + (end - begin) * k / 40) for k in range(41)]
    points = [(centre[0] + radius * math.cos(a), centre[1] - radius * math.sin(a)) for a in steps]
    return line([(round(x, 1), round(y, 1)) for x, y in points[:-2]], colour) + arrow(
        points[-6], points[-1], colour, 0.01
    )


def whole(width: int, height: int, parts: list[str]) -> str:
    """Return a drawing on white."""
    size = f'viewBox="0 0 {width} {height}" width="{width}"'
    head = f'<svg xmlns="http://www.w3.org/2000/svg" {size} font-family="sans-serif">'
    return "\n".join([head, '<rect width="100%" height="100%" fill="white"/>', *parts, "</svg>"]) + "\n"
