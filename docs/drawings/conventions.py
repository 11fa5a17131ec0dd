"""Draw the frames and the PWM period of the page of conventions: `python docs/drawings/conventions.py`."""

from __future__ import annotations

import math
from pathlib import Path

from svg import BLUE, GREEN, GREY, INK, RED, Point, arc, arrow, line, whole, words

STATIC = Path(__file__).resolve().parents[1] / "_static"


def at(centre: Point, radius: float, degrees: float) -> Point:
    """Return a point around a centre; angles anticlockwise from the right."""
    a = math.radians(degrees)
    return centre[0] + radius * math.cos(a), centre[1] - radius * math.sin(a)


def axis(centre: Point, degrees: float, name: str, colour: str, radius: float = 165, dashed: bool = False) -> list[str]:
    """Return an axis with its name at the tip."""
    x, y = at(centre, radius + 26, degrees)
    return [
        arrow(centre, at(centre, radius, degrees), colour, dashed=dashed),
        words(x, y + 5, name, colour, "middle", 15),
    ]


def frames() -> str:
    """Return the stationary frame, the true and the estimated rotor frame, and what each sign means."""
    c, true, estimated = (240.0, 235.0), 42.0, 22.0
    parts = axis(c, 0, "α = a", INK) + axis(c, 90, "β", INK)
    parts += axis(c, 120, "b", GREY, 120) + axis(c, 240, "c", GREY, 120)
    parts += axis(c, true, "d (true: north pole)", BLUE, 165)[:1] + axis(c, true + 90, "q", BLUE)
    parts += [words(*at(c, 172, true), "d: the magnet's north pole", BLUE)]
    parts += axis(c, estimated, "", RED, 165, True)[:1] + axis(c, estimated + 90, "", RED, 165, True)[:1]
    parts += [
        words(*at(c, 172, estimated), "d̂: the estimate", RED),
        words(*at(c, 180, estimated + 90), "q̂", RED, "middle"),
    ]
    parts += [arc(c, 62, 0, true, BLUE), words(*at(c, 80, 9), "θ", BLUE, "middle", 16)]
    parts += [arc(c, 120, estimated, true, GREEN), words(*at(c, 137, 32), "e", GREEN, "middle", 16)]
    parts += [words(300, 330, "e = θ − θ̂", GREEN, size=17), words(300, 354, "Here the estimate lags: e > 0.", INK)]
    notes = [
        (BLUE, "θ: electrical angle of the north pole from phase a, anticlockwise."),
        (INK, "Currents flow into the motor; a vector's length is the phase's peak."),
        (INK, "i_q > 0 makes torque > 0: it drives the rotor anticlockwise (ω > 0)."),
        (INK, "Load > 0 is i_q > 0 as a current, and brakes ω > 0 as a torque."),
    ]
    return whole(640, 520, parts + [words(40, 425 + 25 * k, said, colour) for k, (colour, said) in enumerate(notes)])


def leg(top: float, duty: float, name: str, left: float, period: float) -> list[str]:
    """Return a leg's level over a period: high from (1 - D) T/2 to (1 + D) T/2."""
    rise, fall = (left + 0.5 * (1 + s * duty) * period for s in (-1, 1))
    level = [(left, top + 30), (rise, top + 30), (rise, top), (fall, top), (fall, top + 30), (left + period, top + 30)]
    more = [line([(x, top - 6), (x, top + 38)], GREY, 1, True) for x in (rise, fall)]
    return [*more, line(level, BLUE, 2.2), words(left - 14, top + 22, name, BLUE, "end")]


def period() -> str:
    """Return what happens between sample k and sample k + 1."""
    left, wide, top = 130.0, 560.0, 80.0
    parts = []
    for k, (name, duty) in enumerate((("leg a", 0.72), ("leg b", 0.5), ("leg c", 0.3))):
        parts += leg(top + 62 * k, duty, name, left, wide)
    for x, k in ((left, "k"), (left + wide, "k+1")):
        parts += [line([(x, 52), (x, 275)], INK, 1.5), words(x, 40, f"t_{k}", INK, "middle", 16)]
        parts += [words(x + (6 if k == "k" else -6), 300, f"sample {k}", RED, "start" if k == "k" else "end", 15)]
    parts += [words(left + 6, 318, "reads i_a, i_b, i_c, θ, u_dc", RED, size=13)]
    parts += [words(left + wide - 6, 318, "reads the next ones", RED, "end", 13)]
    middle = left + wide / 2
    parts += [arrow((middle, 62), (left + 3, 62), GREY, 1.2), arrow((middle, 62), (left + wide - 3, 62), GREY, 1.2)]
    parts += [words(middle, 54, "the command u_k acts: one PWM period (single update)", INK, "middle")]
    parts += [
        words(left + 20, 265, "zero vector", GREY, size=12),
        words(left + wide - 20, 265, "zero vector", GREY, "end", 12),
    ]
    parts += [words(middle, 265, "zero vector", GREY, "middle", 12)]
    said = (
        "Duty of a leg: D = 1/2 + (u_leg + u_0)/u_dc, u_0 = −(largest + smallest)/2 of the three phase commands.",
        "A leg is high from (1 − D) T/2 to (1 + D) T/2: six edges a period, and the plant steps from edge to edge.",
    )
    return whole(820, 400, parts + [words(40, 355 + 24 * k, text, INK, size=14) for k, text in enumerate(said)])


if __name__ == "__main__":
    STATIC.mkdir(exist_ok=True)
    for name, text in (("frames.svg", frames()), ("period.svg", period())):
        (STATIC / name).write_text(text, encoding="utf-8")
        print(STATIC / name)
