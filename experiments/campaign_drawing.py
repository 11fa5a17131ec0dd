"""Draw what belongs to a row of a recording: sample, PWM period, command and link reading.

python -m experiments.campaign_drawing
"""

from __future__ import annotations

from pathlib import Path

WIDE, LEFT, PERIOD = 940, 150, 180  # px
INK, GREY, BLUE, RED = "#222222", "#999999", "#1f77b4", "#d62728"
DUTY = (0.62, 0.35, 0.5, 0.7)  # of leg a, period by period


def text(x: float, y: float, said: str, colour: str = INK, anchor: str = "start", size: int = 13) -> str:
    """Return a line of text."""
    return f'<text x="{x:g}" y="{y:g}" fill="{colour}" text-anchor="{anchor}" font-size="{size}">{said}</text>'


def path(points: list[tuple[float, float]], colour: str, width: float = 1.5) -> str:
    """Return straight lines through points."""
    way = " ".join(f"{x:g},{y:g}" for x, y in points)
    return f'<polyline points="{way}" fill="none" stroke="{colour}" stroke-width="{width:g}"/>'


def carrier(top: float, half: float, periods: int) -> str:
    """Return the carrier: a peak at the first sample; half: px of half a PWM period."""
    points = [(LEFT + k * half, top if k % 2 == 0 else top + 60) for k in range(periods + 1)]
    return path(points, GREY)


def leg(top: float, edges: list[float]) -> str:
    """Return a leg's level: low at first, changing at each edge (px)."""
    points, level = [(float(LEFT), top + 28)], 0
    for x in edges:
        points += [(x, top + 28 * (1 - level)), (x, top + 28 * level)]
        level = 1 - level
    return path([*points, (LEFT + 4 * PERIOD, points[-1][1])], BLUE, 2)


def panel(top: float, double: bool) -> list[str]:
    """Return one panel: samples, carrier, compare values, leg a, and which columns belong to which instant."""
    title = (
        "double update: pwm_frequency = 1 / (2 sampling_period)"
        if double
        else ("single update: pwm_frequency = 1 / sampling_period")
    )
    out = [text(20, top, title, size=15), carrier(top + 20, PERIOD if double else PERIOD / 2, 4 if double else 8)]
    out += [text(20, top + 55, "carrier, compare", GREY), text(20, top + 125, "leg a", BLUE)]
    edges = []
    for k, duty in enumerate(DUTY):
        x = LEFT + k * PERIOD
        y = top + 20 + 60 * (1.0 - duty)
        out.append(path([(x, y), (x + PERIOD, y)], RED, 2))
        if not double:
            edges += [x + 0.5 * (1 - duty) * PERIOD, x + 0.5 * (1 + duty) * PERIOD]
        else:
            edges.append(x + ((1 - duty) if k % 2 == 0 else duty) * PERIOD)
    out.append(leg(top + 105, edges))
    for k in range(5):
        x = LEFT + k * PERIOD
        out += [path([(x, top + 12), (x, top + 175)], GREY, 1), text(x, top + 192, f"t_{k}", anchor="middle")]
    for k in range(4):
        x = LEFT + (k + 0.5) * PERIOD
        out.append(text(x, top + 160, f"u of row {k}", RED, "middle"))
        out.append(text(LEFT + k * PERIOD + 4, top + 175, f"i, theta, u_dc of row {k}", INK, size=11))
    return out


def drawing() -> str:
    """Return the whole drawing as SVG."""
    lines = [f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {WIDE} 440" font-family="sans-serif">']
    lines += ['<rect width="100%" height="100%" fill="white"/>', *panel(30, False), *panel(245, True), "</svg>"]
    return "\n".join(lines) + "\n"


if __name__ == "__main__":
    out = Path(__file__).parents[1] / "sandbox" / "recordings" / "sampling.svg"
    out.write_text(drawing(), encoding="utf-8")
    print(out)
