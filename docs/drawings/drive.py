"""Draw the drive with every effect at its place, from the effects' cards: a new card appears by
itself.

An effect stands in the block of its first port; one without a port in the block of the motor's
value that it replaces.
"""

from __future__ import annotations

from typing import NamedTuple

from svg import BLUE, GREY, INK, arrow, line, whole, words

from model.effects.card import Effect
from model.effects.library import effect_names, load_effect

LINE, PAD, HEAD = 19.0, 10.0, 26.0  # px: from line to line, around them, of a block's title
EFFECTS = "doc:reference/made/effects"


class Block(NamedTuple):
    """A part of the drive: its title, the ports that lie in it, the motor's values that belong to
    it."""

    title: str
    ports: tuple[str, ...]
    values: tuple[str, ...] = ()


BLOCKS = {
    "link": Block("DC link", ("source", "supply", "drawn", "link")),
    "pulses": Block("PWM pulses", ("delay", "edge", "commutation")),
    "legs": Block("inverter legs", ("leg", "leg_curve")),
    "winding": Block("winding", ("resistance", "winding", "skin", "layers"), ("resistance",)),
    "iron": Block(
        "iron, magnets",
        ("iron", "excess", "play", "magnets", "energy"),
        (
            "inductance_d",
            "inductance_q",
            "magnet_flux",
            "alpha_30",
            "alpha_12",
            "alpha_40",
            "alpha_22",
            "alpha_04",
        ),
    ),
    "shaft": Block(
        "shaft, load",
        ("torque", "friction", "bristles", "load", "shaft", "backlash"),
        ("inertia", "viscous_friction"),
    ),
    "current": Block("current sensors", ("reading", "filter", "instant", "channels")),
    "encoder": Block("encoder", ("angle", "offset", "latency")),
}


def block_of(card: Effect) -> str:
    """Return the block of an effect; LookupError for a port or a value that no block has: give it
    one in BLOCKS."""
    if card.at:
        return next(name for name, b in BLOCKS.items() if card.at[0].port in b.ports)
    values = {x for p in card.parameters for x in (p.of_motor, p.scales) if x}
    return next(name for name, b in BLOCKS.items() if values & {*b.values})


def by_block() -> dict[str, list[str]]:
    """Return the names of all effects by block."""
    found: dict[str, list[str]] = {name: [] for name in BLOCKS}
    for name in effect_names():
        found[block_of(load_effect(name))].append(name)
    return found


def height(effects: list[str]) -> float:
    """Return how high a block with these effects is."""
    return HEAD + LINE * len(effects) + (PAD if effects else 4.0)


def box(x: float, y: float, width: float, high: float, title: str, effects: list[str]) -> list[str]:
    """Return a block: a frame, its title, its effects as links to their cards."""
    frame = (
        f'<rect x="{x:g}" y="{y:g}" width="{width:g}" height="{high:g}" rx="5" fill="none" '
        f'stroke="{INK}"/>'
    )
    parts = [
        frame,
        words(x + PAD, y + 19, f"<tspan font-weight='600'>{title}</tspan>", INK, size=15),
    ]
    for k, name in enumerate(effects):
        said = words(x + PAD, y + HEAD + 14 + LINE * k, name.replace("_", " "), BLUE, size=13)
        parts.append(f'<a href="{EFFECTS}#{name.replace("_", "-")}">{said}</a>')
    return parts


def desk(found: dict[str, list[str]]) -> str:
    """Return the drawing for a desk: from left to right to the shaft, below it back through the
    sensors."""
    wide, gap, left = 166.0, 20.0, 4.0
    at = {
        name: left + k * (wide + gap)
        for k, name in enumerate(("pulses", "legs", "winding", "iron", "shaft"))
    }
    top = 30.0 + height(found["link"]) + gap
    row = max(height(found[name]) for name in at)
    low = top + row + 44.0
    parts = box(at["legs"], 20.0, wide, height(found["link"]), BLOCKS["link"].title, found["link"])
    parts += [
        arrow(
            (at["legs"] + wide / 2, 20.0 + height(found["link"])),
            (at["legs"] + wide / 2, top),
            GREY,
        )
    ]
    for name, x in at.items():
        parts += box(x, top, wide, row, BLOCKS[name].title, found[name])
    for x, said in zip(list(at.values())[1:], ("", "u", "", "T"), strict=True):
        parts += [arrow((x - gap, top + row / 2), (x, top + row / 2), GREY)]
        parts += [words(x - gap / 2, top + row / 2 - 8, said, INK, "middle", 13)] if said else []
    sensors = max(height(found[name]) for name in ("current", "encoder"))
    control = box(at["pulses"], low, wide, sensors, "control", [])
    for k, said in enumerate(("with an estimator that", "believes a model")):
        control.append(words(at["pulses"] + PAD, low + HEAD + 14 + LINE * k, said, INK, size=13))
    parts += control
    for name, x in (("current", at["winding"]), ("encoder", at["shaft"])):
        parts += box(x, low, wide, sensors, BLOCKS[name].title, found[name])
        parts += [arrow((x + wide / 2, top + row), (x + wide / 2, low), GREY)]
    middle, end = low + sensors / 2, at["pulses"] + wide
    parts += [arrow((at["winding"], middle), (end, middle), GREY)]
    parts += [words((at["winding"] + end) / 2, middle - 8, "i_a, i_b, i_c", INK, "middle", 13)]
    under = low + sensors + 18.0
    way = [
        (at["shaft"] + wide / 2, low + sensors),
        (at["shaft"] + wide / 2, under),
        (at["pulses"] + wide / 2, under),
    ]
    parts += [
        line(way, GREY, 2, True),
        arrow(way[-1], (at["pulses"] + wide / 2, low + sensors), GREY),
    ]
    parts += [words(at["iron"] + wide / 2, under - 6, "θ: to compare with", INK, "middle", 13)]
    parts += [arrow((at["pulses"] + wide / 2, low), (at["pulses"] + wide / 2, top + row), GREY)]
    parts += [words(at["pulses"] + wide / 2 + 10, low - 16, "u_k", INK, size=13)]
    return whole(at["shaft"] + wide + left, under + 12, parts)


def telephone(found: dict[str, list[str]]) -> str:
    """Return the drawing for a telephone: from top to bottom, back along the left edge."""
    x, wide, gap, y = 40.0, 320.0, 26.0, 8.0
    parts = box(x, y, wide, 30.0, "control with an estimator", [])
    begin, y = y + 15.0, y + 30.0
    order = ("pulses", "link", "legs", "winding", "iron", "shaft", "current", "encoder")
    for name in order:
        returns = name in ("current", "encoder")
        if not returns:
            parts += [arrow((x + wide / 2, y), (x + wide / 2, y + gap), GREY)]
        y += gap
        parts += box(x, y, wide, height(found[name]), BLOCKS[name].title, found[name])
        if returns:
            parts += [line([(x, y + 18), (16.0, y + 18)], GREY, 2, name == "encoder")]
        y += height(found[name])
    foot = y - height(found["encoder"]) + 18
    parts += [line([(16.0, foot), (16.0, begin)], GREY, 2), arrow((16.0, begin), (x, begin), GREY)]
    parts += [words(x + wide, y + 22, "left edge: what the drive measures", INK, "end", 13)]
    return whole(370, y + 32, parts)


def drawings() -> dict[str, str]:
    """Return both drawings by the names of their files."""
    found = by_block()
    return {"drive.svg": desk(found), "drive.narrow.svg": telephone(found)}
