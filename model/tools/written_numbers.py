"""The numbers of a configuration by their names, from the forms in which drives' tools write them:
XML, JSON, lines of a terminal, headers and sketches in C.

VESC's terminal prints what its detection found (`terminal.c`: mOhm, uH or microH, mWb); ODrive's
shell prints a value with its type behind it, and without the path it was asked for.
"""

from __future__ import annotations

import json
import re
from typing import Any
from xml.etree import ElementTree

from model.errors import BadInput

NUMBER = r"[-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?"
DEFINED = re.compile(rf"^\s*#\s*define\s+MCCONF_(\w+)\s+\(?({NUMBER})f?\)?", re.MULTILINE)
ASSIGNED = re.compile(
    r"^\s*(?:conf\s+set\s+)?([A-Za-z_][\w.\[\]]*)\s*[=: \t]\s*"
    rf"({NUMBER})\s*f?\s*(?:/\s*({NUMBER}))?\s*(?:\(\w+\))?\s*[;,]?\s*(?:(?://|#).*)?$",
    re.MULTILINE,
)
DETECTED = re.compile(rf"^\s*Motor (Current|R|L|Flux Linkage)\s*:\s*({NUMBER})", re.MULTILINE)
OF_DETECTED = {
    "Current": ("l_current_max", 1.0),
    "R": ("foc_motor_r", 1e-3),
    "L": ("foc_motor_l", 1e-6),
    "Flux Linkage": ("foc_motor_flux_linkage", 1e-3),
}
SIMPLE = re.compile(
    r"\b(BLDC|(?:Hybrid)?Stepper)Motor\s*\*?\s*(\w*)\s*"
    r"(?:=\s*(?:new\s+)?\w+Motor\s*)?\(([^()]+)\)"
)
SIMPLE_NAMES = tuple(
    f"bldcmotor.{n}" for n in ("pole_pairs", "phase_resistance", "kv", "phase_inductance")
)
CONSTANT = re.compile(
    rf"^\s*(?:#\s*define\s+(\w+)\s+|const\w*[\w ]*?\s(\w+)\s*=\s*)\(?({NUMBER})f?\)?", re.MULTILINE
)
COMMENT = re.compile(r"/\*.*?\*/|//[^\n]*", re.DOTALL)
DRIVER = re.compile(r"\bdriver\w*(?:\.|->)")
IN_XML = ("valdouble", "valint")  # of a parameter's entry, as VESC's tool describes one
OF_A_SHELL = ("phase_resistance", "phase_inductance")  # names without a path: ODrive's motor.config


def numbers_of(text: str, file: str) -> dict[str, float]:
    """Return a configuration's numbers by their lower-case name, dots between levels; BadInput for
    one that is cut, a motor of two phases, or two motors in a sketch."""
    head = text.lstrip()[:1]
    if head == "<" and "<!DOCTYPE" not in text and "<!ENTITY" not in text:
        return _of_xml(text)
    if head == "{":
        try:
            return dict(_flat(json.loads(text), ""))
        except (ValueError, RecursionError) as error:
            raise BadInput(
                f"a configuration that is no whole JSON ({error}); export it again"
            ) from None
    text = COMMENT.sub(" ", text)
    if found := list(SIMPLE.finditer(text)):
        return _of_sketch(text, found, file)
    out = _assigned(text)
    out |= {m[1].lower(): float(m[2]) for m in DEFINED.finditer(text)}
    for m in DETECTED.finditer(text):
        name, factor = OF_DETECTED[m[1]]
        out[name] = factor * float(m[2])
    if all(name in out for name in OF_A_SHELL):
        return {n if "." in n else f"motor.config.{n}": x for n, x in out.items()}
    return out


def _assigned(text: str) -> dict[str, float]:
    """Return numbers that lines give to names, a fraction as its value."""
    found = [(m[1].lower(), float(m[2]), float(m[3] or 1.0)) for m in ASSIGNED.finditer(text)]
    return {name: x / below for name, x, below in found if below}


def _of_sketch(text: str, found: list[re.Match[str]], file: str) -> dict[str, float]:
    """Return the numbers of a sketch of SimpleFOC: its motor's and driver's under these names."""
    if any(m[1] != "BLDC" for m in found):
        raise BadInput(f"{file}: a stepper has two phases; motors of three phases are simulated")
    names = list(dict.fromkeys(m[2] or "motor" for m in found))
    if len(names) > 1:
        raise BadInput(
            f"{file} holds {len(names)} motors ({', '.join(names)}); leave the lines of one in a "
            "copy"
        )
    lines = re.sub(r"[;{}]", "\n", re.sub(rf"\b{names[0]}(?:\.|->)", "motor.", text))
    out = _assigned(DRIVER.sub("driver.", lines))
    constants = {m[1] or m[2]: float(m[3]) for m in CONSTANT.finditer(text)}
    given = [
        constants.get(x.strip(), _float(x.strip().rstrip("f"))) for x in found[0][3].split(",")
    ]
    return out | {n: x for n, x in zip(SIMPLE_NAMES, given, strict=False) if x is not None}


def _of_xml(text: str) -> dict[str, float]:
    """Return the numbers of elements, and of those that hold one in an element of its own."""
    try:
        root = ElementTree.fromstring(text)
    except (ElementTree.ParseError, ValueError) as error:
        raise BadInput(f"a configuration that is no whole XML ({error}); export it again") from None
    found = {e.tag.lower(): x for e in root.iter() if (x := _float(e.text)) is not None}
    inside = [(e.tag.lower(), c) for e in root.iter() for c in e if c.tag.lower() in IN_XML]
    return found | {name: x for name, c in inside if (x := _float(c.text)) is not None}


def _flat(tree: Any, above: str) -> list[tuple[str, float]]:
    out: list[tuple[str, float]] = []
    for key, value in tree.items() if isinstance(tree, dict) else ():
        name = f"{above}.{key}".strip(".").lower()
        if isinstance(value, dict):
            out += _flat(value, name)
        elif (x := _float(value)) is not None:
            out.append((name, x))
    return out


def _float(value: Any) -> float | None:
    if isinstance(value, bool):
        return None
    try:
        return float(value)
    except (TypeError, ValueError):
        return None
