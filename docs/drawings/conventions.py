"""Draw the frames and the PWM period of the page of conventions:
`python docs/drawings/conventions.py`."""

from __future__ import annotations

import math
from pathlib import Path

from svg import BLUE, GREEN, GREY, INK, RED, Point, arc, arrow, line, whole, words

STATIC = Path(__file__).resolve().parents[1] / "_static"


def at(centre: Point, radius: float, degrees: float) -> Point:
    """Return a point around a centre; angles anticlockwise from the right."""
    a = math.radians(degrees)
    return centre[0] + radius * math.cos(a), centre[1] - radius * math.sin(a)


def axis(
    centre: Point, degrees: float, name: str, colour: str, radius: float = 165, dashed: bool = False
) -> list[str]:
    """Return an axis with its name at the tip."""
    x, y = at(centre, radius + 26, degrees)
    return [
        arrow(centre, at(centre, radius, degrees), colour, dashed=dashed),
        words(x, y + 5, name, colour, "middle", 15),
    ]


def frames(narrow: bool = False) -> str:
    """Return the stationary frame, the true and the estimated rotor frame, and what each sign
    means."""
    c, true, estimated = ((120.0, 200.0), 42.0, 22.0) if narrow else ((260.0, 215.0), 42.0, 22.0)
    reach = 120.0 if narrow else 165.0
    parts = axis(c, 0, "α = a" if not narrow else "α", INK, reach) + axis(c, 90, "β", INK, reach)
    parts += axis(c, 120, "b", GREY, 0.7 * reach) + axis(c, 240, "c", GREY, 0.7 * reach)
    parts += axis(c, true, "", BLUE, reach)[:1] + axis(c, true + 90, "q", BLUE, reach - 20)
    parts += (
        axis(c, estimated, "", RED, reach, True)[:1]
        + axis(c, estimated + 90, "", RED, reach - 20, True)[:1]
    )
    parts += [
        words(
            *at(c, reach + 7, true),
            "d: north pole" if narrow else "d: the magnet's north pole",
            BLUE,
        )
    ]
    parts += [words(*at(c, reach + 7, estimated), "d̂: the estimate", RED)]
    parts += [words(*at(c, reach - 4, estimated + 90), "q̂", RED, "middle")]
    parts += [
        arc(c, 0.36 * reach, 0, true, BLUE),
        words(*at(c, 0.48 * reach, 9), "θ", BLUE, "middle", 16),
    ]
    parts += [arc(c, 0.72 * reach, estimated, true, GREEN)]
    parts += [words(*at(c, 0.84 * reach, 32), "e", GREEN, "middle", 16)]
    x, y = (150.0, 262.0) if narrow else (330.0, 300.0)
    parts += [
        words(x, y, "e = θ − θ̂", GREEN, size=17),
        words(x, y + 22, "Here the estimate lags: e &gt; 0.", INK),
    ]
    return whole(370, 330, parts) if narrow else whole(600, 400, parts)


def leg(top: float, duty: float, name: str, left: float, period: float) -> list[str]:
    """Return a leg's level over a period: high from (1 - D) T/2 to (1 + D) T/2."""
    rise, fall = (left + 0.5 * (1 + s * duty) * period for s in (-1, 1))
    level = [
        (left, top + 30),
        (rise, top + 30),
        (rise, top),
        (fall, top),
        (fall, top + 30),
        (left + period, top + 30),
    ]
    more = [line([(x, top - 6), (x, top + 38)], GREY, 1, True) for x in (rise, fall)]
    return [*more, line(level, BLUE, 2.2), words(left - 14, top + 22, name, BLUE, "end")]


def period(narrow: bool = False) -> str:
    """Return what happens between sample k and sample k + 1."""
    left, wide, top = (48.0, 300.0, 92.0) if narrow else (130.0, 560.0, 80.0)
    right, middle, parts = left + wide, left + wide / 2, []
    for k, (name, duty) in enumerate((("leg a", 0.72), ("leg b", 0.5), ("leg c", 0.3))):
        parts += leg(top + 62 * k, duty, name[-1] if narrow else name, left, wide)
    for x, k in ((left, "k"), (right, "k+1")):
        parts += [
            line([(x, top - 28), (x, top + 195)], INK, 1.5),
            words(x, top - 36, f"t_{k}", INK, "middle", 16),
        ]
        at_left = k == "k"
        parts += [
            words(
                x + (6 if at_left else -6),
                top + 220,
                f"sample {k}",
                RED,
                "start" if at_left else "end",
                15,
            )
        ]
    reads = (
        ("reads i, θ, u_dc", "the next ones")
        if narrow
        else ("reads i_a, i_b, i_c, θ, u_dc", "reads the next ones")
    )
    parts += [
        words(left + 6, top + 239, reads[0], RED),
        words(right - 6, top + 239, reads[1], RED, "end"),
    ]
    for x in (left + 3, right - 3):
        parts.append(arrow((middle, top - 18), (x, top - 18), GREY, 1.2))
    acts = (
        "the command u_k acts" if narrow else "the command u_k acts: one PWM period (single update)"
    )
    parts.append(words(middle, top - 26, acts, INK, "middle"))
    inside = 4 if narrow else 20
    for x, anchor in ((left + inside, "start"), (middle, "middle"), (right - inside, "end")):
        parts.append(words(x, top + 185, "zero" if narrow else "zero vector", GREY, anchor, 13))
    return whole(370 if narrow else 820, top + 258, parts)


def drawings() -> dict[str, str]:
    """Return every file of this script by its name."""
    return {
        f"{name}{'.narrow' * narrow}.svg": draw(narrow)
        for name, draw in (("frames", frames), ("period", period))
        for narrow in (False, True)
    }


if __name__ == "__main__":
    STATIC.mkdir(exist_ok=True)
    for name, text in drawings().items():
        (STATIC / name).write_text(text, encoding="utf-8")
        print(STATIC / name)
