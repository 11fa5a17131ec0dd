"""Draw what the plant does in one PWM period, `sandbox.plant.period.travel`, step by step:
`python docs/drawings/travel.py`."""

from __future__ import annotations

from pathlib import Path
from typing import NamedTuple

from svg import BLUE, GREEN, GREY, INK, RED, Point, arrow, line, whole, words

PLANT = Path(__file__).resolve().parents[2] / "sandbox" / "plant"
LINE, PAD, GAP = 18.0, 8.0, 16.0  # px: from line to line, inside a box, between boxes
CUTS = (0.433, 0.527)  # of the longest gap
EDGES = ((0.16, "↑"), (0.25, "↑"), (0.34, "↑"), (0.62, "↓"), (0.71, "↓"), (0.84, "↓"))


class Step(NamedTuple):
    """Calls of `travel`, what they do, and when."""

    calls: str
    does: str
    when: str = ""


class Group(NamedTuple):
    """Steps that belong together, with what they are."""

    title: str
    steps: tuple[Step, ...]
    note: str = ""


START = Group(
    "at the segment's start",
    (
        Step("facing_at, orient", "where the rotor stands"),
        Step("at_start", "ends the one before: flux, current, losses"),
        Step("stiffen, stiffen_further", "slopes of current against flux", "first segment"),
        Step("first_instant", "link's sag, late edges, sample", "first segment"),
        Step("commutate", "how late the edge acts: its leg's current now", "dead time"),
    ),
    "not after a plain step, which has done it",
)
INSIDE = Group(
    "what it meets",
    (
        Step("supply", "link voltage at two instants", "rippling link"),
        Step("float_legs", "what the diodes allow", "blocked gates"),
        Step("enter, lose_waiting", "volt-seconds that late edges take", "dead time"),
        Step("looked_at", "whether a sampler holds in it", "late sampling"),
    ),
)
PLAIN = Group(
    "a plain step",
    (
        Step("plain_step", "all in one loop"),
        Step("commutate", "the next edge"),
    ),
    "where nothing is added",
)
FULL = Group(
    "otherwise",
    (
        Step("dropped", "after a plain one"),
        Step("face, lag_through", "core, skin, filter"),
        Step("layers_through", "eddies in conductors", "layers"),
        Step("core_ahead", "flux held back, mean", "hysteresis"),
        Step("in_middle", "mean flux, losses"),
        Step("core_drags", "flux held, at its end", "hysteresis"),
    ),
)
END = Group(
    "at the segment's end",
    (
        Step("peek", "the current where a sampler holds it", "late sampling"),
        Step("moved", "turns the rotor on", "closed loop"),
        Step("nothing_lost", "clears what late edges took", "dead time"),
    ),
)
CLOSE = Group(
    "after the last segment",
    (Step("close_period", "later edges wait for the next period", "dead time"),),
)


def height(group: Group, tall: bool) -> float:
    """Return how high a group's box is; tall: what steps do stands below their names."""
    lines = 1 + bool(group.note) + (2 if tall else 1) * len(group.steps)
    return 2 * PAD + LINE * lines


def box(group: Group, at: Point, wide: float, tall: bool, colour: str = INK) -> list[str]:
    """Return a group's box: its title, its steps a line each, or two where it is tall."""
    (x, y), high = at, height(group, tall)
    parts = [
        f'<rect x="{x:g}" y="{y:g}" width="{wide:g}" height="{high:g}" rx="5" fill="none" '
        f'stroke="{colour}"/>',
        words(x + PAD, y + PAD + 12, f"<tspan font-weight='600'>{group.title}</tspan>", colour),
    ]
    y += PAD + 12
    if group.note:
        y += LINE
        parts.append(words(x + PAD, y, group.note, GREY, size=12))
    for step in group.steps:
        y += LINE
        parts.append(words(x + PAD, y, step.calls, BLUE, size=13))
        if step.when:
            parts.append(words(x + wide - PAD, y, step.when, GREY, "end", 12))
        y += LINE if tall else 0.0
        parts.append(words(x + (PAD + 10 if tall else 190), y, step.does, INK, size=13))
    return parts


def timeline(left: float, wide: float, y: float) -> list[str]:
    """Return a period at y with its six edges, which cut it into segments."""
    right = left + wide
    parts = [line([(left, y), (right, y)], INK, 2)]
    for x, name, anchor in ((left, "0", "start"), (right, "T", "end")):
        parts += [line([(x, y - 22), (x, y + 10)]), words(x, y + 26, name, INK, anchor)]
    for k, (share, sign) in enumerate(EDGES):
        x = left + share * wide
        parts.append(line([(x, y - 14), (x, y + 8)], BLUE, 2))
        parts.append(words(x, y - 18, sign, BLUE, "middle", 13))
        parts.append(words(x, y + 26, str(k + 1), BLUE, "middle", 13))
    for share in CUTS:
        x = left + share * wide
        parts.append(line([(x, y - 8), (x, y + 8)], GREY, 1.5, True))
    first, last = left + EDGES[2][0] * wide, left + CUTS[0] * wide
    parts.append(line([(first + 2, y), (last - 2, y)], GREEN, 5))
    parts.append(words(0.5 * (first + last), y + 42, "a segment", GREEN, "middle", 13))
    return parts


def flow(narrow: bool = False) -> str:
    """Return the steps from top to bottom, the loop over segments along the left edge."""
    left, wide = (38.0, 324.0) if narrow else (50.0, 560.0)
    middle, half = left + wide / 2, (wide - GAP) / 2
    said = ["Six edges of three legs cut the period", "into segments; long ones are cut again."]
    said = said if narrow else [" ".join(said)]
    parts = [words(left, 18 + LINE * k, text) for k, text in enumerate(said)]
    y = 46 + LINE * len(said)
    parts += timeline(left, wide, y)
    top = y = y + 60
    for group in (START, INSIDE):
        parts += box(group, (left, y), wide, narrow)
        y += height(group, narrow)
        for x in (left + half / 2, left + wide - half / 2) if group is INSIDE else (middle,):
            parts.append(arrow((x, y), (x, y + GAP), GREY))
        y += GAP
    fork = max(height(PLAIN, True), height(FULL, True))
    for x, group in ((left, PLAIN), (left + half + GAP, FULL)):
        parts += box(group, (x, y), half, True, GREEN if group is PLAIN else INK)
        centre, low = x + half / 2, y + height(group, True)
        parts.append(arrow((centre, low), (centre, y + fork + GAP), GREY))
    y += fork + GAP
    parts += box(END, (left, y), wide, narrow)
    foot = y + height(END, narrow) - 20
    parts += [line([(left, foot), (left - 18, foot), (left - 18, top + 20)], RED, 2)]
    parts += [arrow((left - 18, top + 20), (left, top + 20), RED)]
    x, turn = left - 23, 0.5 * (top + foot)
    again = words(x, turn, "next segment", RED, "middle")
    parts.append(f'<g transform="rotate(-90 {x:g} {turn:g})">{again}</g>')
    y += height(END, narrow)
    parts.append(arrow((middle, y), (middle, y + GAP), GREY))
    y += GAP
    parts += box(CLOSE, (left, y), wide, narrow)
    return whole(left + wide + 8, y + height(CLOSE, narrow) + 8, parts)


def drawings() -> dict[str, str]:
    """Return every file of this script by its name."""
    return {"travel.svg": flow(), "travel.narrow.svg": flow(narrow=True)}


if __name__ == "__main__":
    for name, text in drawings().items():
        (PLANT / name).write_text(text, encoding="utf-8")
        print(PLANT / name)
